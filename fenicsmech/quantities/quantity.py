"""Quantities Q(y, p) of an equilibrium: numbers or vectors with their derivatives.

    y = (u, p, z, λ, f) the unknowns of the equilibrium,      p the design field d and numbers of parts

A ``Quantity`` is described as plain data. ``on`` a model it is an ``Observable``, which gives the values of a state
and the partial derivatives of each component; the adjoint in ``sensitivity`` turns them into total derivatives. A new
quantity is one subclass of each.

Derived quantities follow by the chain rule: ``Component`` of a vector along a direction, and its ``Magnitude``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from types import MappingProxyType
from typing import ClassVar

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import assemble_vector, compile_form, owned_values
from fenicsmech.equilibrium import EquilibriumSystem, State
from fenicsmech.errors import DescriptionError, direction, expect, in_plane, point_text, set_fields
from fenicsmech.mechanism import (
    FlexibleLink,
    Force,
    Joint,
    Material,
    MaterialPoint,
    Motor,
    Output,
    RigidLink,
    Scene,
    Units,
    in_dimension,
)
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import JointChange
from fenicsmech.quantities.sample import Sample


@dataclass(frozen=True, eq=False)
class Partial:
    """Partial derivatives of one component, everything else held; 0 where there are none.

    Attributes:
        links: by this rank's displacements and pressures of all nodes, (owned dofs,).
        border: by poses, multipliers and the controlled force, the same on all ranks, (border,).
        design: by this rank's owned values of the design field, flat.
        per_link: by numbers of links, by their names in ``ElasticBody.numbers``, (links,).
        by_places: pairs of a factor and a function, which gives the derivative from changes of joints by index of the
            connection; they add up.
    """

    links: np.ndarray | float = 0.0
    border: np.ndarray | float = 0.0
    design: np.ndarray | float = 0.0
    per_link: Mapping[str, np.ndarray] = field(default_factory=lambda: MappingProxyType({}))
    by_places: tuple[tuple[float, Callable[[Mapping[int, JointChange]], float]], ...] = ()

    @property
    def of_state(self) -> bool:
        """Whether the component depends on the state."""
        return isinstance(self.links, np.ndarray) or isinstance(self.border, np.ndarray)

    def __mul__(self, factor: float) -> Partial:
        per_link = {name: np.multiply(factor, values) for name, values in self.per_link.items()}
        border, design = factor * self.border, factor * self.design
        by_places = tuple((factor * own, rate) for own, rate in self.by_places)
        return Partial(factor * self.links, border, design, per_link, by_places)

    __rmul__ = __mul__

    def __add__(self, other: Partial) -> Partial:
        names = dict.fromkeys((*self.per_link, *other.per_link))
        per_link = {name: np.add(self.per_link.get(name, 0.0), other.per_link.get(name, 0.0)) for name in names}
        border, design = self.border + other.border, self.design + other.design
        return Partial(self.links + other.links, border, design, per_link, self.by_places + other.by_places)


class Observable(ABC):
    """A quantity on one model; the model holds the state in question.

    Attributes:
        size: number of its components.
        on_link: whether its value in the unloaded configuration changes with the design.
    """

    size: int = 1
    on_link: bool = False

    @abstractmethod
    def values(self, state: State) -> np.ndarray:
        """Q, the same on all ranks, (size,)."""

    @abstractmethod
    def partials(self, system: EquilibriumSystem, state: State) -> list[Partial]:
        """The derivatives of each component at a state of ``system``."""

    def holding(self, other: State) -> Observable:
        """The quantity of two states as one of either of them, ``other`` held."""
        raise NotImplementedError(f"{type(self).__name__} is of one state")

    def smoothing_errors(self, state: State | None) -> np.ndarray:
        """What the true extreme adds to each value where that is a smooth one in its place, (size,); 0 by default."""
        return np.zeros(self.size)


class RestObservable(Observable):
    """A quantity of the links at rest on one model; it has one component."""

    @abstractmethod
    def value(self) -> float:
        """Q at the design that the model holds."""

    @abstractmethod
    def slope(self) -> Partial:
        """The derivatives with respect to the design."""

    def values(self, state):
        return np.array([self.value()])

    def partials(self, system, state):
        return [self.slope()]


@dataclass(frozen=True)
class Quantity(ABC):
    """A number or a vector that belongs to an equilibrium, or to the links at rest; a frozen dataclass.

    Attributes:
        of_state: whether it depends on an equilibrium; those that do not need no sample.
        from_unloaded: whether it counts from the unloaded configuration.
        smoothed: whether its observable has smooth values in place of those of an extreme, and knows the difference.
        resolution: relative change of an extreme that is within the accuracy to which it is known.
    """

    of_state: ClassVar[bool] = True
    from_unloaded: ClassVar[bool] = False
    smoothed: ClassVar[bool] = False
    resolution: ClassVar[float] = 0.0

    @property
    @abstractmethod
    def name(self) -> str:
        """The quantity in words, for messages and tables."""

    @abstractmethod
    def unit(self, units: Units) -> str:
        """Its unit."""

    @abstractmethod
    def on(self, model: MechanismModel) -> Observable:
        """The quantity of one model."""

    @property
    def material_points(self) -> tuple[MaterialPoint, ...]:
        """The points of links that it refers to by their drawn places; none by default."""
        return ()

    @property
    def since(self) -> Sample | None:
        """A second sample that it depends on, in the same way, as a cycle between two does; None by default."""
        return None

    def of_part(self, links: Collection[FlexibleLink]) -> bool:
        """Whether parts that are known by their outline alone, in place of ``links``, have it; by default they do."""
        return True

    def size(self, dim: int) -> int:
        """Number of its components in ``dim`` dimensions; 1 by default."""
        return 1

    def reduce(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) made of those of the observable, (n,), and their derivatives, (m, n); the same by default."""
        return values, np.eye(len(values))

    def check(self, scene: Scene, dim: int) -> None:
        """Checks that the quantity exists in ``scene`` in ``dim`` dimensions; by default, that its parts do.

        Raises:
            DescriptionError: it does not.
        """
        mechanism = scene.mechanism
        parts = (*mechanism.links, *mechanism.joints, *mechanism.motors, *mechanism.forces, *mechanism.outputs)
        for own in fields(self):
            given = getattr(self, own.name)
            for part in given if isinstance(given, tuple) else (given,):
                if isinstance(part, RigidLink | FlexibleLink | Joint | Motor | Force | Output) and part not in parts:
                    raise DescriptionError(
                        self.name, f"{part.name!r} is not a part of {mechanism.name!r}", "Name one of its parts"
                    )
                if isinstance(part, Quantity):
                    part.check(scene, dim)

    def check_materials(self, materials: Mapping[FlexibleLink, Material]) -> None:  # noqa: B027  # a hook
        """Checks that the materials of all flexible links have what the quantity needs; by default they do.

        Raises:
            DescriptionError: they do not.
        """

    def __str__(self) -> str:
        return self.name


