"""Centreline and thickness of a link as a cubic Hermite spline of its design parameters; its samples and its fit.

With control points C_k (position P_k and tangent M_k, three components each) and t = k + τ, 0 ≤ τ ≤ 1,

    (x, y, δ)(p, t) = h₀₀(τ) P_k + h₁₀(τ) M_k + h₀₁(τ) P_{k+1} + h₁₁(τ) M_{k+1}.

The parameters p are the tangents at joints, and position and tangent at all other control points: the thickness at a
joint stays, and so does its place unless joints move. Free ends change their thickness; they stay where they are drawn
unless they may move. The curve is linear in p.

Where joints move, their places are parameters too. Shifts δ_j of joints shift the curve between two of them to

    x(t) + δ_j + (t − t_j) / (t_{j+1} − t_j) · (δ_{j+1} − δ_j),     t_j ≤ t ≤ t_{j+1},

and beyond the last joint by that joint's shift. A straight link with two joints stays straight. At joints between
others the change of the tangent is the mean of both sides, so that the curve stays C¹.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial.polynomial import polyder

from fenicsmech.errors import DescriptionError, counted
from fenicsmech.mechanism import Centreline
from fenicsmech.polygons import chord_lengths

# h₀₀ (P_k), h₁₀ (M_k), h₀₁ (P_{k+1}), h₁₁ (M_{k+1}) in powers of τ, and their derivatives
_HERMITE = np.array([[1.0, 0.0, -3.0, 2.0], [0.0, 1.0, -2.0, 1.0], [0.0, 0.0, 3.0, -2.0], [0.0, 0.0, -1.0, 1.0]])
_DERIVATIVES = [polyder(_HERMITE, order, axis=1) for order in range(5)]
_TOGETHER = np.array([np.pad(rows, ((0, 0), (0, 4 - rows.shape[1]))).T for rows in _DERIVATIVES[:4]])


@dataclass(frozen=True, eq=False)
class LinkSpline:
    """The spline of one link.

    Attributes:
        controls: initial control points, (n, 2, 3): position and tangent, each (x, y, δ).
        is_joint: which control points are joints, (n,).
        ends_move: whether the places of free ends are parameters.
        joints_move: whether those of joints are, and with them those of free ends, which follow the last joint.
    """

    controls: np.ndarray
    is_joint: np.ndarray
    ends_move: bool = False
    joints_move: bool = False

    @property
    def segments(self) -> int:
        """Number of cubic segments; t runs from 0 to this."""
        return len(self.controls) - 1

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.entries)

    @cached_property
    def entries(self) -> np.ndarray:
        """Indices of the parameters in ``controls.ravel()``, (size,)."""
        free = self._shape.copy()
        if self.joints_move:
            free[:, 0, :2] = True
        return np.flatnonzero(free)

    @cached_property
    def of_shape(self) -> np.ndarray:
        """Mask of the parameters of the shape; the others are places that follow joints alone, (size,)."""
        return self._shape.ravel()[self.entries]

    @cached_property
    def _shape(self) -> np.ndarray:
        """Mask of the parameters of the shape, as ``controls``."""
        free = np.ones(self.controls.shape, dtype=bool)
        free[self.is_joint, 0] = False
        if not self.ends_move:
            free[[0, -1], 0, :2] = False
        return free

    def following(self) -> np.ndarray:
        """Derivatives of the parameters by the shifts δ_j of joints, in order along the curve, (size, joints, 2)."""
        t, joints = np.arange(len(self.controls)), np.flatnonzero(self.is_joint)
        share = np.array([np.interp(t, joints, row) for row in np.eye(len(joints))]).T  # (n, joints)
        rise = np.diff(share, axis=0)
        slope = 0.5 * (np.vstack([rise[:1], rise]) + np.vstack([rise, rise[-1:]]))
        moved = np.zeros((*self.controls.shape, len(joints), 2))
        for axis in range(2):
            moved[:, 0, axis, :, axis], moved[:, 1, axis, :, axis] = share, slope
        return moved.reshape(-1, len(joints), 2)[self.entries]

    @property
    def initial(self) -> np.ndarray:
        """Initial parameters, (size,)."""
        return self.controls.ravel()[self.entries]

    @property
    def is_thickness(self) -> np.ndarray:
        """Mask of the parameters of δ; the others are lengths, (size,)."""
        return self.entries % 3 == 2

    def controls_at(self, p: np.ndarray) -> np.ndarray:
        """The control points for parameters ``p`` (size,), (n, 2, 3)."""
        controls = self.controls.copy()
        controls.ravel()[self.entries] = p
        return controls

    def evaluate(self, p: np.ndarray, t: np.ndarray) -> np.ndarray:
        """(x, y, δ) at ``t`` (m,), (m, 3)."""
        return self.basis(t) @ self.controls_at(p).reshape(-1, 3)

    def derivative(self, p: np.ndarray, t: np.ndarray) -> np.ndarray:
        """d(x, y, δ)/dt at ``t`` (m,), (m, 3); at a control point both segments agree."""
        return self.basis(t, order=1) @ self.controls_at(p).reshape(-1, 3)

    def derivatives(self, p: np.ndarray, t: np.ndarray, segments: np.ndarray) -> np.ndarray:
        """(x, y, δ) at ``t`` (m,) of ``segments`` (m,), differentiated 0 to 3 times by t, (4, m, 3)."""
        weights = (t - segments)[:, None] ** np.arange(4) @ _TOGETHER
        near = self.controls_at(p).reshape(-1, 3)[2 * segments[:, None] + np.arange(4)]
        return (weights[:, :, None] @ near)[:, :, 0]

    def gradient(self, t: np.ndarray, *, order: int = 0, segments: np.ndarray | None = None) -> np.ndarray:
        """∂/∂p of (x, y, δ), differentiated ``order`` times by t, at ``t`` (m,), (m, 3, size); the same for all p."""
        rows, component = np.divmod(self.entries, 3)
        gradient = np.zeros((len(t), 3, self.size))
        gradient[:, component, np.arange(self.size)] = self.basis(t, order=order, segments=segments)[:, rows]
        return gradient

    def segments_of(self, t: np.ndarray) -> np.ndarray:
        """The segment of each ``t`` (m,), the later one at a control point, (m,)."""
        return np.minimum(np.maximum(np.floor(t).astype(int), 0), self.segments - 1)

    def basis(self, t: np.ndarray, *, order: int = 0, segments: np.ndarray | None = None) -> np.ndarray:
        """Weights of P_0, M_0, P_1, M_1, … in the curve, differentiated ``order`` times by t, at ``t`` (m,), (m, 2n).

        segments: the segment of each t; at a control point one of two cubics is meant.
        """
        segments = self.segments_of(t) if segments is None else segments
        weights = np.zeros((len(t), 2 * len(self.controls)))
        columns = 2 * segments[:, None] + np.arange(4)
        coefficients = _DERIVATIVES[order]
        powers = (t - segments)[:, None] ** np.arange(coefficients.shape[1])
        weights[np.arange(len(t))[:, None], columns] = powers @ coefficients.T
        return weights


class SplineSamples:
    """Samples of one spline, uniform in t: the thickness δ, and the curvature ratio of three consecutive points,

        r = h / R = (|a| + |b|) (a × b) / (|a| |b| |a + b|),

    h the mean length of the segments a, b between them, R their circumradius, with the sign of the bend, which keeps r
    smooth. δ and the points are linear in p. The default of 500 samples is the paper's (section VI-A).
    """

    def __init__(self, spline: LinkSpline, *, count: int = 500) -> None:
        self.t = np.linspace(0.0, spline.segments, count)
        gradient, fixed = spline.gradient(self.t), spline.evaluate(np.zeros(spline.size), self.t)
        # apart from each other, as products with strided arrays take several times as long
        self._thickness, self._thickness_gradient = fixed[:, 2].copy(), gradient[:, 2].copy()
        self._segments, self._moves = (
            np.diff(np.ascontiguousarray(np.moveaxis(part, 1, 0)[:2]), axis=1) for part in (fixed, gradient)
        )

    @property
    def thickness_gradient(self) -> np.ndarray:
        """∂δ/∂p, the same for all p, (count, size)."""
        return self._thickness_gradient

    def thickness(self, p: np.ndarray) -> np.ndarray:
        """δ, (count,)."""
        return self._thickness + self._thickness_gradient @ p

    def curvature(self, p: np.ndarray) -> np.ndarray:
        """r, signed, at the inner samples, (count − 2,)."""
        segments = self._segments_at(p)
        a, b, inverse = segments[:, :-1], segments[:, 1:], 1.0 / _length(segments)
        return _cross(a, b) * (inverse[:-1] + inverse[1:]) / _length(a + b)

    def curvature_gradient(self, p: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """∂r/∂p at some of the inner samples, a mask (count − 2,), (chosen, size)."""
        segments = self._segments_at(p)
        slopes = _ratio_gradient(segments[:, :-1][:, chosen], segments[:, 1:][:, chosen])
        pairs = zip(slopes, (self._moves[:, :-1][:, chosen], self._moves[:, 1:][:, chosen]), strict=True)
        return sum(np.einsum("cn,cnp->np", slope, move) for slope, move in pairs)

    def _segments_at(self, p: np.ndarray) -> np.ndarray:
        """The segments between samples, (2, count − 1)."""
        return self._segments + (self._moves.reshape(-1, len(p)) @ p).reshape(2, -1)


def _length(a: np.ndarray) -> np.ndarray:
    return np.sqrt(a[0] * a[0] + a[1] * a[1])  # several times as fast as np.hypot


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[1] - a[1] * b[0]


def _ratio_gradient(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of r = g (a × b), g = (1/|a| + 1/|b|) / |a + b|, by a and by b, both (2, n)."""
    c, cross = a + b, _cross(a, b)
    A, B, C = (_length(v) for v in (a, b, c))
    g = (1.0 / A + 1.0 / B) / C
    shared = g * c / C**2
    by_a = g * np.stack([b[1], -b[0]]) - cross * (a / (A**3 * C) + shared)
    by_b = g * np.stack([-a[1], a[0]]) - cross * (b / (B**3 * C) + shared)
    return by_a, by_b


