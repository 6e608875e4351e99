"""What a material law is: the strain energy W(F) per volume of the undeformed material, and nothing else.

A law is a frozen dataclass whose fields are its parameters, numbers or tuples of numbers, and whose ``energy`` is
written in them as in a textbook:

    @dataclass(frozen=True)
    class Biderman(Law):
        C1: float
        C2: float
        bulk: float

        def energy(self, strain):
            i = strain.J ** (-2 / 3) * strain.I1 - 3
            return self.C1 * i + self.C2 * i**2 + self.bulk / 2 * strain.j**2

        E = property(lambda self: 18 * self.C1 * self.bulk / (3 * self.bulk + 2 * self.C1))
        nu = property(lambda self: (3 * self.bulk - 4 * self.C1) / (6 * self.bulk + 4 * self.C1))

Nothing else is needed: stress and stiffness follow by differentiation, plane stress by a local solve. A law may add
closed forms: ``mixed_energy``, the u–p (mixed) form for nearly incompressible materials, and ``contraction``, the
thickness in plane stress.

In forms the parameters are fields with one value per cell, so that links of one law share compiled code, and parameters
change without compiling. There ``energy`` is called on a copy of the law whose parameters are UFL expressions.

Energies are written in j = J − 1, s = tr FᵀF − 3 − 2 j and remainders such as φ(j) = j − ln(1 + j), so that no digits
are lost at small strain.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import Field, fields
from typing import Any, ClassVar

from ufl.core.expr import Expr

from fenicsmech.errors import DescriptionError, set_fields
from fenicsmech.laws.strain import Strain


class Law(ABC):
    """A strain energy and its parameters; derive a frozen dataclass from it.

    Attributes:
        E: Young's modulus at small strain, a parameter or a property that follows from the parameters. Of an
            anisotropic law a typical value, on which the energy of links does not depend, but the choice of the u–p
            formulation, the stiffness of contact, and part of what is estimated of plane stress (see
            ``E_across_plane``), of forces at points and of bending out of the plane do.
        nu: Poisson's ratio at small strain, likewise.
        moduli: names of its fields that are force per area.
        directions: names of its fields that are directions, whose coordinates do not change one by one.
        stable: whether it is known to be stable at any strain, see ``stability``.
    """

    E: float | Expr
    nu: float | Expr
    moduli: ClassVar[tuple[str, ...]] = ("E",)
    directions: ClassVar[tuple[str, ...]] = ()
    stable: ClassVar[bool] = False
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]  # of the derived class

    @abstractmethod
    def energy(self, strain: Strain) -> Expr:
        """W per volume of the undeformed material; NaN or infinite where J ≤ 0."""

    def mixed_energy(self, strain: Strain, p: Expr) -> Expr:
        """Π(F, p), stationary in the pressure p where it equals W, with terms that stay bounded as ν goes to 0.5.

        Raises:
            DescriptionError: the law has no such form.
        """
        problem = "it has no u–p form (mixed_energy), which nearly incompressible links need"
        remedy = "Derive it from SplitLaw, or use formulation=DisplacementFormulation()"
        raise DescriptionError(f"law {type(self).__name__}", problem, remedy)

    def contraction(self, H: Expr) -> Expr | None:
        """F₃₃ − 1 in plane stress from the gradient H in the plane, 2 × 2; None if there is no closed form."""
        return None

    @property
    def E_across_plane(self) -> Expr | float:
        """Young's modulus at small strain along z, across links in the plane."""
        return self.E

    @property
    def axes(self) -> tuple[tuple[float, ...], ...]:
        """Directions of symmetry of the undeformed material, unit vectors normal to each other, 3 × 3."""
        return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)

    @property
    def has_mixed_energy(self) -> bool:
        """Whether the law has a u–p form."""
        return type(self).mixed_energy is not Law.mixed_energy

    @property
    def parameters(self) -> dict[str, float]:
        """Every number of the law by name; those of a tuple are numbered: alpha0, alpha1, …"""
        return self._numbers([field.name for field in fields(self)])

    @property
    def constants(self) -> dict[str, float]:
        """The ``parameters`` but for the coordinates of directions."""
        return self._numbers([field.name for field in fields(self) if field.name not in self.directions])

    def is_modulus(self, parameter: str) -> bool:
        """Whether a parameter is force per area."""
        return parameter in self._numbers([field.name for field in fields(self) if field.name in self.moduli])

    def _numbers(self, names: Iterable[str]) -> dict[str, float]:
        """The parameters in the fields of these ``names``."""
        found: dict[str, float] = {}
        for name in names:
            value = getattr(self, name)
            counted = [(f"{name}{k}", v) for k, v in enumerate(value)] if isinstance(value, tuple) else None
            found |= dict(counted or [(name, value)])
        return found

    def with_parameters(self, values: Mapping[str, Expr | float]) -> Law:
        """The law with other ``parameters``, which may be UFL expressions and are not checked."""
        law = copy(self)
        for field in fields(self):
            own = getattr(self, field.name)
            counted = tuple(values[f"{field.name}{k}"] for k in range(len(own))) if isinstance(own, tuple) else None
            set_fields(law, **{field.name: values[field.name] if counted is None else counted})
        return law
