"""The limit of a sequence of meshes by Richardson extrapolation, and how well it is known.

With element sizes h₁ < h₂ < h₃ and values f₁, f₂, f₃, the model f = f₀ + c hᵖ gives the observed order p from

    (f₃ − f₂) / (f₂ − f₁) = (h₃ᵖ − h₂ᵖ) / (h₂ᵖ − h₁ᵖ),

and with an order q that is trusted the limit

    f₀ = f₁ + (f₁ − f₂) / ((h₂ / h₁)^q − 1).

Sources: Roache, J. Fluids Eng. 116 (1994), doi:10.1115/1.2910291; Celik et al., J. Fluids Eng. 130 (2008),
doi:10.1115/1.2960953; Oberkampf & Roy, Verification and Validation in Scientific Computing (2010), chapter 8; Eça &
Hoekstra, J. Comput. Phys. 262 (2014), doi:10.1016/j.jcp.2014.01.006, on sequences that do not converge evenly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from fenicsmech.errors import DescriptionError

FORMAL_ORDER = 2.0
"""Highest order that is trusted: cells have straight sides, so pins and curved links are resolved as h²."""

_LEAST_ORDER, _LARGEST_ORDER = 0.5, 6.0  # of sequences taken for even: displacements of P3 converge with 2·3 at best
_SEARCHED = 12.0  # highest order that is looked for
_SAFETY, _DOUBT = 1.25, 3.0  # on the correction of an even sequence; on anything else
_APART = 1.2  # least ratio of sizes between meshes that are compared


@dataclass(frozen=True)
class Limit:
    """The limit of a sequence of meshes.

    Attributes:
        value: f₀.
        uncertainty: half the width of the interval around it, from safety factors of the literature.
        order: observed; None if the sequence shows none.
        levels: meshes used, at most three.
    """

    value: float
    uncertainty: float
    order: float | None
    levels: int


def extrapolate(sizes: Sequence[float], values: Sequence[float], *, formal: float = FORMAL_ORDER) -> Limit | None:
    """The limit of ``values`` as the element size goes to zero.

    The three finest meshes count whose sizes are at least a fifth apart. An even sequence, whose order is between a
    half and 6, is extrapolated with that order, ``formal`` at most, and the uncertainty is 1.25 times the correction.
    Two meshes are extrapolated with ``formal``, and three times the correction. Other values are not extrapolated:
    the limit is the finest one, and the uncertainty three times the last change if they seem to settle faster than
    any element does, three times the largest change if they oscillate or do not settle.

    Args:
        sizes: element sizes in any unit and order, (n,).
        values: (n,).
        formal: largest order to be trusted.

    Returns:
        the limit; None if there are no two meshes to compare.

    Raises:
        DescriptionError: the numbers do not pair, or a size is not positive.
    """
    if len(sizes) != len(values) or not all(size > 0.0 for size in sizes):
        raise DescriptionError(
            "extrapolation", f"sizes {list(sizes)} for {len(values)} values", "Give one positive size per value"
        )
    chosen: list[tuple[float, float]] = []
    for h, f in sorted(zip(map(float, sizes), map(float, values), strict=True)):
        if len(chosen) < 3 and (not chosen or h >= _APART * chosen[-1][0]):
            chosen.append((h, f))
    if len(chosen) < 2:
        return None
    h, f = np.array(chosen).T
    h = h / h[0]
    if len(h) == 2:
        correction = _correction(h, f, formal)
        return Limit(float(f[0] + correction), _DOUBT * abs(correction), None, 2)
    order = _observed_order(h, f)
    if order is None or order < _LEAST_ORDER:
        return Limit(float(f[0]), _DOUBT * float(np.abs(np.diff(f)).max()), order, 3)
    if order > _LARGEST_ORDER:
        return Limit(float(f[0]), _DOUBT * float(abs(f[1] - f[0])), order, 3)
    correction = _correction(h, f, min(order, formal))
    return Limit(float(f[0] + correction), _SAFETY * abs(correction), order, 3)


def _correction(h: np.ndarray, f: np.ndarray, order: float) -> float:
    return float((f[0] - f[1]) / ((h[1] / h[0]) ** order - 1.0))


def _observed_order(h: np.ndarray, f: np.ndarray) -> float | None:
    """p of three meshes, h₁ = 1; None if they oscillate, grow apart, or have settled to the last digit."""
    near, far = f[1] - f[0], f[2] - f[1]
    if near == 0.0 or far / near <= 0.0:
        return None
    ratio = far / near

    def excess(p: float) -> float:
        return (h[2] ** p - h[1] ** p) / (h[1] ** p - 1.0) - ratio

    lowest = 1e-3
    if excess(lowest) >= 0.0:
        return None
    return _SEARCHED if excess(_SEARCHED) <= 0.0 else float(brentq(excess, lowest, _SEARCHED))
