"""The largest curvature of a link's outline at rest, whose inverse is its least radius.

At a node X_i, with the edges a and b from X_{i−1} to X_i and on to X_{i+1}, the circle through the three has the
curvature

    κ_i = 2 (a × b) / (|a| |b| |a + b|),

positive where the outline is convex.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.errors import DescriptionError, expect, positive, set_fields
from fenicsmech.mechanism import FlexibleLink
from fenicsmech.meshing import FREE
from fenicsmech.model import MechanismModel
from fenicsmech.quantities.outlines import SHARPNESS, LinkOutline, smooth_maximum
from fenicsmech.quantities.quantity import Partial, Quantity, RestObservable

_SIGNS = {"both": (1.0, -1.0), "convex": (1.0,), "concave": (-1.0,)}


@dataclass(frozen=True)
class LargestCurvature(Quantity):
    """The largest curvature of the outline of a flexible link at rest, 1 / length.

    A least radius of 5 mm is ``Target(LargestCurvature(leg), at_most=1 / 5)``. Corners of the drawn outline stay
    corners and do not count, nor do parts that one interface holds, nor holes.

    Attributes:
        link: the link.
        side: "convex", "concave" or "both".
        sharpness: ρ of the smooth maximum that optimisers see (``outlines``), with the inverse of the drawn mean
            thickness for s.

    Raises:
        DescriptionError: this is not a flexible link, the sharpness is not positive, or there is no such side; later:
            an interface holds all of the outline.
    """

    link: FlexibleLink
    side: str = "both"
    sharpness: float = SHARPNESS
    of_state = False
    smoothed = True

    def __post_init__(self) -> None:
        what = "largest curvature"
        expect(what, self.link, FlexibleLink, "a flexible link", "Give a flexible link of the mechanism")
        if self.side not in _SIGNS:
            raise DescriptionError(what, f"its side is {self.side!r}", f"Choose one of {', '.join(_SIGNS)}")
        set_fields(self, sharpness=positive(f"sharpness of the {self.name}", self.sharpness))

    @property
    def name(self):
        return f"largest {'' if self.side == 'both' else self.side + ' '}curvature of {self.link.name!r}"

    def unit(self, units):
        return f"1/{units.length}"

    def on(self, model):
        return _Curvature(model, self)


class _Curvature(RestObservable):
    """The smooth maximum over the nodes that count."""

    def __init__(self, model: MechanismModel, curvature: LargestCurvature) -> None:
        self._outline = outline = LinkOutline(model, curvature.link, curvature.name)
        self._signs, self._sharpness = np.array(_SIGNS[curvature.side]), curvature.sharpness
        held = outline.body != FREE
        for step in (-1, 1):
            held &= np.roll(outline.body, step) == outline.body
        self._nodes = np.flatnonzero(~held & ~outline.corner)
        if not len(self._nodes):
            raise DescriptionError(
                curvature.name, "interfaces hold all of its outline", "Name a link with a part that can deform"
            )

    def value(self):
        return self._smooth(self._curvatures()[0])[0]

    def slope(self):
        curvatures, (by_a, by_b) = self._curvatures()
        shares = self._smooth(curvatures)[1].reshape(len(self._signs), -1)
        weights = (self._signs @ shares)[:, None]
        count, found = len(self._outline.drawn), np.zeros_like(self._outline.drawn)
        for step, part in ((-1, -by_a), (0, by_a - by_b), (1, by_b)):
            found[(self._nodes + step) % count] += weights * part
        return Partial(design=self._outline.by_design(found))

    def smoothing_errors(self, state):
        curvatures, _ = self._curvatures()
        return np.array([np.max(np.outer(self._signs, curvatures)) - self._smooth(curvatures)[0]])

    def _smooth(self, curvatures: np.ndarray) -> tuple[float, np.ndarray]:
        return smooth_maximum(np.outer(self._signs, curvatures).ravel(), 1.0 / self._outline.width, self._sharpness)

    def _curvatures(self) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """κ of the nodes that count, (k,), and its derivatives by a and b, both (k, 2)."""
        X = self._outline.rest()
        a, b = ((X - np.roll(X, 1, axis=0))[self._nodes], (np.roll(X, -1, axis=0) - X)[self._nodes])
        c, cross = a + b, a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        A, B, C = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        kappa = 2.0 * cross / (A * B * C)
        scale = (2.0 / (A * B * C))[:, None]
        shared = c / C[:, None] ** 2
        by_a = scale * np.stack([b[:, 1], -b[:, 0]], axis=1) - kappa[:, None] * (a / A[:, None] ** 2 + shared)
        by_b = scale * np.stack([-a[:, 1], a[:, 0]], axis=1) - kappa[:, None] * (b / B[:, None] ** 2 + shared)
        return kappa, (by_a, by_b)
