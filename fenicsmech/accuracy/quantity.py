"""Quantities of interest: a number read from one equilibrium of a mechanism."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from fenicsmech.checks import finite
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import DRAWN, Configuration, Force, Units
from fenicsmech.simulation import Frame


class Quantity(Protocol):
    """A number read from the equilibrium under one load.

    Attributes:
        force_part: the force that grows from zero.
        load: its magnitude.
        configuration: motor positions.
        name: in words, for plots and tables.
        rigid_value: the number if no link bends.
    """

    @property
    def force_part(self) -> Force: ...

    @property
    def load(self) -> float: ...

    @property
    def configuration(self) -> Configuration: ...

    @property
    def name(self) -> str: ...

    @property
    def rigid_value(self) -> float: ...

    def unit(self, units: Units) -> str:
        """The unit of the number."""

    def read(self, frame: Frame) -> float:
        """The number in an equilibrium."""


@dataclass(frozen=True)
class Displacement:
    """Displacement of a force's point along the force.

    Attributes:
        force_part: the force.
        load: its magnitude, not zero.
        configuration: motor positions.

    Raises:
        DescriptionError: the load is zero or not finite.
    """

    force_part: Force
    load: float
    configuration: Configuration = DRAWN

    def __post_init__(self) -> None:
        part = f"load of {self.force_part.name!r}"
        object.__setattr__(self, "load", finite(part, self.load))
        if self.load == 0.0:
            raise DescriptionError(part, "it is zero: nothing would move", "Give another magnitude")

    @property
    def name(self) -> str:
        return f"displacement of {self.force_part.name!r}"

    @property
    def rigid_value(self) -> float:
        return 0.0

    def unit(self, units: Units) -> str:
        return units.length

    def read(self, frame: Frame) -> float:
        return frame.displacement
