"""A scene at one fidelity: bodies, mesh, equations and estimates, built on first use."""

from __future__ import annotations

from copy import copy
from functools import cached_property

from mpi4py import MPI

from fenicsmech.clock import Clock
from fenicsmech.collective import on_one
from fenicsmech.continuation import Predictor
from fenicsmech.equilibrium import EquilibriumSolver, Iteration
from fenicsmech.errors import DescriptionError
from fenicsmech.estimates import Estimates
from fenicsmech.mechanism import Force, Material, PrescribedPart, Scene
from fenicsmech.meshing import MechanismMesh
from fenicsmech.model import Fidelity, MechanismModel, check_links, mesh_mechanism
from fenicsmech.multibody import build_linkage
from fenicsmech.simulation.request import controlled_load


class Discretisation:
    """The meshed and compiled parts of simulations, which simulations of several designs share, and curves refer to.

    Args:
        scene: the mechanism and its effects.
        fidelity: elements and formulation.
        solver: of equilibria.
        predictor: of the next equilibrium on a curve.
        clock: of the phases.
        comm: processes that share the work.

    Attributes:
        linkage: the bodies.
        materials: of the flexible links.

    Raises:
        DescriptionError: links, joints or points cannot be right.
    """

    def __init__(
        self,
        scene: Scene,
        fidelity: Fidelity,
        solver: EquilibriumSolver,
        predictor: Predictor,
        clock: Clock,
        comm: MPI.Comm,
    ) -> None:
        self.scene, self.fidelity, self.clock, self.comm = scene, fidelity, clock, comm
        self.solver, self.predictor = solver, predictor
        self.linkage = build_linkage(scene.mechanism, fidelity.model.mechanism_dim)
        self.materials = tuple(link.material for link in scene.mechanism.flexible_links)
        self._iterations: dict[tuple, Iteration] = {}
        on_one(comm, lambda: check_links(scene.mechanism, self.linkage, fidelity))

    def at(self, fidelity: Fidelity, clock: Clock, comm: MPI.Comm) -> Discretisation:
        """The same scene at another fidelity or on other processes, with nothing meshed yet."""
        other = Discretisation(self.scene, fidelity, self.solver, self.predictor, clock, comm)
        other.materials = self.materials
        return other

    def with_material(self, drawn: Material, other: Material) -> Discretisation:
        """The same scene on the same mesh, with links of another material instead of ``drawn``.

        Raises:
            DescriptionError: no link is made of it.
        """
        if drawn not in self.materials:
            raise DescriptionError(
                f"material {drawn.name!r}",
                f"no link of {self.scene.mechanism.name!r} is made of it",
                f"Give one of {', '.join(sorted({repr(material.name) for material in self.materials}))}",
            )
        changed = copy(self)
        changed.materials = tuple(other if material == drawn else material for material in self.materials)
        changed.mesh, changed._iterations = self.mesh, {}
        for name in ("model", "estimates"):
            changed.__dict__.pop(name, None)
        return changed

    @cached_property
    def mesh(self) -> MechanismMesh:
        """The reference mesh of all flexible links."""
        with self.clock.phase("mesh"):
            return mesh_mechanism(self.comm, self.scene.mechanism, self.linkage, self.fidelity)

    @cached_property
    def model(self) -> MechanismModel:
        """The meshed mechanism."""
        scene, mesh = self.scene, self.mesh
        with self.clock.phase("setup"):
            return MechanismModel(
                scene.mechanism, self.linkage, mesh, self.fidelity, self.clock, scene.effects, self.materials
            )

    @cached_property
    def estimates(self) -> Estimates:
        """Error estimates at equilibria."""
        return Estimates(self.model)

    def newton(self, part: PrescribedPart, others: tuple[tuple[Force, float], ...] = ()) -> Iteration:
        """The solver for what changes and some constant forces, kept for all configurations."""
        key = part, others
        if key not in self._iterations:
            loads = tuple((self.model.point_load(other), float(magnitude)) for other, magnitude in others)
            self._iterations[key] = self.solver.on(self.model.system(controlled_load(part, self.model), loads))
        return self._iterations[key]
