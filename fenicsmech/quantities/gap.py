"""The least gap between the outlines of two flexible links, or of one and an obstacle, in an equilibrium.

    g = min ( min_i d(x_i, B), min_j d(y_j, A) ),     g = min_i g_o(x_i)

with points x_i and y_j of the loaded outlines A and B, the distance d from a closed chain of straight edges, negative
inside, and the gap g_o of an obstacle. Where two such chains do not cross, the least distance of one from the other is
that of a node of one of them. Where they do, long edges may cross with no node inside: so the points are the nodes and
others between them, half the width of the other link apart at most.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.effects import Obstacle, smooth_gap
from fenicsmech.errors import DescriptionError, expect, positive, set_fields
from fenicsmech.mechanism import FlexibleLink
from fenicsmech.model import MechanismModel
from fenicsmech.polygons import are_inside
from fenicsmech.quantities.outlines import SHARPNESS, LinkOutline, from_edges, smooth_maximum
from fenicsmech.quantities.quantity import Observable, Partial, Quantity


@dataclass(frozen=True)
class LeastGap(Quantity):
    """The least gap between two flexible links, or a flexible link and an obstacle, in their plane.

        Target(LeastGap(left, right), sample, at_least=1.0)
        Target(LeastGap(left, Cylinder((20, 30), 5.0)), sample, at_least=1.0)

    It is negative by the penetration where outlines overlap. ``limits`` holds it over the samples of a motion.
    In space it is that of the faces of greatest z, seen along z.

    Attributes:
        link: a flexible link.
        other: another one, or an obstacle; it need not be one of the scene's effects.
        sharpness: ρ of the smooth minimum that optimisers see (``outlines``), with the drawn mean thickness for s.

    Raises:
        DescriptionError: they are not a flexible link and another one or an obstacle, or the sharpness is not
            positive; later: a joint holds both links.
    """

    link: FlexibleLink
    other: FlexibleLink | Obstacle
    sharpness: float = SHARPNESS
    smoothed = True

    def __post_init__(self) -> None:
        expect("least gap", self.link, FlexibleLink, "a flexible link", "Give a flexible link of the mechanism")
        expect("least gap", self.other, FlexibleLink | Obstacle, "a flexible link or an obstacle", "Give one of them")
        if self.other == self.link:
            raise DescriptionError(
                self.name, "a link has no gap to itself", "Give two links, or a link and an obstacle"
            )
        set_fields(self, sharpness=positive(f"sharpness of the {self.name}", self.sharpness))

    @property
    def name(self):
        other = repr(self.other.name) if isinstance(self.other, FlexibleLink) else str(self.other)
        return f"least gap between {self.link.name!r} and {other}"

    def unit(self, units):
        return units.length

    def check(self, scene, dim):
        super().check(scene, dim)
        if isinstance(self.other, Obstacle):
            self.other.check(2)
            return
        for joint in scene.mechanism.joints:
            if {joint.a, joint.b} == {self.link, self.other}:
                raise DescriptionError(self.name, f"{joint.name!r} joins them", "Name links with a gap between them")

    def on(self, model):
        return _BetweenLinks(model, self) if isinstance(self.other, FlexibleLink) else _ToObstacle(model, self)


class _Gap(Observable):
    """The smooth minimum of the gaps of nodes of some outlines."""

    def __init__(self, model: MechanismModel, gap: LeastGap, links: Sequence[FlexibleLink]) -> None:
        self._outlines = [LinkOutline(model, link, gap.name) for link in links]
        self._size, self._sharpness = min(own.width for own in self._outlines), gap.sharpness

    def values(self, state):
        return np.array([-self._smooth(self._gaps()[0])[0]])

    def partials(self, system, state):
        gaps, slopes = self._gaps()
        total = Partial()
        for outline, slope in zip(self._outlines, slopes(self._smooth(gaps)[1]), strict=True):
            total += Partial(links=outline.by_state(slope), design=outline.by_design(slope))
        return [total]

    def smoothing_errors(self, state):
        gaps, _ = self._gaps()
        return np.array([gaps.min() + self._smooth(gaps)[0]])

    @abstractmethod
    def _gaps(self) -> tuple[np.ndarray, Callable[[np.ndarray], list[np.ndarray]]]:
        """The gaps of all nodes, (n,), and derivatives of their sum weighted by shares (n,), by nodes per outline."""

    def _smooth(self, gaps: np.ndarray) -> tuple[float, np.ndarray]:
        return smooth_maximum(-gaps, self._size, self._sharpness)


class _BetweenLinks(_Gap):
    """Those of the nodes of either link to the other one."""

    def __init__(self, model: MechanismModel, gap: LeastGap) -> None:
        assert isinstance(gap.other, FlexibleLink), "of two links"
        super().__init__(model, gap, [gap.link, gap.other])
        widths = [own.width for own in self._outlines]
        self._shares = [
            _shares(own.drawn, 0.5 * width) for own, width in zip(self._outlines, widths[::-1], strict=True)
        ]

    def _gaps(self):
        places = [own.loaded() for own in self._outlines]
        points = [_between(*pair) for pair in zip(places, self._shares, strict=True)]
        found = [_to_chain(*pair) for pair in zip(points, places[::-1], strict=True)]
        first = len(points[0])

        def slopes(shares: np.ndarray) -> list[np.ndarray]:
            totals = [np.zeros_like(own) for own in places]
            for of, to, (_, edge, parts), share in zip((0, 1), (1, 0), found, np.split(shares, [first]), strict=True):
                by_point, by_start, by_end = (share[:, None] * part for part in parts)
                totals[of] += _between_transposed(by_point, self._shares[of])
                np.add.at(totals[to], edge, by_start)
                np.add.at(totals[to], (edge + 1) % len(places[to]), by_end)
            return totals

        return np.concatenate([gaps for gaps, _, _ in found]), slopes


def _shares(chain: np.ndarray, spacing: float) -> np.ndarray:
    """Where on each edge of a closed chain (n, 2) points lie at most so far apart, from 0 at its start, (parts,)."""
    longest = float(np.linalg.norm(np.roll(chain, -1, axis=0) - chain, axis=1).max())
    parts = max(1, math.ceil(longest / spacing))
    return np.arange(parts) / parts


def _between(chain: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """The points at ``shares`` of the edges of a closed chain (n, 2), edge by edge, (n parts, 2)."""
    along = np.roll(chain, -1, axis=0) - chain
    return (chain[:, None] + shares[:, None] * along[:, None]).reshape(-1, 2)


def _between_transposed(slopes: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Derivatives by the chain from those by the points."""
    slopes = slopes.reshape(-1, len(shares), 2)
    by_end = (shares[:, None] * slopes).sum(axis=1)
    return slopes.sum(axis=1) - by_end + np.roll(by_end, 1, axis=0)


