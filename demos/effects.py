"""What each effect costs: the claw's curve with effects added one by one.

    OPENBLAS_NUM_THREADS=1 python3 demos/effects.py [--space SPACE] [--size MM]

One table: terms of the energy, unknowns, seconds per Newton iteration relative to the bare scene (median over a curve,
the bare scene measured again at the end), and how far the effect moves the finger.
"""

import argparse
from statistics import median

import claw

import fenicsmech as fm
from fenicsmech.report import format_table

HEADERS = (
    "effect",
    "energy terms",
    "unknowns",
    "iterations",
    "s/iteration",
    "relative",
    "moves the finger by [mm]",
)


def scenes():
    """The claw without effects, with each of them, with all, and without again: name → scene and force."""
    made = {"none": lambda mechanism: []}
    for name, make in EFFECTS.items():
        made[name] = lambda mechanism, make=make: [make(mechanism)]
    made["all of them"] = lambda mechanism: [make(mechanism) for make in EFFECTS.values()]
    made["none, again"] = lambda mechanism: []
    for name, effects in made.items():
        scene, grasp = claw.describe()
        yield name, fm.Scene(scene.mechanism, effects=effects(scene.mechanism)), grasp


def link(mechanism, name):
    """A flexible link by its name."""
    return next(link for link in mechanism.flexible_links if link.name == name)


def joint_at(mechanism, place):
    """The joint that was drawn at ``place``."""
    return next(joint for joint in mechanism.joints if tuple(joint.at[:2]) == tuple(map(float, place)))


EFFECTS = {
    "gravity": lambda m: fm.Gravity((0, -9810), {fm.ONYX: 1.2e-9}),
    "joint spring": lambda m: fm.JointSpring(joint_at(m, claw.WRIST), 50.0),
    "joint compliance": lambda m: fm.JointCompliance(joint_at(m, claw.HIP), 1e-3),
    "contact": lambda m: fm.Contact(link(m, "guide"), fm.Cylinder((45, 62), 20.0)),
    "prestrain": lambda m: fm.Prestrain(link(m, "guide"), 1.001),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--space", choices=("3d", "3d-symmetric", "plane-stress"), default="3d")
    parser.add_argument("--size", type=float, default=claw.SIZE, metavar="MM", help="element size")
    options = parser.parse_args()
    rows, bare = [], None
    for name, scene, grasp in scenes():
        sim = fm.Simulation(scene, space=options.space, size=options.size)
        sim.load_displacement(grasp, forces=claw.FORCES[:2])  # compiles
        curve = sim.load_displacement(grasp, forces=claw.FORCES)
        seconds = median(frame.seconds / frame.iterations for frame in curve.frames[1:])
        iterations = sum(frame.iterations for frame in curve.frames)
        bare = bare or (seconds, curve.displacements[-1])
        terms = len(sim.model.elastic.energy_ufl.integrals())
        moved = curve.displacements[-1] - bare[1]
        rows.append((name, terms, sim.model.flexible_dofs, iterations, seconds, seconds / bare[0], moved))
    print(format_table(HEADERS, rows))


if __name__ == "__main__":
    main()
