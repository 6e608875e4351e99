"""A bistable switch snaps: a four-bar with a flexible follower, pushed directly and through a soft spring.

    python3 demos/snap.py [--size MM] [--out DIR]

Both curves are followed past their limit points. Pushed directly the force falls and rises again; behind the spring the
curve folds back over itself, so that even a held finger feels the switch jump. Leaves curve.png and the pictures.
"""

import argparse
from pathlib import Path

import fenicsmech as fm
from fenicsmech.report import format_table, plot_curve

PIVOT, KNEE, PIN, ROOT = (0, 0), (25, 8), (50, 0), (50, -40)
HEAD, BOW = (25, 68), (45, 38)  # the finger's end of the spring, and the middle of its bow
ONWARD = 2.0  # N: beyond the force at which the switch snaps


def describe(sprung):
    """The scene, and the force of the finger."""
    switch = fm.Mechanism("switch behind a spring" if sprung else "switch")
    base = switch.rigid("base", fixed=True)
    crank, coupler = switch.rigid("crank"), switch.rigid("coupler")
    follower = switch.flexible("follower", fm.strip([(50, -44), PIN], thickness=4.0, depth=5.0), fm.ONYX)
    switch.revolute(base, crank, at=PIVOT)
    switch.revolute(crank, coupler, at=KNEE)
    switch.revolute(coupler, follower, at=PIN, radius=2.0)
    switch.weld(base, follower, at=(50, -42), region=fm.Rectangle(6.0, 4.0))
    if not sprung:
        return fm.Scene(switch), switch.force(on=crank, at=KNEE, direction=(0, -1), name="finger")
    finger = switch.rigid("finger")
    spring = switch.flexible("spring", fm.strip([KNEE, BOW, HEAD], thickness=1.6, depth=5.0), fm.ONYX)
    switch.revolute(crank, spring, at=KNEE, radius=0.8)
    switch.revolute(spring, finger, at=HEAD, radius=0.8)
    switch.prismatic(base, finger, at=HEAD, axis=(0, 1))
    return fm.Scene(switch), switch.force(on=finger, at=HEAD, direction=(0, -1), name="finger")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=float, default=1.0, metavar="MM", help="element size")
    parser.add_argument("--out", type=Path, default=Path("results/snap"), metavar="DIR")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    series, rows = [], []
    for sprung, label in ((False, "pushed directly"), (True, "through a spring")):
        scene, finger = describe(sprung)
        sim = fm.Simulation(scene, space="plane-stress", size=options.size)
        curve = sim.follow(finger, until=fm.Until(force=ONWARD))
        series.append(curve.series(label))
        for event in curve.events:
            frame = event.frame
            rows.append([label, event.kind.value, frame.displacement, frame.force])
        sim.picture(options.out / f"{scene.mechanism.name.replace(' ', '-')}.png", curve)
    plot_curve(options.out / "curve.png", series, title="bistable switch")
    print(format_table(["switch", "event", "displacement [mm]", "force [N]"], rows))


if __name__ == "__main__":
    main()
