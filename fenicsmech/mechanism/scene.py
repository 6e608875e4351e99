"""The scene of a mechanism: the effects simulated, its configurations, names of units, and the checks of the whole.

Effects add to the potential energy

    Π = E_int + σ · (Σ link energies + Σ pose potentials) + Σ potentials that hold − loads.

The load factor σ, which also multiplies constant loads, grows from 0 to 1 before the controlled force does. Potentials
that hold the mechanism, such as the stiffness of a spring, act from the start: without them equilibria on the way need
not exist.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import ClassVar

from fenicsmech.errors import DescriptionError, expect, set_fields
from fenicsmech.mechanism.mechanism import Mechanism
from fenicsmech.mechanism.parts import FlexibleLink, Joint, Link, Material, Motor, RigidLink, read_pairs, same_place
from fenicsmech.mechanism.shapes import Region
from fenicsmech.mechanism.units import MILLIMETRES, Units


@dataclass(frozen=True)
class Effect(ABC):
    """An effect on a mechanism: a frozen dataclass derived from this one, in a file of its own.

    It overrides the hooks that it needs. By default each hook returns nothing, and adds no form, no unknown and no
    entry of a matrix. The arguments of hooks are objects of the layers above.

    Attributes:
        obstructs: whether it only keeps links from places, and does not grow as loads do when these are applied.
    """

    obstructs: ClassVar[bool] = False

    @property
    def faces(self) -> tuple:
        """``Faces``, the parts of links' boundaries that ``link_energy`` integrates over."""
        return ()

    @abstractmethod
    def explain(self) -> str:
        """The effect in one plain sentence without a full stop."""

    def check(self, mechanism: Mechanism, dim: int) -> None:
        """Checks that the effect applies to ``mechanism`` in ``dim`` dimensions; by default, that its parts exist.

        Raises:
            DescriptionError: it does not.
        """
        for field in fields(self):
            part = getattr(self, field.name)
            if isinstance(part, Link | Joint) and part not in (*mechanism.links, *mechanism.joints):
                kind = "joint" if isinstance(part, Joint) else "link"
                problem = f"{part.name!r} is not a {kind} of {mechanism.name!r}"
                raise DescriptionError(f"effect {type(self).__name__}", problem, f"Name a {kind} of the mechanism")

    def link_energy(self, fields):
        """A potential energy of flexible links in UFL, a form in the ``LinkFields``; None if no link is concerned."""
        return None

    def one_sided(self, fields):
        """A sequence of ``OneSided`` constraints, whose energy ``link_energy`` contains: Newton steps find with them
        which points touch."""
        return ()

    def turns_with(self, link) -> bool:
        """Whether turns of a flexible link as a rigid body leave ``link_energy`` as it is, where no ``one_sided``
        constraint acts: the link may spin idly between two ball joints."""
        return False

    def pose_potentials(self, linkage):
        """A sequence of ``PosePotential``, potentials of the poses of bodies of the ``Linkage``.

        Those that refer to a joint override ``PosePotential.gradient_by_places``.
        """
        return ()

    def soften(self, linkage):
        """Compliances c ≥ 0 by row of ``linkage.joints``, whose equation becomes C + c λ = 0; those of effects add."""
        return {}

    @property
    def pressure_across_depth(self):
        """The pressure on the faces of each link at the ends of its depth, which only space has."""
        return {}

    def growth(self, model, links):
        """The ``Stretch`` of each of the flexible ``links`` whose strain-free length differs from the drawn one; those
        of effects of several classes multiply.

        Raises:
            DescriptionError: the ``ElasticModel`` does not support it.
        """
        return {}


@dataclass(frozen=True)
class Configuration:
    """Motor positions that stay fixed while loads are applied.

    Attributes:
        name: for messages, plots and tables.
        positions: (motor, position) pairs, or a mapping: angle in rad or travel, counted from the drawn configuration.

    Raises:
        DescriptionError: something else than a motor is given, one is given twice, or a position is not finite.
    """

    name: str
    positions: tuple[tuple[Motor, float], ...] = ()

    def __post_init__(self) -> None:
        set_fields(self, positions=read_pairs(f"configuration {self.name!r}", self.positions, Motor, "position"))

    def __repr__(self) -> str:
        positions = ", ".join(f"{motor.name!r} at {position:g}" for motor, position in self.positions)
        return f"Configuration({self.name!r}: {positions or 'every motor as drawn'})"

    def position(self, motor: Motor) -> float:
        """The position of ``motor``: 0 (as drawn) unless given."""
        return dict(self.positions).get(motor, 0.0)


DRAWN = Configuration("as drawn")
"""Every motor at the position in which the mechanism was drawn."""


