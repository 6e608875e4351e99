"""The handles of one link, which couple its mesh to its spline.

A handle at X moves a point v around it by T (v_x − X_x, v_y − X_y, 1), with T of shape (2, 3); the out-of-plane
coordinate does not change:

    joint handles turn about their joint by θ = α
    and go with it where joints move:                         T = [R(α) − I | x − X],
    all others ride on the spline at θ = t; at x, with the
    unit tangent e and δ there:                               T = [δ R(e) R(eᵢₙᵢₜ)ᵀ − I | x − X].

Those between joints slide along the spline, those at free ends stay at its end. The map T_j of handle j depends on p
and on θ_j only. For handles that ride, with q = (x, y, δ, x′, y′) at t and subscripts for derivatives,

    T_p = T_q q_p,     T_θ = T_q q_t,     G · T_θp = q_tᵀ (G · T_qq) q_p + (G · T_q) · q_tp,     T_θθ alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import sympy

from fenicsmech.design.shape.spline import LinkSpline
from fenicsmech.symbolic import SmoothFunction, derive

BETWEEN = -1  # instead of the interface that a joint handle holds


@dataclass(frozen=True, eq=False)
class LinkHandles:
    """The handles of one link, in order along its spline.

    Attributes:
        spline: the link's spline.
        t: spline parameter of each handle at the initial design, (n,).
        site: interface of the link that a joint handle holds, ``BETWEEN`` for the others, (n,).
        turns: whether the joints of a joint handle let it turn about z; False for the others, (n,).
    """

    spline: LinkSpline
    t: np.ndarray
    site: np.ndarray
    turns: np.ndarray

    def __len__(self) -> int:
        return len(self.t)

    @cached_property
    def rides(self) -> np.ndarray:
        """Mask of the handles that ride on the spline, (n,)."""
        return self.site == BETWEEN

    @cached_property
    def slides(self) -> np.ndarray:
        """Mask of those that slide along it: free ends are the first and the last handle, and do not, (n,)."""
        slides = self.rides.copy()
        slides[[0, -1]] = False
        return slides

    @cached_property
    def initial(self) -> np.ndarray:
        """θ at the initial design, (n,)."""
        return np.where(self.rides, self.t, 0.0)

    @cached_property
    def centre(self) -> np.ndarray:
        """Initial positions X, (n, 2)."""
        return self.spline.evaluate(self.spline.initial, self.t)[:, :2]

    def segments(self, theta: np.ndarray) -> np.ndarray:
        """The segment each handle is in, (n,); the later one at a control point."""
        return self.spline.segments_of(np.where(self.rides, theta, self.t))

    def transforms(self, p: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """The maps T of all handles, (n, 2, 3), from parameters ``p`` (size,) and ``theta`` (n,)."""
        T = _turns(theta)
        q = self._q(p, theta, self.segments(theta))
        T[self.rides] = _spline_maps().value(q, self._frames).reshape(-1, 2, 3)
        if self.spline.joints_move:
            T[~self.rides, :, 2] = self.spline.evaluate(p, self.t[~self.rides])[:, :2] - self.centre[~self.rides]
        return T

    def gradients(
        self, p: np.ndarray, theta: np.ndarray, *, segments: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """∂T/∂p, (n, 2, 3, size), and ∂T_j/∂θ_j, (n, 2, 3).

        segments: the segment of each handle: from which side to differentiate by θ at a control point.
        """
        segments = self.segments(theta) if segments is None else segments
        by_p, by_theta = np.zeros((len(self), 2, 3, self.spline.size)), _turns(theta, order=1)
        by_q = _spline_maps().gradient(self._q(p, theta, segments), self._frames).reshape(-1, 2, 3, 5)
        by_p[self.rides] = np.einsum("nabq,nqp->nabp", by_q, self._q_by_p(theta, segments))
        by_theta[self.rides] = np.einsum("nabq,nq->nab", by_q, self._q(p, theta, segments, order=1))
        if self.spline.joints_move:
            by_p[~self.rides, :, 2] = self.spline.gradient(self.t[~self.rides])[:, :2]
        return by_p, by_theta

    def curvatures(
        self, p: np.ndarray, theta: np.ndarray, weights: np.ndarray, *, segments: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Σ G ∂²T_j/∂θ_j∂p, (n, size), and Σ G ∂²T_j/∂θ_j², (n,), with ``weights`` G (n, 2, 3); others as above."""
        cross, twice = np.zeros((len(self), self.spline.size)), np.sum(weights * _turns(theta, order=2), axis=(1, 2))
        q, G = self._q(p, theta, segments), weights[self.rides].reshape(-1, 6)
        slope = np.einsum("ni,niq->nq", G, _spline_maps().gradient(q, self._frames))
        velocity = self._q(p, theta, segments, order=1)
        turned = np.einsum("nqr,nq->nr", _spline_maps().hessian(q, self._frames, G), velocity)
        cross[self.rides] = np.einsum("nq,nqp->np", turned, self._q_by_p(theta, segments)) + np.einsum(
            "nq,nqp->np", slope, self._q_by_p(theta, segments, order=1)
        )
        twice[self.rides] = np.sum(turned * velocity + slope * self._q(p, theta, segments, order=2), axis=1)
        return cross, twice

    def _q(self, p: np.ndarray, theta: np.ndarray, segments: np.ndarray, *, order: int = 0) -> np.ndarray:
        """q of the handles that ride, differentiated ``order`` times by t, (k, 5)."""
        t, segments = theta[self.rides], segments[self.rides]
        controls = self.spline.controls_at(p).reshape(-1, 3)
        curve, tangent = (self.spline.basis(t, order=o, segments=segments) @ controls for o in (order, order + 1))
        return np.concatenate([curve, tangent[:, :2]], axis=1)

    def _q_by_p(self, theta: np.ndarray, segments: np.ndarray, *, order: int = 0) -> np.ndarray:
        """∂q/∂p of the handles that ride, differentiated ``order`` times by t, (k, 5, size)."""
        t, segments = theta[self.rides], segments[self.rides]
        curve, tangent = (self.spline.gradient(t, order=o, segments=segments) for o in (order, order + 1))
        return np.concatenate([curve, tangent[:, :2]], axis=1)

    @cached_property
    def _frames(self) -> np.ndarray:
        """Initial positions and unit tangents of the handles that ride, (k, 4)."""
        tangent = self.spline.derivative(self.spline.initial, self.t)[:, :2]
        return np.column_stack([self.centre, tangent / np.linalg.norm(tangent, axis=1, keepdims=True)])[self.rides]


def _turns(angle: np.ndarray, order: int = 0) -> np.ndarray:
    """[R(α) − I | 0] for angles (n,), differentiated ``order`` times, (n, 2, 3)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    for _ in range(order):
        cosine, sine = -sine, cosine
    T = np.zeros((len(angle), 2, 3))
    T[:, 0, 0] = T[:, 1, 1] = cosine - (order == 0)
    T[:, 0, 1], T[:, 1, 0] = -sine, sine
    return T


@cache
def _spline_maps() -> SmoothFunction:
    """T of handles that ride, row by row, by q; constants: their initial position and unit tangent."""
    x, y, delta, u, v = q = sympy.symbols("x y delta u v", real=True)
    X, Y, U, V = constants = sympy.symbols("X Y U V", real=True)
    scale = delta / sympy.sqrt(u * u + v * v)
    cosine, sine = scale * (u * U + v * V), scale * (v * U - u * V)
    return derive([cosine - 1, -sine, x - X, sine, cosine - 1, y - Y], q, constants, many=True)
