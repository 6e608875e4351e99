"""Materials: a name and a law with its numbers."""

from __future__ import annotations

from dataclasses import dataclass

from fenicsmech.errors import DescriptionError
from fenicsmech.laws import Law, NeoHookean, elastic_constants


@dataclass(frozen=True, init=False)
class Material:
    """A hyperelastic material: ``Material("PLA", 2000.0, 0.35)`` or ``Material("rubber", law=Yeoh(…))``.

    Args:
        name: for messages.
        E, nu: Young's modulus (force per area) and Poisson's ratio of the law ``NeoHookean(E, nu)``.
        law: any law, instead of E and nu.

    Raises:
        DescriptionError: E ≤ 0, ν outside (−1, 0.5), or not numbers; a law and numbers are given, or neither.
    """

    name: str
    law: Law

    def __init__(self, name: str, E: float | None = None, nu: float | None = None, *, law: Law | None = None) -> None:
        part = f"material {name!r}"
        if law is None:
            law = NeoHookean(*elastic_constants(part, E, nu))
        elif E is not None or nu is not None:
            raise DescriptionError(part, "it has a law and numbers", f"Give them to the law, {type(law).__name__}(…)")
        if not isinstance(law, Law):
            raise DescriptionError(part, f"its law is {law!r}", "Give a law with its numbers, as NeoHookean(E, nu)")
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "law", law)


ONYX = Material("Onyx", 1770.0, 0.42)
"""Carbon-filled nylon, MPa; modulus fitted by the authors of the method (section VII-B)."""

SMOOTH_SIL_950 = Material("Smooth-Sil 950", 1.90, 0.475)
"""Platinum-cure silicone, MPa; constants used by the authors of the method (section VII-B)."""
