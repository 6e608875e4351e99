"""One rung measured: the value it gives, and the seconds it takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median
from time import perf_counter

from mpi4py import MPI
from petsc4py import PETSc

from fenicsmech.accuracy.quantity import Quantity
from fenicsmech.accuracy.rung import RIGID, Rung
from fenicsmech.elasticity import Quadrature
from fenicsmech.equilibrium import PrimalDualNewton
from fenicsmech.errors import FenicsmechError
from fenicsmech.mechanism import FlexibleLink, Scene
from fenicsmech.multibody import assemble, build_linkage
from fenicsmech.simulation import CurveRequest, Simulation, read_request

_SAMPLES = (0.2, 0.4, 0.6, 0.8, 1.0)  # of the load: evenly, as predictors like it
_ENOUGH = 5.0  # s: a curve that takes as long is not noise


@dataclass(frozen=True)
class Measurement:
    """What a rung gives and costs.

    Attributes:
        rung: the fidelity.
        value: of the quantity; None if the rung failed or was left out.
        frame_seconds: the equilibrium, from its neighbour at 0.8 of the load.
        curve_seconds: from the unloaded configuration to the load in five samples.
        setup_seconds: mesh, numbering and matrix patterns; without the forms' compilation, once per computer.
        unknowns: coordinates of rigid bodies and finite-element unknowns.
        spacing: cells^(−1/dim): the element size that refinement around pins leaves, up to a constant.
        iterations: of Newton's method, for the curve.
        repeats: curves whose median the seconds are.
        failure: why there is no value.
    """

    rung: Rung
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
    rung: Rung,
    *,
    size: float | Mapping[FlexibleLink, float],
    repeats: int,
    comm: MPI.Comm,
) -> Measurement:
    """The measurement of a rung; a failure is recorded in it (collective).

    Args:
        scene: what is computed.
        quantity: what is read.
        rung: the fidelity.
        size: element size at factor 1, or one per flexible link.
        repeats: most curves to time; fewer once they took five seconds.
        comm: processes that share the work.
    """
    try:
        if rung.model is None:
            return _measure_rigid(scene, quantity, repeats)
        return _measure_elastic(scene, quantity, rung, size, repeats, comm)
    except (FenicsmechError, PETSc.Error) as error:  # PETSc's own: a matrix that does not fit into memory
        return Measurement(rung, failure=str(error))


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
        value=quantity.rigid_value,
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
    rung: Rung,
    size: float | Mapping[FlexibleLink, float],
    repeats: int,
    comm: MPI.Comm,
) -> Measurement:
    simulation = Simulation(
        scene,
        space=rung.model.name,
        order=rung.order,
        size=_scaled(size, rung.factor),
        quadrature=None if rung.quadrature is None else Quadrature(rung.quadrature),
        solver=PrimalDualNewton(tolerance=rung.tolerance),
        comm=comm,
    )
    simulation.trace(_request(scene, quantity, (0.0,)))  # compiles, and touches every page for the first time
    request = _request(scene, quantity, _SAMPLES)
    curves, seconds = [], []
    while len(curves) < repeats and sum(seconds) < _ENOUGH:
        start = perf_counter()
        curves.append(simulation.trace(request))
        seconds.append(comm.bcast(perf_counter() - start))
    mesh, clock = simulation.model.mesh.mesh, simulation.clock.seconds
    cells = mesh.topology.index_map(mesh.topology.dim).size_global
    return Measurement(
        rung,
        value=quantity.read(curves[0].frames[-1]),
        frame_seconds=median(curve.frames[-1].seconds for curve in curves),
        curve_seconds=median(seconds),
        setup_seconds=clock["mesh"] + clock["setup"],
        unknowns=simulation.model.rigid_dofs + simulation.model.flexible_dofs,
        spacing=float(cells) ** (-1.0 / rung.model.dim),
        iterations=sum(frame.iterations for frame in curves[0].frames),
        repeats=len(curves),
    )


def _request(scene: Scene, quantity: Quantity, shares: tuple[float, ...]) -> CurveRequest:
    """The curve through shares of the quantity's load."""
    return read_request(
        scene.mechanism,
        quantity.force_part,
        forces=[share * quantity.load for share in shares],
        displacements=None,
        configuration=quantity.configuration,
        others=None,
    )


def _scaled(size: float | Mapping[FlexibleLink, float], factor: float) -> float | dict[FlexibleLink, float]:
    if isinstance(size, Mapping):
        return {link: factor * value for link, value in size.items()}
    return factor * size
