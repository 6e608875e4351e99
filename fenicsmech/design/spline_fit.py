"""The spline that follows a given centreline.

Joints and interior control points lie on the curve; the tangents minimise the distance across the curve,

    Σ_k (n_k · (x(t_k) − c_k))² + ε² (τ_k · (x(t_k) − c_k))²,

with c_k the foot point of x(t_k) on the centreline, τ_k and n_k its tangent and normal, and a small ε that keeps the
samples from running along the curve. Foot points and tangents are improved in turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.design.spline import LinkSpline
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import Centreline

_SAMPLES = 32  # per segment
_ALONG = 0.1  # ε
_ROUNDS = 40


@dataclass(frozen=True, eq=False)
class SplineFit:
    """A spline and how well it follows its centreline.

    Attributes:
        spline: the spline.
        sites: index among the given joints of each joint control point, in order along the curve.
        deviation: largest distance from the spline to the centreline.
    """

    spline: LinkSpline
    sites: tuple[int, ...]
    deviation: float


def fit_spline(
    centreline: Centreline,
    joints: Sequence[Sequence[float]],
    interior: Sequence[int],
    *,
    part: str = "spline",
) -> SplineFit:
    """The spline along ``centreline`` with control points at ``joints`` and evenly spaced ones between them.

    Args:
        centreline: the curve to follow.
        joints: positions of the link's joints, (n, 2), in any order.
        interior: number of control points between each joint and the next along the curve, (n − 1,).
        part: what the spline belongs to, for messages.

    Raises:
        DescriptionError: fewer than two joints, two joints at one place of the curve, or ``interior`` does not match.
    """
    joints = np.asarray(joints, dtype=float)
    if len(joints) < 2:
        raise DescriptionError(part, f"the link has {len(joints)} joint", "Only links with two joints or more have one")
    if len(interior) != len(joints) - 1 or any(count < 0 for count in interior):
        raise DescriptionError(
            part,
            f"interior control points {tuple(interior)} do not match {len(joints)} joints",
            f"Give {len(joints) - 1} numbers from 0 up, one per span between joints",
        )
    curve = _ArcLength(centreline)
    order, arcs = _along(curve, joints, part)
    joints = joints[order]

    knots, is_joint = [arcs[0]], [True]
    for start, end, count in zip(arcs, arcs[1:], interior, strict=False):
        knots += np.linspace(start, end, count + 2)[1:].tolist()
        is_joint += [False] * count + [True]
    is_joint = np.array(is_joint)
    positions = curve.point(np.array(knots))
    positions[is_joint] = joints

    controls = np.zeros((len(knots), 2, 3))
    controls[:, 0, :2], controls[:, 0, 2] = positions, 1.0
    spline = LinkSpline(controls, is_joint)
    t = np.arange(0.5, spline.segments * _SAMPLES) / _SAMPLES
    feet = np.interp(t, np.arange(len(knots)), knots)
    for _ in range(_ROUNDS):
        controls[:, 1, :2] = _fit_tangents(spline.basis(t), positions, curve, feet)
        samples = spline.evaluate(spline.initial, t)[:, :2]
        feet = curve.foot(samples, feet)
    deviation = np.linalg.norm(samples - curve.point(feet), axis=1).max()
    return SplineFit(spline, tuple(order.tolist()), float(deviation))


def _along(curve: _ArcLength, joints: np.ndarray, part: str) -> tuple[np.ndarray, np.ndarray]:
    """The order of ``joints`` along the curve, and their arc lengths in this order."""
    arcs = np.array([curve.arc(joint) for joint in joints])
    order = np.argsort(arcs)
    if np.any(np.diff(arcs[order]) <= 1e-9 * curve.length):
        raise DescriptionError(part, "two joints are at one place of the centreline", "Move one of them")
    return order, arcs[order]


def _fit_tangents(basis: np.ndarray, positions: np.ndarray, curve: _ArcLength, feet: np.ndarray) -> np.ndarray:
    """The tangents (n, 2) that minimise the weighted distances from the samples to the points ``feet``."""
    gap = basis[:, ::2] @ positions - curve.point(feet)
    along = curve.tangent(feet)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    rows, rhs = [], []
    for direction, weight in ((across, 1.0), (along, _ALONG)):
        rows.append(weight * (direction[:, None, :] * basis[:, 1::2, None]).reshape(len(feet), -1))
        rhs.append(-weight * np.sum(direction * gap, axis=1))
    return np.linalg.lstsq(np.concatenate(rows), np.concatenate(rhs), rcond=None)[0].reshape(-1, 2)


class _ArcLength:
    """A centreline by its arc length a, from a fine table."""

    def __init__(self, centreline: Centreline) -> None:
        self._curve = centreline
        self._s = centreline.samples(1000)
        chords = np.linalg.norm(np.diff(centreline.evaluate(self._s), axis=0), axis=1)
        self._a = np.concatenate([[0.0], np.cumsum(chords)])

    @property
    def length(self) -> float:
        return float(self._a[-1])

    def arc(self, point: np.ndarray) -> float:
        return float(np.interp(self._curve.closest(point), self._s, self._a))

    def point(self, a: np.ndarray) -> np.ndarray:
        return self._curve.evaluate(np.interp(a, self._a, self._s))

    def tangent(self, a: np.ndarray) -> np.ndarray:
        return self._curve.tangent(np.interp(a, self._a, self._s))

    def foot(self, points: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Arc lengths of the points of the curve nearest to ``points`` (m, 2), from guesses ``a`` (m,)."""
        for _ in range(3):
            step = np.sum((points - self.point(a)) * self.tangent(a), axis=1)
            a = np.clip(a + step, 0.0, self.length)
        return a
