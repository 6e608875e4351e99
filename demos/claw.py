"""Claw gripper (half): a motor closes a rigid finger through four Onyx links, shaped to give way to the object.

The finger pushes on the object at its tip; the object pushes back across the finger. The motor holds the closed
configuration while the force grows to 10 N. The links are shaped until the finger gives way by 5 mm at 4 N and by
20 mm at 10 N. Geometry and targets are this project's own; tables set the time of a frame of this drawn design beside
that of the article's optimised one.

    python3 demos/claw.py [--space SPACE] [--order 1|2] [--size MM] [--quick] [--simulate-only] [--out DIR]
    mpirun -n 2 python3 demos/claw.py
"""

import argparse
from pathlib import Path

import fenicsmech as fm

THICKNESS, DEPTH, PIN = 3.0, 8.5, 3.0  # mm
SHAFT, AXLE, ANCHOR = (15, 0), (60, 5), (22, 32)  # on the base: motor shaft and two axles
ELBOW, KNEE, HIP, WRIST = (38, 22), (62, 42), (56, 88), (28, 92)  # moving joints
FINGERTIP = (8, 125)
SIZE, QUICK = 1.73, 3.0  # mm, elements
FORCES = [float(force) for force in range(11)]  # N


def link(*points):
    """A strip of Onyx along ``points``."""
    return fm.strip(points, thickness=THICKNESS, depth=DEPTH)


def describe():
    """The scene, the force of the object on the finger, and the configurations."""
    claw = fm.Mechanism("claw gripper")
    base, finger = claw.rigid("base", fixed=True), claw.rigid("finger")
    crank = claw.flexible("crank", link(SHAFT, (29, 8), ELBOW), fm.ONYX)
    coupler = claw.flexible("coupler", link(ELBOW, (50, 30), KNEE, (66, 64), HIP), fm.ONYX)
    rocker = claw.flexible("rocker", link(AXLE, (67, 23), KNEE), fm.ONYX)
    guide = claw.flexible("guide", link(ANCHOR, (15, 62), WRIST), fm.ONYX)
    shaft = claw.revolute(base, crank, at=SHAFT, interface_radius=PIN)
    claw.revolute(crank, coupler, at=ELBOW, interface_radius=PIN)
    claw.revolute(base, rocker, at=AXLE, interface_radius=PIN)
    claw.revolute(rocker, coupler, at=KNEE, interface_radius=PIN)
    claw.revolute(coupler, finger, at=HIP, interface_radius=PIN)
    claw.revolute(base, guide, at=ANCHOR, interface_radius=PIN)
    claw.revolute(guide, finger, at=WRIST, interface_radius=PIN)
    claw.motor(shaft, name="servo")
    grasp = claw.force(on=finger, at=FINGERTIP, direction=(1, 0), name="object on finger")
    return fm.Scene(claw), grasp, [fm.DRAWN]


def wanted(scene, grasp, configurations):
    """The links that may change, and the targets."""
    designs = [fm.SplineDesign(link, segments=3, thickness=(1.0, 9.0)) for link in scene.mechanism.flexible_links]
    targets = [fm.Target(grasp, force=4.0, displacement=5.0), fm.Target(grasp, force=10.0, displacement=20.0)]
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
    parser.add_argument("--out", type=Path, default=Path("results/claw"), metavar="DIR", help="folder for files")
    options = parser.parse_args()
    fidelity = {"order": options.order, "size": options.size or (QUICK if options.quick else SIZE)}

    scene, grasp, _ = task = describe()
    sim = fm.Simulation(scene, space=options.space, **fidelity)
    before = sim.load_displacement(grasp, forces=FORCES)
    if options.simulate_only:
        return fm.write_report(options.out, sim, [before]).show()
    start = None
    if options.space.startswith("3d"):  # the optimum in plane stress takes seconds and is close to the one in space
        flat = fm.Simulation(scene, space="plane-stress", **fidelity)
        saved = {"checkpoint": options.out / "checkpoint-plane-stress.json", "resume": options.resume}
        start = fm.DesignProblem(flat, **wanted(*task)).optimise(**saved)
    problem = fm.DesignProblem(sim, **wanted(*task))
    saved = {"checkpoint": options.out / f"checkpoint-{options.space}.json", "resume": options.resume}
    result = problem.optimise(start=start, **saved)
    sim = sim.with_design(result)
    after = sim.load_displacement(grasp, forces=FORCES)
    found = fm.Optimisation(problem, result, before=[before], start=start, pin_diameter=PIN)
    fm.write_report(options.out, sim, [after], optimisation=found).show()


if __name__ == "__main__":
    main()
