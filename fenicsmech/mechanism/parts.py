"""Parts of a mechanism as plain data: materials, links, joints, motors, forces, output points, and their positions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from fenicsmech.errors import DescriptionError, expect, finite, point_text, positive, set_fields
from fenicsmech.joints import JointKind
from fenicsmech.laws import Law, NeoHookean
from fenicsmech.mechanism.shapes import Face, Point, Region, Shape
from fenicsmech.mechanism.strength import Strength
from fenicsmech.mechanism.units import Units

Single = TypeVar("Single", "Motor", "Force")


@dataclass(frozen=True, init=False)
class Material:
    """A hyperelastic material: ``Material("PLA", 2000.0, 0.35)`` or ``Material("rubber", law=Yeoh(…))``.

    Args:
        name: for messages.
        E, nu: Young's modulus (force per area) and Poisson's ratio of the law ``NeoHookean(E, nu)``.
        law: any law, instead of E and nu.
        density: mass per volume, for its weight; with forces in N and lengths in mm in t/mm³ (water: 1e-9).
        expansion: coefficient of linear thermal expansion α, 1/K, for its ``Temperature``.
        strength: what it bears, if known.
        units: of its numbers, which a scene has to have; None for those of any scene.

    Raises:
        DescriptionError: E ≤ 0, ν outside (−1, 0.5), the density not positive, or not numbers, as the expansion; a law
            and numbers are given, or neither; the strength or the units are something else.
    """

    name: str
    law: Law
    density: float | None
    expansion: float | None
    strength: Strength | None
    units: Units | None

    def __init__(
        self,
        name: str,
        E: float | None = None,
        nu: float | None = None,
        *,
        law: Law | None = None,
        density: float | None = None,
        expansion: float | None = None,
        strength: Strength | None = None,
        units: Units | None = None,
    ) -> None:
        part = f"material {name!r}"
        if law is None:
            try:
                law = NeoHookean(E, nu)  # type: ignore[arg-type]  # which refuses None
            except DescriptionError as error:
                raise DescriptionError(f"{error.part} of {part}", error.problem, error.remedy) from None
        elif E is not None or nu is not None:
            raise DescriptionError(
                part, "both a law and numbers are given", f"Give the numbers to the law, {type(law).__name__}(…)"
            )
        if not isinstance(law, Law):
            raise DescriptionError(part, f"its law is {law!r}", "Give a law with its numbers: NeoHookean(E, nu)")
        if density is not None:
            density = positive(f"density of {part}", density)
        if expansion is not None:
            expansion = finite(f"expansion of {part}", expansion)
        expect(part, strength, Strength | None, "a strength", "Give Strength(…)")
        expect(part, units, Units | None, "a set of units", "Give Units(…)")
        set_fields(self, name=name, law=law, density=density, expansion=expansion, strength=strength, units=units)


@dataclass(frozen=True)
class RigidLink:
    """A link that does not deform.

    Attributes:
        name: unique in the mechanism.
        fixed: part of the ground.
    """

    name: str
    fixed: bool = False

    def __repr__(self) -> str:
        return f"RigidLink({self.name!r}{', fixed' if self.fixed else ''})"


@dataclass(frozen=True)
class FlexibleLink:
    """A link of ``shape`` and ``material`` that bends."""

    name: str
    shape: Shape
    material: Material

    def __repr__(self) -> str:
        return f"FlexibleLink({self.name!r}: {type(self.shape).__name__} of {self.material.name})"


Link = RigidLink | FlexibleLink


@dataclass(frozen=True)
class Joint:
    """Connects link ``a`` with link ``b``.

    Attributes:
        kind: its constraint equations.
        a: one link.
        b: the other; motions are counted of b relative to a.
        at: its drawn position (2 or 3 coordinates).
        axis: unit vector of its axis, 3 coordinates (revolute: z by default).
        regions: interface region on a and on b; None on rigid links.
        name: unique in the mechanism.
    """

    kind: JointKind
    a: Link
    b: Link
    at: Point
    axis: Point
    regions: tuple[Region | None, Region | None]
    name: str

    def __repr__(self) -> str:
        return f"Joint({self.name!r}: {self.kind.name}, {self.a.name!r} to {self.b.name!r} at {point_text(self.at)})"


@dataclass(frozen=True)
class Motor:
    """Prescribes the free coordinate of ``joint``, counted from the drawn configuration."""

    joint: Joint
    name: str

    def __repr__(self) -> str:
        return f"Motor({self.name!r} on {self.joint.name!r})"

    @property
    def sliding(self) -> bool:
        """Whether it slides."""
        return self.joint.kind.sliding

    @property
    def ratios(self) -> tuple[tuple[Motor, float], ...]:
        """As of a ``Drive`` of this motor alone."""
        return ((self, 1.0),)


def read_pairs(part: str, given: Any, sort: type[Single], number: str) -> tuple[tuple[Single, float], ...]:
    """``given``, pairs of a motor or force and its ``number``, or a mapping, as pairs.

    Raises:
        DescriptionError: it is neither, something else than a ``sort`` is given, one is given twice, or a number is not
            finite.
    """
    noun = sort.__name__.lower()
    try:
        pairs = [(own, value) for own, value in (given.items() if isinstance(given, Mapping) else given)]
    except (TypeError, ValueError):
        raise DescriptionError(part, f"{given!r} gives no {number}s", f"Give {{{noun}: {number}, …}}") from None
    read: dict[Single, float] = {}
    for own, value in pairs:
        expect(part, own, sort, f"a {noun}")
        if own in read:
            raise DescriptionError(part, f"{own.name!r} is given twice", f"Give each {noun} once")
        read[own] = finite(f"{number} of {noun} {own.name!r} in {part}", value)
    return tuple(read.items())


@dataclass(frozen=True)
class Drive:
    """Motors that move together, as if geared to each other: when the drive is at p, each motor is at ratio · p.

    Attributes:
        name: for messages, plots and tables.
        ratios: (motor, ratio) pairs, or a mapping; motors that all turn or all slide.

    Raises:
        DescriptionError: there are no motors, one is given twice, a ratio is zero or not a number, or some motors turn
            and others slide.
    """

    name: str
    ratios: tuple[tuple[Motor, float], ...]

    def __post_init__(self) -> None:
        part = f"drive {self.name!r}"
        checked = read_pairs(part, self.ratios, Motor, "ratio")
        if not checked or not all(ratio for _, ratio in checked):
            raise DescriptionError(part, f"its ratios are {self.ratios!r}", "Give motors with ratios other than zero")
        if len({motor.sliding for motor, _ in checked}) > 1:
            raise DescriptionError(part, "some of its motors turn and others slide", "Give motors of one kind")
        set_fields(self, ratios=checked)

    def __repr__(self) -> str:
        return f"Drive({self.name!r}: {', '.join(f'{ratio:g} × {motor.name!r}' for motor, ratio in self.ratios)})"

    @property
    def sliding(self) -> bool:
        """Whether its motors slide."""
        return self.ratios[0][0].sliding


MaterialPoint = tuple[Link, Point, Region | Face | None]
"""A link, a drawn point of it, and a region about or through this point."""


@dataclass(frozen=True)
class _AtPoint:
    """A direction at a material point of a link, or on a ``region`` of a flexible link about or through this point."""

    on: Link
    at: Point
    direction: Point
    name: str
    region: Region | Face | None = None

    def __repr__(self) -> str:
        sort, at, direction = type(self).__name__, point_text(self.at), point_text(self.direction)
        region = "" if self.region is None else f" over {self.region}"
        return f"{sort}({self.name!r} on {self.on.name!r} at {at}{region} along {direction})"

    @property
    def material(self) -> MaterialPoint:
        """The point or region alone."""
        return self.on, self.at, self.region


class Force(_AtPoint):
    """A dead force along ``direction`` (unit vector) at the material point ``at``, or on a region, of link ``on``."""

    @property
    def ratios(self) -> tuple[tuple[Force, float], ...]:
        """As of a ``ForceGroup`` of this force alone."""
        return ((self, 1.0),)


class Output(_AtPoint):
    """The displacement along ``direction`` (unit vector) of the point ``at``, or average over a region, of ``on``."""


@dataclass(frozen=True)
class ForceGroup:
    """Forces that grow together: at its magnitude f each has ratio · f.

    Attributes:
        name: for messages, plots and tables.
        ratios: (force, ratio) pairs, or a mapping.

    Raises:
        DescriptionError: there are no forces, one is given twice, or a ratio is not a number.
    """

    name: str
    ratios: tuple[tuple[Force, float], ...]

    def __post_init__(self) -> None:
        part = f"forces {self.name!r}"
        checked = read_pairs(part, self.ratios, Force, "ratio")
        if not checked:
            raise DescriptionError(part, "there are none", "Give forces with their ratios")
        set_fields(self, ratios=checked)

    def __repr__(self) -> str:
        return f"ForceGroup({self.name!r}: {', '.join(f'{ratio:g} × {force.name!r}' for force, ratio in self.ratios)})"


PrescribedPart = Force | ForceGroup | Motor | Drive
"""A part whose value is prescribed along an equilibrium path."""


def in_dimension(position: Sequence[float], dim: int) -> tuple[float, ...]:
    """``position`` with ``dim`` coordinates; a missing z is 0."""
    return (*position, 0.0)[:dim]


def same_place(a: Sequence[float], b: Sequence[float], *, dim: int, length: float) -> bool:
    """Whether two positions in a mechanism of size ``length`` differ by rounding only."""
    return math.dist(in_dimension(a, dim), in_dimension(b, dim)) <= 1e-9 * length
