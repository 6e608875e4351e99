"""A bistable switch snaps: a four-bar with a flexible follower, pushed directly, through a soft spring, and by a motor.

    python3 demos/snap.py [--size MM] [--quick] [--out DIR]

Both curves are followed past their limit points. Pushed directly the force falls and rises again; behind the spring the
curve folds back over itself, so that even a held finger feels the switch snap: load_displacement holds it at one
position after the other, and its remarks say where. A motor in the crank's hinge turns the switch over without a snap;
its torque is drawn over its angle. Leaves curve.png, crank.png and the pictures. The geometry is this project's own.
"""

import argparse
from pathlib import Path

import fenicsmech as fm

PIVOT, KNEE, PIN, ROOT = (0, 0), (25, 8), (50, 0), (50, -42)  # mm
HEAD, BOW = (25, 68), (45, 38)  # mm: the finger's end of the spring, and the middle of its bow
ONWARD = 2.0  # N: beyond the force at which the switch snaps
HELD = (9.0, 11.0, 13.0, 15.0)  # mm: where the finger is held, before and after the snap
OVER = -0.7  # rad: beyond the crank's second rest


def describe(sprung):
    """The scene, the force of the finger, and the hinge of the crank."""
    switch = fm.Mechanism("switch behind a spring" if sprung else "switch")
    pivot, wall = switch.rigid("pivot", fixed=True), switch.rigid("wall", fixed=True)
    crank, coupler = switch.rigid("crank"), switch.rigid("coupler")
    follower = switch.flexible("follower", fm.strip([(50, -44), PIN], thickness=4.0, depth=5.0), fm.ONYX)
    hinge = switch.revolute(pivot, crank, at=PIVOT)
    switch.revolute(crank, coupler, at=KNEE)
    switch.revolute(coupler, follower, at=PIN, interface_radius=2.0)
    switch.weld(wall, follower, at=ROOT, region=fm.Rectangle(6.0, 4.0))
    if not sprung:
        return fm.Scene(switch), switch.force(on=crank, at=KNEE, direction=(0, -1), name="finger"), hinge
    finger, guide = switch.rigid("finger"), switch.rigid("guide", fixed=True)
    spring = switch.flexible("spring", fm.strip([KNEE, BOW, HEAD], thickness=1.6, depth=5.0), fm.ONYX)
    switch.revolute(crank, spring, at=KNEE, interface_radius=0.8)
    switch.revolute(spring, finger, at=HEAD, interface_radius=0.8)
    switch.prismatic(guide, finger, at=HEAD, axis=(0, 1))
    return fm.Scene(switch), switch.force(on=finger, at=HEAD, direction=(0, -1), name="finger"), hinge


def main():
    fm.mpi_abort_on_error()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=float, default=1.0, metavar="MM", help="element size (default 1 mm)")
    parser.add_argument("--quick", dest="size", action="store_const", const=2.0, help="elements of 2 mm")
    parser.add_argument("--out", type=Path, default=Path("results/snap"), metavar="DIR", help="folder for files")

    options = parser.parse_args()
    series = []
    for sprung, label in ((False, "pushed directly"), (True, "through a spring")):
        scene, finger, _ = describe(sprung)
        sim = fm.Simulation(scene, space="plane-stress", size=options.size)
        curve = sim.follow(finger, until=fm.Until(force=ONWARD))
        series.append(curve.series(label))
        for event in curve.events:
            frame = event.frame
            fm.print_once(f"{label}: {event.kind.value} at {frame.displacement:.4g} mm, {frame.force:.4g} N")
        curve.picture(options.out / f"{scene.mechanism.name.replace(' ', '-')}.png")
    held = sim.load_displacement(finger, displacements=HELD)
    series.append(held.series("held behind the spring"))
    fm.plot_curve(options.out / "curve.png", series, title="bistable switch")
    fm.print_once(*held.remarks, sep="\n")
    scene, _, hinge = describe(sprung=False)
    motor = scene.mechanism.motor(hinge, name="crank")
    sim = fm.Simulation(scene, space="plane-stress", size=options.size)
    turned = sim.follow(motor, until=fm.Until(position=OVER))
    turned.plot(options.out / "crank.png")
    fm.print_once(f"the motor in the crank needs up to {abs(turned.forces).max():.3g} N mm, and does not snap")


if __name__ == "__main__":
    main()
