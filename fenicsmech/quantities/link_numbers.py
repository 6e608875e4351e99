"""Numbers of flexible links: numbers of their law, their depth, and changes of their temperature.

All are fields with one value per cell in the energy E, whose derivative with respect to the value on one link is a
form,

    xᵀ ∂F/∂p = ∂(r · û)/∂p,     r = ∂E/∂u,     û = ∂u/∂y · x.

In space the depth b is part of the rest shape: links are stretched along z from the middle of their depth,

    d_z = (b / b₀ − 1) (Z − Z_m).

The field of the temperature is the excess length α ΔT.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np

from fenicsmech.compat import cell_dofs
from fenicsmech.effects import Temperature
from fenicsmech.errors import DescriptionError, expect, finite, set_fields
from fenicsmech.mechanism import FlexibleLink, Material, Scene, Units
from fenicsmech.model import MechanismModel
from fenicsmech.quantities.number import ModelNumber, NumberKind


class _OfLinks(NumberKind):
    """A number of flexible links."""

    parts: tuple[FlexibleLink, ...]

    def __init__(self, *parts: FlexibleLink) -> None:
        for part in parts:
            expect(self.what, part, FlexibleLink, "a flexible link")
        super().__init__(*parts)

    @staticmethod
    def candidates(scene: Scene) -> Sequence[FlexibleLink]:
        return scene.mechanism.flexible_links

    def chosen(self, model: MechanismModel) -> np.ndarray:
        """Which flexible links have it, (links,)."""
        return np.array([link in self.parts for link in model.mechanism.flexible_links])


@dataclass(frozen=True, init=False)
class Depth(_OfLinks):
    """The depth of flexible links: ``Depth(finger)``; in space they are stretched across their plane.

    Args:
        parts: a flexible link, or several that share it.

    Raises:
        DescriptionError: there are no links, or one is given twice.
    """

    what = "depth"

    @property
    def reshaped(self):
        return self.parts

    def described(self, part):
        return part.shape.depth

    def unit(self, units):
        return units.length

    def on(self, model):
        chosen = self.chosen(model)
        return _Depth(model, chosen, self.shared(compress(model.depths, chosen)))


@dataclass(frozen=True, init=False)
class LawParameter(_OfLinks):
    """A number of the law of flexible links: ``LawParameter("E", finger)``.

    Args:
        parameter: its name, as in ``law.constants``.
        parts: a flexible link, or several that share it.

    Raises:
        DescriptionError: there are no links, or one is given twice.
    """

    parameter: str = ""
    what = "parameter"

    def __init__(self, parameter: str, *parts: FlexibleLink) -> None:
        if not isinstance(parameter, str):
            raise DescriptionError(
                self.what, f"{parameter!r} is not the name of a number", "Name it first, as in (“E”, link)"
            )
        set_fields(self, parameter=parameter)
        super().__init__(*parts)

    @property
    def name(self):
        return f"{self.parameter} of {' and '.join(repr(link.name) for link in self.parts)}"

    @property
    def slots(self):
        return tuple((*slot, self.parameter) for slot in super().slots)

    @property
    def words(self):
        return (self.parameter, *super().words)

    @classmethod
    def read(cls, scene, words):
        return cls(words[0], *(cls._part(scene, word) for word in words[1:]))

    def described(self, part):
        return self._of(part.material)

    def _of(self, material: Material) -> float:
        law, known = material.law, material.law.constants
        if self.parameter in known:
            return known[self.parameter]
        problem, remedy = f"the law of {material.name!r} has no such number", f"It has {', '.join(known)}"
        if self.parameter in law.parameters:
            problem = f"it is a coordinate of a direction of the law of {material.name!r}, which has unit length"
            remedy = f"Turn the direction by simulation.with_material(…); the numbers of the law are {', '.join(known)}"
        raise DescriptionError(self.name, problem, remedy)

    def check_value(self, value):
        value = finite(self.name, value)
        for link in self.parts:
            law = link.material.law
            replace(law.with_parameters({**law.parameters, self.parameter: value}))  # runs its checks

    def unit(self, units: Units) -> str:
        return units.stress if self.parts[0].material.law.is_modulus(self.parameter) else ""

    def on(self, model):
        chosen = self.chosen(model)
        drawn = self.shared(map(self._of, compress(model.materials, chosen)))
        return _LawParameter(model, self.parameter, chosen, drawn)


@dataclass(frozen=True, init=False)
class TemperatureChange(NumberKind):
    """The change of temperature of flexible links: ``TemperatureChange(warm)``; K.

    Args:
        parts: a ``Temperature`` of the scene, or several that share the change.

    Raises:
        DescriptionError: there are none, or one is given twice.
    """

    what = "change of temperature"
    parts: tuple[Temperature, ...]

    @staticmethod
    def candidates(scene: Scene) -> Sequence[Temperature]:
        return [effect for effect in scene.effects if isinstance(effect, Temperature)]

    @staticmethod
    def label(part):
        if not isinstance(part, Temperature):
            return repr(part)
        return "all links" if part.links is None else ", ".join(link.name for link in part.links)

    def described(self, part):
        return self.shared(part.change if isinstance(part.change, tuple) else [part.change])

    def unit(self, units):
        return "K"

    def check_value(self, value):
        value = finite(self.name, value)
        # those of effects on all links are not known without a mechanism
        for link in (link for effect in self.parts for link in effect.changes(())):
            Temperature.check_change(link, value)

    def on(self, model):
        return _TemperatureChange(model, self.parts, self.described(self.parts[0]))


class _TemperatureChange(ModelNumber):
    """The change of temperature of the links of some effects."""

    def __init__(self, model: MechanismModel, effects: Sequence[Temperature], drawn: float) -> None:
        self._growth, links = model.elastic.growth, model.mechanism.flexible_links
        warm = {link for effect in effects for link in effect.changes(links)}
        self._expansions = {k: link.material.expansion for k, link in enumerate(links) if link in warm}
        self.drawn = self.value = drawn

    def set(self, value):
        self.value = value
        for link, expansion in self._expansions.items():
            self._growth.stretch(Temperature.__name__, link, expansion * value)

    def slope(self, terms):
        by_link = terms.by_link(Temperature.__name__)
        return float(sum(expansion * by_link[link] for link, expansion in self._expansions.items()))


class _LawParameter(ModelNumber):
    """A number of the laws of the ``chosen`` links."""

    def __init__(self, model: MechanismModel, name: str, chosen: np.ndarray, drawn: float) -> None:
        self._model, self._name, self._chosen = model, name, chosen
        self.drawn = self.value = drawn

    def set(self, value):
        self.value = value
        self._model.set_parameter(self._chosen, self._name, value)

    def slope(self, terms):
        return float(terms.by_link(self._name)[self._chosen].sum())


class _Depth(ModelNumber):
    """The depth of the ``chosen`` links."""

    def __init__(self, model: MechanismModel, chosen: np.ndarray, drawn: float) -> None:
        self._model, self._chosen = model, chosen
        self.drawn = self.value = drawn
        self.rate = (self._heights() / self.drawn).ravel()

    def set(self, value):
        self.value = value
        self._model.set_depth(self._chosen, value)

    def slope(self, terms):
        return float(terms.by_link("depth")[self._chosen].sum())

    def _heights(self) -> np.ndarray:
        """Z − Z_m of the nodes of the chosen links in space, else zero, as the design field, (nodes, dim)."""
        elastic, mesh = self._model.elastic, self._model.mesh
        space, dim = elastic.shape.function_space, elastic.model.dim
        nodes = space.tabulate_dof_coordinates()[:, :dim] + elastic.drawn_shape.reshape(-1, dim)
        owner, heights = np.full(len(nodes), -1), np.zeros((len(nodes), dim))
        owner[cell_dofs(space)] = mesh.link[:, None]
        for link in np.flatnonzero(self._chosen) if dim == 3 else ():
            across = nodes[owner == link, 2]
            ends = mesh.comm.allgather((across.min(initial=np.inf), across.max(initial=-np.inf)))
            middle = 0.0 if elastic.model.half else 0.5 * (min(low for low, _ in ends) + max(high for _, high in ends))
            heights[owner == link, 2] = across - middle
        return heights
