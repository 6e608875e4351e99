"""The u–p (mixed) formulation: links of nearly incompressible material whose pressure is an unknown.

Displacements alone lock as ν goes to 0.5. In such links the energy W(F) of the law is replaced by its Π(F, p), see
``SplitLaw``, a minimum in u and a maximum in the pressure p. With p continuous and one degree lower than u
(Taylor–Hood), the elements do not lock. Source: Boffi, Brezzi & Fortin
(doi:10.1007/978-3-642-36519-5) for the elements.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh

from fenicsmech.compat import add_ghosts, cell_dofs, owned_values, scalar_space
from fenicsmech.elasticity.models import ElasticModel
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import Material

LOCKING = 0.49
"""ν above which quadratic displacements alone are too stiff (measured, tests/elasticity/test_locking.py)."""


class Formulation(ABC):
    """Treatment of links of nearly incompressible material."""

    @abstractmethod
    def mixed(self, materials: Sequence[Material], model: ElasticModel, order: int) -> tuple[bool, ...]:
        """Whether links of ``materials`` are in the u–p formulation, at displacements of degree ``order``.

        Raises:
            DescriptionError: the law of one that should be has no u–p form.
        """


@dataclass(frozen=True)
class DisplacementFormulation(Formulation):
    """Displacements alone, whatever Poisson's ratio is."""

    def mixed(self, materials, model, order):
        return (False,) * len(materials)


@dataclass(frozen=True)
class MixedFormulation(Formulation):
    """Displacement and pressure in links whose Poisson's ratio is above a limit, displacements alone in all others.

    In plane stress, where depths adjust to keep the volume, and for order 1, which has no stable partner for its
    displacements, displacements are alone.

    Attributes:
        above: the limit, at least 0: a pressure needs resistance to changes of volume.

    Raises:
        DescriptionError: the limit is not in [0, 0.5).
    """

    above: float = LOCKING

    def __post_init__(self) -> None:
        if not 0.0 <= self.above < 0.5:
            raise DescriptionError(
                "mixed formulation", f"its limit of Poisson's ratio is {self.above!r}", "Give one from 0 to below 0.5"
            )

    def mixed(self, materials, model, order):
        found = tuple(model.confined and order > 1 and material.law.nu > self.above for material in materials)
        for material, mixed in zip(materials, found, strict=True):
            if mixed and not material.law.has_mixed_energy:
                raise DescriptionError(
                    f"material {material.name!r}",
                    f"ν = {material.law.nu:g} asks for the u–p formulation, and its law "
                    f"{type(material.law).__name__} has no mixed_energy",
                    "Derive the law from SplitLaw, or use formulation=DisplacementFormulation()",
                )
        return found


class PressureField:
    """p, and which of its nodes are unknowns: not those that only touch cells in which it does not act.

    Args:
        mesh: reference mesh.
        degree: of p.
        cells: local cells in which p acts.

    Attributes:
        p: the field, zero where it does not act.
        unknown: whether each owned node is an unknown, (owned,).
        count: number of unknowns on all ranks.
    """

    def __init__(self, mesh: dmesh.Mesh, degree: int, cells: np.ndarray) -> None:
        V = scalar_space(mesh, degree)
        self.p = fem.Function(V, name="pressure")
        marker = fem.Function(V)
        marker.x.array[cell_dofs(V)[cells]] = 1.0
        # a node may touch such a cell only on another rank
        add_ghosts(marker)
        self.unknown = owned_values(marker) > 0.0
        self.count = int(mesh.comm.allreduce(int(self.unknown.sum())))
