"""Strength of a material as plain data; nothing is computed from it here.

With the ultimate stress σ_u and the line of Basquin (1910) a cycle of amplitude σ_a about the mean σ_m fails after N
cycles, the mean stress as Goodman (1899) takes it:

    σ_a / (1 − σ_m / σ_u) = σ_f′ (2 N)^b.

Elastomers are limited by the greatest strain they bear, ``ultimate_strain``.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

from fenicsmech.errors import DescriptionError, expect, finite, positive, set_fields


@dataclass(frozen=True)
class Basquin:
    """The line σ_a = σ_f′ (2 N)^b of fully reversed stress over N cycles to failure.

    Attributes:
        coefficient: σ_f′, force per area.
        exponent: b, between −1 and 0.

    Raises:
        DescriptionError: σ_f′ is not positive, or b is not between −1 and 0.
    """

    coefficient: float
    exponent: float

    def __post_init__(self) -> None:
        coefficient = positive("coefficient of Basquin's line", self.coefficient)
        exponent = finite("exponent of Basquin's line", self.exponent)
        if not -1.0 < exponent < 0.0:
            remedy = "Give b, a number between −1 and 0, with σ_f′ at one reversal"
            raise DescriptionError("exponent of Basquin's line", f"it is {exponent:g}", remedy)
        set_fields(self, coefficient=coefficient, exponent=exponent)


@dataclass(frozen=True)
class Strength:
    """What a material bears; None where nothing is known. Stresses and strains are nominal.

    Attributes:
        yield_stress: at yield of plastics, at 0.2 % plastic strain of metals; force per area.
        ultimate_stress: the greatest in a tension test; force per area.
        yield_strain: at the yield stress of plastics.
        ultimate_strain: at break.
        fatigue: fully reversed stress over cycles.
        endurance_stress: amplitude of fully reversed stress that is borne without failure; force per area.

    Raises:
        DescriptionError: a number is not positive, or ``fatigue`` is not a ``Basquin``.
    """

    yield_stress: float | None = None
    ultimate_stress: float | None = None
    yield_strain: float | None = None
    ultimate_strain: float | None = None
    fatigue: Basquin | None = None
    endurance_stress: float | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name == "fatigue":
                expect("fatigue of a strength", value, Basquin | None, "a line of Basquin", "Give Basquin(σ_f′, b)")
            elif value is not None:
                set_fields(self, **{field.name: positive(f"{field.name} of a strength", value)})
