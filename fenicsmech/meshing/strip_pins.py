"""How a pin sits in a strip: the size of its disc and of its eye, and the narrow places beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fenicsmech.mechanism import Disc
from fenicsmech.meshing.centreline import Centreline
from fenicsmech.meshing.interface_site import InterfaceSite
from fenicsmech.meshing.sizing import circle_segments, gap_refinement

ON_CENTRELINE = 1e-3  # of the thickness: what rounded coordinates may deviate
_MOST_SNAPPED = 0.02  # of the half thickness


@dataclass(frozen=True)
class StripPin:
    """A pin in a strip, in units of the element size.

    Attributes:
        site: the site, moved onto the centreline, and its disc to the strip's sides, if they miss by a hair.
        half: half the strip's thickness.
        inward: unit vector along the strip, away from its nearer end, shape (2,).
        station: parameter of the centreline's point nearest to the pin.
        offset: how far the pin lies left of the centreline.
        to_end: distance from the nearer end of the centreline.
    """

    site: InterfaceSite
    half: float
    inward: np.ndarray
    station: float
    offset: float
    to_end: float

    @classmethod
    def place(cls, site: InterfaceSite, centreline: Centreline, thickness: float) -> StripPin:
        """The pin at ``site``, which has a disc, in the strip along ``centreline``."""
        half, at = 0.5 * thickness, np.asarray(site.at[:2])
        ends = {end: centreline.evaluate(end) for end in (0.0, centreline.end)}
        nearer = min(ends, key=lambda end: np.linalg.norm(at - ends[end]))
        s = nearer if np.linalg.norm(at - ends[nearer]) <= ON_CENTRELINE * thickness else centreline.closest(at)
        foot, normal = centreline.evaluate(s), centreline.normal(s)
        offset = float((at - foot) @ normal)
        if abs(offset) <= ON_CENTRELINE * thickness:
            at, offset = foot, 0.0
        inward = centreline.tangent(s) * (1.0 if nearer == 0.0 else -1.0)
        placed = replace(site, at=(*at.tolist(), *site.at[2:]), region=Disc(_snapped(site.region.radius, half)))
        return cls(placed, half, inward, s, offset, float(np.linalg.norm(at - ends[nearer])))

    @property
    def radius(self) -> float:
        """Radius of the disc that the pin holds."""
        return self.site.region.radius

    @property
    def corners(self) -> tuple[float, ...]:
        """Angles (rad) at which the disc's outline has vertices.

        Where the disc touches the sides, so that they share a vertex there; only towards the end if it crosses them.
        """
        outward = math.atan2(-self.inward[1], -self.inward[0])
        return (
            (outward,) if self.radius > self.half else tuple(outward + quarter * 0.5 * math.pi for quarter in range(4))
        )

    @property
    def touches_sides(self) -> bool:
        """Whether the disc, or an eye as wide as the strip, may touch the strip's sides along the way."""
        return self.radius <= self.half and self.offset == 0.0

    @property
    def rounds_end(self) -> bool:
        """Whether the eye is the round end of the strip, no wider than the strip."""
        return self.radius <= self.half and self.to_end == 0.0

    @property
    def eye(self) -> InterfaceSite | None:
        """The disc that the eye adds to the strip, if it adds any besides a round end."""
        inside = self.offset == 0.0 and self.to_end >= self.half
        if self.radius <= self.half and (self.rounds_end or inside):
            return None
        return replace(self.site, region=Disc(max(self.radius, self.half)))

    @property
    def refinements(self) -> list[str]:
        """Element sizes, as gmsh expressions, for the narrow places between the disc and the link's edge."""
        around_eye, beside = self.half - self.radius, self.half - abs(self.offset) - self.radius
        both_ways = (self.inward, -self.inward)
        gaps = [(around_eye, ())] if self.eye else []
        gaps += [(beside, both_ways[:1] if self.rounds_end else both_ways)]
        at = self.site.at[:2]
        return [gap_refinement(at, gap, self.radius, widening) for gap, widening in gaps if gap > 0.0]


def _snapped(radius: float, half: float) -> float:
    """``half``, if the polygon that stands for the circle cannot tell the two radii apart, else ``radius``.

    A chord's height is r (1 − cos(π/n)): what is thinner than that is no place for an element.
    """
    height = radius * (1.0 - math.cos(math.pi / circle_segments(radius, 1.0)))
    return half if abs(radius - half) <= min(height, _MOST_SNAPPED * half) else radius