@dataclass(frozen=True)
class Scene:
    """A mechanism and the ``effects`` that act on it; ``units`` name the units of plots and tables.

    Raises:
        DescriptionError: ``mechanism`` is not a mechanism, something listed under ``effects`` is not an effect, or the
            material of a link is in other units than ``units``.
    """

    mechanism: Mechanism
    effects: Sequence[Effect] = ()
    units: Units = MILLIMETRES

    def __post_init__(self) -> None:
        expect("scene", self.mechanism, Mechanism, "a mechanism", "Pass a Mechanism")
        expect("effects of a scene", self.effects, Iterable, "a list of effects", "Give effects=[Gravity(…), …]")
        set_fields(self, effects=tuple(self.effects))
        for effect in self.effects:
            expect("scene", effect, Effect, "an effect", "List effects only, such as Gravity(…)")
        expect("units of a scene", self.units, Units, "a set of units", "Give units=Units(…)")
        for link in self.mechanism.flexible_links:
            check_units(f"link {link.name!r}", link.material, self.units)

    def __repr__(self) -> str:
        effects = "; ".join(effect.explain() for effect in self.effects)
        return f"Scene({self.mechanism.name!r}: {effects or 'no effects'})"

    def configuration(self, name: str, positions: Mapping[Motor, float]) -> Configuration:
        """A configuration with the given motor positions (rad or length, from the drawn configuration).

        Raises:
            DescriptionError: a motor is not in the mechanism, or its position is not finite.
        """
        made = Configuration(name, positions)  # type: ignore[arg-type]  # a mapping becomes pairs
        for motor, _ in made.positions:
            if motor not in self.mechanism.motors:
                problem = f"{motor.name!r} is not a motor of {self.mechanism.name!r}"
                raise DescriptionError(f"configuration {name!r}", problem, "Add it with motor()")
        return made


def check_units(part: str, material: Material, units: Units) -> None:
    """Checks that the numbers of the material of a ``part`` are in the ``units`` of the scene, or in none.

    Raises:
        DescriptionError: they are in others.
    """
    if material.units not in (None, units):
        problem = f"its material {material.name!r} is in {material.units}, the scene in {units}"
        raise DescriptionError(part, problem, "Give units=… of the scene to material(…)")


def validate(mechanism: Mechanism, dim: int) -> None:
    """Checks that ``mechanism`` can be simulated in ``dim`` dimensions.

    Raises:
        DescriptionError: no ground, an unconnected link, no load path to ground, a force on a fixed link, a joint
            or direction that does not exist in the plane, two interfaces of different shape at one place of a link.
    """
    _check_ground(mechanism)
    check_loads(mechanism, dim)
    _check_interfaces(mechanism, dim)
    if dim == 2:
        _check_planar(mechanism)


def check_loads(mechanism: Mechanism, dim: int) -> None:
    """Checks the forces and outputs of ``mechanism``, which may be added later than its other parts.

    Raises:
        DescriptionError: a force on a fixed link, or in two dimensions a direction that leaves the plane.
    """
    for force in mechanism.forces:
        if isinstance(force.on, RigidLink) and force.on.fixed:
            problem = f"it acts on the fixed link {force.on.name!r}"
            raise DescriptionError(f"force {force.name!r}", problem, "Give a link that moves")
    for load in (*mechanism.forces, *mechanism.outputs):
        if dim == 2 and len(load.direction) == 3 and abs(load.direction[2]) > 1e-12:
            problem = f"its direction {load.direction} leaves the plane"
            raise DescriptionError(f"{load.name!r}", problem, "Give (x, y) or use space='3d'")


def _check_ground(mechanism: Mechanism) -> None:
    part = f"mechanism {mechanism.name!r}"
    if not mechanism.links:
        raise DescriptionError(part, "it has no links", "Add links with rigid() and flexible()")
    grounded: set[Link] = {link for link in mechanism.rigid_links if link.fixed}
    if not grounded:
        remedy = "Make one rigid link the ground: rigid(name, fixed=True)"
        raise DescriptionError(part, "no link is fixed, so no load has a path to ground", remedy)
    pairs = [{joint.a, joint.b} for joint in mechanism.joints]
    for link in mechanism.links:
        if link not in grounded.union(*pairs):
            problem = "it is not connected: no joint holds it"
            raise DescriptionError(f"link {link.name!r}", problem, "Join it to another link or remove it")
    while reached := [pair for pair in pairs if pair & grounded and pair - grounded]:
        grounded = grounded.union(*reached)
    if apart := [link.name for link in mechanism.links if link not in grounded]:
        problem = f"no load path to ground: no joint connects {', '.join(map(repr, apart))} with a fixed link"
        raise DescriptionError(f"link {apart[0]!r}", problem, "Join one of them to a fixed link")


def _check_interfaces(mechanism: Mechanism, dim: int) -> None:
    found: list[tuple[FlexibleLink, Joint, Region]] = []
    for joint in mechanism.joints:
        for link, region in zip((joint.a, joint.b), joint.regions, strict=True):
            if not isinstance(link, FlexibleLink) or region is None:
                continue
            for owner, first, known in found:
                same = owner == link and same_place(first.at, joint.at, dim=dim, length=mechanism.length)
                if same and known != region:
                    problem = (
                        f"its interface on {link.name!r} is {region}, but {first.name!r} has {known} at the same place"
                    )
                    remedy = "Give joints at one place of a link the same interface radius or region"
                    raise DescriptionError(f"{joint.name!r}", problem, remedy)
            found.append((link, joint, region))


def _check_planar(mechanism: Mechanism) -> None:
    for joint in mechanism.joints:
        part = f"{joint.name!r}"
        if not joint.kind.planar:
            problem = f"a {joint.kind.name} joint does not exist in a planar model"
            raise DescriptionError(part, problem, "Use space='3d' or a planar joint")
        axis, out_of_plane = f"its axis {joint.axis}", abs(joint.axis[2])
        if joint.kind.axis_in_plane and out_of_plane > 1e-12:
            raise DescriptionError(part, f"{axis} leaves the plane", "Give an axis (x, y) or use space='3d'")
        if not joint.kind.axis_in_plane and out_of_plane < 1.0 - 1e-12:
            remedy = "Leave it at (0, 0, 1) or use space='3d'"
            raise DescriptionError(part, f"{axis} is not normal to the plane", remedy)
