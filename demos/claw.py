"""Claw gripper (half): a motor closes a rigid finger through four Onyx links, shaped to give way to the object.

The finger pushes on the object at its tip; the object pushes back across the finger. The motor holds the closed
configuration while the force grows to 10 N. The links are shaped until the finger gives way by 5 mm at 4 N and by
20 mm at 10 N; with --least-mass they become as light as these displacements, as bounds, allow. The targets are the
paper's, the geometry is this project's own.

    python3 demos/claw.py [--space SPACE] [--quick] [--simulate-only] [--least-mass] [--resume] [--out DIR]
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
    claw.motor(claw.revolute(base, crank, at=SHAFT, interface_radius=PIN), name="servo")
    claw.revolute(crank, coupler, at=ELBOW, interface_radius=PIN)
    claw.revolute(base, rocker, at=AXLE, interface_radius=PIN)
    claw.revolute(rocker, coupler, at=KNEE, interface_radius=PIN)
    claw.revolute(coupler, finger, at=HIP, interface_radius=PIN)
    claw.revolute(base, guide, at=ANCHOR, interface_radius=PIN)
    claw.revolute(guide, finger, at=WRIST, interface_radius=PIN)
    grasp = claw.force(on=finger, at=FINGERTIP, direction=(1, 0), name="object on finger")
    return fm.Scene(claw), grasp, [fm.DRAWN]


def wanted(scene, grasp, configurations, least_mass=False):
    """The links that may change, and the targets."""
    links, least = scene.mechanism.flexible_links, 2.0 if least_mass else 1.0  # mm: light ones buckle if thinner
    targets = [fm.Target(grasp, force=4.0, displacement=5.0), fm.Target(grasp, force=10.0, displacement=20.0)]
    if least_mass:
        targets = [fm.Target(own.quantity, own.sample, at_most=own.wanted[0]) for own in targets]
        targets += [fm.Target(fm.LinkMass(links), least=True)]
    return {"designs": [fm.SplineDesign(link, 3, thickness=(least, 9.0)) for link in links], "targets": targets}


def main():
    fm.mpi_abort_on_error()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--space", choices=list(fm.SPACES), default="3d")
    parser.add_argument("--quick", action="store_true", help=f"elements of {QUICK} mm instead of {SIZE} mm")
    parser.add_argument("--simulate-only", action="store_true", help="simulate the drawn design only")
    parser.add_argument("--least-mass", action="store_true", help="as light as possible, displacements as bounds")
    parser.add_argument("--resume", action="store_true", help="continue an interrupted optimisation")
    parser.add_argument("--out", type=Path, default=Path("results/claw"), metavar="DIR", help="folder for files")
    options = parser.parse_args()

    scene, grasp, configurations = describe()
    sim = fm.Simulation(scene, space=options.space, size=QUICK if options.quick else SIZE)
    curves = [sim.load_displacement(grasp, forces=FORCES, configuration=place) for place in configurations]
    if options.simulate_only:
        return fm.write_report(options.out, sim, curves).show()
    problem = fm.DesignProblem(sim, **wanted(scene, grasp, configurations, options.least_mass))
    fm.design_study(options.out, problem, curves, resume=options.resume, pin_diameter=PIN).show()


if __name__ == "__main__":
    main()