class _OfVector(Quantity):
    """A number made of a vector."""

    vector: Quantity

    @property
    def of_state(self):  # type: ignore[override]
        return self.vector.of_state

    @property
    def from_unloaded(self):  # type: ignore[override]
        return self.vector.from_unloaded

    @property
    def material_points(self):
        return self.vector.material_points

    def of_part(self, links):
        return self.vector.of_part(links)

    def unit(self, units):
        return self.vector.unit(units)

    def __post_init__(self) -> None:
        expect(
            type(self).__name__.lower(),
            self.vector,
            Quantity,
            "a quantity",
            "Give a vector, as Displacement(link, at=…)",
        )

    def check_materials(self, materials):
        self.vector.check_materials(materials)

    def check(self, scene, dim):
        super().check(scene, dim)
        if self.vector.size(dim) == 1:
            raise DescriptionError(self.name, f"the {self.vector} is a number in {dim} dimensions", "Use it as it is")

    def on(self, model):
        return self.vector.on(model)


@dataclass(frozen=True)
class Component(_OfVector):
    """The component of a vector along a direction.

    Attributes:
        vector: the quantity.
        direction: any length; 2 or 3 coordinates.

    Raises:
        DescriptionError: this is not a quantity, or the direction has no length.
    """

    vector: Quantity
    direction: tuple[float, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        set_fields(self, direction=direction(f"direction of the {self.vector}", self.direction))

    @property
    def name(self):
        return f"{self.vector} along {point_text(self.direction)}"

    def check(self, scene, dim):
        super().check(scene, dim)
        in_plane(f"direction of the {self.vector}", self.direction, dim)

    def reduce(self, values):
        along = np.array(in_dimension(self.direction, len(values)))
        return np.array([along @ values]), along[None]


@dataclass(frozen=True)
class Magnitude(_OfVector):
    """The length of a vector.

    Attributes:
        vector: the quantity.

    Raises:
        DescriptionError: this is not a quantity.
    """

    vector: Quantity

    @property
    def name(self):
        return f"magnitude of the {self.vector}"

    def reduce(self, values):
        length = float(np.linalg.norm(values))
        return np.array([length]), (values / length if length > 0.0 else np.zeros(len(values)))[None]


def border_of(system: EquilibriumSystem, **blocks: tuple[Sequence[int] | np.ndarray, np.ndarray | float]) -> np.ndarray:
    """∂Q/∂(z, λ, f) from places and values of its blocks ``poses``, ``multipliers`` and ``load``, (border,)."""
    border = np.zeros(system.blocks.border.size)
    parts = system.blocks.restrict_border(border)
    for name, (places, values) in blocks.items():
        getattr(parts, name)[places] += values
    return border


class FormValue:
    """A form at the fields that the model holds, and its derivatives with respect to them, compiled when first needed.

    Args:
        model: whose links it is integrated over.
        form: a scalar.
        fields: by name, with respect to which it is differentiated.
    """

    def __init__(self, model: MechanismModel, form: ufl.Form, fields: Mapping[str, fem.Function]) -> None:
        self._model, self._form, self._fields = model, form, dict(fields)
        self._slopes: dict[str, tuple] = {}

    def value(self) -> float:
        """The value on the whole mesh."""
        return float(self._model.mesh.comm.allreduce(fem.assemble_scalar(self._compiled)))

    def slope(self, name: str) -> np.ndarray:
        """The derivative with respect to a field, this rank's owned values, flat; zeros if there is none."""
        if self._fields[name] not in self._form.coefficients():
            return np.zeros(len(owned_values(self._fields[name])))
        if name not in self._slopes:
            field = self._fields[name]
            with self._model.clock.phase("compile"):
                form = compile_form(ufl.derivative(self._form, field))
            self._slopes[name] = form, fem.Function(field.function_space)
        with self._model.clock.phase("adjoint"):
            return assemble_vector(*self._slopes[name]).copy()

    def per_link(self, name: str) -> np.ndarray:
        """The derivative with respect to the value of a field of cells on each flexible link, (links,)."""
        cells, links = self.slope(name), len(self._model.mechanism.flexible_links)
        sums = np.bincount(self._model.mesh.link[: len(cells)], weights=cells, minlength=links)
        return self._model.mesh.comm.allreduce(sums, op=MPI.SUM)

    @cached_property
    def _compiled(self):
        return compile_form(self._form)
