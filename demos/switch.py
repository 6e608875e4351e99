"""Bistable switch with a given snap force and a given second position.

A rigid crank and coupler press against a flexible follower; a torsion spring in the crank's hinge turns it back. The
follower is shaped until the switch snaps at a force of 1 N on the finger, and then rests 15 mm from where it began: two
targets for forces at prescribed displacements, the second of them zero. The whole curve is then followed, and its limit
point and rest are read from it. Geometry and targets are this project's own.

    python3 demos/switch.py [--quick] [--out DIR]
"""

import argparse
import json
from pathlib import Path

import fenicsmech as fm

PIVOT, KNEE, PIN, ROOT = (0, 0), (25, 8), (50, 0), (50, -42)  # mm
STIFFNESS = 20.0  # N mm/rad: of the spring
SNAP_FORCE, NEAR_PEAK, SECOND_REST = 1.0, 3.4, 15.0  # N, mm, mm
BEYOND = 17.0  # mm: end of the curves
SIZE, QUICK = 1.0, 2.0  # mm, elements


def describe():
    """The scene, and the force of the finger."""
    switch = fm.Mechanism("switch")
    pivot, wall = switch.rigid("pivot", fixed=True), switch.rigid("wall", fixed=True)
    crank, coupler = switch.rigid("crank"), switch.rigid("coupler")
    follower = switch.flexible("follower", fm.strip([(50, -44), PIN], thickness=4.0, depth=5.0), fm.ONYX)
    hinge = switch.revolute(pivot, crank, at=PIVOT)
    switch.revolute(crank, coupler, at=KNEE)
    switch.revolute(coupler, follower, at=PIN, interface_radius=2.0)
    switch.weld(wall, follower, at=ROOT, region=fm.Rectangle(6.0, 4.0))
    finger = switch.force(on=crank, at=KNEE, direction=(0, -1), name="finger")
    return fm.Scene(switch, [fm.JointSpring(hinge, STIFFNESS)]), finger


def wanted(scene, finger):
    """The links that may change, and the targets."""
    peak, rest = (fm.Sample({finger: fm.at(displacement)}) for displacement in (NEAR_PEAK, SECOND_REST))
    force = fm.ForceMagnitude(finger)
    return {
        "designs": [fm.SplineDesign(link, 2, thickness=(1.0, 8.0)) for link in scene.mechanism.flexible_links],
        "targets": [
            fm.Target(force, peak, equals=SNAP_FORCE, weight=10.0),
            fm.Target(force, rest, equals=0.0, scale=SNAP_FORCE, weight=10.0),
        ],
    }


def main():
    fm.mpi_abort_on_error()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help=f"elements of {QUICK} mm instead of {SIZE} mm")
    parser.add_argument("--out", type=Path, default=Path("results/switch"), metavar="DIR", help="folder for files")
    options = parser.parse_args()

    scene, finger = describe()
    sim = fm.Simulation(scene, space="plane-stress", size=QUICK if options.quick else SIZE)
    before = sim.follow(finger, until=fm.Until(displacement=BEYOND))
    problem = fm.DesignProblem(sim, **wanted(scene, finger))
    result = problem.verify(problem.optimise(), options.out / "parts")
    problem.picture(options.out / "links.png", result)
    result.save(options.out / "design.json")
    sim = sim.with_design(result)
    after = sim.follow(finger, until=fm.Until(displacement=BEYOND))
    snap, rest = after.events[0].frame, sim.follow(finger, until=fm.Until(displacement=SECOND_REST)).frames[-1]
    series = [before.series("drawn", faint=True), after.series("optimised")]
    marks = [fm.CurveTarget(NEAR_PEAK, SNAP_FORCE, None), fm.CurveTarget(SECOND_REST, 0.0, None)]
    fm.plot_curve(options.out / "curve.png", series, targets=marks, title="bistable switch")
    figures = {"snap_force": snap.force, "snap_displacement": snap.displacement, "force_at_rest": rest.force}
    figures |= {"stable": bool(rest.stable), "part_error": result.worst_part_error}
    fm.print_once(result, json.dumps(figures), sep="\n")
    if sim.comm.rank == 0:
        (options.out / "summary.json").write_text(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
