"""Numbers that scenes are drawn with: decades, materials, and the force that bends a link."""

from __future__ import annotations

import math
from random import Random

from .blueprint import LinkPlan

MATERIALS = ((2e5, 0.3), (1770.0, 0.42), (1.9, 0.475), (0.2, 0.49))  # steel, nylon, two silicones
INCOMPRESSIBLE = (0.4, 0.497)
LAWS = ("NeoHookean", "LogarithmicNeoHookean", "IsochoricNeoHookean", "IsochoricSimoNeoHookean")


def decade(rng: Random, low: float, high: float) -> float:
    """A number from 10^low to 10^high, evenly by its logarithm."""
    return 10.0 ** rng.uniform(low, high)


def length(link: LinkPlan) -> float:
    """Of the polygon through the points of a centreline."""
    return sum(math.dist(a, b) for a, b in zip(link.centreline, link.centreline[1:], strict=False))


def bending_force(link: LinkPlan) -> float:
    """EI/ℓ², a force that bends the link a good way."""
    return link.young * link.depth * link.thickness**3 / 12.0 / length(link) ** 2
