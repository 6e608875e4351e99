"""The handles of one link: where its spline takes hold of its mesh.

A joint handle turns about its joint by θ = α. An intermediary handle rides on the spline at θ = t and may slide along.
The map T_j of handle j depends on p and on θ_j only. For intermediary handles, with q = (x, y, δ, x′, y′) at t and
subscripts for derivatives,

    T_p = T_q q_p,     T_θ = T_q q_t,     G · T_θp = q_tᵀ (G · T_qq) q_p + (G · T_q) · q_tp,     T_θθ alike.


----
The affine maps that handles apply to their surroundings, with derivatives derived symbolically once per kind.

A handle at X moves a point v around it by T (v_x − X_x, v_y − X_y, 1), with T of shape (2, 3):

    turning by α about a joint:       T = [R(α) − I | 0]
    riding at x, unit tangent e, δ:   T = [δ R(e) R(eᵢₙᵢₜ)ᵀ − I | x − X]

The out-of-plane coordinate is not changed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import sympy

from fenicsmech.design.shape.spline import LinkSpline

BETWEEN = -1  # instead of the interface that a joint handle holds


@dataclass(frozen=True, eq=False)
class LinkHandles:
    """The handles of one link, in order along its spline.

    Attributes:
        spline: the link's spline.
        t: spline parameter of each handle at the initial design, (n,).
        site: interface of the link that a joint handle holds, ``BETWEEN`` for intermediary handles, (n,).
        turns: whether a joint handle may turn (a clamp may not); False for intermediary handles, (n,).
    """

    spline: LinkSpline
    t: np.ndarray
    site: np.ndarray
    turns: np.ndarray

    def __len__(self) -> int:
        return len(self.t)

    @cached_property
    def slides(self) -> np.ndarray:
        """Which handles are intermediary, (n,)."""
        return self.site == BETWEEN

    @cached_property
    def initial(self) -> np.ndarray:
        """θ at the initial design, (n,)."""
        return np.where(self.slides, self.t, 0.0)

    @cached_property
    def centre(self) -> np.ndarray:
        """Initial positions X, (n, 2)."""
        return self.spline.evaluate(self.spline.initial, self.t)[:, :2]

    def segments(self, theta: np.ndarray) -> np.ndarray:
        """The segment each handle is in, (n,); the later one at a control point."""
        return self.spline.segments_of(np.where(self.slides, theta, self.t))

    def transforms(self, p: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """The maps T of all handles, (n, 2, 3), from parameters ``p`` (size,) and ``theta`` (n,)."""
        T = np.empty((len(self), 2, 3))
        T[~self.slides] = turning().value(*self._angles(theta))
        T[self.slides] = riding().value(*self._rides(p, theta, self.segments(theta)))
        return T

    def gradients(
        self, p: np.ndarray, theta: np.ndarray, *, segments: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """∂T/∂p, (n, 2, 3, size), and ∂T_j/∂θ_j, (n, 2, 3).

        segments: the segment of each handle; tells at a control point from which side to differentiate by θ.
        """
        segments = self.segments(theta) if segments is None else segments
        by_p, by_theta = np.zeros((len(self), 2, 3, self.spline.size)), np.empty((len(self), 2, 3))
        by_theta[~self.slides] = turning().gradient(*self._angles(theta))[..., 0]
        by_q = riding().gradient(*self._rides(p, theta, segments))
        by_p[self.slides] = np.einsum("nabq,nqp->nabp", by_q, self._q_by_p(theta, segments))
        by_theta[self.slides] = np.einsum("nabq,nq->nab", by_q, self._q(p, theta, segments, order=1))
        return by_p, by_theta

    def curvatures(
        self, p: np.ndarray, theta: np.ndarray, weights: np.ndarray, *, segments: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Σ G ∂²T_j/∂θ_j∂p, (n, size), and Σ G ∂²T_j/∂θ_j², (n,), with ``weights`` G (n, 2, 3); others as above."""
        segments = self.segments(theta) if segments is None else segments
        mixed, twice = np.zeros((len(self), self.spline.size)), np.empty(len(self))
        twice[~self.slides] = turning().hessian(*self._angles(theta), weights[~self.slides])[:, 0, 0]
        rides, G = self._rides(p, theta, segments), weights[self.slides]
        slope = np.einsum("nab,nabq->nq", G, riding().gradient(*rides))
        velocity = self._q(p, theta, segments, order=1)
        bend = np.einsum("nqr,nq->nr", riding().hessian(*rides, G), velocity)
        mixed[self.slides] = np.einsum("nq,nqp->np", bend, self._q_by_p(theta, segments)) + np.einsum(
            "nq,nqp->np", slope, self._q_by_p(theta, segments, order=1)
        )
        twice[self.slides] = np.sum(bend * velocity + slope * self._q(p, theta, segments, order=2), axis=1)
        return mixed, twice

    def _angles(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Variables and constants of the joint handles."""
        angles = theta[~self.slides, None]
        return angles, np.empty((len(angles), 0))

    def _rides(self, p: np.ndarray, theta: np.ndarray, segments: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Variables q and constants of the intermediary handles."""
        return self._q(p, theta, segments), self._frames

    def _q(self, p: np.ndarray, theta: np.ndarray, segments: np.ndarray, *, order: int = 0) -> np.ndarray:
        """q of the intermediary handles, differentiated ``order`` times by t, (k, 5)."""
        t, segments = theta[self.slides], segments[self.slides]
        controls = self.spline.controls_at(p).reshape(-1, 3)
        curve, tangent = (self.spline.basis(t, order=o, segments=segments) @ controls for o in (order, order + 1))
        return np.concatenate([curve, tangent[:, :2]], axis=1)

    def _q_by_p(self, theta: np.ndarray, segments: np.ndarray, *, order: int = 0) -> np.ndarray:
        """∂q/∂p of the intermediary handles, differentiated ``order`` times by t, (k, 5, size)."""
        t, segments = theta[self.slides], segments[self.slides]
        curve, tangent = (self.spline.gradient(t, order=o, segments=segments) for o in (order, order + 1))
        return np.concatenate([curve, tangent[:, :2]], axis=1)

    @cached_property
    def _frames(self) -> np.ndarray:
        """Initial positions and unit tangents of the intermediary handles, (k, 4)."""
        tangent = self.spline.derivative(self.spline.initial, self.t)[:, :2]
        return np.column_stack([self.centre, tangent / np.linalg.norm(tangent, axis=1, keepdims=True)])[self.slides]


@dataclass(frozen=True)
class Transform:
    """A compiled map, for n handles at once.

    Every function takes the variables (n, m) and the constants of the handles, (n, k).

    Attributes:
        value: T, (n, 2, 3).
        gradient: ∂T/∂q of the variables q, (n, 2, 3, m).
        hessian: takes G (n, 2, 3) last; Σ G ∂²T/∂q², (n, m, m).
    """

    value: Callable[..., np.ndarray]
    gradient: Callable[..., np.ndarray]
    hessian: Callable[..., np.ndarray]


@cache
def turning() -> Transform:
    """The map of a joint handle; variable: α; no constants."""
    angle = sympy.Symbol("alpha", real=True)
    return _derive(_turn_and_scale(sympy.S.One, sympy.cos(angle), sympy.sin(angle), sympy.zeros(2, 1)), [angle], [])


@cache
def riding() -> Transform:
    """The map of an intermediary handle.

    Variables: position (2), δ, tangent of any length (2). Constants: initial position (2) and unit tangent (2).
    """
    x, y, delta, u, v = variables = sympy.symbols("x y delta u v", real=True)
    X, Y, U, V = constants = sympy.symbols("X Y U V", real=True)
    scale = delta / sympy.sqrt(u * u + v * v)
    turn = _turn_and_scale(scale, u * U + v * V, v * U - u * V, sympy.Matrix([x - X, y - Y]))
    return _derive(turn, variables, constants)


def _turn_and_scale(scale: sympy.Expr, cosine: sympy.Expr, sine: sympy.Expr, shift: sympy.Matrix) -> sympy.Matrix:
    """[scale R − I | shift]."""
    return (scale * sympy.Matrix([[cosine, -sine], [sine, cosine]]) - sympy.eye(2)).row_join(shift)


def _derive(transform: sympy.Matrix, variables: Sequence[sympy.Symbol], constants: Sequence[sympy.Symbol]) -> Transform:
    entries, m = list(transform), len(variables)
    weights = sympy.symbols("g0:6", real=True)
    pull = sum((g * entry for g, entry in zip(weights, entries, strict=True)), sympy.S.Zero)

    def compile_(expressions, shape, *more):
        flat = sympy.lambdify((variables, constants, *more), expressions, "numpy", cse=True)

        def evaluate(q, c, *weight):
            numbers = flat(q.T, c.T, *(w.reshape(-1, 6).T for w in weight))
            rows = np.empty((len(numbers), len(q)))
            for row, number in zip(rows, numbers, strict=True):
                row[:] = number
            return rows.T.reshape(len(q), *shape)

        return evaluate

    slopes = [sympy.diff(pull, q) for q in variables]
    lower = compile_(
        [sympy.diff(slopes[i], variables[j]) for i in range(m) for j in range(i + 1)], (m * (m + 1) // 2,), weights
    )
    return Transform(
        value=compile_(entries, (2, 3)),
        gradient=compile_([sympy.diff(entry, q) for entry in entries for q in variables], (2, 3, m)),
        hessian=lambda *point: _symmetric(lower(*point), m),
    )


def _symmetric(lower: np.ndarray, m: int) -> np.ndarray:
    """The symmetric matrices (n, m, m) with the given lower triangles, row by row."""
    full = np.empty((len(lower), m, m))
    rows, columns = np.tril_indices(m)
    full[:, rows, columns] = full[:, columns, rows] = lower
    return full
