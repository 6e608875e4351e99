"""Numbers p of parts, which designs change in addition to shapes.

A ``NumberKind`` is described as plain data: ``Depth(finger)``, or ``Depth(left, right)`` for parts that share a value.
``on`` a model it is a ``ModelNumber``, which sets the value there and gives the derivative of a component Q of a
quantity from its adjoint x, the same one that derivatives by the shape are made of:

    dQ/dp = ∂Q/∂p − xᵀ ∂F/∂p + dQ/dd · ∂d/∂p

with the equations F and the design field d, which is linear in p if it depends on it. A new kind is one subclass of
each. Numbers of effects have theirs, ``EffectNumber``: an effect enters F by the energy Π of links with û = ∂u/∂y · x,
and by potentials V of poses, with the poses' part ẑ of x, which count with a factor σ,

    xᵀ ∂F/∂p = ∂(∂Π/∂u · û)/∂p + ẑ · σ ∂²V/∂z∂p.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fenicsmech.equilibrium import Adjoint
from fenicsmech.errors import DescriptionError, positive, set_fields
from fenicsmech.mechanism import Configuration, Effect, FlexibleLink, Joint, Scene, Units
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import JointChange, JointSystem
from fenicsmech.quantities.quantity import Partial


@dataclass(frozen=True, eq=False)
class NumberTerms:
    """The derivatives of one component that those by numbers are made of.

    Attributes:
        partial: everything but the number held.
        adjoint: x; None if the component does not depend on the state.
        by_link: ∂Q/∂p − xᵀ ∂F/∂p of a number of every flexible link by its name among ``ElasticBody.numbers``,
            (links,); zeros of names that are not among them.
    """

    partial: Partial
    adjoint: Adjoint | None
    by_link: Callable[[str], np.ndarray]

    def work(self, joints: JointSystem, bodies: Sequence[int], rates: np.ndarray) -> float:
        """ẑ · ``rates`` of forces on the poses of ``bodies``, (bodies · pose_size,); 0 of fixed ones."""
        assert self.adjoint is not None, "the component depends on the state"
        each = zip(bodies, rates.reshape(len(bodies), -1), strict=True)
        return sum(float(self.adjoint.poses[joints.columns[k]] @ rate) for k, rate in each if k in joints.columns)


class ModelNumber(ABC):
    """A number on one model.

    Attributes:
        drawn: its value as described.
        value: its present value.
        rate: ∂d/∂p of the design field, this rank's values with ghosts, flat; zero by default.
    """

    drawn: float
    value: float
    rate: np.ndarray | float = 0.0

    @abstractmethod
    def set(self, value: float) -> None:
        """Gives the parts the value, all but the design field. Local."""

    @abstractmethod
    def slope(self, terms: NumberTerms) -> float:
        """∂Q/∂p − xᵀ ∂F/∂p."""

    def through_field(self, design: np.ndarray) -> float:
        """dQ/dd · ∂d/∂p on this rank, from its owned values of dQ/dd, flat. Local."""
        return float(design @ self.rate[: len(design)]) if isinstance(self.rate, np.ndarray) else 0.0


class EffectNumber(ModelNumber):
    """A number of effects: one of their fields on links (``LinkFields.number``), of potentials (``numbers``), or both.

    Args:
        model: with the effects.
        effects: of its scene.
        name: of the number, in fields and potentials, and of the effects' attribute.

    Raises:
        DescriptionError: the effects' fields and potentials have no such number, or a field another value than the
            attribute.
    """

    def __init__(self, model: MechanismModel, effects: Sequence[Effect], name: str) -> None:
        self._elastic, self._link, self._name = model.elastic, model.mesh.link, name
        self._joints = model.linkage.joints
        self._potentials = [
            own
            for effect, found in model.effect_potentials
            if effect in effects
            for own in found
            if name in own.numbers
        ]
        self._fields: list[tuple[str, np.ndarray]] = []
        for effect, fields in model.effect_fields:
            if effect in effects and name in fields.numbers:
                known, chosen, value = fields.numbers[name]
                if value != getattr(effect, name):
                    raise DescriptionError(
                        f"{name} of {effect}",
                        f"its field on links has the value {value:g}, and the effect {getattr(effect, name):g}",
                        "Give fields.number(…) the attribute, and keep factors outside the field",
                    )
                self._fields.append((known, chosen))
        if not self._potentials and not self._fields:
            raise DescriptionError(
                f"{name} of {effects[0]}",
                "neither a field on links nor a potential has such a number",
                "Make it one by fields.number(…) in link_energy, or name it in the potential's numbers",
            )
        self.drawn = self.value = getattr(effects[0], name)

    def set(self, value):
        self.value = value
        for potential in self._potentials:
            potential.numbers[self._name] = value
        for known, chosen in self._fields:
            self._elastic.numbers[known].x.array[np.flatnonzero(chosen[self._link])] = value

    def slope(self, terms: NumberTerms) -> float:
        total = sum(float(terms.by_link(known)[chosen].sum()) for known, chosen in self._fields)
        if terms.adjoint is not None:
            state = terms.adjoint.at.state
            for own in self._potentials:
                rates = own.gradient_by(self._name, state.poses)
                total -= own.factor(state.load_factor) * terms.work(self._joints, own.bodies, rates)
        return total


@dataclass(frozen=True, init=False)
class NumberKind(ABC):
    """A kind of number, of one part or of several that share its value; a frozen dataclass.

    Args:
        parts: of the scene; their numbers are drawn alike.

    Raises:
        DescriptionError: there are no parts, or one is given twice.
    """

    what: ClassVar[str]
    parts: tuple[Any, ...]

    def __init__(self, *parts: Any) -> None:
        if not parts:
            raise DescriptionError(self.what, "no part is named", "Name one part, or several that share the number")
        if len(set(map(id, parts))) < len(parts):
            raise DescriptionError(self.what, f"{self.label(parts[0])!r} is given twice", "Give each part once")
        set_fields(self, parts=tuple(parts))

    @staticmethod
    @abstractmethod
    def candidates(scene: Scene) -> Sequence[Any]:
        """The parts of a scene that have such a number."""

    @abstractmethod
    def described(self, part: Any) -> float:
        """The number of a part as described."""

    @abstractmethod
    def unit(self, units: Units) -> str:
        """Its unit."""

    @abstractmethod
    def on(self, model: MechanismModel) -> ModelNumber:
        """The number on one model."""

    @staticmethod
    def label(part: Any) -> str:
        """The name of a part, by which results find it."""
        return getattr(part, "name", repr(part))

    @property
    def name(self) -> str:
        """The number in words."""
        return f"{self.what} of {' and '.join(repr(self.label(part)) for part in self.parts)}"

    @property
    def slots(self) -> tuple[Hashable, ...]:
        """What it changes; two kinds that change the same contradict each other."""
        return tuple((type(self), part) for part in self.parts)

    @property
    def words(self) -> tuple[str, ...]:
        """Plain data from which ``read`` makes the kind again: names of the parts by default."""
        return tuple(self.label(part) for part in self.parts)

    @classmethod
    def kinds(cls) -> list[type[NumberKind]]:
        """All kinds derived from this one, of the package and of others that are imported."""
        own = cls.__subclasses__()
        return own + [found for kind in own for found in kind.kinds()]

    @classmethod
    def read(cls, scene: Scene, words: Sequence[str]) -> NumberKind:
        """The kind with the ``words``, of parts of a scene.

        Raises:
            DescriptionError: the scene has no such part.
        """
        return cls(*(cls._part(scene, word) for word in words))

    @property
    def reshaped(self) -> Sequence[FlexibleLink]:
        """Flexible links whose solids change with the number; none by default."""
        return ()

    def changes(self, dim: int) -> Mapping[Joint, JointChange]:
        """Changes of the places of joints by a unit of the number, in ``dim`` dimensions; none by default."""
        return {}

    def moves_unloaded(self, configuration: Configuration) -> bool:
        """Whether the unloaded configuration, from which displacements count, moves with it; not by default."""
        return False

    def check_value(self, value: float) -> None:
        """Refuses an invalid value with a DescriptionError; by default one that is not positive."""
        positive(self.name, value)

    def check(self, scene: Scene, dim: int) -> None:
        """Checks that the number exists in ``scene`` in ``dim`` dimensions.

        Raises:
            DescriptionError: a part is not one of the scene or not the only one of its name there, or they are drawn
                with different numbers.
        """
        candidates = self.candidates(scene)
        for part in self.parts:
            if part not in candidates:
                has = ", ".join(repr(self.label(other)) for other in candidates) or "nothing of this kind"
                raise DescriptionError(
                    self.name, f"{part!r} of {scene.mechanism.name!r} has none", f"The scene has {has}"
                )
            # results find parts by their labels
            alike = [self.label(other) for other in candidates].count(self.label(part))
            if alike > 1:
                raise DescriptionError(self.name, f"the scene has {alike} parts of that name", "Describe them as one")
        self.shared([self.described(part) for part in self.parts])

    def shared(self, values: Iterable[float]) -> float:
        """The one of ``values`` of the parts, which are drawn alike.

        Raises:
            DescriptionError: they are not.
        """
        first, *others = sorted(set(values))
        if others:
            raise DescriptionError(
                self.name,
                f"they are drawn with {', '.join(f'{v:g}' for v in (first, *others))}",
                "Draw parts alike that share it",
            )
        return first

    @classmethod
    def _part(cls, scene: Scene, word: str) -> Any:
        for part in cls.candidates(scene):
            if cls.label(part) == word:
                return part
        raise DescriptionError(
            f"{cls.what} of {word!r}",
            f"{scene.mechanism.name!r} has no such part",
            "Give a scene of the same mechanism",
        )

    def __str__(self) -> str:
        return self.name


def joint_changes(values: Mapping[NumberKind, float], dim: int) -> dict[Joint, JointChange]:
    """Total changes of the places of joints by numbers with some ``values``, in ``dim`` dimensions."""
    found: dict[Joint, JointChange] = {}
    for kind, value in values.items():
        for joint, unit in kind.changes(dim).items():
            found[joint] = value * unit + found[joint] if joint in found else value * unit
    return found


def read_kind(scene: Scene, kind: str, words: Sequence[str]) -> NumberKind:
    """The kind of number whose class is named ``kind``, with its ``words``.

    Raises:
        DescriptionError: there is no such class, or the scene has no such part.
    """
    for known in NumberKind.kinds():
        if known.__name__ == kind:
            return known.read(scene, words)
    raise DescriptionError(f"number {kind!r}", "there is no such kind", "Import the module that defines it")
