"""Memory: simulations free theirs when they are gone, iterations while they go on."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

from ..design.mechanisms import truss
from .demo_scenes import describe

STATUS = Path("/proc/self/status")
pytestmark = [
    pytest.mark.parallel,
    pytest.mark.skipif(not STATUS.exists(), reason="the system does not report the memory of a process"),
]


def megabytes() -> float:
    """Memory this process holds."""
    (line,) = (line for line in STATUS.read_text().splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1024.0


def growth(run: Callable[[], None], *, before: int, times: int) -> float:
    """MB that the process grows by per run, once it has run a few times; on the rank that grows most."""
    for _ in range(before):
        run()
    held = megabytes()
    for _ in range(times):
        run()
    return MPI.COMM_WORLD.allreduce((megabytes() - held) / times, op=MPI.MAX)


def simulate(**fidelity) -> tuple[fm.Simulation, fm.Curve]:
    scene, push = describe("truss")
    simulation = fm.Simulation(scene, **fidelity)
    return simulation, simulation.load_displacement(push, forces=[0.05])


@pytest.mark.thorough
def test_simulations_give_their_memory_back():
    # what one holds: 20 MB on one process, 10 MB on each of two; of a curve, 3 MB; of a design problem, 20 MB
    assert growth(lambda: simulate(space="3d", size=3.0), before=2, times=3) < 4.0


@pytest.mark.thorough
def test_curves_of_one_simulation_give_their_memory_back():
    simulation, curve = simulate(space="3d", size=3.0)

    def run() -> None:
        simulation.load_displacement(curve.part, forces=[0.05]).error_estimates()

    assert growth(run, before=2, times=4) < 0.8


def test_constant_forces_of_all_magnitudes_share_one_matrix():
    simulation, curve = simulate(space="plane-stress", size=3.0)
    mechanism = simulation.scene.mechanism
    pull = mechanism.force(on=curve.part.on, at=curve.part.at, direction=(0, -1), name="pull")

    def pulled(magnitude: float) -> fm.Curve:
        return simulation.load_displacement(curve.part, forces=[0.05], others={pull: magnitude})

    def systems() -> int:
        gc.collect()
        return sum(isinstance(thing, fm.EquilibriumSystem) for thing in gc.get_objects())

    before, magnitudes = systems(), (0.0, 0.01, -0.02, 0.03)
    curves = {magnitude: pulled(magnitude) for magnitude in magnitudes}
    assert systems() == before + 1
    # each still has its own force: none is that of the curve without, but where its magnitude is zero
    errors = {magnitude: own.error_estimates() for magnitude, own in curves.items()}
    assert errors[0.0] == pytest.approx(curve.error_estimates(), rel=1e-6)
    assert curves[0.0].displacements == pytest.approx(curve.displacements, rel=1e-8)
    for magnitude in magnitudes[1:]:
        alone = fm.Simulation(simulation.scene, space="plane-stress", size=3.0)
        again = alone.load_displacement(curve.part, forces=[0.05], others={pull: magnitude})
        assert curves[magnitude].displacements == pytest.approx(again.displacements, rel=1e-8)
        assert errors[magnitude] == pytest.approx(again.error_estimates(), rel=1e-6)
        assert abs(curves[magnitude].displacements[0] / curve.displacements[0] - 1.0) > 1e-3


def test_frames_of_one_design_share_its_field():
    simulation, curve = simulate(space="plane-stress", size=3.0)
    for own in (simulation, simulation.with_design(np.zeros_like(curve.frames[0].design.field))):
        curves = [own.load_displacement(curve.part, forces=[0.02, 0.05]) for _ in range(2)]
        fields = [frame.design.field for curve in curves for frame in curve.frames]
        assert all(field is fields[0] for field in fields)
        with pytest.raises(ValueError, match="read-only"):
            fields[0][:] = 1.0


@pytest.mark.thorough
def test_designs_give_their_memory_back():
    case = truss((0.1, 6.0), (0.4, 9.0))

    def run() -> None:
        problem = case.problem(size=1.0, comm=MPI.COMM_WORLD)
        problem.optimise(optimiser=fm.LevenbergMarquardt(iterations=1))

    assert growth(run, before=1, times=2) < 4.0


def test_nothing_but_its_owner_and_its_curves_keeps_a_simulation():
    """No cycle of references waits for Python's collector, which counts objects and not their size."""
    gc.collect()
    gc.disable()
    try:
        simulation, curve = simulate(space="plane-stress", size=3.0)
        curve.error_estimates()
        model, system = simulation.model, simulation.solver(curve.part).system
        gone = [weakref.ref(thing) for thing in (simulation, model, model.elastic, system)]
        del simulation, curve, model, system
        assert [thing() for thing in gone] == [None] * len(gone)
    finally:
        gc.enable()
