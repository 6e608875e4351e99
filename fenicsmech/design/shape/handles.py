"""The handles of one link, which couple its mesh to its spline.

A handle at X moves a point v around it by T (v_x − X_x, v_y − X_y, 1), with T of shape (2, 3); the out-of-plane
coordinate does not change. With points of the plane as complex numbers, T is v − X ↦ (w − 1) (v − X) + x − X:

    joint handles turn about their joint by θ = α
    and go with it where joints move:                         w = exp(iα),
    all others ride on the spline at θ = t; with its
    tangent z = x′ + i y′ and δ there:                        w = δ e,     e = z / |z| · |zᵢₙᵢₜ| / zᵢₙᵢₜ.

Those between joints slide along the spline, those at free ends stay at its end. The map T_j of handle j depends on p
and on θ_j only. With φ = arg z, handles that ride have, by any two a and b of p and t,

    w_a = (δ_a + i δ φ_a) e,                                                   φ_a = Im z_a/z,
    w_ab = (δ_ab − δ φ_a φ_b + i (δ_a φ_b + δ_b φ_a + δ φ_ab)) e,              φ_ab = Im (z_ab/z − z_a z_b/z²).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fenicsmech.design.shape.spline import LinkSpline

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
        w, moved = np.exp(1j * theta), np.zeros(len(self), complex)
        (x, z, *_), (delta, *_) = self._curve(p, theta, self.segments(theta))
        w[self.rides] = delta * self._direction(z)
        moved[self.rides] = x - self._frames[0]
        if self.spline.joints_move:
            joints = self.spline.evaluate(p, self.t[~self.rides])[:, :2] - self.centre[~self.rides]
            moved[~self.rides] = joints @ (1.0, 1.0j)
        return _maps(w - 1.0, moved)

    def gradients(self, p: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """∂T/∂p, (n, 2, 3, size), and ∂T_j/∂θ_j, (n, 2, 3); at a control point those of the segment after it."""
        segments = self.segments(theta)
        return self.by_p(p, theta, segments), self.by_theta(p, theta, segments)

    def by_p(self, p: np.ndarray, theta: np.ndarray, segments: np.ndarray) -> np.ndarray:
        """∂T/∂p, (n, 2, 3, size).

        segments: the segment of each handle: from which side to differentiate by θ at a control point.
        """
        w, moved = np.zeros((2, len(self), self.spline.size), complex)
        (_, z, *_), (delta, *_) = self._curve(p, theta, segments)
        (x_p, delta_p), (z_p, _) = (self._curve_by_p(theta, segments, order) for order in (0, 1))
        w[self.rides] = (delta_p + 1j * delta[:, None] * (z_p / z[:, None]).imag) * self._direction(z)[:, None]
        moved[self.rides] = x_p
        if self.spline.joints_move:
            moved[~self.rides] = np.einsum("nap,a->np", self.spline.gradient(self.t[~self.rides])[:, :2], (1.0, 1.0j))
        return np.moveaxis(_maps(w, moved), 1, -1)

    def by_theta(self, p: np.ndarray, theta: np.ndarray, segments: np.ndarray) -> np.ndarray:
        """∂T_j/∂θ_j, (n, 2, 3); ``segments`` as above."""
        w, moved = 1j * np.exp(1j * theta), np.zeros(len(self), complex)
        (_, z, z_t, _), (delta, delta_t, *_) = self._curve(p, theta, segments)
        w[self.rides] = (delta_t + 1j * delta * (z_t / z).imag) * self._direction(z)
        moved[self.rides] = z
        return _maps(w, moved)

    def twice_by_theta(self, p: np.ndarray, theta: np.ndarray, weights: np.ndarray, segments: np.ndarray) -> np.ndarray:
        """Σ G ∂²T_j/∂θ_j², (n,), with ``weights`` G (n, 2, 3); ``segments`` as above."""
        w, moved = -np.exp(1j * theta), np.zeros(len(self), complex)
        (_, z, z_t, z_tt), (delta, delta_t, delta_tt, _) = self._curve(p, theta, segments)
        turn = z_t / z
        phi_t, phi_tt = turn.imag, (z_tt / z - turn**2).imag
        radial, across = delta_tt - delta * phi_t**2, 2.0 * delta_t * phi_t + delta * phi_tt
        w[self.rides] = (radial + 1j * across) * self._direction(z)
        moved[self.rides] = z_t
        linear, constant = _paired(weights)
        return (linear * w + constant * moved).real

    def by_theta_and_p(self, p: np.ndarray, theta: np.ndarray, weights: np.ndarray, segments: np.ndarray) -> np.ndarray:
        """Σ G ∂²T_j/∂θ_j∂p, (n, size), with ``weights`` G (n, 2, 3); ``segments`` as above."""
        found = np.zeros((len(self), self.spline.size))
        (_, z, z_t, _), (delta, delta_t, *_) = (part[..., None] for part in self._curve(p, theta, segments))
        e = self._direction(z[:, 0])[:, None]
        (_, delta_p), (z_p, delta_tp), (z_tp, _) = (self._curve_by_p(theta, segments, order) for order in range(3))
        phi_t, phi_p, phi_tp = (z_t / z).imag, (z_p / z).imag, (z_tp / z - z_t * z_p / z**2).imag
        radial, across = delta_tp - delta * phi_t * phi_p, delta_t * phi_p + delta_p * phi_t + delta * phi_tp
        linear, constant = (part[self.rides, None] for part in _paired(weights))
        found[self.rides] = (linear * (radial + 1j * across) * e + constant * z_p).real
        return found

    def _curve(self, p: np.ndarray, theta: np.ndarray, segments: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """x + iy and δ of the handles that ride, each differentiated 0 to 3 times by t, both (4, k)."""
        found = self.spline.derivatives(p, theta[self.rides], segments[self.rides])
        return found[..., 0] + 1j * found[..., 1], found[..., 2]

    def _curve_by_p(self, theta: np.ndarray, segments: np.ndarray, order: int) -> tuple[np.ndarray, np.ndarray]:
        """∂/∂p of x + iy and δ of the handles that ride, differentiated ``order`` times by t, both (k, size)."""
        found = self.spline.gradient(theta[self.rides], order=order, segments=segments[self.rides])
        return found[:, 0] + 1j * found[:, 1], found[:, 2]

    def _direction(self, z: np.ndarray) -> np.ndarray:
        """e of the handles that ride, from tangents z (k,)."""
        return z / np.abs(z) / self._frames[1]

    @cached_property
    def _frames(self) -> tuple[np.ndarray, np.ndarray]:
        """Initial positions and unit tangents of the handles that ride, both (k,), complex."""
        tangent = self.spline.derivative(self.spline.initial, self.t)[self.rides, :2] @ (1.0, 1.0j)
        return self.centre[self.rides] @ (1.0, 1.0j), tangent / np.abs(tangent)


def _maps(w: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """The maps v ↦ w v + moved, (…), as arrays (…, 2, 3)."""
    T = np.empty((*w.shape, 2, 3))
    T[..., 0, 0] = T[..., 1, 1] = w.real
    T[..., 0, 1], T[..., 1, 0] = -w.imag, w.imag
    T[..., 0, 2], T[..., 1, 2] = moved.real, moved.imag
    return T


def _paired(weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Factors g and h, (n,), so that Σ G T = Re (g w + h moved) of a map T with ``weights`` G, (n, 2, 3)."""
    (a, b, c), (d, e, f) = np.moveaxis(weights, 0, -1)
    return a + e - 1j * (d - b), c - 1j * f
