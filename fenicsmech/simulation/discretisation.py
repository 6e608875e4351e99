"""A scene at one fidelity: its bodies at once, its mesh, equations and estimates when they are first needed."""

from __future__ import annotations

from functools import cached_property

from mpi4py import MPI

from fenicsmech.clock import Clock
from fenicsmech.collective import on_one
from fenicsmech.continuation import Predictor
from fenicsmech.equilibrium import EquilibriumSolver
from fenicsmech.mechanism import Scene
from fenicsmech.model import Fidelity, MechanismModel, check_links, mesh_mechanism
from fenicsmech.multibody import build_linkage
from fenicsmech.simulation.curves import Curves
from fenicsmech.simulation.estimates import Estimates


class Discretisation:
    """What a simulation computes with.

    Args:
        scene: the mechanism and what acts on it.
        fidelity: how finely.
        solver: how equilibria are found.
        predictor: how the next equilibrium on a curve is guessed.
        clock: where time is counted.
        comm: processes that share the work.

    Attributes:
        linkage: the bodies.

    Raises:
        DescriptionError: links, joints or points cannot be right.
    """

    def __init__(
        self,
        scene: Scene,
        fidelity: Fidelity,
        *,
        solver: EquilibriumSolver,
        predictor: Predictor,
        clock: Clock,
        comm: MPI.Comm,
    ) -> None:
        self.scene, self.fidelity, self.clock, self.comm = scene, fidelity, clock, comm
        self.solver, self.predictor = solver, predictor
        self.linkage = build_linkage(scene.mechanism, fidelity.model.mechanism_dim)
        on_one(comm, lambda: check_links(scene.mechanism, self.linkage, fidelity))

    def at(self, fidelity: Fidelity) -> Discretisation:
        """The same scene at another fidelity, with nothing meshed yet."""
        return Discretisation(
            self.scene, fidelity, solver=self.solver, predictor=self.predictor, clock=self.clock, comm=self.comm
        )

    @cached_property
    def model(self) -> MechanismModel:
        """The meshed mechanism (collective)."""
        mechanism = self.scene.mechanism
        with self.clock.phase("mesh"):
            mesh = mesh_mechanism(self.comm, mechanism, self.linkage, self.fidelity)
        with self.clock.phase("setup"):
            return MechanismModel(mechanism, self.linkage, mesh, self.fidelity, self.clock, self.scene.effects)

    @cached_property
    def curves(self) -> Curves:
        """What computes curves (collective)."""
        return Curves(self.model, self.solver, self.predictor, self.scene.units)

    @cached_property
    def estimates(self) -> Estimates:
        """Error estimates at equilibria (collective)."""
        return Estimates(self.model, self.curves.newton)
