"""Where the error of a rung comes from.

With v the value of the rung, v* that of the same rung with Newton's tolerance at its tightest, f₀ the limit of its
model as meshes are refined, and r the reference, the limit in space:

    v − r  =  (f₀ − r)  +  (v* − f₀)  +  (v − v*)
              modelling    discretisation  algebraic
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fenicsmech.accuracy.extrapolation import Limit
from fenicsmech.accuracy.measurement import Measurement


@dataclass(frozen=True)
class ErrorSplit:
    """Parts of v − r, in the unit of the quantity and with their signs.

    Attributes:
        modelling: of the assumption on the third dimension, or that links are rigid.
        discretisation: of mesh, order and quadrature.
        algebraic: of Newton's tolerance.
    """

    modelling: float
    discretisation: float
    algebraic: float

    @property
    def total(self) -> float:
        """v − r."""
        return self.modelling + self.discretisation + self.algebraic

    @property
    def magnitude(self) -> float:
        """The parts added by magnitude: what is left if none of them happens to cancel another."""
        return abs(self.modelling) + abs(self.discretisation) + abs(self.algebraic)


def split_error(
    measurement: Measurement, measurements: Sequence[Measurement], *, own: Limit, reference: Limit
) -> ErrorSplit:
    """The parts of a rung's error.

    Args:
        measurement: the rung, with a value.
        measurements: the ladder, where the same rung with a tighter tolerance is looked for.
        own: limit of the rung's model.
        reference: limit in space.
    """
    converged = _tightest(measurement, measurements)
    return ErrorSplit(
        modelling=own.value - reference.value,
        discretisation=converged - own.value,
        algebraic=measurement.value - converged,
    )


def _tightest(measurement: Measurement, measurements: Sequence[Measurement]) -> float:
    """The value of the same rung at the tightest tolerance of the ladder."""
    rung = measurement.rung
    same = [m for m in measurements if m.value is not None and replace(m.rung, tolerance=rung.tolerance) == rung]
    return min([measurement, *same], key=lambda m: m.rung.tolerance).value