def _to_chain(
    points: np.ndarray, chain: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Signed distances of ``points`` (n, 2) from a closed chain (m, 2), the nearest edges, and derivatives, (n, 2).

    Those are by the point, and by the start and the end of its edge.
    """
    n, m = len(points), len(chain)
    node, edge = (places.ravel() for places in np.mgrid[:n, :m])
    distances, parts = from_edges(points[node], chain[edge], np.roll(chain, -1, axis=0)[edge])
    nearest = np.argmin(distances.reshape(n, m), axis=1)
    rows, sign = np.arange(n) * m + nearest, np.where(are_inside(chain, points), -1.0, 1.0)
    by_node, by_start, by_end = (sign[:, None] * part[rows] for part in parts)
    return sign * distances[rows], nearest, (by_node, by_start, by_end)


class _ToObstacle(_Gap):
    """Those of the nodes of a link to an obstacle."""

    def __init__(self, model: MechanismModel, gap: LeastGap) -> None:
        assert isinstance(gap.other, Obstacle), "of a link and an obstacle"
        super().__init__(model, gap, [gap.link])
        self._gap, self._numbers = smooth_gap(gap.other, 2), np.array([gap.other.numbers])

    def _gaps(self):
        at = self._outlines[0].loaded(), self._numbers
        gradient = self._gap.gradient(*at)[:, 0]
        return self._gap.value(*at)[:, 0], lambda shares: [shares[:, None] * gradient]
