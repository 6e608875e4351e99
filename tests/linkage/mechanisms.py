"""Mechanisms whose motion is known in closed form, described with the package and drawn by the oracles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from fenicsmech.linkage import Assembly, Linkage, assemble, build_linkage
from fenicsmech.mechanism import Configuration, Link, Mechanism, Motor, validate

from ..oracles import klann as patent
from ..oracles.fourbar import FourBar

Place = Callable[[float, float], Sequence[float]]


def same(x: float, y: float) -> tuple[float, float]:
    """Places points where the oracle has them."""
    return x, y


@dataclass
class Machine:
    """A mechanism, its motor, and the (link, drawn position) of every pivot that is followed."""

    mechanism: Mechanism
    motor: Motor | None
    pivots: dict[str, tuple[Link, tuple[float, ...]]] = field(default_factory=dict)

    def linkage(self, dim: int) -> Linkage:
        """Checked and built in ``dim`` dimensions."""
        validate(self.mechanism, dim)
        return build_linkage(self.mechanism, dim)

    def drive(self, linkage: Linkage, position: float) -> Assembly:
        """The assembly with the motor at ``position`` from where it was drawn."""
        return assemble(linkage, Configuration("driven", ((self.motor, position),)))

    def positions(self, linkage: Linkage, poses: np.ndarray) -> dict[str, np.ndarray]:
        """Where all pivots (dim,) are."""
        return {name: point_of(linkage, poses, link, at) for name, (link, at) in self.pivots.items()}


def point_of(linkage: Linkage, poses: np.ndarray, link: Link, at: Sequence[float]) -> np.ndarray:
    """Where the point of ``link`` drawn at ``at`` is, (dim,)."""
    body = linkage.body_of(link)
    drawn = np.array([*at, 0.0])[: linkage.dim]
    offset = drawn - linkage.bodies[body].centre
    return drawn + linkage.joints.space.displace(poses[body], offset[None])[0]


def four_bar(
    oracle: FourBar, angle: float, *, driven: str | None = "crank", place: Place = same, order: Sequence[int] = range(4)
) -> Machine:
    """The four-bar of ``oracle`` drawn at the crank ``angle``; joints are added in ``order``."""
    pin, joint = oracle.positions(angle)
    m = Mechanism("four-bar")
    ground = m.rigid("ground", fixed=True)
    crank, coupler, rocker = (m.rigid(name) for name in ("crank", "coupler", "rocker"))
    hinges = (
        (ground, crank, oracle.shaft, "shaft"),
        (crank, coupler, pin, "pin"),
        (coupler, rocker, joint, "joint"),
        (ground, rocker, oracle.axle, "axle"),
    )
    made = {hinges[k][3]: m.revolute(*hinges[k][:2], at=place(*hinges[k][2]), name=hinges[k][3]) for k in order}
    motor = m.motor(made["shaft" if driven == "crank" else "axle"]) if driven else None
    return Machine(m, motor, {"pin": (crank, place(*pin)), "joint": (rocker, place(*joint))})


CRANK_ROCKER = FourBar((0.0, 0.0), (32.0, 4.0), crank=10.0, coupler=30.0, rocker=25.0)
DRAWN_ANGLE = 0.7


def parallelogram(angle: float, **options) -> Machine:
    """A parallelogram linkage of sides 40 and 20 drawn at the crank ``angle``."""
    return four_bar(FourBar((0.0, 0.0), (40.0, 0.0), crank=20.0, coupler=40.0, rocker=20.0), angle, **options)


def collinear_parallelogram(*, driven: bool = False) -> Machine:
    """The parallelogram drawn flat, at its change point, where it may become an antiparallelogram."""
    m = Mechanism("flat parallelogram")
    ground = m.rigid("ground", fixed=True)
    crank, coupler, rocker = (m.rigid(name) for name in ("crank", "coupler", "rocker"))
    shaft = m.revolute(ground, crank, at=(0.0, 0.0))
    m.revolute(crank, coupler, at=(20.0, 0.0))
    m.revolute(coupler, rocker, at=(60.0, 0.0))
    m.revolute(ground, rocker, at=(40.0, 0.0))
    return Machine(m, m.motor(shaft) if driven else None)


def klann() -> Machine:
    """The Klann leg of the patent, rigid, drawn with the crank at 180°."""
    pose = patent.klann(patent.DRAWN_ANGLE)
    m = Mechanism("Klann leg")
    base = m.rigid("base", fixed=True)
    crank, rod, first, second, leg = (m.rigid(n) for n in ("crank", "rod", "first rocker", "second rocker", "leg"))
    shaft = m.revolute(base, crank, at=patent.CRANK_SHAFT)
    m.revolute(base, first, at=patent.FIRST_AXLE)
    m.revolute(base, second, at=patent.SECOND_AXLE)
    m.revolute(crank, rod, at=pose.crank_pin)
    m.revolute(rod, second, at=pose.elbow)
    m.revolute(rod, leg, at=pose.knee)
    m.revolute(first, leg, at=pose.hip)
    on = {"crank_pin": crank, "elbow": second, "knee": rod, "hip": first, "foot": leg}
    return Machine(m, m.motor(shaft), {name: (link, tuple(getattr(pose, name))) for name, link in on.items()})


@dataclass(frozen=True)
class Bennett:
    """The Bennett loop of four bars of lengths a, b, a, b and twists α, β, α, β with sin α / a = sin β / b.

    It moves although no count of joints lets it: tan(θ/2) tan(φ/2) = sin((α + β)/2) / sin((α − β)/2) holds between
    the turns θ and φ about neighbouring hinges.
    """

    length: float = 30.0
    twist: float = 0.5
    other_twist: float = 1.1

    @property
    def other_length(self) -> float:
        return self.length * np.sin(self.other_twist) / np.sin(self.twist)

    def hinges(self, theta: float) -> tuple[np.ndarray, np.ndarray]:
        """Positions (4, 3) and axes (4, 3) of the hinges, seen from the bar between hinges 3 and 0 (numbered 0 to 3)."""
        half = np.sin(0.5 * (self.other_twist + self.twist)) / np.sin(0.5 * (self.other_twist - self.twist))
        phi = 2.0 * np.arctan2(half, np.tan(0.5 * theta))
        frame, points, axes = np.eye(4), [], []
        for turn, length, twist in (
            (theta, self.length, self.twist),
            (phi, self.other_length, self.other_twist),
            (-theta, self.length, self.twist),
            (-phi, self.other_length, self.other_twist),
        ):
            points.append(frame[:3, 3])
            axes.append(frame[:3, 2])
            frame = frame @ _screw(turn, length, twist)
        if np.max(np.abs(frame - np.eye(4))) > 1e-12 * self.length:
            raise ValueError("the loop does not close")
        return np.array(points), np.array(axes)

    def machine(self, theta: float, *, driven: bool = False) -> Machine:
        """The loop drawn at ``theta``, its motor at the first hinge; the pivots are the second and third hinge."""
        points, axes = self.hinges(theta)
        m = Mechanism("Bennett")
        links = [m.rigid("ground", fixed=True), *(m.rigid(f"bar {k}") for k in range(3))]
        joints = [m.revolute(links[k], links[(k + 1) % 4], at=points[k], axis=axes[k]) for k in range(4)]
        pivots = {f"hinge {k}": (links[k], tuple(points[k])) for k in (1, 2)}
        return Machine(m, m.motor(joints[0]) if driven else None, pivots)


def _screw(turn: float, length: float, twist: float) -> np.ndarray:
    """Denavit–Hartenberg step: a turn about z, a bar along the new x, a twist about it, (4, 4)."""
    c, s, ca, sa = np.cos(turn), np.sin(turn), np.cos(twist), np.sin(twist)
    return np.array(
        [[c, -s * ca, s * sa, length * c], [s, c * ca, -c * sa, length * s], [0.0, sa, ca, 0.0], [0.0, 0.0, 0.0, 1.0]]
    )
