"""The stretch out of the plane in plane stress: e = F₃₃² − 1 such that S₃₃ = 0, per material law."""

from __future__ import annotations

from functools import singledispatch

from ufl.core.expr import Expr

from fenicsmech.elasticity.strain import Moduli
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import EnergyLaw, NeoHookean


@singledispatch
def transverse_strain(law: EnergyLaw, in_plane: Expr, moduli: Moduli) -> Expr:
    """e from ``in_plane`` = J₂ − 1. Register a function for laws with a closed form.

    Raises:
        DescriptionError: the law has none.
    """
    raise DescriptionError(
        f"material law {type(law).__name__}",
        "its plane-stress stretch has no closed form",
        "Use the law NeoHookean(), or plane strain or 3D",
    )


@transverse_strain.register
def _(law: NeoHookean, in_plane: Expr, moduli: Moduli) -> Expr:
    """F₃₃² = (μ + λ/2) / (μ + λ/2 J₂²), so e = −(λ/2) j₂ (2 + j₂) / (μ + λ/2 J₂²)."""
    half = moduli.lam / 2
    return -half * in_plane * (2 + in_plane) / (moduli.mu + half * (1 + in_plane) ** 2)
