"""Hard cases and their findings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.mechanism import Force, Output

PLANE, SPACE = "plane-stress", "3d"
BOTH = (PLANE, SPACE)


@dataclass(frozen=True)
class Deviation:
    """Deviation of ``what`` from its known value, relative to its size; NaN does not hold."""

    what: str
    value: float
    bound: float

    @property
    def holds(self) -> bool:
        return bool(self.value <= self.bound)

    def __str__(self) -> str:
        return f"{self.what} within {self.value:.0e} (≤ {self.bound:.0e})"


@dataclass(frozen=True)
class Fact:
    """Something that is so, or should be."""

    what: str
    holds: bool

    def __str__(self) -> str:
        return self.what if self.holds else f"NOT: {self.what}"


Check = Deviation | Fact


def deviation(what: str, found, wanted, bound: float, *, scale: float | None = None) -> Deviation:
    """The largest difference between ``found`` and ``wanted`` (numbers or arrays), over the largest ``wanted``.

    Args:
        what: the measured quantity, in words.
        bound: what the difference may be.
        scale: what to divide by instead.
    """
    found, wanted = np.asarray(found, dtype=float), np.asarray(wanted, dtype=float)
    size = float(np.max(np.abs(wanted))) if scale is None else scale
    return Deviation(what, float(np.max(np.abs(found - wanted))) / size, bound)


def travel(simulation: fm.Simulation, part: Force | Output, frame: fm.Frame) -> float:
    """Displacement of the point of a force or output along its direction from the drawn place (collective)."""
    simulation.model.load(frame.state)
    return simulation.model.travel(part, frame.state)


@dataclass(frozen=True)
class HardCase:
    """A named scene and what is known about it.

    Attributes:
        name: unique.
        hard: what makes it hard.
        run: what is found out in one of ``spaces`` on a communicator (collective).
        spaces: elastic models it makes sense in.
        slow: takes more than ten seconds.
    """

    name: str
    hard: str
    run: Callable[[str, MPI.Comm], Iterator[Check]]
    spaces: tuple[str, ...] = BOTH
    slow: bool = False
