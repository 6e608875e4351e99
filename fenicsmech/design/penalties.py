"""What keeps designs near the start and within the bounds of fabrication: terms R(p) of the objective.

Penalties combine with + and *: ``3.0 * StayClose(p0) + ShapeBounds(...)``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.design.barrier import Barrier
from fenicsmech.design.spline_samples import SplineSamples


@dataclass(frozen=True)
class Quadratic:
    """A penalty near one point.

    Attributes:
        value: R.
        gradient: ∂R/∂p, (n,).
        curvature: ∂²R/∂p², or a positive semidefinite approximation, (n, n).
    """

    value: float
    gradient: np.ndarray
    curvature: np.ndarray


class Penalty(ABC):
    """A term R(p) of the objective."""

    @abstractmethod
    def at(self, p: np.ndarray) -> Quadratic:
        """R and its derivatives at ``p`` (n,)."""

    def __add__(self, other: Penalty) -> Penalty:
        return Weighted((self, other), (1.0, 1.0))

    def __mul__(self, factor: float) -> Penalty:
        return Weighted((self,), (float(factor),))

    __rmul__ = __mul__


@dataclass(frozen=True)
class Weighted(Penalty):
    """Σ weight · penalty."""

    terms: tuple[Penalty, ...]
    weights: tuple[float, ...]

    def at(self, p):
        parts = [(weight, term.at(p)) for weight, term in zip(self.weights, self.terms, strict=True)]
        return Quadratic(
            sum(weight * part.value for weight, part in parts),
            sum(weight * part.gradient for weight, part in parts),
            sum(weight * part.curvature for weight, part in parts),
        )


@dataclass(frozen=True, eq=False)
class StayClose(Penalty):
    """R_init = ½ |p − p₀|² (the paper's equation 7)."""

    start: np.ndarray

    def at(self, p):
        away = p - self.start
        return Quadratic(0.5 * float(away @ away), away, np.eye(len(p)))


@dataclass(frozen=True)
class Bounds:
    """Fabrication bounds of a link.

    Attributes:
        thickness: least and largest thickness in the plane.
        bend: largest curvature ratio r.
    """

    thickness: tuple[float, float]
    bend: float = 0.08


class ShapeBounds(Penalty):
    """R_shape: barriers on thickness and curvature at the samples of each spline (section V-A of the paper).

    Args:
        samples: of each link's spline.
        widths: thickness of each link where δ = 1.
        bounds: of each link.
        places: which entries of p are each link's.
    """

    def __init__(
        self,
        samples: Sequence[SplineSamples],
        widths: Sequence[float],
        bounds: Sequence[Bounds],
        places: Sequence[slice],
    ) -> None:
        self._links = list(zip(samples, widths, bounds, places, strict=True))

    def at(self, p):
        value, gradient, curvature = 0.0, np.zeros(len(p)), np.zeros((len(p), len(p)))
        for samples, width, bounds, place in self._links:
            own = p[place]
            thickness, by_thickness = width * samples.thickness(own), width * samples.thickness_gradient
            bend, by_bend = samples.curvature(own)
            least, most = bounds.thickness
            terms = (
                (-thickness, -by_thickness, Barrier(-least, 0.02 * least)),
                (thickness, by_thickness, Barrier(most, 0.02 * most)),
                (bend, by_bend, Barrier(bounds.bend, 0.01)),
                (-bend, -by_bend, Barrier(bounds.bend, 0.01)),
            )
            for x, by_p, barrier in terms:
                value += float(barrier.value(x).sum())
                gradient[place] += barrier.slope(x) @ by_p
                # the curvature of x itself is left out: it may be negative, and is multiplied by a small slope
                curvature[place, place] += by_p.T @ (barrier.curvature(x)[:, None] * by_p)
        return Quadratic(value, gradient, curvature)
