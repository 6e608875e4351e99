"""Regularisers: terms R(p) of the objective that keep designs near the start, meshes good and links printable.

They combine with + and *: ``MeshQuality() + ShapeBounds() + 1e-3 * StayClose()``. All are free of units.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fenicsmech.design.optimisers.problem import Deferred, Quadratic
from fenicsmech.design.rest_shape import DesignedLink, ParametricShape
from fenicsmech.design.shape.handle_optimum import HandlePlacement
from fenicsmech.design.shape.quality import Barrier
from fenicsmech.errors import finite, set_options

Model = Callable[[np.ndarray], Quadratic]


class Regulariser(ABC):
    """A term R(p) of the objective."""

    @abstractmethod
    def around(self, rest: ParametricShape, placement: HandlePlacement) -> Model:
        """R near the design that ``rest`` holds, placed as in ``placement``.

        The model needs no mesh: it is R itself where R is a function of the splines alone, otherwise it agrees with R
        and its gradient at the design.
        """

    def active(self, rest: ParametricShape, placement: HandlePlacement) -> tuple[str, ...]:
        """The bounds that hold the design back, in words."""
        return ()

    def __add__(self, other: Regulariser) -> Regulariser:
        return Weighted((self, other), (1.0, 1.0))

    def __mul__(self, factor: float) -> Regulariser:
        return Weighted((self,), (finite("weight of a regulariser", factor),))

    __rmul__ = __mul__


@dataclass(frozen=True)
class Weighted(Regulariser):
    """Σ weight · term."""

    terms: tuple[Regulariser, ...]
    weights: tuple[float, ...]

    def around(self, rest, placement):
        models = [(weight, term.around(rest, placement)) for weight, term in zip(self.weights, self.terms, strict=True)]

        def model(p: np.ndarray) -> Quadratic:
            parts = [(weight, part(p)) for weight, part in models]

            def derivatives() -> tuple[np.ndarray, np.ndarray]:
                return (
                    sum(weight * part.gradient for weight, part in parts),
                    sum(weight * part.curvature for weight, part in parts),
                )

            return Deferred(sum(weight * part.value for weight, part in parts), derivatives)

        return model

    def active(self, rest, placement):
        return tuple(bound for term in self.terms for bound in term.active(rest, placement))


@dataclass(frozen=True)
class StayClose(Regulariser):
    """R_init = ½ Σ ((p − p₀) / h)², h the thickness of each link (the paper's equation 7, made free of units).

    The sum runs over parameters of shapes only. Thickness parameters δ are relative to h already.
    Design problems weight it 1e-4 by default where the paper's equation has 1: with weight 1 the designs stay so close
    to the drawing that the demos miss their targets (benchmarks/closeness.py).
    """

    def around(self, rest, placement):
        scale = 1.0 / rest.lengths**2
        scale[rest.of_numbers] = 0.0  # numbers to be identified are not drawn back to their start

        def model(p: np.ndarray) -> Quadratic:
            away = p - rest.initial
            return Quadratic(0.5 * float(away @ (scale * away)), scale * away, np.diag(scale))

        return model


@dataclass(frozen=True)
class NumberBounds(Regulariser):
    """Barriers on numbers; each begins at a distance of 2 % of the interval between both bounds from its bound.

    No design leaves the bounds themselves.
    """

    def around(self, rest, placement):
        q, barrier = rest.of_numbers, Barrier(-0.02, 0.02)

        def model(p: np.ndarray) -> Quadratic:
            low, high, found = -p[q], p[q] - 1.0, Quadratic.zero(len(p))
            found.gradient[q] = barrier.slope(high) - barrier.slope(low)
            found.curvature[q, q] = np.diag(barrier.curvature(high) + barrier.curvature(low))
            value = float(np.sum(barrier.value(high) + barrier.value(low)))
            return Quadratic(value, found.gradient, found.curvature)

        nothing = Quadratic.zero(len(placement.p))
        return model if rest.numbers.numbers else lambda p: nothing

    def active(self, rest, placement):
        found = []
        for own, at in zip(rest.numbers.numbers, placement.p[rest.of_numbers], strict=True):
            if at < 0.02:
                found.append(f"least {own} {own.least:g}")
            if at > 0.98:
                found.append(f"largest {own} {own.most:g}")
        return tuple(found)


@dataclass(frozen=True)
class ShapeBounds(Regulariser):
    """R_shape: barriers on thickness and curvature ratio at the samples of each spline (section V-A of the paper).

    Widths and strengths of the barriers are the paper's; they begin a width before the bounds, so that designs end
    within them.
    """

    def around(self, rest, placement):
        links = [(link.parameters, _bounds(link)) for link in rest.links]

        def model(p: np.ndarray) -> Quadratic:
            exceeded = [(own, [bound for bound in bounds(own.of(p)) if bound.beyond.any()]) for own, bounds in links]
            value = sum(float(b.barrier.value(b.values[b.beyond]).sum()) for _, bounds in exceeded for b in bounds)

            def derivatives() -> tuple[np.ndarray, np.ndarray]:
                gradient, curvature = np.zeros(len(p)), np.zeros((len(p), len(p)))
                for own, bounds in exceeded:
                    size = len(own.fixed)
                    slope, bent = np.zeros(size), np.zeros((size, size))  # by the spline's parameters
                    for bound in bounds:
                        x, by_own, barrier = bound.values[bound.beyond], bound.gradient(bound.beyond), bound.barrier
                        slope += barrier.slope(x) @ by_own
                        # the curvature of x itself is left out: it may be negative, and is multiplied by a small slope
                        bent += by_own.T @ (barrier.curvature(x)[:, None] * by_own)
                    if bounds:
                        gradient += slope @ own.matrix
                        curvature += own.matrix.T @ bent @ own.matrix
                return gradient, curvature

            return Deferred(value, derivatives)

        return model

    def active(self, rest, placement):
        found = []
        for link in rest.links:
            for bound in _bounds(link)(link.parameters.of(placement.p)):
                if bound.beyond.any():
                    found.append(f"{bound.name} of {link.name!r}")
        return tuple(dict.fromkeys(found))


@dataclass(frozen=True, eq=False)
class _Bound:
    """A quantity with an upper bound along a link.

    Attributes:
        name: of the bound.
        values: at the samples, (n,).
        gradient: derivatives by the link's parameters at chosen samples, a mask (n,).
        barrier: on the values.
    """

    name: str
    values: np.ndarray
    gradient: Callable[[np.ndarray], np.ndarray]
    barrier: Barrier

    @cached_property
    def beyond(self) -> np.ndarray:
        """Mask of the samples where the barrier is positive, (n,)."""
        return self.values > self.barrier.limit


def _bounds(link: DesignedLink) -> Callable[[np.ndarray], list[_Bound]]:
    """The bounds of a link by the parameters of its spline; links that follow joints alone stay as drawn."""
    if link.follows:
        return lambda p: []
    samples, (least, most) = link.samples, link.bounds.thickness
    # thickness over its bound at each sample, for δ = 1
    lower, upper = (np.broadcast_to(link.thickness / bound, samples.t.shape) for bound in (least, most))
    by_lower, by_upper = (-lower[:, None] * samples.thickness_gradient, upper[:, None] * samples.thickness_gradient)
    thin, thick = f"least thickness {_span(least)}", f"largest thickness {_span(most)}"
    thinnest, thickest = Barrier(-1.02, 0.02), Barrier(0.98, 0.02)
    sharpest, sharp = Barrier(link.bounds.bend - 0.01, 0.01), f"curvature {link.bounds.bend:g}"

    def at(p: np.ndarray) -> list[_Bound]:
        delta, bend = samples.thickness(p), samples.curvature(p)
        return [
            _Bound(thin, -lower * delta, lambda chosen: by_lower[chosen], thinnest),
            _Bound(thick, upper * delta, lambda chosen: by_upper[chosen], thickest),
            _Bound(sharp, bend, lambda chosen: samples.curvature_gradient(p, chosen), sharpest),
            _Bound(sharp, -bend, lambda chosen: -samples.curvature_gradient(p, chosen), sharpest),
        ]

    return at


def _span(bound: float | np.ndarray) -> str:
    """A bound in words, from its least to its largest value along a link."""
    low, high = (f"{end:g}" for end in (np.min(bound), np.max(bound)))
    return low if low == high else f"{low} to {high}"


@dataclass(frozen=True)
class MeshQuality(Regulariser):
    """R_mesh = Σ_e β(ρ_e), ρ a cell's circumradius over its inradius; infinite where cells are inverted.

    The constants are the paper's (appendix). Cells that cannot deform do not count: those of other links, and those
    that clamps or pins hold at all corners. A design with inverted cells has no placement at all and is refused before
    R_mesh is evaluated.

    Attributes:
        limit: largest aspect ratio without penalty.
        width, strength: ε and m of the barrier.

    Raises:
        DescriptionError: one of them is not a positive number.
    """

    limit: float = 30.0
    width: float = 30.0
    strength: float = 5.0

    def __post_init__(self) -> None:
        set_options(self, "the mesh quality")

    def around(self, rest, placement):
        here = Quadratic.zero(len(placement.p))
        if rest.worst_ratio() > self.limit:
            barrier = Barrier(self.limit, self.width, self.strength)
            value, gradient = rest.quality_penalty(barrier, placement)
            # exact for one cell beyond the limit: β″ = ⅔ β′² / β
            here = Quadratic(value, gradient, np.outer(gradient, gradient) * (2.0 / 3.0) / value)

        def model(p: np.ndarray) -> Quadratic:
            step = p - placement.p
            curved = here.curvature @ step
            return Quadratic(
                here.value + float((here.gradient + 0.5 * curved) @ step), here.gradient + curved, here.curvature
            )

        return model if here.value else lambda p: here

    def active(self, rest, placement):
        return (f"aspect ratio {self.limit:g} of the mesh",) if rest.worst_ratio() > self.limit else ()