@dataclass(frozen=True, eq=False)
class SplineFit:
    """A spline fitted to a centreline.

    Attributes:
        spline: the spline.
        sites: index among the given joints of each joint control point, in order along the curve.
        deviation: largest distance from the spline to the centreline.
    """

    spline: LinkSpline
    sites: tuple[int, ...]
    deviation: float


@dataclass(frozen=True)
class ControlLayout:
    """The places of control points along a centreline.

    Attributes:
        start, end: whether its first and its last point are free ends.
        interior: control points inside of each span between joints and free ends, in order.
    """

    start: bool
    end: bool
    interior: tuple[int, ...]


def lay_out(
    centreline: Centreline,
    joints: Sequence[Sequence[float]],
    reach: Sequence[float],
    segments: int,
    *,
    part: str = "spline",
) -> ControlLayout:
    """Control points for a number of ``segments``, where joints and free ends are farthest apart.

    An end of the centreline is free where it is more than twice as far from the next joint as its interface reaches.

    Args:
        centreline: the curve to follow.
        joints: positions of the link's joints, (n, 2), in any order.
        reach: how far the interface of each joint extends from it, (n,).
        segments: number of cubic segments.
        part: what the spline belongs to, for messages.

    Raises:
        DescriptionError: there are fewer segments than spans, or one joint and no free end.
    """
    stations = np.array([centreline.closest(joint) for joint in joints])
    first, last = int(np.argmin(stations)), int(np.argmax(stations))
    start = bool(stations[first] > 2.0 * reach[first])
    end = bool(centreline.end - stations[last] > 2.0 * reach[last])
    gaps = np.diff([*[0.0] * start, *np.sort(stations), *[centreline.end] * end])
    if not len(gaps):
        raise DescriptionError(
            part, "the link has 1 joint and no free end", "Continue its centreline to a free end, or give it two joints"
        )
    if segments < len(gaps):
        between = "joints and free ends" if start or end else "joints"
        raise DescriptionError(
            part, f"{counted(segments, 'segment')} for {len(gaps)} gaps between {between}", f"Give at least {len(gaps)}"
        )
    interior = np.zeros(len(gaps), dtype=int)
    for _ in range(segments - len(gaps)):
        interior[int(np.argmax(gaps / (interior + 1)))] += 1
    return ControlLayout(start, end, tuple(interior.tolist()))


