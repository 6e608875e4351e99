"""A scene at one fidelity: bodies, mesh, equations and estimates, built on first use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

from mpi4py import MPI

from fenicsmech.collective import on_one
from fenicsmech.continuation import Predictor
from fenicsmech.elasticity import Quadrature
from fenicsmech.equilibrium import EquilibriumMethod, EquilibriumSolver, LoadControl, MotorControl, PointLoad
from fenicsmech.errors import DescriptionError, expect
from fenicsmech.estimates import Estimates
from fenicsmech.log import Clock
from fenicsmech.mechanism import (
    FlexibleLink,
    Force,
    ForceGroup,
    Joint,
    Material,
    MaterialPoint,
    PrescribedPart,
    Scene,
    Shape,
    check_units,
)
from fenicsmech.meshing import MechanismMesh
from fenicsmech.model import Fidelity, MechanismModel, check_links, mesh_mechanism, spatial_model
from fenicsmech.multibody import JointChange, PlacedPoint, build_linkage
from fenicsmech.stress import StressOptions, StressRecovery


class Discretisation:
    """The meshed and compiled parts of simulations, which simulations of several designs share, and curves refer to.

    Attributes:
        linkage: the bodies.
        materials: of the flexible links.
        shapes: of the flexible links.
        moved: joints that are placed otherwise than drawn.
        placed: points of links that are elsewhere than drawn.

    Raises:
        DescriptionError: links, joints or points contradict each other.
    """

    def __init__(
        self,
        scene: Scene,
        fidelity: Fidelity,
        method: EquilibriumMethod,
        predictor: Predictor,
        clock: Clock,
        comm: MPI.Comm,
        shapes: Mapping[FlexibleLink, Shape] | None = None,
        moved: Mapping[Joint, JointChange] | None = None,
        placed: Mapping[MaterialPoint, PlacedPoint] | None = None,
        stress: StressOptions | None = None,
    ) -> None:
        self.scene, self.fidelity, self.clock, self.comm = scene, fidelity, clock, comm
        self.method, self.predictor, self._stress = method, predictor, stress
        self.moved, self.placed = dict(moved or {}), dict(placed or {})
        self.linkage = build_linkage(scene.mechanism, fidelity.model.mechanism_dim, self.moved)
        links = scene.mechanism.flexible_links
        self.materials = tuple(link.material for link in links)
        self.shapes = {link: link.shape for link in links} | dict(shapes or {})
        self._solvers: dict[tuple, EquilibriumSolver] = {}
        own = tuple(self.shapes.values())
        on_one(comm, lambda: check_links(scene.mechanism, own, self.linkage, fidelity, self.placed))

    def at(
        self,
        fidelity: Fidelity,
        clock: Clock,
        comm: MPI.Comm,
        shapes: Mapping[FlexibleLink, Shape] | None = None,
        moved: Mapping[Joint, JointChange] | None = None,
        placed: Mapping[MaterialPoint, PlacedPoint] | None = None,
    ) -> Discretisation:
        """The same scene at another fidelity, on other processes, with links of other shapes, or joints or points at
        other places, nothing meshed yet."""
        shapes, moved = self.shapes | dict(shapes or {}), self.moved | dict(moved or {})
        placed = self.placed | dict(placed or {})
        other = Discretisation(
            self.scene, fidelity, self.method, self.predictor, clock, comm, shapes, moved, placed, self._stress
        )
        other.materials = self.materials
        return other

    def on(self, comm: MPI.Comm, clock: Clock) -> Discretisation:
        """The same scene on the same mesh, distributed over other processes; collective on these alone."""
        other = self.at(self.fidelity, clock, comm)
        if "mesh" in vars(self):
            other.mesh = self.mesh.on(comm)
        return other

    @cached_property
    def finer(self) -> Discretisation:
        """The same scene on the same mesh, in elements of the next order."""
        fidelity, order = self.fidelity, self.fidelity.order + 1
        rule = max(fidelity.quadrature, Quadrature.for_order(order, fidelity.model.dim), key=lambda own: own.degree)
        other = self.at(replace(fidelity, order=order, quadrature=rule), self.clock, self.comm)
        other.mesh = self.mesh
        return other

    @cached_property
    def halved(self) -> Discretisation:
        """The same scene in the plane, in elements half as wide: each triangle of the mesh is cut in four.

        Peaks of stress leave out as much beside singular places.
        """
        sizes = {link: 0.5 * size for link, size in self.fidelity.sizes.items()}
        other = self.at(replace(self.fidelity, sizes=sizes), self.clock, self.comm)
        other.mesh = self.mesh.quartered()
        stress = self._stress or StressOptions()
        reach = 2.0 * stress.singularity.least_reach
        other._stress = replace(stress, singularity=replace(stress.singularity, least_reach=reach))
        return other

    @property
    def refined(self) -> Discretisation:
        """What errors of elements are found in: ``finer``, in the plane ``halved`` too."""
        return self.finer if self.fidelity.model.dim == 3 else self.finer.halved

    @cached_property
    def in_space(self) -> Discretisation:
        """The same scene in space, in elements as large, of order 3 at most."""
        fidelity, order = self.fidelity, min(self.fidelity.order, 3)
        model = spatial_model(self.scene, list(self.shapes.values()))
        rule = Quadrature.for_order(order, model.dim)
        return self.at(replace(fidelity, model=model, order=order, quadrature=rule), self.clock, self.comm)

    def with_material(self, drawn: Material, other: Material) -> Discretisation:
        """The same scene on the same mesh, with links of another material instead of ``drawn``."""
        for given in (drawn, other):
            expect("other material", given, Material, "a material", "Give with_material(drawn, other), two materials")
        check_units(f"link {self._made_of(drawn).name!r}", other, self.scene.units)
        changed = copy(self)
        # with offsets of motors of its own
        changed.linkage = build_linkage(self.scene.mechanism, self.fidelity.model.mechanism_dim, self.moved)
        changed.materials = tuple(other if material == drawn else material for material in self.materials)
        changed.mesh, changed._solvers = self.mesh, {}
        for name in ("model", "estimates", "stresses", "finer", "halved", "in_space"):
            changed.__dict__.pop(name, None)
        return changed

    def _made_of(self, material: Material) -> FlexibleLink:
        """The first link of a material."""
        links = self.scene.mechanism.flexible_links
        for link, own in zip(links, self.materials, strict=True):
            if own == material:
                return link
        raise DescriptionError(
            f"material {material.name!r}",
            f"no link of {self.scene.mechanism.name!r} is made of it",
            f"Give one of {', '.join(sorted({repr(own.name) for own in self.materials}))}",
        )

    @cached_property
    def mesh(self) -> MechanismMesh:
        """The reference mesh of all flexible links."""
        with self.clock.phase("mesh"):
            shapes = tuple(self.shapes.values())
            return mesh_mechanism(self.comm, self.scene.mechanism, shapes, self.linkage, self.fidelity)

    @cached_property
    def model(self) -> MechanismModel:
        """The meshed mechanism."""
        scene, mesh = self.scene, self.mesh
        with self.clock.phase("setup"):
            return MechanismModel(
                scene.mechanism,
                self.linkage,
                mesh,
                self.fidelity,
                self.clock,
                scene.effects,
                self.materials,
                tuple(self.shapes.values()),
                self.placed,
                self._stress,
            )

    @cached_property
    def estimates(self) -> Estimates:
        """Error estimates at equilibria."""
        return Estimates(self.model)

    @cached_property
    def stresses(self) -> StressRecovery:
        """Recovered stresses at equilibria."""
        return StressRecovery(self.model)

    def solver(self, part: PrescribedPart, others: Sequence[Force] = ()) -> EquilibriumSolver:
        """The solver for a force or motors that change and some constant forces.

        It is kept for all configurations and magnitudes.
        """
        key = part, tuple(others)
        if key not in self._solvers:
            loads = [self.model.point_load(other) for other in others]
            self._solvers[key] = self.method.solver(self.model.system(self._controlled_load(part), loads))
        return self._solvers[key]

    def forget(self, part: PrescribedPart) -> None:
        """Drops the solvers of a part. Local."""
        self._solvers = {key: own for key, own in self._solvers.items() if key[0] != part}

    def followed_control(self, part: PrescribedPart) -> LoadControl | MotorControl:
        """The control whose value changes along the path of a part."""
        if isinstance(part, Force | ForceGroup):
            return LoadControl()
        ratios = dict(part.ratios)
        return MotorControl(0.0, self.linkage.joints.motor_values(lambda motor: ratios.get(motor, 0.0)))

    def _controlled_load(self, part: PrescribedPart) -> PointLoad:
        """The load whose magnitude is unknown; for motors, a load that acts nowhere."""
        forces = part.ratios if isinstance(part, Force | ForceGroup) else ()
        loads = [(self.model.point_load(force), ratio) for force, ratio in forces]
        acting = tuple((point, ratio * way) for load, ratio in loads for point, way in load.acting)
        return PointLoad(part.name, acting, tuple(place for load, _ in loads for place in load.places))
