"""Truss finger: a rigid parallelogram whose silicone diagonal is shaped to yield to a grasped object as wanted.

The rigid links form a parallelogram, so the tip only translates and the height of the pushing point does not
matter. The diagonal resists: soft while it unbends, stiff once it is straight. Its shape is optimised until the tip
moves by 6 mm under 0.1 N, and by no more than 9 mm under four times as much. Geometry and targets are this project's
own.

    python3 demos/truss.py [--space SPACE] [--quick] [--simulate-only] [--resume] [--out DIR]
    python3 demos/truss.py --part meshes/diagonal.step  # from a tapered diagonal, drawn elsewhere
    mpirun -n 2 python3 demos/truss.py
"""

import argparse
from pathlib import Path

import fenicsmech as fm

SIZE, QUICK = 2.1, 3.0  # mm, elements
FORCES = [0.0, 0.025, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4]  # N
PIN = 3.0  # mm: radius of the discs that hold the diagonal, and diameter of the holes left for its pins


def describe(part=None):
    """The scene, the diagonal from a STEP file if one is given, the force on the tip, and the configurations."""
    finger = fm.Mechanism("truss finger")
    base = finger.rigid("base", fixed=True)
    left, right, tip = (finger.rigid(name) for name in ("left leg", "right leg", "tip"))
    shape = fm.strip([(0, 0), (18, 34), (40, 60)], thickness=3.0, depth=20.0)
    if part is not None:
        shape = fm.step_file(part, depth=20.0)
    diagonal = finger.flexible("diagonal", shape, fm.SMOOTH_SIL_950)
    finger.revolute(base, left, at=(0, 0))
    finger.revolute(base, right, at=(40, 0))
    finger.revolute(left, tip, at=(0, 60))
    finger.revolute(right, tip, at=(40, 60))
    finger.revolute(base, diagonal, at=(0, 0), interface_radius=PIN)
    finger.revolute(diagonal, tip, at=(40, 60), interface_radius=PIN)
    return fm.Scene(finger), finger.force(on=tip, at=(20, 70), direction=(1, 0), name="push on tip"), [fm.DRAWN]


def wanted(scene, push, configurations):
    """The links that may change, and the targets."""
    designs = [fm.SplineDesign(link, segments=3, thickness=(1.5, 6.0)) for link in scene.mechanism.flexible_links]
    targets = [fm.Target(push, force=0.1, displacement=6.0), fm.Target(push, force=0.4, displacement=9.0)]
    return {"designs": designs, "targets": targets}


def main():
    fm.mpi_abort_on_error()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--space", choices=list(fm.SPACES), default="3d")
    parser.add_argument("--quick", action="store_true", help=f"elements of {QUICK} mm instead of {SIZE} mm")
    parser.add_argument("--simulate-only", action="store_true", help="simulate the drawn design only")
    parser.add_argument("--resume", action="store_true", help="continue an interrupted optimisation")
    parser.add_argument("--part", type=Path, metavar="STEP", help="file of the diagonal, instead of a strip")
    parser.add_argument("--out", type=Path, default=Path("results/truss"), metavar="DIR", help="folder for files")
    options = parser.parse_args()

    scene, push, configurations = describe(options.part)
    sim = fm.Simulation(scene, space=options.space, size=QUICK if options.quick else SIZE)
    curves = [sim.load_displacement(push, forces=FORCES, configuration=place) for place in configurations]
    if options.simulate_only:
        return fm.write_report(options.out, sim, curves).show()
    problem = fm.DesignProblem(sim, **wanted(scene, push, configurations))
    fm.design_study(options.out, problem, curves, resume=options.resume, pin_diameter=PIN).show()


if __name__ == "__main__":
    main()
