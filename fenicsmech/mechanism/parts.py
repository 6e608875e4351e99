"""Parts of a mechanism as plain data: links, joints, motors, forces and output points, and their positions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fenicsmech.checks import finite, point_text
from fenicsmech.errors import DescriptionError
from fenicsmech.joints import JointKind
from fenicsmech.mechanism.materials import Material
from fenicsmech.mechanism.shapes import Point, Region, Shape


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
        a, b: the links; motions are counted of b relative to a.
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


@dataclass(frozen=True)
class Drive:
    """Motors that move together, as geared to each other: at its position p each stands at ratio · p.

    Attributes:
        name: for messages, plots and tables.
        ratios: (motor, ratio) pairs, or a mapping; motors that all turn or all slide.

    Raises:
        DescriptionError: there are no motors, a ratio is zero or not a number, or some motors turn and others slide.
    """

    name: str
    ratios: tuple[tuple[Motor, float], ...]

    def __post_init__(self) -> None:
        part, given = f"drive {self.name!r}", self.ratios
        pairs = tuple(given.items()) if isinstance(given, Mapping) else tuple(given)
        checked = tuple((motor, finite(f"ratio of a motor of {part}", ratio)) for motor, ratio in pairs)
        if not checked or not all(isinstance(motor, Motor) and ratio for motor, ratio in checked):
            raise DescriptionError(part, f"its ratios are {given!r}", "Give motors with ratios other than zero")
        if len({motor.joint.kind.sliding for motor, _ in checked}) > 1:
            raise DescriptionError(part, "some of its motors turn and others slide", "Give motors of one sort")
        object.__setattr__(self, "ratios", checked)

    def __repr__(self) -> str:
        return f"Drive({self.name!r}: {', '.join(f'{ratio:g} × {motor.name!r}' for motor, ratio in self.ratios)})"

    @property
    def sliding(self) -> bool:
        """Whether its motors slide."""
        return self.ratios[0][0].joint.kind.sliding


@dataclass(frozen=True)
class _AtPoint:
    """A direction at a material point of a link."""

    on: Link
    at: Point
    direction: Point
    name: str

    def __repr__(self) -> str:
        sort, at, direction = type(self).__name__, point_text(self.at), point_text(self.direction)
        return f"{sort}({self.name!r} on {self.on.name!r} at {at} along {direction})"


class Force(_AtPoint):
    """A dead force along ``direction`` (unit vector) at the material point ``at`` of link ``on``."""


class Output(_AtPoint):
    """The displacement of the material point ``at`` of link ``on`` along ``direction`` (unit vector)."""


PrescribedPart = Force | Motor | Drive
"""A part whose value is prescribed along an equilibrium path."""


def in_dimension(position: Sequence[float], dim: int) -> tuple[float, ...]:
    """``position`` with ``dim`` coordinates; a missing z is 0."""
    return (*position, 0.0)[:dim]


def same_place(a: Sequence[float], b: Sequence[float], *, dim: int, length: float) -> bool:
    """Whether two positions in a mechanism of size ``length`` differ by rounding only."""
    return math.dist(in_dimension(a, dim), in_dimension(b, dim)) <= 1e-9 * length
