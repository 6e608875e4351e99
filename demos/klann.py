"""Klann leg: a walking leg whose four Onyx links are shaped to spring when the foot meets an obstacle.

The linkage is that of US patent 6,260,862: its foot runs nearly straight along the ground while the crank turns. The
links, drawn for this project, are shaped until 5 N lift the foot by 10 mm in three configurations, as in the paper.

    python3 demos/klann.py [--space SPACE] [--quick] [--simulate-only] [--resume] [--out DIR]
"""

import argparse
from math import hypot, radians
from pathlib import Path

import fenicsmech as fm

SIZE, QUICK = 1.71, 2.2  # mm, elements
FORCES = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]  # N
THICKNESS, DEPTH, PIN, FOOT = 3.0, 8.5, 3.0, (0.0, 0.0)  # mm
PATENT = ((17.607, 11.807), (17.818, 16.076), (12.101, 10.186), (14.631, 11.807), (9.125, 11.807), (3.024, 13.099))
AXES = [(150.0 / 19.2 * x, 150.0 / 19.2 * y) for x, y in (*PATENT, (11.119, 19.200))]  # mm: 150 from foot to hip
SHAFT, FIRST_AXLE, SECOND_AXLE, CRANK_PIN, ELBOW, KNEE, HIP = AXES


def bowed(start, end, rise):
    """A strip from ``start`` to ``end`` that bows by ``rise`` to the left."""
    (x, y), (dx, dy) = start, (end[0] - start[0], end[1] - start[1])
    middle = x + dx / 2 - rise * dy / hypot(dx, dy), y + dy / 2 + rise * dx / hypot(dx, dy)
    return fm.strip([start, middle, end], thickness=THICKNESS, depth=DEPTH)


def describe():
    """The scene, the force of an obstacle on the foot, and the configurations of the stroke; drawn is 180°."""
    leg = fm.Mechanism("Klann leg")
    base, foot = leg.rigid("base", fixed=True), leg.rigid("leg")
    crank = leg.flexible("crank", bowed(SHAFT, CRANK_PIN, 3.0), fm.ONYX)
    rod = leg.flexible("connecting rod", fm.strip([CRANK_PIN, ELBOW, KNEE], thickness=THICKNESS, depth=DEPTH), fm.ONYX)
    first = leg.flexible("first rocker", bowed(FIRST_AXLE, HIP, 10.0), fm.ONYX)
    second = leg.flexible("second rocker", bowed(SECOND_AXLE, ELBOW, 5.0), fm.ONYX)
    motor = leg.motor(leg.revolute(base, crank, at=SHAFT, interface_radius=PIN), name="crank motor")
    pins = ((crank, rod, CRANK_PIN), (base, second, SECOND_AXLE), (second, rod, ELBOW), (base, first, FIRST_AXLE))
    for a, b, at in (*pins, (first, foot, HIP), (rod, foot, KNEE)):
        leg.revolute(a, b, at=at, interface_radius=PIN)
    lift = leg.force(on=foot, at=FOOT, direction=(0, 1), name="obstacle under foot")
    scene = fm.Scene(leg)
    return scene, lift, [scene.configuration(f"crank {a} deg", {motor: radians(a - 180)}) for a in (45, 95, 145)]


def wanted(scene, lift, stroke):
    """The links that may change, and the targets."""
    counts = zip(scene.mechanism.flexible_links, (2, 2, 3, 3), strict=True)
    designs = [fm.SplineDesign(link, segments=count, thickness=(1.0, 9.0)) for link, count in counts]
    targets = [fm.Target(lift, force=5.0, displacement=10.0, configuration=place) for place in stroke]
    return {"designs": designs, "targets": targets}


def main():
    fm.mpi_abort_on_error()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--space", choices=list(fm.SPACES), default="3d")
    parser.add_argument("--quick", action="store_true", help=f"elements of {QUICK} mm instead of {SIZE} mm")
    parser.add_argument("--simulate-only", action="store_true", help="simulate the drawn design only")
    parser.add_argument("--resume", action="store_true", help="continue an interrupted optimisation")
    parser.add_argument("--out", type=Path, default=Path("results/klann"), metavar="DIR", help="folder for files")
    options = parser.parse_args()

    scene, lift, stroke = describe()
    sim = fm.Simulation(scene, space=options.space, size=QUICK if options.quick else SIZE)
    curves = [sim.load_displacement(lift, forces=FORCES, configuration=place) for place in stroke]
    if options.simulate_only:
        return fm.write_report(options.out, sim, curves).show()
    problem = fm.DesignProblem(sim, **wanted(scene, lift, stroke))
    report = fm.design_study(options.out, problem, curves, resume=options.resume, pin_diameter=PIN)
    report.show()
    motor = scene.mechanism.motors[0]
    turn = [scene.configuration(f"turned by {a} deg", {motor: radians(a)}) for a in range(0, 361, 4)]
    path = fm.Trace(sim.path(lift, turn)[:, :2], "foot path", sim.path(lift, stroke)[:, :2])
    report.curves[1].picture(options.out / "foot-path.png", stress=False, traces=[path])


if __name__ == "__main__":
    main()
