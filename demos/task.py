"""A demo's task: curves to simulate, links that may change, targets; and how it is done."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType

from common import Demo, simulation
from files import Outcome, leave

import fenicsmech as fm


@dataclass(frozen=True)
class Task:
    """What a demo does.

    Attributes:
        force: the force that changes.
        loads: its magnitudes, those of the targets among them.
        configurations: in which the curve is simulated.
        designs: links that may change.
        targets: what is wanted of the curves.
        pin: diameter of the holes in the exported links, mm.
    """

    force: fm.Force
    loads: Sequence[float]
    configurations: Sequence[fm.Configuration]
    designs: Sequence[fm.SplineDesign]
    targets: Sequence[fm.Target]
    pin: float


def scene_and_task(mechanism: ModuleType) -> tuple[fm.Scene, Task]:
    """What the module of a mechanism describes: truss, claw or klann."""
    scene, *parts = mechanism.describe()
    return scene, mechanism.task(scene, *parts)


def run(demo: Demo, scene: fm.Scene, task: Task) -> Outcome:
    """Simulates the drawn mechanism, optimises its links unless told not to, and leaves the files of both."""
    sim = simulation(demo, scene)
    before = curves(sim, task)
    if demo.options.simulate_only:
        outcome = Outcome(demo, sim, before, targets=task.targets)
    else:
        coarse = None
        if demo.options.space in ("3d", "3d-symmetric"):
            # a planar mechanism's plane-stress optimum is found in seconds and is close to the one in space
            coarse = optimise(demo, fm.DesignProblem(simulation(demo, scene, "plane-stress"), **wanted(task)), None)
        problem = fm.DesignProblem(sim, **wanted(task))
        result = optimise(demo, problem, coarse)
        after = sim.with_design(result)
        outcome = Outcome(demo, after, curves(after, task), task.targets, before, problem, result, coarse, task.pin)
    leave(outcome)
    return outcome


def wanted(task: Task) -> dict:
    """The arguments of the design problem."""
    return {"designs": task.designs, "targets": task.targets}


def curves(sim: fm.Simulation, task: Task) -> list[fm.Curve]:
    """The curve in every configuration, of the simulation's present shapes."""
    return [
        sim.load_displacement(task.force, forces=task.loads, configuration=configuration)
        for configuration in task.configurations
    ]


def optimise(demo: Demo, problem: fm.DesignProblem, start: fm.DesignResult | None) -> fm.DesignResult:
    """The optimum, with a checkpoint in the demo's folder after each iteration."""
    space = problem.simulation.fidelity.model.name
    return problem.optimise(
        optimiser=fm.BFGS() if demo.options.bfgs else fm.LevenbergMarquardt(),
        start=start,
        checkpoint=demo.folder / f"checkpoint-{space}.json",
        resume=demo.options.resume,
    )
