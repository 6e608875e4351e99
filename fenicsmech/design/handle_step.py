"""Newton steps for the handle positions of one link, from derivatives of S = Σρ by the maps T of its handles.

The spline's tangent has a kink at interior control points, and so has S as a function of t where a handle slides over
one. A handle there moves to the side on which S falls, and is held if S rises to both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.design.handles import LinkHandles

_LARGEST_TURN = 0.5  # rad per step
_GAP_KEPT = 0.2  # of the gap to the next handle, per step
_FLATTEST = 1e-8  # smallest eigenvalue of the Hessian, relative to the largest


@dataclass(frozen=True, eq=False)
class LinkDerivatives:
    """Derivatives of S at one point.

    Attributes:
        gradient: ∂S/∂T, (n, 2, 3).
        hessian: ∂²S/∂T∂T, (n, 2, 3, n, 2, 3).
    """

    gradient: np.ndarray
    hessian: np.ndarray


@dataclass(frozen=True, eq=False)
class Sides:
    """From which side each handle is differentiated.

    Attributes:
        segments: the segment of the spline each handle moves in, (n,).
        free: which handles move, (n,).
    """

    segments: np.ndarray
    free: np.ndarray


def choose_sides(handles: LinkHandles, p: np.ndarray, theta: np.ndarray, by_T: LinkDerivatives) -> Sides:
    """The side to which S falls, for handles at a control point; their segment, for others."""
    after = handles.segments(theta)
    at_kink = handles.slides & (theta == after)
    free = handles.slides | handles.turns
    if not np.any(at_kink):
        return Sides(after, free)
    before = np.where(at_kink, after - 1, after)
    forward, backward = (
        np.sum(by_T.gradient * handles.gradients(p, theta, segments=side)[1], axis=(1, 2)) for side in (after, before)
    )
    held = at_kink & (forward >= 0.0) & (backward <= 0.0)
    return Sides(np.where(at_kink & (forward >= 0.0), before, after), free & ~held)


def second_derivatives(
    handles: LinkHandles, p: np.ndarray, theta: np.ndarray, sides: Sides, by_T: LinkDerivatives
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """S_θ (f,), S_θθ (f, f) and S_θp (f, parameters) of the free handles."""
    by_p, by_theta = handles.gradients(p, theta, segments=sides.segments)
    mixed, twice = handles.curvatures(p, theta, by_T.gradient, segments=sides.segments)
    free = sides.free
    slope = np.einsum("jak,jak->j", by_T.gradient, by_theta)[free]
    pulled = np.einsum("jak,jakmbl->jmbl", by_theta, by_T.hessian)[free]
    bend = np.einsum("jmbl,mbl->jm", pulled, by_theta)[:, free] + np.diag(twice[free])
    return slope, 0.5 * (bend + bend.T), np.einsum("jmbl,mblp->jp", pulled, by_p) + mixed[free]


@dataclass(frozen=True, eq=False)
class LinkStep:
    """A step of the handles of one link.

    Attributes:
        handles: the handles.
        step: change of θ, (n,).
        slope: S_θ, 0 for handles that do not move, (n,).
        segments: the segment each handle stays in, (n,).
    """

    handles: LinkHandles
    step: np.ndarray
    slope: np.ndarray
    segments: np.ndarray

    @property
    def predicted(self) -> float:
        """The decrease of S that the quadratic model predicts."""
        return -0.5 * float(self.slope @ self.step)

    def position(self, theta: np.ndarray, fraction: float) -> np.ndarray:
        """θ after a ``fraction`` of the step; a handle that would leave its segment stops at the control point."""
        moved = theta + fraction * self.step
        return np.where(self.handles.slides, np.clip(moved, self.segments, self.segments + 1), moved)

    def longest(self, theta: np.ndarray) -> float:
        """The largest fraction, up to 1, that keeps handles in order and turns joints moderately."""
        slides = self.handles.slides
        turn = np.abs(self.step[~slides]).max(initial=0.0)
        gaps, closing = np.diff(_along(self.handles, theta)), -np.diff(np.where(slides, self.step, 0.0))
        limits = (1.0 - _GAP_KEPT) * gaps[closing > 0.0] / closing[closing > 0.0]
        return min(1.0, _LARGEST_TURN / max(turn, _LARGEST_TURN), limits.min(initial=1.0))


def link_step(handles: LinkHandles, p: np.ndarray, theta: np.ndarray, by_T: LinkDerivatives) -> LinkStep:
    """Newton's step −|S_θθ|⁻¹ S_θ, with the eigenvalues of the Hessian made positive."""
    sides = choose_sides(handles, p, theta, by_T)
    free_slope, bend, _ = second_derivatives(handles, p, theta, sides, by_T)
    values, vectors = np.linalg.eigh(bend)
    values = np.maximum(np.abs(values), _FLATTEST * np.abs(values).max(initial=0.0))
    step, slope = np.zeros(len(handles)), np.zeros(len(handles))
    step[sides.free] = -vectors @ (vectors.T @ free_slope / values)
    slope[sides.free] = free_slope
    return LinkStep(handles, step, slope, sides.segments)


def follow_spline(handles: LinkHandles, p: np.ndarray) -> np.ndarray:
    """θ with joints turned like the tangent of the spline there, and all other handles at their initial t."""
    tangents = (handles.spline.derivative(q, handles.t)[:, :2] for q in (handles.spline.initial, p))
    before, now = (np.arctan2(tangent[:, 1], tangent[:, 0]) for tangent in tangents)
    turn = np.remainder(now - before + np.pi, 2.0 * np.pi) - np.pi
    return np.where(handles.slides, handles.t, np.where(handles.turns, turn, 0.0))


def in_order(handles: LinkHandles, theta: np.ndarray) -> bool:
    """Whether the handles follow each other along the spline, between its ends."""
    return bool(np.all(np.diff(_along(handles, theta)) > 0.0))


def _along(handles: LinkHandles, theta: np.ndarray) -> np.ndarray:
    """Spline parameters of all handles, joints too."""
    return np.where(handles.slides, theta, handles.t)
