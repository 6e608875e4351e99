"""The quantity of a study, and one level measured: the value it gives, and the seconds it takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median
from time import perf_counter

from mpi4py import MPI
from petsc4py import PETSc

from fenicsmech.elasticity import Quadrature
from fenicsmech.equilibrium import PrimalDualNewton
from fenicsmech.errors import DescriptionError, FenicsmechError, finite, set_fields
from fenicsmech.mechanism import DRAWN, Configuration, FlexibleLink, Force, Scene
from fenicsmech.multibody import assemble, build_linkage
from fenicsmech.simulation import Simulation

from .levels import RIGID, FidelityLevel

_SAMPLES = (0.2, 0.4, 0.6, 0.8, 1.0)  # load factors: even steps, as predictors like them
_ENOUGH = 5.0  # s: a curve that takes as long is not noise


@dataclass(frozen=True)
class Quantity:
    """The displacement of a force's point along the force: the number that a study looks at.

    Attributes:
        part: the force that grows from zero.
        load: its magnitude, not zero.
        configuration: motor positions.

    Raises:
        DescriptionError: the load is zero or not finite.
    """

    part: Force
    load: float
    configuration: Configuration = DRAWN

    def __post_init__(self) -> None:
        part = f"load of {self.part.name!r}"
        set_fields(self, load=finite(part, self.load))
        if self.load == 0.0:
            raise DescriptionError(part, "it is zero: nothing would move", "Give another magnitude")

    @property
    def name(self) -> str:
        return f"displacement of {self.part.name!r}"


@dataclass(frozen=True)
class Measurement:
    """The value and the cost of a level.

    Attributes:
        level: the fidelity.
        value: of the quantity; None if the level failed or was left out.
        frame_seconds: the equilibrium, from its neighbour at 0.8 of the load.
        curve_seconds: from the unloaded configuration to the load in five samples.
        setup_seconds: mesh, numbering and matrix patterns; without the forms' compilation, once per computer.
        unknowns: coordinates of rigid bodies and finite-element unknowns.
        spacing: cells^(−1/dim): the element size that refinement around pins leaves, up to a constant.
        iterations: of Newton's method, for the curve.
        repeats: curves whose median the seconds are.
        failure: the reason where the value is missing.
    """

    level: FidelityLevel
    value: float | None = None
    frame_seconds: float | None = None
    curve_seconds: float | None = None
    setup_seconds: float | None = None
    unknowns: int | None = None
    spacing: float | None = None
    iterations: int | None = None
    repeats: int = 0
    failure: str = ""


def measure(
    scene: Scene,
    quantity: Quantity,
    level: FidelityLevel,
    *,
    size: float | Mapping[FlexibleLink, float],
    repeats: int,
    comm: MPI.Comm,
) -> Measurement:
    """The measurement of a level; a failure is recorded in it.

    Args:
        scene: the mechanism and its effects.
        quantity: of which the value is measured.
        level: the fidelity.
        size: element size at factor 1, or one per flexible link.
        repeats: maximum number of curves to time; fewer once they took five seconds.
        comm: processes that share the work.
    """
    try:
        if level.model is None:
            return _measure_rigid(scene, quantity, repeats)
        return _measure_elastic(scene, quantity, level, size, repeats, comm)
    except (FenicsmechError, PETSc.Error) as error:  # PETSc's own: a matrix that does not fit into memory
        return Measurement(level, failure=str(error))


def _measure_rigid(scene: Scene, quantity: Quantity, repeats: int) -> Measurement:
    """Rigid kinematics in space: the curve is the way to the configuration; a frame finds that nothing has moved."""
    linkage = build_linkage(scene.mechanism, 3)
    joints = linkage.rigid
    motors = joints.motor_values(quantity.configuration.position)
    ways, frames = [], []
    for _ in range(repeats):
        start = perf_counter()
        poses = assemble(linkage, quantity.configuration).poses
        there = perf_counter()
        joints.value(poses, motors)
        frames.append(perf_counter() - there)
        ways.append(perf_counter() - start)
    return Measurement(
        RIGID,
        value=0.0,
        frame_seconds=median(frames),
        curve_seconds=median(ways),
        setup_seconds=0.0,
        unknowns=len(linkage.bodies) * joints.space.pose_size,
        iterations=0,
        repeats=repeats,
    )


def _measure_elastic(
    scene: Scene,
    quantity: Quantity,
    level: FidelityLevel,
    size: float | Mapping[FlexibleLink, float],
    repeats: int,
    comm: MPI.Comm,
) -> Measurement:
    simulation = Simulation(
        scene,
        space=level.model.name,
        order=level.order,
        size=_scaled(size, level.factor),
        quadrature=None if level.quadrature is None else Quadrature(level.quadrature),
        solver=PrimalDualNewton(tolerance=level.tolerance),
        comm=comm,
    )
    force, configuration = quantity.part, quantity.configuration
    # compiles, and touches every page for the first time
    simulation.load_displacement(force, forces=[0.0], configuration=configuration)
    forces = [factor * quantity.load for factor in _SAMPLES]
    curves, seconds = [], []
    while len(curves) < repeats and sum(seconds) < _ENOUGH:
        start = perf_counter()
        curves.append(simulation.load_displacement(force, forces=forces, configuration=configuration))
        seconds.append(comm.bcast(perf_counter() - start))
    mesh, clock = simulation.model.mesh.mesh, simulation.clock.seconds
    cells = mesh.topology.index_map(mesh.topology.dim).size_global
    return Measurement(
        level,
        value=curves[0].frames[-1].displacement,
        frame_seconds=median(curve.frames[-1].seconds for curve in curves),
        curve_seconds=median(seconds),
        setup_seconds=clock["mesh"] + clock["setup"],
        unknowns=simulation.model.rigid_dofs + simulation.model.flexible_dofs,
        spacing=float(cells) ** (-1.0 / level.model.dim),
        iterations=sum(frame.iterations for frame in curves[0].frames),
        repeats=len(curves),
    )


def _scaled(size: float | Mapping[FlexibleLink, float], factor: float) -> float | dict[FlexibleLink, float]:
    if isinstance(size, Mapping):
        return {link: factor * value for link, value in size.items()}
    return factor * size
