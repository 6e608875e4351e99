"""Spatial mechanisms: the Bennett loop, and a rod between two balls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.mechanism import Mechanism

from .machine import Machine


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
        """Positions (4, 3) and axes (4, 3) of the hinges; the bar between hinges 3 and 0 is the ground."""
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
        frame[:3, 3] /= self.length
        if np.max(np.abs(frame - np.eye(4))) > 1e-12:
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


def two_ball_rod(*, driven: bool = True) -> Machine:
    """Crank and rocker about skew axes, connected by a rod between two balls, which may spin about itself."""
    m = Mechanism("two-ball rod")
    ground = m.rigid("ground", fixed=True)
    crank, rod, rocker = (m.rigid(name) for name in ("crank", "rod", "rocker"))
    pin, ball = (10.0, 0.0, 0.0), (40.0, 5.0, 30.0)
    shaft = m.revolute(ground, crank, at=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    m.spherical(crank, rod, at=pin)
    m.spherical(rod, rocker, at=ball)
    m.revolute(rocker, ground, at=(40.0, 35.0, 0.0), axis=(1.0, 0.2, 0.0))
    return Machine(m, m.motor(shaft) if driven else None, {"pin": (crank, pin), "ball": (rocker, ball)})
