"""Double wishbone suspension, seen from the front: the place of the upper arm is optimised for the camber of the wheel.

The upper arm is a leaf of steel, clamped to the body; the lower arm is rigid, with a spring at the body. Targets are a
force of 900 N in bump, 30 mm up, and the camber of the wheel: 0.4° inwards in bump, 0.1° outwards in rebound. Three
numbers are found: the place of the clamp, in two directions, and the stiffness of the spring. Geometry and targets are
this project's own.

    python3 demos/suspension.py [--quick] [--simulate-only] [--out DIR]
"""

import argparse
from math import radians
from pathlib import Path

import fenicsmech as fm

STEEL = fm.Material("steel", 210e3, 0.3, density=7.85e-9)  # MPa, t/mm³
INNER, OUTER = {"lower": (0, 0), "upper": (60, 190)}, {"lower": (340, -10), "upper": (310, 200)}  # mm, joints
WHEEL = (420, -80)  # where the tyre meets the road
SPRING = 3e6  # N mm/rad, as drawn
BUMP, REBOUND, LOAD = 30.0, -30.0, 900.0  # mm, mm, N
LEANS = radians(0.4), radians(-0.1)  # camber in bump and rebound, positive inwards
SIZE, QUICK = 2.0, 3.0  # mm, elements


def describe():
    """The scene, the force of the road, and the clamp of the upper arm."""
    car = fm.Mechanism("suspension")
    body, upright, lower = car.rigid("body", fixed=True), car.rigid("upright"), car.rigid("lower arm")
    leaf = fm.strip([INNER["upper"], OUTER["upper"]], thickness=4.0, depth=30.0)
    upper = car.flexible("upper arm", leaf, STEEL)
    low = car.revolute(body, lower, at=INNER["lower"], name="lower pin")
    clamp = car.weld(body, upper, at=INNER["upper"], interface_radius=8.0, name="upper clamp")
    car.revolute(lower, upright, at=OUTER["lower"])
    car.revolute(upper, upright, at=OUTER["upper"], interface_radius=8.0)
    road = car.force(on=upright, at=WHEEL, direction=(0, 1), name="road")
    return fm.Scene(car, [fm.JointSpring(low, SPRING)]), road, clamp


def wanted(scene, road, clamp):
    """The numbers that may change, and the targets."""
    (spring,), upright = scene.effects, road.on
    bump, rebound = (fm.Sample({road: fm.at(travel)}) for travel in (BUMP, REBOUND))
    place = [fm.Number(fm.JointPosition(clamp, direction=way), -120.0, 90.0) for way in ((1, 0), (0, 1))]
    return {
        "designs": [*place, fm.Number(fm.SpringStiffness(spring), 0.2 * SPRING, 5.0 * SPRING)],
        "targets": [
            fm.Target(fm.ForceMagnitude(road), bump, equals=LOAD),
            *(
                fm.Target(fm.Rotation(upright), own, equals=lean)
                for own, lean in zip((bump, rebound), LEANS, strict=True)
            ),
        ],
    }


def main():
    fm.mpi_abort_on_error()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help=f"elements of {QUICK} mm instead of {SIZE} mm")
    parser.add_argument("--simulate-only", action="store_true", help="simulate the drawn design only")
    parser.add_argument("--out", type=Path, default=Path("results/suspension"), metavar="DIR", help="folder for files")
    options = parser.parse_args()

    scene, road, clamp = describe()
    sim = fm.Simulation(scene, space="plane-stress", size=QUICK if options.quick else SIZE)
    travels = [10.0, 20.0, BUMP]
    before = sim.load_displacement(road, displacements=travels)
    if options.simulate_only:
        return fm.write_report(options.out, sim, [before]).show()
    problem = fm.DesignProblem(sim, **wanted(scene, road, clamp))
    result = problem.verify(problem.optimise(), options.out / "parts")
    sim = sim.with_design(result)
    study = fm.Optimisation(problem, result, before=[before])
    fm.write_report(options.out, sim, [sim.load_displacement(road, displacements=travels)], optimisation=study).show()


if __name__ == "__main__":
    main()
