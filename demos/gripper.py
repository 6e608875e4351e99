"""Adaptive gripper (half): a finger in two flexible phalanges, shaped to wrap around an object that it holds.

The object pushes on the pad in the middle of the finger and on its tip at once. Under both forces each of the two
contact points has to move by a vector: the pad straight back by 2 mm, the tip by 7 mm and up by 0.9 mm.
Geometry and targets are this project's own.

    python3 demos/gripper.py [--space SPACE] [--quick] [--simulate-only] [--out DIR]
"""

import argparse
from pathlib import Path

import fenicsmech as fm

DEPTH, HOLD = 8.0, 2.5  # mm: HOLD is the radius of the discs in which phalanges are cast into base, pad and tip
PAD, TIP = (0, 40), (-10, 80)  # contact points
PUSH_ON_PAD, PUSH_ON_TIP = 2.0, 1.0  # N
PAD_MOVES, TIP_MOVES = (2.0, 0.0), (7.0, 0.9)  # mm
SIZE, QUICK = 1.2, 2.0  # mm, elements


def describe():
    """The scene and the two forces; first the one on the pad."""
    gripper = fm.Mechanism("gripper")
    base, pad, tip = gripper.rigid("base", fixed=True), gripper.rigid("pad"), gripper.rigid("tip")
    lower = fm.strip([(0, -3), (0, 0), (3, 20), (4, 36), (4, 39)], thickness=3.0, depth=DEPTH)
    upper = fm.strip([(4, 41), (4, 44), (2, 60), (-6, 78), (-8, 81)], thickness=2.4, depth=DEPTH)
    lower = gripper.flexible("lower phalanx", lower, fm.ONYX)
    upper = gripper.flexible("upper phalanx", upper, fm.ONYX)
    for a, b, at in ((base, lower, (0, 0)), (lower, pad, (4, 36)), (pad, upper, (4, 44)), (upper, tip, (-6, 78))):
        gripper.weld(a, b, at=at, interface_radius=HOLD)
    on_pad = gripper.force(on=pad, at=PAD, direction=(1, 0), name="object on pad")
    on_tip = gripper.force(on=tip, at=TIP, direction=(1, 0.2), name="object on tip")
    return fm.Scene(gripper), on_pad, on_tip


def wanted(scene, on_pad, on_tip):
    """The links that may change, and the targets."""
    grasp = fm.Sample({on_pad: PUSH_ON_PAD, on_tip: PUSH_ON_TIP})
    contacts = ((on_pad.on, PAD, PAD_MOVES), (on_tip.on, TIP, TIP_MOVES))
    return {
        "designs": [fm.SplineDesign(link, 2, thickness=(1.0, 7.0)) for link in scene.mechanism.flexible_links],
        "targets": [
            fm.Target(fm.Displacement(link, at=at), grasp, equals=moves, weight=10.0) for link, at, moves in contacts
        ],
    }


def main():
    fm.mpi_abort_on_error()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--space", choices=list(fm.SPACES), default="plane-stress")
    parser.add_argument("--quick", action="store_true", help=f"elements of {QUICK} mm instead of {SIZE} mm")
    parser.add_argument("--simulate-only", action="store_true", help="simulate the drawn design only")
    parser.add_argument("--out", type=Path, default=Path("results/gripper"), metavar="DIR", help="folder for files")
    options = parser.parse_args()

    scene, on_pad, on_tip = describe()
    sim = fm.Simulation(scene, space=options.space, size=QUICK if options.quick else SIZE)
    both = fm.ForceGroup("object", {on_pad: PUSH_ON_PAD, on_tip: PUSH_ON_TIP})
    share = [0.0, 0.25, 0.5, 0.75, 1.0]
    before = sim.load_displacement(both, forces=share)
    if options.simulate_only:
        return fm.write_report(options.out, sim, [before]).show()
    problem = fm.DesignProblem(sim, **wanted(scene, on_pad, on_tip))
    result = problem.verify(problem.optimise(), options.out / "parts")
    sim = sim.with_design(result)
    study = fm.Optimisation(problem, result, before=[before])
    fm.write_report(options.out, sim, [sim.load_displacement(both, forces=share)], optimisation=study).show()


if __name__ == "__main__":
    main()
