"""The time that each effect takes: the claw's curve with effects added one by one.

    OPENBLAS_NUM_THREADS=1 python3 -m benchmarks.effects [--space SPACE] [--size MM]

One table: terms of the energy, unknowns, seconds per Newton iteration relative to the bare scene (median over a curve,
the bare scene measured again at the end), and how far the effect moves the finger.
"""

from statistics import median

import fenicsmech as fm
from fenicsmech.report import format_table

from .mechanisms import mechanism
from .table import command, publish

WRIST, HIP = (28, 92), (56, 88)  # joints of the claw

HEADERS = ("effect", "energy terms", "unknowns", "iterations", "s/iteration", "relative", "moves the finger by [mm]")


def scenes():
    """The claw without effects, with each of them, with all, and without again: name → scene and force."""
    chosen = {"none": [], **{name: [make] for name, make in EFFECTS.items()}}
    chosen |= {"all of them": list(EFFECTS.values()), "none, again": []}
    for name, effects in chosen.items():
        case = mechanism("claw")
        made = case.scene.mechanism
        yield name, fm.Scene(made, effects=[make(made) for make in effects]), case.force


def link(mechanism, name):
    """A flexible link by its name."""
    return next(link for link in mechanism.flexible_links if link.name == name)


def joint_at(mechanism, place):
    """The joint that was drawn at ``place``."""
    return next(joint for joint in mechanism.joints if tuple(joint.at[:2]) == tuple(map(float, place)))


EFFECTS = {
    "gravity": lambda m: fm.Gravity((0, -9810)),
    "joint spring": lambda m: fm.JointSpring(joint_at(m, WRIST), 50.0),
    "joint compliance": lambda m: fm.JointCompliance(joint_at(m, HIP), 1e-3),
    "contact": lambda m: fm.Contact(link(m, "guide"), fm.Cylinder((45, 62), 20.0)),
    "prestrain": lambda m: fm.Prestrain(link(m, "guide"), 1.001),
}


def main():
    parser = command(__doc__)
    claw = mechanism("claw")
    parser.add_argument("--space", choices=("3d", "3d-symmetric", "plane-stress"), default="3d")
    parser.add_argument("--size", type=float, default=claw.size, metavar="MM", help="element size")
    options = parser.parse_args()
    rows, bare = [], None
    for name, scene, grasp in scenes():
        sim = fm.Simulation(scene, space=options.space, size=options.size)
        sim.load_displacement(grasp, forces=claw.loads[:2])  # compiles
        curve = sim.load_displacement(grasp, forces=claw.loads)
        seconds = median(frame.seconds / frame.iterations for frame in curve.frames[1:])
        iterations = sum(frame.iterations for frame in curve.frames)
        bare = bare or (seconds, curve.displacements[-1])
        terms = len(sim.model.elastic.energy_ufl.integrals())
        moved = curve.displacements[-1] - bare[1]
        rows.append((name, terms, sim.model.flexible_dofs, iterations, seconds, seconds / bare[0], moved))
    publish("effects", format_table(HEADERS, rows), write=options.write)


if __name__ == "__main__":
    main()
