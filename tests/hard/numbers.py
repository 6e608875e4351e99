"""NaN and infinity at every place where a number comes in: refused with an error that names the part."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import inf, nan

import numpy as np
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.elasticity import Quadrature
from fenicsmech.equilibrium import PrimalDualNewton

from ..mechanism.parts import parts
from ..mechanism.test_numbers import NUMBERS
from .case import Check, Fact, HardCase
from .requests import truss


def _effects(part) -> dict[str, Callable[[float], object]]:
    """Entries of effects on the parts of a mechanism."""
    load = fm.Cylinder((0, 0), 1.0)
    return {
        "mass of a rigid link": lambda x: fm.Mass(x, (0, 0)),
        "centre of mass": lambda x: fm.Mass(1.0, (0, x)),
        "gravity": lambda x: fm.Gravity((0, x)),
        "cylinder's centre": lambda x: fm.Cylinder((x, 0), 1.0),
        "cylinder's radius": lambda x: fm.Cylinder((0, 0), x),
        "half-plane's point": lambda x: fm.HalfPlane((0, x), (0, 1)),
        "half-plane's normal": lambda x: fm.HalfPlane((0, 0), (x, 1)),
        "contact's stiffness": lambda x: fm.Contact(part.rod, load, stiffness=x),
        "contact's points": lambda x: fm.Contact(part.crank, load, stiffness=1.0, points=[(0, x)]),
        "pressure": lambda x: fm.Pressure(part.rod, x),
        "pressure's centre": lambda x: fm.Pressure(part.rod, 1.0, about=(x, 0)),
        "prestrain": lambda x: fm.Prestrain(part.rod, x),
        "direction of prestrain": lambda x: fm.Prestrain(part.rod, 1.1, along=(x, 0)),
        "spring's stiffness": lambda x: fm.JointSpring(part.shaft, x),
        "spring's rest": lambda x: fm.JointSpring(part.shaft, 1.0, rest=x),
        "compliance": lambda x: fm.JointCompliance(part.shaft, x),
        "coefficient of friction": lambda x: fm.PinFriction(x, 1.0),
        "radius of friction": lambda x: fm.PinFriction(0.1, x),
    }


def _fidelity(scene: fm.Scene, space: str, comm: MPI.Comm) -> dict[str, Callable[[float], object]]:
    """Entries that say how finely, and how long, something is computed."""

    def simulated(**options):
        return fm.Simulation(scene, **{"space": space, "size": 5.0, "comm": comm, **options})

    return {
        "element size": lambda x: simulated(size=x),
        "order": lambda x: simulated(order=x),
        "quadrature": lambda x: simulated(quadrature=Quadrature(x)),
        "Newton's tolerance": lambda x: simulated(solver=PrimalDualNewton(tolerance=x)),
        "Newton's round-off": lambda x: simulated(solver=PrimalDualNewton(roundoff=x)),
        "Newton's neighbourhood": lambda x: simulated(solver=PrimalDualNewton(near=x)),
        "Newton's largest turn": lambda x: simulated(solver=PrimalDualNewton(largest_turn=x)),
        "Newton's divergence": lambda x: simulated(solver=PrimalDualNewton(divergence=x)),
        "Newton's contraction": lambda x: simulated(solver=PrimalDualNewton(contraction=x)),
        "Levenberg–Marquardt's tolerance": lambda x: fm.LevenbergMarquardt(tolerance=x),
        "Levenberg–Marquardt's damping": lambda x: fm.LevenbergMarquardt(damping=x),
        "BFGS's tolerance": lambda x: fm.BFGS(tolerance=x),
    }


def _requests(simulation: fm.Simulation, push) -> dict[str, Callable[[float], object]]:
    """Entries of what is asked of a simulation."""
    link = simulation.scene.mechanism.flexible_links[0]
    target = fm.Target(push, force=0.5, displacement=1.0)
    problem = fm.DesignProblem(simulation, [fm.SplineDesign(link, segments=2)], targets=[target])

    def applied(x: float) -> None:
        design = problem.initial.copy()
        design[-1] = x
        problem.rest_shape(design)

    def explained(x: float) -> None:
        simulation.load_displacement(push, forces=[0.1]).explain(tolerance=x)

    return {
        "force of a curve": lambda x: simulation.load_displacement(push, forces=[0.1, x]),
        "displacement of a curve": lambda x: simulation.load_displacement(push, displacements=[x]),
        "tolerance of an explanation": explained,
        "force of a target": lambda x: fm.Target(push, force=x, displacement=1.0),
        "displacement of a target": lambda x: fm.Target(push, force=1.0, displacement=x),
        "weight of a target": lambda x: fm.Target(push, force=1.0, displacement=1.0, weight=x),
        "least thickness": lambda x: fm.SplineDesign(link, segments=2, thickness=(x, 9.0)),
        "largest thickness": lambda x: fm.SplineDesign(link, segments=2, thickness=(1.0, x)),
        "bend of a design": lambda x: fm.SplineDesign(link, segments=2, bend=x),
        "parameter of a design": applied,
        "weight of a regulariser": lambda x: x * fm.StayClose(),
        "limit of the mesh quality": lambda x: fm.MeshQuality(limit=x),
        "width of the mesh quality": lambda x: fm.MeshQuality(width=x),
        "strength of the mesh quality": lambda x: fm.MeshQuality(strength=x),
        "force of an experiment": lambda x: fm.Experiment(simulation, push, [1.0, x], [1.0, 2.0]),
        "displacement of an experiment": lambda x: fm.Experiment(simulation, push, [1.0, 2.0], [1.0, x]),
    }


def _not_finite(space: str, comm: MPI.Comm) -> Iterator[Check]:
    simulation, push = truss(space, comm)
    entries = {name: lambda x, enter=enter: enter(parts(), x) for name, enter in NUMBERS.items()}
    entries |= _effects(parts()) | _fidelity(simulation.scene, space, comm) | _requests(simulation, push)
    let_in = []
    for name, enter in entries.items():
        for value in (nan, inf, -inf):
            try:
                enter(value)
            except fm.DescriptionError:
                continue
            except Exception as error:
                let_in.append(f"{value} as {name} ends in {type(error).__name__}")
            else:
                let_in.append(f"{value} as {name} is let in")
    yield Fact(f"all {len(entries)} entries refuse all three" + "".join(f"; {said}" for said in let_in), not let_in)
    (after,) = simulation.load_displacement(push, forces=[0.5]).displacements
    yield Fact("the simulation is as sound as before", bool(np.isfinite(after)))


CASES = (HardCase("NaN and infinity", "typed in wherever a number is asked for", _not_finite),)
