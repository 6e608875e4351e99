"""Units of a scene: their names, and what numbers in SI are in them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fenicsmech.errors import DescriptionError

POUND_FORCE, INCH = 4.4482216152605, 0.0254  # N, m
PSI = POUND_FORCE / INCH**2  # Pa

LENGTHS = {"m": 1.0, "cm": 1e2, "mm": 1e3, "µm": 1e6, "um": 1e6, "in": 1.0 / INCH}  # in a metre
FORCES = {"N": 1.0, "mN": 1e3, "kN": 1e-3, "lbf": 1.0 / POUND_FORCE}  # in a newton
STRESSES = {"Pa": 1.0, "kPa": 1e-3, "MPa": 1e-6, "N/mm²": 1e-6, "GPa": 1e-9, "psi": 1.0 / PSI}  # in a pascal


@dataclass(frozen=True)
class Units:
    """Names of a consistent set of units, stress in force over length squared; time is in seconds.

    Labels of plots and tables show them as they are. Numbers are converted only where a material comes from a card.
    """

    length: str = "mm"
    force: str = "N"
    stress: str = "MPa"

    def __str__(self) -> str:
        return f"{self.length}, {self.force}, {self.stress}"

    def stress_of(self, pascals: float) -> float:
        """A stress given in Pa, in these units. *Local.*

        Raises:
            DescriptionError: a name is not that of a known unit, or the stress is not the force over length squared.
        """
        per_metre, per_newton = self._scales()
        return pascals * per_newton / per_metre**2

    def density_of(self, kilograms: float) -> float:
        """A density given in kg/m³, in these units: force · s² / length⁴, with mm and N in t/mm³. *Local.*

        Raises:
            DescriptionError: as ``stress_of``.
        """
        per_metre, per_newton = self._scales()
        return kilograms * per_newton / per_metre**4

    def _scales(self) -> tuple[float, float]:
        """Units of length in a metre, units of force in a newton."""
        part = f"units {self}"
        for name, known in ((self.length, LENGTHS), (self.force, FORCES), (self.stress, STRESSES)):
            if name not in known:
                raise DescriptionError(part, f"{name!r} cannot be converted", f"Use one of {', '.join(known)}")
        per_metre, per_newton = LENGTHS[self.length], FORCES[self.force]
        if not math.isclose(STRESSES[self.stress], per_newton / per_metre**2, rel_tol=1e-9):
            problem = f"{self.stress} is not {self.force}/{self.length}²"
            raise DescriptionError(part, problem, "Give consistent units, such as mm, N, MPa or m, N, Pa")
        return per_metre, per_newton


MILLIMETRES = Units()
"""mm, N and MPa, the units of scenes unless given."""
