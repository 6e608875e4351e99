"""Places of joints: positions and axes in the drawn configuration.

Both bodies of a joint attach at the same point of this configuration, which stays assembled as the point is shifted and
the axis turned. As the place of a joint changes, the constraints C change at the rate Ċ and their forces S = Aᵀλ on the
poses z at the rate Ṡ. Potentials V of springs count with a factor σ. With the parts ẑ and λ̂ of the adjoint x,

    −xᵀ ∂F/∂p = λ̂ · Ċ + ẑ · (Ṡ − σ ∂²V/∂z∂p).

Forces, outputs and centres of mass keep their drawn places on rigid links. Flexible links that meet at a joint follow
it by the handles of their shape (``fenicsmech.design.rest_shape``).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from fenicsmech.errors import DescriptionError, counted, direction, finite, in_plane, point_text, set_fields
from fenicsmech.mechanism import Configuration, FlexibleLink, Joint, Scene, in_dimension, same_place
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import JointChange
from fenicsmech.quantities.number import ModelNumber, NumberKind, NumberTerms


@dataclass(frozen=True, init=False)
class _OfJoints(NumberKind):
    """A number of the places of joints, zero as drawn."""

    parts: tuple[Joint, ...]
    vectors: tuple[tuple[float, ...], ...] = ()

    def __init__(self, *parts: Joint, given: Sequence[float] | Sequence[Sequence[float]]) -> None:
        super().__init__(*parts)
        where = f"direction of the {self.what}"
        lists = Sequence | np.ndarray
        if not isinstance(given, lists) or not any(isinstance(own, lists) for own in given):
            vectors = (direction(where, given),) * len(parts)  # type: ignore[arg-type]  # one for all
        else:
            vectors = tuple(direction(where, own) for own in given)  # type: ignore[arg-type]  # of each
        if len(vectors) != len(parts):
            several = counted(len(vectors), "direction"), counted(len(parts), "joint")
            raise DescriptionError(where, f"{several[0]} for {several[1]}", "Give one for all joints, or one for each")
        set_fields(self, vectors=vectors)

    @staticmethod
    def candidates(scene: Scene) -> Sequence[Joint]:
        return scene.mechanism.joints

    @property
    def slots(self):
        return tuple((*slot, vector) for slot, vector in zip(super().slots, self.vectors, strict=True))

    @property
    def words(self):
        return ("; ".join(" ".join(map(repr, own)) for own in self._distinct), *super().words)

    @classmethod
    def read(cls, scene, words):
        parts = (cls._part(scene, word) for word in words[1:])
        vectors = [tuple(map(float, own.split())) for own in words[0].split(";")]
        kind = cls._read(parts, vectors if len(vectors) > 1 else vectors[0])
        # to the last digit as written: a unit vector divided by its length may differ
        set_fields(kind, vectors=tuple(vectors) if len(vectors) > 1 else tuple(vectors) * len(kind.parts))
        return kind

    @classmethod
    @abstractmethod
    def _read(cls, parts, given):
        """The kind of some parts and its vector, or those of each."""

    @property
    def _distinct(self) -> tuple[tuple[float, ...], ...]:
        """The one vector of all parts, or those of each."""
        return self.vectors[:1] if len(set(self.vectors)) == 1 else self.vectors

    @property
    def _text(self) -> str:
        return " and ".join(map(point_text, self._distinct))

    def described(self, part):
        return 0.0

    def check_value(self, value):
        finite(self.name, value)

    def moves_unloaded(self, configuration: Configuration) -> bool:
        return any(position for _, position in configuration.positions)

    def changes(self, dim):
        return {part: self.change(vector, dim) for part, vector in zip(self.parts, self.vectors, strict=True)}

    def on(self, model):
        return _Place(model, self.changes(model.linkage.dim))

    @abstractmethod
    def change(self, vector: tuple[float, ...], dim: int) -> JointChange:
        """The change of a joint with this vector by a unit of the number, in ``dim`` dimensions."""


@dataclass(frozen=True, init=False)
class JointPosition(_OfJoints):
    """The shift of joints from where they are drawn, in units of length: ``JointPosition(pin, direction=(1, 0))``.

        P + v e,     e the unit vector along ``direction``, v the number, zero as drawn

    Two numbers, along x and y, let a joint go anywhere in the plane. All bodies that meet there attach at the shifted
    point. In a design problem flexible links follow: their interface by the shift, their centreline by the linear
    interpolation of the shifts of its joints. Forces and outputs on rigid links stay where they are drawn on the link,
    even at the place of the joint. Joints of flexible links are shifted in the plane only, all those at one place of a
    link together. Links that share a shape (``SplineDesign.same``, ``mirrored``) have their joints shifted as images of
    one another: ``JointPosition(left, right, direction=[(1, 0), (-1, 0)])`` for links mirrored in x.

    Args:
        parts: a joint, or several with the same shift, such as those of a pin through several links.
        direction: in which the shift is positive, of any length; 2 or 3 coordinates; or one direction for each joint.

    Raises:
        DescriptionError: there are no joints, one is given twice, directions are not as many as joints, or one has no
            length. Later, by a design problem: a flexible link does not allow the shift.
    """

    what = "position"

    def __init__(self, *parts: Joint, direction: Sequence[float] | Sequence[Sequence[float]]) -> None:
        super().__init__(*parts, given=direction)

    @classmethod
    def _read(cls, parts, given):
        return cls(*parts, direction=given)

    @property
    def name(self):
        return f"{super().name} along {self._text}"

    @property
    def reshaped(self):
        return tuple(
            dict.fromkeys(o for joint in self.parts for o in (joint.a, joint.b) if isinstance(o, FlexibleLink))
        )

    def unit(self, units):
        return units.length

    def check(self, scene, dim):
        super().check(scene, dim)
        for vector in self.vectors:
            in_plane(f"direction of the {self.name}", vector, dim)
        mechanism = scene.mechanism
        along = {joint: in_dimension(own, 3) for joint, own in zip(self.parts, self.vectors, strict=True)}
        for joint, vector in along.items():
            held = [link for link in (joint.a, joint.b) if isinstance(link, FlexibleLink)]
            if held and vector[2]:
                raise DescriptionError(
                    self.name,
                    f"{joint.name!r} holds {held[0].name!r}, which is flexible and follows joints in the plane alone",
                    "Shift it along x and y, or weld a rigid link there and shift a joint of that",
                )
        for joint, link in ((joint, link) for joint in self.parts for link in self.reshaped):
            for other in mechanism.joints:
                here = same_place(joint.at, other.at, dim=dim, length=mechanism.length)
                alike = along.get(other) == along[joint]
                if not alike and link in (other.a, other.b) and link in (joint.a, joint.b) and here:
                    raise DescriptionError(
                        self.name,
                        f"{other.name!r} is at the same place of {link.name!r}",
                        f"Shift both alike: name {other.name!r} too, with the same direction",
                    )

    def change(self, vector, dim):
        nothing = np.zeros(1 if dim == 2 else 3)
        return JointChange(np.array(in_dimension(vector, dim)), nothing)


@dataclass(frozen=True, init=False)
class JointAxis(_OfJoints):
    """The turn, rad, of the axes of joints from how they are drawn: ``JointAxis(hinge, about=(1, 0, 0))``.

        exp [v e]×,     e the unit vector along ``about``, v the number, zero as drawn, |v| < π

    In the plane only axes that lie in it, such as those of sliders, turn, about z. Turns of one joint about several
    axes add up as rotation vectors. Interfaces of flexible links keep their regions.

    Args:
        parts: a joint, or several whose axes turn by the same angle.
        about: the axis of the turn, of any length; 2 or 3 coordinates, z by default; or one for each joint.

    Raises:
        DescriptionError: there are no joints, one is given twice, axes are not as many as joints, or one has no length.
            Later, by a design problem: a joint has no axis in the plane, or the axis would leave it.
    """

    what = "axis"

    def __init__(self, *parts: Joint, about: Sequence[float] | Sequence[Sequence[float]] = (0.0, 0.0, 1.0)) -> None:
        super().__init__(*parts, given=about)

    @classmethod
    def _read(cls, parts, given):
        return cls(*parts, about=given)

    @property
    def name(self):
        return f"{super().name} about {self._text}"

    def unit(self, units):
        return "rad"

    def check_value(self, value):
        if not abs(finite(self.name, value)) < pi:
            raise DescriptionError(self.name, f"a turn by {value:g} rad", "Turn it by less than half a turn")

    def check(self, scene, dim):
        super().check(scene, dim)
        for joint in self.parts:
            if dim == 2 and not joint.kind.axis_in_plane:
                raise DescriptionError(
                    self.name,
                    f"a {joint.kind.name} joint has no axis in the plane",
                    "Turn axes of hinges in space, or those of sliders",
                )
        if dim == 2 and any(abs(in_dimension(vector, 3)[2]) != 1.0 for vector in self.vectors):
            raise DescriptionError(self.name, "the axis would leave the plane", "Turn it about z in the plane")

    def change(self, vector, dim):
        turn = np.array(in_dimension(vector, 3))
        return JointChange(np.zeros(dim), turn[2:] if dim == 2 else turn)


class _Place(ModelNumber):
    """A change of the places of some connections."""

    drawn = 0.0

    def __init__(self, model: MechanismModel, changes: Mapping[Joint, JointChange]) -> None:
        self._joints, self._model, self.value = model.linkage.joints, model, 0.0
        self._changes = {model.linkage.connection_of(joint): change for joint, change in changes.items()}

    def set(self, value):
        self.value = value
        changes = {k: value * unit for k, unit in self._changes.items()} if value else {}
        self._joints.places.change(self, changes)

    def slope(self, terms: NumberTerms) -> float:
        total = sum(factor * rate(self._changes) for factor, rate in terms.partial.by_places)
        if terms.adjoint is None:
            return total
        adjoint, state, size = terms.adjoint, terms.adjoint.at.state, self._joints.space.pose_size
        for k, unit in self._changes.items():
            rate, forces = self._joints.place_rates(k, unit, state.poses, state.motors, state.multipliers)
            total += float(adjoint.multipliers @ rate)
            total += sum(terms.work(self._joints, [body], force) for body, force in forces.items())
        for own in self._model.potentials:
            rates = np.broadcast_to(own.gradient_by_places(self._changes, state.poses), len(own.bodies) * size)
            total -= own.factor(state.load_factor) * terms.work(self._joints, own.bodies, rates)
        return total
