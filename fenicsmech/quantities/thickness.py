"""The least thickness of a link at rest, measured across its outline.

    t = min |X_i − Y_j|,     Y_j the point nearest to X_i on the edge j

over the nodes X_i and the edges of the outline that face them through the link. Which do is decided as drawn: the
nearest point lies inwards, within 60° of the normal, and the way to it along the outline is at least twice as long.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.errors import DescriptionError, expect, positive, set_fields
from fenicsmech.mechanism import FlexibleLink
from fenicsmech.meshing import FREE
from fenicsmech.model import MechanismModel
from fenicsmech.polygons import chord_lengths
from fenicsmech.quantities.outlines import SHARPNESS, LinkOutline, from_edges, smooth_maximum
from fenicsmech.quantities.quantity import Partial, Quantity, RestObservable

_AWAY = 3.0  # of the drawn distance to the nearest edge across: those farther away stay farther


@dataclass(frozen=True)
class LeastThickness(Quantity):
    """The least thickness of a flexible link in its plane, at rest: ``Target(LeastThickness(leg), at_least=2.0)``.

    Parts that one interface holds keep theirs and do not count; holes do not either.

    Attributes:
        link: the link.
        sharpness: ρ of the smooth minimum that optimisers see (``outlines``), with the drawn mean thickness for s.

    Raises:
        DescriptionError: this is not a flexible link, or the sharpness is not positive; later: no sides face each
            other.
    """

    link: FlexibleLink
    sharpness: float = SHARPNESS
    of_state = False
    smoothed = True

    def __post_init__(self) -> None:
        expect("least thickness", self.link, FlexibleLink, "a flexible link", "Give a flexible link of the mechanism")
        set_fields(self, sharpness=positive(f"sharpness of the {self.name}", self.sharpness))

    @property
    def name(self):
        return f"least thickness of {self.link.name!r}"

    def unit(self, units):
        return units.length

    def on(self, model):
        return _Thickness(model, self)


class _Thickness(RestObservable):
    """The smooth minimum over pairs of nodes and edges."""

    def __init__(self, model: MechanismModel, thickness: LeastThickness) -> None:
        self._outline = outline = LinkOutline(model, thickness.link, thickness.name)
        self._sharpness = thickness.sharpness
        self._nodes, self._edges = _facing(outline)
        if not len(self._nodes):
            raise DescriptionError(
                thickness.name, "no two sides of its outline face each other", "Mesh the link with smaller elements"
            )

    def value(self):
        return -self._smooth(self._distances()[0])[0]

    def slope(self):
        distances, slopes = self._distances()
        shares = self._smooth(distances)[1][:, None]
        by_place, after = np.zeros_like(self._outline.drawn), (self._edges + 1) % len(self._outline.drawn)
        for places, part in zip((self._nodes, self._edges, after), slopes, strict=True):
            np.add.at(by_place, places, shares * part)
        return Partial(design=self._outline.by_design(by_place))

    def smoothing_errors(self, state):
        distances, _ = self._distances()
        return np.array([distances.min() + self._smooth(distances)[0]])

    def _smooth(self, distances: np.ndarray) -> tuple[float, np.ndarray]:
        return smooth_maximum(-distances, self._outline.width, self._sharpness)

    def _distances(self) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
        X = self._outline.rest()
        return from_edges(X[self._nodes], X[self._edges], np.roll(X, -1, axis=0)[self._edges])


def _facing(outline: LinkOutline) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and edges, by the node at which these begin, that face each other through the link, both (pairs,)."""
    X, body = outline.drawn, outline.body
    count, after = len(X), np.roll(X, -1, axis=0)
    along = after - np.roll(X, 1, axis=0)
    inwards = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    node, edge = (places.ravel() for places in np.mgrid[:count, :count])
    distance, (away, _, _) = from_edges(X[node], X[edge], after[edge])
    arc = chord_lengths(np.vstack([X, X[:1]]))
    ways = np.abs(arc[[edge, edge + 1]] - arc[node])
    way = np.minimum(ways, arc[-1] - ways).min(axis=0)
    rigid = (body[node] != FREE) & (body[node] == body[edge]) & (body[node] == np.roll(body, -1)[edge])
    across = -np.sum(away * inwards[node], axis=1) >= 0.5
    facing = across & (way >= 2.0 * distance) & ~rigid & (distance > 0.0)
    nearest = np.full(count, np.inf)
    np.minimum.at(nearest, node[facing], distance[facing])
    facing &= distance <= _AWAY * nearest[node]
    return node[facing], edge[facing]
