"""Constant-force spring: a slender strut pushes a shuttle back with the same force wherever the shuttle is.

The strut is pinned to a wall and to a shuttle on a straight guide. Pressed down, it buckles: its thrust hardly grows,
and more and more of it points across the guide. The shape of the strut is optimised until both effects cancel, and the
shuttle is pushed back by 8 N within 1 % from 2 mm to 8 mm. Geometry and targets are this project's own.

    python3 demos/constant_force.py [--space SPACE] [--quick] [--simulate-only] [--out DIR]
"""

import argparse
from math import cos, sin
from pathlib import Path

import numpy as np

import fenicsmech as fm

LENGTH, INCLINATION, BOW = 60.0, 0.7, 1.2  # mm and rad: between the pins, from the guide; and its rise in the middle
THICKNESS, DEPTH, EYE = 1.6, 10.0, 1.5  # mm
FORCE, RANGE = 8.0, [2.0, 4.0, 6.0, 8.0]  # N and mm: where the shuttle is held
SHOWN = np.linspace(0.0, 10.0, 21).tolist()  # mm
SIZE, QUICK = 1.0, 2.0  # mm, elements


def describe():
    """The scene, the force that pushes the shuttle, and the configurations."""
    spring = fm.Mechanism("constant-force spring")
    wall, guide, shuttle = spring.rigid("wall", fixed=True), spring.rigid("guide", fixed=True), spring.rigid("shuttle")
    top = LENGTH * sin(INCLINATION), LENGTH * cos(INCLINATION)
    middle = 0.5 * top[0] + BOW * cos(INCLINATION), 0.5 * top[1] - BOW * sin(INCLINATION)
    shape = fm.strip([(0, 0), middle, top], thickness=THICKNESS, depth=DEPTH)
    strut = spring.flexible("strut", shape, fm.ONYX)
    spring.revolute(wall, strut, at=(0, 0), interface_radius=EYE)
    spring.revolute(strut, shuttle, at=top, interface_radius=EYE)
    spring.prismatic(guide, shuttle, at=top, axis=(0, 1))
    return fm.Scene(spring), spring.force(on=shuttle, at=top, direction=(0, -1), name="push"), [fm.DRAWN]


def wanted(scene, push, configurations):
    """The links that may change, and the targets."""
    (strut,) = scene.mechanism.flexible_links
    places = [fm.Sample({push: fm.at(displacement)}) for displacement in RANGE]
    return {
        "designs": [fm.SplineDesign(strut, segments=2, thickness=(0.8, 4.0))],
        "targets": [fm.Target(fm.ForceMagnitude(push), place, equals=FORCE, weight=10.0) for place in places],
    }


def main():
    fm.mpi_abort_on_error()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--space", choices=list(fm.SPACES), default="plane-stress")
    parser.add_argument("--quick", action="store_true", help=f"elements of {QUICK} mm instead of {SIZE} mm")
    parser.add_argument("--simulate-only", action="store_true", help="simulate the drawn design only")
    parser.add_argument("--out", type=Path, default=Path("results/constant_force"), metavar="DIR")
    options = parser.parse_args()

    scene, push, configurations = describe()
    sim = fm.Simulation(scene, space=options.space, size=QUICK if options.quick else SIZE)
    drawn = sim.load_displacement(push, displacements=SHOWN)
    if options.simulate_only:
        return fm.write_report(options.out, sim, [drawn]).show()
    problem = fm.DesignProblem(sim, **wanted(scene, push, configurations))
    result = problem.verify(problem.optimise(), options.out / "parts")
    sim = sim.with_design(result)
    after = sim.load_displacement(push, displacements=SHOWN)
    study = fm.Optimisation(problem, result, before=[drawn], pin_diameter=EYE)
    fm.write_report(options.out, sim, [after], optimisation=study).show()
    held = [force for place, force in zip(SHOWN, after.forces, strict=True) if RANGE[0] <= place <= RANGE[-1]]
    fm.print_once(f"from {RANGE[0]:g} to {RANGE[-1]:g} mm the force is {min(held):.3f} to {max(held):.3f} N")


if __name__ == "__main__":
    main()
