"""Forces at points of flexible links: their own displacement grows without limit as elements shrink.

Next to a force F at a point of an elastic body the displacement is that of Flamant's (in the plane) or Boussinesq's (in
space) problem, at the distance r

    u ≈ 2 F / (π E′ b) ln(1/r),     u ≈ (1 − ν²) F / (π E r),

E′ = E in plane stress, E / (1 − ν²) in plane strain, b the depth. Elements of size h resolve it down to r ~ h: each
halving of h adds

    2 ln 2 F / (π E′ b)  in the plane,     about F / (E h)  in space.

At points inside a link it is less than half of this in the plane, and nothing in interfaces, which are rigid. Source:
Johnson, Contact Mechanics (1985), sections 2.2 and 3.2.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from fenicsmech.elasticity import PLANE_STRAIN, ElasticModel
from fenicsmech.mechanism import FlexibleLink, Force, ForceGroup, PrescribedPart
from fenicsmech.model import MechanismModel, plan_sites


def growth_by_halving(
    part: PrescribedPart, model: MechanismModel, sizes: Mapping[FlexibleLink, float], kind: ElasticModel | None = None
) -> float:
    """Largest growth of the displacement of ``part`` per force when all elements of some ``sizes`` are halved.

    0 if no force acts at a point of a flexible link outside its interfaces. ``kind`` is that of the model by default.
    """
    kind, total = kind or model.elastic.model, 0.0
    for force, link, ratio in _at_points(part):
        at = np.array([force.at[:2]])
        if any(site.contains(at, 0.0)[0] for site in plan_sites(model.linkage, link)):
            continue
        index = model.mechanism.flexible_links.index(link)
        law = model.materials[index].law
        if kind.dim == 3:
            compliance = 1.0 / (law.E * sizes[link])
        else:
            modulus = law.E / (1.0 - law.nu**2) if kind is PLANE_STRAIN else law.E
            compliance = 2.0 * math.log(2.0) / (math.pi * modulus * model.depths[index])
        total += ratio**2 * compliance
    return total


def cause_of_growth(part: PrescribedPart) -> str:
    """The forces of ``part`` at points of flexible links, and the remedy, in one sentence; empty if there are none."""
    found = [f"{force.name!r} acts at a point of flexible link {link.name!r}" for force, link, _ in _at_points(part)]
    if not found:
        return ""
    return (
        f"{' and '.join(found)}: its displacement grows without limit as elements shrink; "
        "spread it with region=…, as fm.Disc(radius) or fm.Face()"
    )


def _at_points(part: PrescribedPart) -> Iterator[tuple[Force, FlexibleLink, float]]:
    if isinstance(part, Force | ForceGroup):
        for force, ratio in part.ratios:
            if isinstance(force.on, FlexibleLink) and force.region is None:
                yield force, force.on, ratio
