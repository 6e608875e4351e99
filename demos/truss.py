"""Truss finger: a rigid parallelogram whose silicone diagonal is shaped to yield to a grasped object as wanted.

The rigid links form a parallelogram, so the tip only translates and the height of the pushing point does not
matter. The diagonal resists: soft while it unbends, stiff once it is straight. Its shape is optimised until the tip
moves by 6 mm under 0.1 N, and by no more than 9 mm under four times as much.

    python3 demos/truss.py [--space SPACE] [--order 1|2] [--size MM] [--quick] [--out DIR]
    mpirun -n 2 python3 demos/truss.py --resume
"""

from common import parse
from task import Task, run

import fenicsmech as fm

SIZE = 2.1  # mm
FORCES = [0.0, 0.025, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4]


def describe():
    """The scene, and the force that pushes the tip."""
    finger = fm.Mechanism("truss finger")
    base = finger.rigid("base", fixed=True)
    left, right, tip = (finger.rigid(name) for name in ("left leg", "right leg", "tip"))
    diagonal = finger.flexible(
        "diagonal", fm.strip([(0, 0), (18, 34), (40, 60)], thickness=3.0, depth=20.0), fm.SMOOTH_SIL_950
    )
    finger.revolute(base, left, at=(0, 0))
    finger.revolute(base, right, at=(40, 0))
    finger.revolute(left, tip, at=(0, 60))
    finger.revolute(right, tip, at=(40, 60))
    finger.revolute(base, diagonal, at=(0, 0), radius=3.0)
    finger.revolute(diagonal, tip, at=(40, 60), radius=3.0)
    push = finger.force(on=tip, at=(20, 70), direction=(1, 0), name="push on tip")
    return fm.Scene(finger), push


def task(scene, push):
    """What is simulated and wanted."""
    return Task(
        push,
        loads=FORCES,
        configurations=[fm.DRAWN],
        designs=[fm.SplineDesign(link, segments=3, thickness=(1.5, 6.0)) for link in scene.mechanism.flexible_links],
        targets=[fm.Target(push, force=0.1, displacement=6.0), fm.Target(push, force=0.4, displacement=9.0)],
        pin=3.0,
    )


def main():
    demo = parse("truss", __doc__.splitlines()[0], size=SIZE, quick_size=3.0)
    scene, push = describe()
    run(demo, scene, task(scene, push))


if __name__ == "__main__":
    main()
