"""Strength of a material: what it bears once, and how often.

With the ultimate stress σ_u and the line of Basquin (1910) a cycle of amplitude σ_a about the mean σ_m fails after N
cycles, the mean stress as Goodman (1899) takes it:

    σ_a / (1 − σ_m / σ_u) = σ_ar = σ_f′ (2 N)^b.

A mean stress below zero, which lengthens lives, counts as zero.

Source: N. E. Dowling, Mechanical Behavior of Materials, section 9.7.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

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
class Allowable:
    """The limit that a factor of safety compares with.

    Attributes:
        name: as "yield stress".
        value: force per area, or a strain.
        is_strain: whether it is one.
    """

    name: str
    value: float
    is_strain: bool


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

    @property
    def allowable(self) -> Allowable | None:
        """The yield stress, or else the yield strain, the strain at break or the ultimate stress; None if unknown.

        The strain at break comes before the ultimate stress: materials without yield point that stretch far, as
        elastomers, break at a true stress far above the nominal one.
        """
        for name in ("yield_stress", "yield_strain", "ultimate_strain", "ultimate_stress"):
            if (value := getattr(self, name)) is not None:
                return Allowable(name.replace("_", " "), value, name.endswith("strain"))
        return None

    @property
    def missing_for_life(self) -> str:
        """What ``cycles`` needs and is not known; empty if nothing."""
        missing = [] if self.ultimate_stress is not None else ["ultimate stress (ultimate_stress=…)"]
        if self.fatigue is None and self.endurance_stress is None:
            missing.append("line of Basquin (fatigue=Basquin(σ_f′, b)) or endurance limit (endurance_stress=…)")
        return " and ".join(missing)

    def reversed_amplitude(self, amplitude: np.ndarray, mean: np.ndarray) -> np.ndarray:
        """σ_ar of cycles of an ``amplitude`` about a ``mean`` stress, any shape; infinite from σ_m = σ_u on.

        Needs the ultimate stress.
        """
        assert self.ultimate_stress is not None, "it is needed"
        factor, _ = goodman(mean, self.ultimate_stress)
        # also without an amplitude
        return np.multiply(amplitude, factor, out=np.full(np.shape(factor), np.inf), where=np.isfinite(factor))

    def cycles(self, amplitude: np.ndarray, mean: np.ndarray) -> np.ndarray:
        """Cycles N to failure of an ``amplitude`` about a ``mean`` stress, any shape.

        Infinite up to the endurance limit; above it nan if no line of Basquin is known. Needs what
        ``missing_for_life`` names.
        """
        reversed_ = self.reversed_amplitude(np.asarray(amplitude, dtype=float), np.asarray(mean, dtype=float))
        cycles = np.full(reversed_.shape, np.nan)
        if (line := self.fatigue) is not None:
            with np.errstate(divide="ignore"):  # no amplitude: infinite
                cycles = 0.5 * (reversed_ / line.coefficient) ** (1.0 / line.exponent)
        return np.where(reversed_ <= (self.endurance_stress or 0.0), np.inf, cycles)


def goodman(mean: np.ndarray, ultimate: np.ndarray | float, *, least: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """σ_ar / σ_a at a ``mean`` stress, any shape, and its derivative by it; infinite from σ_m = σ_u on.

    Args:
        mean: σ_m.
        ultimate: σ_u.
        least: where 1 − σ_m / σ_u is below it, the line goes on along its tangent.
    """
    rest = 1.0 - np.maximum(mean, 0.0) / ultimate
    held = np.maximum(rest, least)
    safe = np.where(held > 0.0, held, 1.0)
    factor = np.where(held > 0.0, 1.0 / safe + (held - rest) / safe**2, np.inf)
    slope = np.where(held > 0.0, 1.0 / (safe**2 * ultimate), np.inf)
    return factor, np.where(np.asarray(mean) > 0.0, slope, 0.0)
