"""Klann leg: a walking leg whose four Onyx links are shaped to spring when the foot meets an obstacle.

The linkage is that of US patent 6,260,862. Its foot runs along a nearly straight ground stroke while the crank turns;
the links are shaped until 5 N lift the foot by 10 mm in three configurations of the stroke. Shapes of the links and
targets are this project's own; tables set the time of a frame of this drawn design beside that of the article's
optimised one.

    python3 demos/klann.py [--space SPACE] [--order 1|2] [--size MM] [--quick] [--simulate-only] [--out DIR]
    mpirun -n 2 python3 demos/klann.py
"""

import argparse
from math import radians
from pathlib import Path

import numpy as np

import fenicsmech as fm

SIZE, QUICK = 1.71, 2.2  # mm, elements
FORCES = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]  # N
SCALE = 150.0 / 19.2  # mm per unit of the patent: 150 mm from foot to hip
THICKNESS, DEPTH, PIN = 3.0, 8.5, 3.0
SEGMENTS = {"crank": 2, "connecting rod": 2, "first rocker": 3, "second rocker": 3}


def pivot(x, y):
    """A pivot of the patent, in mm; the foot is the origin."""
    return (SCALE * x, SCALE * y)


SHAFT, FIRST_AXLE, SECOND_AXLE = pivot(17.607, 11.807), pivot(17.818, 16.076), pivot(12.101, 10.186)
CRANK_PIN, ELBOW, KNEE, HIP = pivot(14.631, 11.807), pivot(9.125, 11.807), pivot(3.024, 13.099), pivot(11.119, 19.200)
FOOT = pivot(0.0, 0.0)


def bowed(start, end, rise):
    """A strip of Onyx from ``start`` to ``end`` that bows by ``rise`` to the left."""
    start, end = np.array(start), np.array(end)
    across = np.array([start[1] - end[1], end[0] - start[0]]) / np.hypot(*(end - start))
    return fm.strip([start, (start + end) / 2 + rise * across, end], thickness=THICKNESS, depth=DEPTH)


def describe():
    """The scene, the force of an obstacle on the foot, and the configurations of the stroke."""
    leg = fm.Mechanism("Klann leg")
    base, foot = leg.rigid("base", fixed=True), leg.rigid("leg")
    crank = leg.flexible("crank", bowed(SHAFT, CRANK_PIN, 3.0), fm.ONYX)
    rod = leg.flexible("connecting rod", fm.strip([CRANK_PIN, ELBOW, KNEE], thickness=THICKNESS, depth=DEPTH), fm.ONYX)
    first = leg.flexible("first rocker", bowed(FIRST_AXLE, HIP, 10.0), fm.ONYX)
    second = leg.flexible("second rocker", bowed(SECOND_AXLE, ELBOW, 5.0), fm.ONYX)
    shaft = leg.revolute(base, crank, at=SHAFT, interface_radius=PIN)
    leg.revolute(crank, rod, at=CRANK_PIN, interface_radius=PIN)
    leg.revolute(base, second, at=SECOND_AXLE, interface_radius=PIN)
    leg.revolute(second, rod, at=ELBOW, interface_radius=PIN)
    leg.revolute(base, first, at=FIRST_AXLE, interface_radius=PIN)
    leg.revolute(first, foot, at=HIP, interface_radius=PIN)
    leg.revolute(rod, foot, at=KNEE, interface_radius=PIN)
    motor = leg.motor(shaft, name="crank motor")
    lift = leg.force(on=foot, at=FOOT, direction=(0, 1), name="obstacle under foot")
    scene = fm.Scene(leg)
    # crank angles of the patent; the drawn one is 180°
    stroke = [scene.configuration(f"crank {angle} deg", {motor: radians(angle - 180)}) for angle in (45, 95, 145)]
    return scene, lift, stroke


def wanted(scene, lift, stroke):
    """The links that may change, and the targets."""
    designs = [
        fm.SplineDesign(link, segments=SEGMENTS[link.name], thickness=(1.0, 9.0))
        for link in scene.mechanism.flexible_links
    ]
    targets = [fm.Target(lift, force=5.0, displacement=10.0, configuration=place) for place in stroke]
    return {"designs": designs, "targets": targets}


def main():
    fm.mpi_abort_on_error()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--space", choices=list(fm.SPACES), default="3d")
    parser.add_argument("--order", type=int, choices=(1, 2), default=2, help="degree of the displacement field")
    parser.add_argument("--size", type=float, metavar="MM", help=f"element size (default {SIZE} mm)")
    parser.add_argument("--quick", action="store_true", help=f"coarse: element size {QUICK} mm")
    parser.add_argument("--simulate-only", action="store_true", help="simulate the drawn design only")
    parser.add_argument("--resume", action="store_true", help="go on with an optimisation that was interrupted")
    parser.add_argument("--out", type=Path, default=Path("results/klann"), metavar="DIR", help="folder for files")
    options = parser.parse_args()
    fidelity = {"order": options.order, "size": options.size or (QUICK if options.quick else SIZE)}

    scene, lift, stroke = task = describe()
    sim = fm.Simulation(scene, space=options.space, **fidelity)
    before = [sim.load_displacement(lift, forces=FORCES, configuration=place) for place in stroke]
    if options.simulate_only:
        return fm.write_report(options.out, sim, before).show()
    start = None
    if options.space.startswith("3d"):  # the optimum in plane stress takes seconds and is close to the one in space
        flat = fm.Simulation(scene, space="plane-stress", **fidelity)
        saved = {"checkpoint": options.out / "checkpoint-plane-stress.json", "resume": options.resume}
        start = fm.DesignProblem(flat, **wanted(*task)).optimise(**saved)
    problem = fm.DesignProblem(sim, **wanted(*task))
    saved = {"checkpoint": options.out / f"checkpoint-{options.space}.json", "resume": options.resume}
    result = problem.optimise(start=start, **saved)
    sim = sim.with_design(result)
    after = [sim.load_displacement(lift, forces=FORCES, configuration=place) for place in stroke]
    found = fm.Optimisation(problem, result, before=before, start=start, pin_diameter=PIN)
    fm.write_report(options.out, sim, after, optimisation=found).show()

    motor = scene.mechanism.motors[0]
    turn = [scene.configuration(f"turned by {angle} deg", {motor: radians(angle)}) for angle in range(0, 361, 4)]
    path = fm.Trace(sim.path(lift, turn)[:, :2], "foot path", sim.path(lift, stroke)[:, :2])
    after[1].picture(options.out / "foot-path.png", stress=False, traces=[path])


if __name__ == "__main__":
    main()
