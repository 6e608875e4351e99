"""Parts of a mechanism as plain data: links, joints, motors, forces and output points."""

from __future__ import annotations

from dataclasses import dataclass

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


@dataclass(frozen=True)
class FlexibleLink:
    """A link of ``shape`` and ``material`` that bends."""

    name: str
    shape: Shape
    material: Material


Link = RigidLink | FlexibleLink


@dataclass(frozen=True)
class Joint:
    """Connects link ``a`` with link ``b``.

    Attributes:
        kind: which relative motions it leaves free.
        a, b: the links; motions are counted of b relative to a.
        at: where it is drawn (2 or 3 coordinates).
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


@dataclass(frozen=True)
class Motor:
    """Prescribes the free coordinate of ``joint``, counted from the drawn configuration."""

    joint: Joint
    name: str


@dataclass(frozen=True)
class Force:
    """A dead force along ``direction`` (unit vector) at the material point ``at`` of link ``on``."""

    on: Link
    at: Point
    direction: Point
    name: str


@dataclass(frozen=True)
class Output:
    """The displacement of the material point ``at`` of link ``on`` along ``direction`` (unit vector)."""

    on: Link
    at: Point
    direction: Point
    name: str
