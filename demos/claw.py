"""Claw gripper (half): a motor closes a rigid finger through four Onyx links, shaped to give way to the object.

The finger pushes on the object at its tip; the object pushes back across the finger. The motor holds the closed
configuration while the force grows to 10 N. The links are shaped until the finger gives way by 5 mm at 4 N and by
20 mm at 10 N.

    python3 demos/claw.py [--space SPACE] [--order 1|2] [--size MM] [--quick] [--out DIR]
    mpirun -n 2 python3 demos/claw.py
"""

from common import parse
from task import Task, run

import fenicsmech as fm

THICKNESS, DEPTH, PIN = 3.0, 8.5, 3.0
SHAFT, AXLE, ANCHOR = (15, 0), (60, 5), (22, 32)  # on the base: motor shaft and two axles
ELBOW, KNEE, HIP, WRIST = (38, 22), (62, 42), (56, 88), (28, 92)  # moving joints
FINGERTIP = (8, 125)
SIZE = 1.73  # mm
FORCES = [float(force) for force in range(11)]


def link(*points):
    """A strip of Onyx along ``points``."""
    return fm.strip(points, thickness=THICKNESS, depth=DEPTH)


def describe():
    """The scene, and the force of the object on the finger."""
    claw = fm.Mechanism("claw gripper")
    base, finger = claw.rigid("base", fixed=True), claw.rigid("finger")
    crank = claw.flexible("crank", link(SHAFT, (29, 8), ELBOW), fm.ONYX)
    coupler = claw.flexible("coupler", link(ELBOW, (50, 30), KNEE, (66, 64), HIP), fm.ONYX)
    rocker = claw.flexible("rocker", link(AXLE, (67, 23), KNEE), fm.ONYX)
    guide = claw.flexible("guide", link(ANCHOR, (15, 62), WRIST), fm.ONYX)
    shaft = claw.revolute(base, crank, at=SHAFT, radius=PIN)
    claw.revolute(crank, coupler, at=ELBOW, radius=PIN)
    claw.revolute(base, rocker, at=AXLE, radius=PIN)
    claw.revolute(rocker, coupler, at=KNEE, radius=PIN)
    claw.revolute(coupler, finger, at=HIP, radius=PIN)
    claw.revolute(base, guide, at=ANCHOR, radius=PIN)
    claw.revolute(guide, finger, at=WRIST, radius=PIN)
    claw.motor(shaft, name="servo")
    grasp = claw.force(on=finger, at=FINGERTIP, direction=(1, 0), name="object on finger")
    return fm.Scene(claw), grasp


def task(scene, grasp):
    """What is simulated and wanted."""
    return Task(
        grasp,
        loads=FORCES,
        configurations=[fm.DRAWN],
        designs=[fm.SplineDesign(link, segments=3, thickness=(1.0, 9.0)) for link in scene.mechanism.flexible_links],
        targets=[fm.Target(grasp, force=4.0, displacement=5.0), fm.Target(grasp, force=10.0, displacement=20.0)],
        pin=PIN,
    )


def main():
    demo = parse("claw", __doc__.splitlines()[0], size=SIZE, quick_size=3.0)
    scene, grasp = describe()
    run(demo, scene, task(scene, grasp))


if __name__ == "__main__":
    main()