def fit_spline(
    centreline: Centreline,
    joints: Sequence[Sequence[float]],
    layout: ControlLayout,
    *,
    ends_move: bool = False,
    joints_move: bool = False,
    part: str = "spline",
) -> SplineFit:
    """The spline along ``centreline`` with control points at ``joints``, free ends, and evenly spaced between them.

    The tangents minimise the distance across the curve,

        Σ_k (n_k · (x(t_k) − c_k))² + ε² (τ_k · (x(t_k) − c_k))²,

    with c_k the foot point of x(t_k) on the centreline, τ_k and n_k its tangent and normal, and a small ε that keeps
    the samples from running along the curve. Foot points and tangents are improved in turn.

    Args:
        centreline: the curve to follow.
        joints: positions of the link's joints, (n, 2), in any order.
        layout: of the control points.
        ends_move, joints_move: whether the places of free ends, of joints, are parameters.
        part: what the spline belongs to, for messages.

    Raises:
        DescriptionError: two joints lie at one place of the curve.
    """
    curve = _ArcLength(centreline)
    arcs = np.array([curve.arc(joint) for joint in joints])
    order = np.argsort(arcs)
    arcs = arcs[order]
    if np.any(np.diff(arcs) <= 1e-9 * curve.length):
        raise DescriptionError(part, "two joints lie at the same place of the centreline", "Move one of them")

    stops = [*[0.0] * layout.start, *arcs, *[curve.length] * layout.end]
    at_joints = [*[False] * layout.start, *[True] * len(arcs), *[False] * layout.end]
    knots, joint_flags = stops[:1], at_joints[:1]
    for start, end, count, at_joint in zip(stops, stops[1:], layout.interior, at_joints[1:], strict=False):
        knots += np.linspace(start, end, count + 2)[1:].tolist()
        joint_flags += [False] * count + [at_joint]
    is_joint = np.array(joint_flags)
    positions = curve.point(np.array(knots))
    positions[is_joint] = np.asarray(joints, dtype=float)[order]

    controls = np.zeros((len(knots), 2, 3))
    controls[:, 0, :2], controls[:, 0, 2] = positions, 1.0
    spline, each = LinkSpline(controls, is_joint, ends_move, joints_move), 32  # samples per segment
    t = np.arange(0.5, spline.segments * each) / each
    feet = np.interp(t, np.arange(len(knots)), knots)
    for _ in range(40):  # the deviation has settled after a few
        controls[:, 1, :2] = _fit_tangents(spline.basis(t), positions, curve, feet)
        samples = spline.evaluate(spline.initial, t)[:, :2]
        feet = curve.foot(samples, feet)
    deviation = np.linalg.norm(samples - curve.point(feet), axis=1).max()
    return SplineFit(spline, tuple(order.tolist()), float(deviation))


def _fit_tangents(basis: np.ndarray, positions: np.ndarray, curve: _ArcLength, feet: np.ndarray) -> np.ndarray:
    """The tangents (n, 2) that minimise the weighted distances from the samples to the points ``feet``."""
    gap = basis[:, ::2] @ positions - curve.point(feet)
    along = curve.tangent(feet)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    rows, rhs = [], []
    for direction, weight in ((across, 1.0), (along, 0.1)):  # ε = 0.1
        rows.append(weight * (direction[:, None, :] * basis[:, 1::2, None]).reshape(len(feet), -1))
        rhs.append(-weight * np.sum(direction * gap, axis=1))
    return np.linalg.lstsq(np.concatenate(rows), np.concatenate(rhs), rcond=None)[0].reshape(-1, 2)


class _ArcLength:
    """A centreline by its arc length a, from a fine table."""

    def __init__(self, centreline: Centreline) -> None:
        self._curve = centreline
        self._s = centreline.samples(1000)
        self._a = chord_lengths(centreline.evaluate(self._s))

    @property
    def length(self) -> float:
        return float(self._a[-1])

    def arc(self, point: Sequence[float]) -> float:
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
