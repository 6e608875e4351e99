"""Which links have the pressure as an unknown of their own beside the displacement."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from fenicsmech.elasticity.models import ElasticModel
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import Material

LOCKING = 0.49
"""ν above which quadratic displacements alone are too stiff (measured, tests/elasticity/test_locking.py)."""


class Formulation(ABC):
    """How links of nearly incompressible material are treated."""

    @abstractmethod
    def with_pressure(self, materials: Sequence[Material], model: ElasticModel, order: int) -> tuple[bool, ...]:
        """Whether links of ``materials`` have a pressure of their own, at displacements of degree ``order``."""


@dataclass(frozen=True)
class Displacement(Formulation):
    """Displacements alone, whatever Poisson's ratio is."""

    def with_pressure(self, materials, model, order):
        return (False,) * len(materials)


@dataclass(frozen=True)
class Mixed(Formulation):
    """Displacement and pressure in links whose Poisson's ratio is above a limit, displacements alone in all others.

    In plane stress, where depths adjust to keep the volume, and for order 1, which has no stable partner for its
    displacements, displacements are alone.

    Attributes:
        above: the limit, at least 0: there is no pressure without resistance to changes of volume.

    Raises:
        DescriptionError: the limit is not in [0, 0.5).
    """

    above: float = LOCKING

    def __post_init__(self) -> None:
        if not 0.0 <= self.above < 0.5:
            raise DescriptionError(
                "mixed formulation", f"its limit of Poisson's ratio is {self.above!r}", "Give one from 0 to below 0.5"
            )

    def with_pressure(self, materials, model, order):
        able = model.confined and order > 1
        return tuple(able and material.poissons_ratio > self.above for material in materials)
