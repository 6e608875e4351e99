"""Numbers that may change within bounds, and their place among the parameters of a design.

Optimisers see each number in units of the interval between its bounds,

    value = least + q (most − least),     0 < q < 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.errors import DescriptionError, finite, set_fields
from fenicsmech.mechanism import Units
from fenicsmech.model import MechanismModel, check_numbers
from fenicsmech.quantities import Gradient, NumberKind

TYPICAL = 0.1
"""Typical change ℓ of a number over the interval between its bounds."""


@dataclass(frozen=True)
class Number:
    """A number of parts that may change: ``Number(Depth(finger), 2.0, 6.0)``.

    Attributes:
        kind: which number of which parts.
        least, most: its bounds, in its own unit; the drawn value lies between them.

    Raises:
        DescriptionError: it is not a kind of number, or the bounds are not finite and in order.
    """

    kind: NumberKind
    least: float
    most: float

    def __post_init__(self) -> None:
        least, most = (finite(f"bound of the {self.kind}", value) for value in (self.least, self.most))
        check_numbers([(self.kind, (least, most))])
        if not least < most:
            raise DescriptionError(
                str(self.kind), f"bounds from {least:g} to {most:g}", "Give the smaller one first, then a larger one"
            )
        set_fields(self, least=least, most=most)

    def __str__(self) -> str:
        return str(self.kind)


@dataclass(frozen=True)
class NumberDesign:
    """A number as designed.

    Attributes:
        name: in words.
        kind, words: its kind and parts, as plain data.
        value: of the design.
        drawn: as described.
        bounds: least and largest value.
        unit: of the values.
    """

    name: str
    kind: str
    words: tuple[str, ...]
    value: float
    drawn: float
    bounds: tuple[float, float]
    unit: str

    @property
    def scaled(self) -> float:
        """In units of the interval between its bounds, from the lower one."""
        least, most = self.bounds
        return (self.value - least) / (most - least)

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.name}: {self.value:.6g}{unit}, drawn with {self.drawn:.6g}{unit}"


class ScaledNumbers:
    """The numbers of a design on one model, as functions of their parameters q.

    Args:
        model: whose parts change.
        numbers: which of their numbers.

    Attributes:
        on_model: the same on the model.
        initial: q of the drawn values, (numbers,).
        width: most − least, (numbers,).

    Raises:
        DescriptionError: a drawn value is not between its bounds.
    """

    def __init__(self, model: MechanismModel, numbers: Sequence[Number]) -> None:
        self.numbers = tuple(numbers)
        self.on_model = [model.number(own.kind) for own in self.numbers]
        self._least = np.array([own.least for own in self.numbers])
        self.width = np.array([own.most for own in self.numbers]) - self._least
        for own, there in zip(self.numbers, self.on_model, strict=True):
            if not own.least < there.drawn < own.most:
                raise DescriptionError(
                    str(own),
                    f"{there.drawn:g} is drawn, not between {own.least:g} and {own.most:g}",
                    "Widen its bounds",
                )
        self.initial = self.scaled([there.drawn for there in self.on_model])

    def scaled(self, values: Sequence[float]) -> np.ndarray:
        """q of some values, (numbers,)."""
        return (np.array(values, dtype=float) - self._least) / self.width

    def values(self, q: np.ndarray) -> dict[NumberKind, float]:
        """The values of q, by kind."""
        found = self._least + q * self.width
        return {own.kind: value for own, value in zip(self.numbers, found.tolist(), strict=True)}

    def slopes(self, gradients: Sequence[Gradient]) -> np.ndarray:
        """dQ/dq of some components, (components, numbers)."""
        return np.array([own.numbers for own in gradients]).reshape(len(gradients), len(self.numbers)) * self.width

    def designs(self, q: np.ndarray, units: Units) -> tuple[NumberDesign, ...]:
        """The numbers at q, as results hold them."""
        return tuple(
            NumberDesign(
                name=str(own),
                kind=type(own.kind).__name__,
                words=own.kind.words,
                value=value,
                drawn=there.drawn,
                bounds=(own.least, own.most),
                unit=own.kind.unit(units),
            )
            for own, there, value in zip(self.numbers, self.on_model, self.values(q).values(), strict=True)
        )
