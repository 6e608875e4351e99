"""The mechanism: a builder that collects links, joints, motors, forces and output points."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import TypeVar

from fenicsmech.errors import DescriptionError, expect, finite, point, point_text, positive
from fenicsmech.errors import direction as unit
from fenicsmech.joints import CYLINDRICAL, PLANAR_JOINT, PRISMATIC, REVOLUTE, SPHERICAL, UNIVERSAL, WELD, JointKind
from fenicsmech.mechanism.parts import (
    FlexibleLink,
    Force,
    Joint,
    Link,
    Material,
    Motor,
    Output,
    RigidLink,
    in_dimension,
)
from fenicsmech.mechanism.shapes import Disc, Face, Rectangle, Region, Shape, Strip, end_clamp

Load = TypeVar("Load", Force, Output)
AnyLink = TypeVar("AnyLink", RigidLink, FlexibleLink)

_Z = (0.0, 0.0, 1.0)


class Mechanism:
    """Collects the parts of a mechanism; every method returns the part it added, as plain data.

    The drawn configuration is the unloaded, assembled one: each joint is given once, at the place where
    both its links meet, and motor positions are counted from there.

    Args:
        name: for messages, plots and files.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.links: list[Link] = []
        self.joints: list[Joint] = []
        self.motors: list[Motor] = []
        self.forces: list[Force] = []
        self.outputs: list[Output] = []

    def __repr__(self) -> str:
        return f"Mechanism({self.name!r}: {', '.join(self._counts()) or 'no parts'})"

    def __str__(self) -> str:
        parts = (*self.links, *self.joints, *self.motors, *self.forces, *self.outputs)
        return "\n".join([repr(self), *(f"  {part!r}" for part in parts)])

    @property
    def length(self) -> float:
        """Diagonal of the box around all joints, forces and outputs; 1 if it has no size."""
        places = [in_dimension(joint.at, 3) for joint in self.joints]
        places += [in_dimension(part.at, 3) for part in (*self.forces, *self.outputs)]
        return math.hypot(*(max(axis) - min(axis) for axis in zip(*places, strict=True))) or 1.0

    @property
    def flexible_links(self) -> list[FlexibleLink]:
        """The links that bend, in the order given."""
        return [link for link in self.links if isinstance(link, FlexibleLink)]

    @property
    def rigid_links(self) -> list[RigidLink]:
        """The links that do not bend, in the order given."""
        return [link for link in self.links if isinstance(link, RigidLink)]

    def rigid(self, name: str, *, fixed: bool = False) -> RigidLink:
        """Adds a rigid link; ``fixed`` makes it part of the ground."""
        return self._add_link(RigidLink(name, fixed))

    def flexible(self, name: str, shape: Shape, material: Material) -> FlexibleLink:
        """Adds a flexible link of ``shape`` and ``material``.

        Raises:
            DescriptionError: ``shape`` is not a shape, ``material`` is not a material, or the name is taken.
        """
        if not isinstance(shape, Shape):
            remedy = "Make one with strip(), polygon(), outline(), step_file() or gmsh_mesh()"
            raise DescriptionError(f"link {name!r}", f"its shape is {shape!r}", remedy)
        if not isinstance(material, Material):
            remedy = "Give a Material(name, E, ν) or an existing one, such as ONYX"
            raise DescriptionError(f"link {name!r}", f"its material is {material!r}", remedy)
        return self._add_link(FlexibleLink(name, shape, material))

    def join(
        self,
        kind: JointKind,
        a: Link,
        b: Link,
        *,
        at: Sequence[float],
        axis: Sequence[float] = _Z,
        interface_radius: float | None = None,
        region: Region | None = None,
        name: str | None = None,
    ) -> Joint:
        """Adds a joint of any kind between links ``a`` and ``b``.

        Args:
            kind: the joint's kind.
            a, b: links of this mechanism.
            at: where the joint is drawn, 2 or 3 coordinates (z = 0 if left out).
            axis: its axis, 2 or 3 coordinates.
            interface_radius: on flexible links everything this close to the axis moves rigidly.
            region: interface region instead of a disc of ``interface_radius`` (a ``Rectangle`` for clamps).
            name: for messages; unique.

        Raises:
            DescriptionError: ``kind`` is not a joint kind, a link is not in the mechanism or joined with itself, a
                flexible link lacks an interface, the interface is not a region or given twice, numbers are not
                finite, or the name is taken.
        """
        expect("joint", kind, JointKind, "a joint kind", "Give an instance of a JointKind")
        for link in (a, b):
            self._check_member(f"{name or f'{kind.name} joint'!r}", link)
        given, name = name, name or f"{kind.name} joint {a.name}–{b.name}"
        at = point(f"position of {name!r}", at)
        if given is None and name in {joint.name for joint in self.joints}:
            name = f"{name} at {at}"
        part = f"{name!r}"
        self._check_name(part, name, self.joints)
        if a == b:
            raise DescriptionError(part, f"link {a.name!r} is joined with itself", "Name two different links")
        region = _interface(part, interface_radius, region)
        regions = tuple(region if isinstance(link, FlexibleLink) else None for link in (a, b))
        for link in (a, b):
            if isinstance(link, FlexibleLink) and region is None:
                remedy = "Give interface_radius=… (pin) or region=… (clamp)"
                raise DescriptionError(part, f"no interface on flexible link {link.name!r}", remedy)
        axis = unit(f"axis of {part}", axis)
        joint = Joint(kind, a, b, at, (*axis, 0.0)[:3], (regions[0], regions[1]), name)
        self.joints.append(joint)
        return joint

    def revolute(self, a: Link, b: Link, *, at: Sequence[float], **options) -> Joint:
        """Adds a hinge at ``at`` that turns about ``axis`` (by default z); options as in ``join``."""
        return self.join(REVOLUTE, a, b, at=at, **options)

    def prismatic(self, a: Link, b: Link, *, at: Sequence[float], axis: Sequence[float], **options) -> Joint:
        """Adds a slider along ``axis``; options as in ``join``."""
        return self.join(PRISMATIC, a, b, at=at, axis=axis, **options)

    def cylindrical(self, a: Link, b: Link, *, at: Sequence[float], axis: Sequence[float], **options) -> Joint:
        """Adds a joint that slides along and turns about ``axis``; options as in ``join``."""
        return self.join(CYLINDRICAL, a, b, at=at, axis=axis, **options)

    def spherical(self, a: Link, b: Link, *, at: Sequence[float], **options) -> Joint:
        """Adds a ball joint; options as in ``join``."""
        return self.join(SPHERICAL, a, b, at=at, **options)

    def universal(self, a: Link, b: Link, *, at: Sequence[float], axis: Sequence[float], **options) -> Joint:
        """Adds a Cardan joint with shaft direction ``axis``; options as in ``join``."""
        return self.join(UNIVERSAL, a, b, at=at, axis=axis, **options)

    def planar(self, a: Link, b: Link, *, at: Sequence[float], axis: Sequence[float] = _Z, **options) -> Joint:
        """Adds a joint whose plane, normal to ``axis``, slides and turns; options as in ``join``."""
        return self.join(PLANAR_JOINT, a, b, at=at, axis=axis, **options)

    def weld(self, a: Link, b: Link, *, at: Sequence[float], **options) -> Joint:
        """Adds a weld, or a clamp if one of the links is flexible; options as in ``join``."""
        return self.join(WELD, a, b, at=at, **options)

    def clamp(self, a: Link, strip: FlexibleLink, *, end: str, length: float, name: str | None = None) -> Joint:
        """Welds link ``a`` to an end of a strip, which it holds over its whole width.

        Args:
            a: a link of this mechanism.
            strip: a flexible link whose shape is a strip.
            end: "start" or "end" of its centreline.
            length: of the clamped piece, along the centreline; its inner face is normal to the strip.
            name: for messages; unique.

        Raises:
            DescriptionError: as ``join``; the link is not a strip, or the clamp does not fit it.
        """
        for link in (a, strip):
            self._check_member(f"{name or 'clamp'!r}", link)
        part = f"{name or f'clamp {a.name}–{strip.name}'!r}"
        if not isinstance(strip, FlexibleLink) or not isinstance(strip.shape, Strip):
            remedy = "Use weld(…, at=…, region=Rectangle(…)) for other shapes"
            raise DescriptionError(part, f"link {strip.name!r} is not a strip", remedy)
        at, region = end_clamp(strip.shape, end, length, part=part)
        return self.weld(a, strip, at=at, region=region, name=name)

    def motor(self, joint: Joint, *, name: str | None = None) -> Motor:
        """Adds a motor that prescribes the free coordinate of ``joint``, such as the angle of a revolute one.

        Raises:
            DescriptionError: the joint's kind takes no motor, it has one already, or it is not in the mechanism.
        """
        expect(f"motor {name!r}" if name else "motor", joint, Joint, "a joint", "Give a joint of the mechanism")
        name = name or f"motor of {joint.name}"
        part = f"motor {name!r}"
        self._check_name(part, name, self.motors)
        if joint not in self.joints:
            raise DescriptionError(part, f"{joint.name!r} is not a joint of {self.name!r}", "Add the joint first")
        if not joint.kind.motorised:
            remedy = "Use a joint with one free coordinate, such as a revolute or a prismatic one"
            raise DescriptionError(part, f"a {joint.kind.name} joint takes no motor", remedy)
        if joint in {motor.joint for motor in self.motors}:
            raise DescriptionError(part, f"{joint.name!r} has a motor already", "Give each joint one motor")
        motor = Motor(joint, name)
        self.motors.append(motor)
        return motor

    def force(
        self,
        *,
        on: Link,
        at: Sequence[float],
        direction: Sequence[float],
        region: Region | Face | None = None,
        name: str | None = None,
    ) -> Force:
        """Adds a dead force along ``direction`` at the material point ``at``, or on a region, of link ``on``.

        The displacement of a force, on which it does work, is that of its point, or the average over its region. As
        elements shrink, the displacement under a force at a point of a flexible link grows without limit: give a region
        where the displacement near the force matters.

        Args:
            on: the link.
            at: a drawn point of the link, 2 or 3 coordinates.
            direction: 2 or 3 coordinates, of any length.
            region: of a flexible link, over whose drawn area or volume the force is spread evenly: ``Disc`` or
                ``Rectangle`` about the point, through the depth of the link, or ``Face``. It moves with the link; where
                its shape is designed, each part of the region keeps its share of the force. In half models it stands
                for both halves.
            name: for messages; unique. By default that of the link, with the place where the first one is taken, and
                the direction where that is too.

        Raises:
            DescriptionError: the link is not in the mechanism, a number is invalid, the region is not a region or is
                given for a rigid link, or the name is taken. Later, when the link is meshed: the region holds none of
                it.
        """
        return self._add_at_point(Force, self.forces, on, at, direction, region, name)

    def output(
        self,
        *,
        on: Link,
        at: Sequence[float],
        direction: Sequence[float],
        region: Region | Face | None = None,
        name: str | None = None,
    ) -> Output:
        """Adds an output: the displacement along ``direction`` of a point, or the average over a region, of ``on``.

        Arguments and errors as those of ``force``.
        """
        return self._add_at_point(Output, self.outputs, on, at, direction, region, name)

    def _counts(self) -> list[str]:
        sorts = [*("rigid link" if isinstance(link, RigidLink) else "flexible link" for link in self.links)]
        sorts += [f"{joint.kind.name} joint" for joint in self.joints]
        sorts += ["motor"] * len(self.motors) + ["force"] * len(self.forces) + ["output"] * len(self.outputs)
        return [f"{count} {sort}{'s' if count > 1 else ''}" for sort, count in Counter(sorts).items()]

    def _add_at_point(
        self,
        sort: type[Load],
        taken: list[Load],
        on: Link,
        at: Sequence[float],
        direction: Sequence[float],
        region: Region | Face | None,
        name: str | None,
    ) -> Load:
        what = sort.__name__.lower()
        self._check_member(f"{name or what!r}", on)
        given, name = name, name or f"{what} on {on.name}"
        place, along = point(f"position of {name!r}", at), unit(f"direction of {name!r}", direction)
        if given is None:
            names = {load.name for load in taken}
            further = f"{name} at {point_text(place)}"
            name = next((own for own in (name, further) if own not in names), f"{further} along {point_text(along)}")
        self._check_name(f"{name!r}", name, taken)
        load = sort(on, place, along, name, _load_region(f"{name!r}", on, region))
        taken.append(load)
        return load

    def _add_link(self, link: AnyLink) -> AnyLink:
        self._check_name(f"link {link.name!r}", link.name, self.links)
        self.links.append(link)
        return link

    def _check_member(self, part: str, link: Link) -> None:
        if link not in self.links:
            raise DescriptionError(part, f"{link!r} is not a link of {self.name!r}", "Add the link first")

    @staticmethod
    def _check_name(part: str, name: str, taken: Sequence[Link | Joint | Motor | Force | Output]) -> None:
        if name in {other.name for other in taken}:
            raise DescriptionError(part, f"the name {name!r} is taken", "Give each part a name of its own")


def _interface(part: str, radius: float | None, region: Region | None) -> Region | None:
    if radius is not None and region is not None:
        raise DescriptionError(part, "both an interface radius and a region are given", "Give one of the two")
    if radius is None and region is None:
        return None
    return _plane_region(part, "interface", region if radius is None else Disc(radius))


def _plane_region(part: str, sort: str, region: object) -> Region:
    match region:
        case Disc(radius=value):
            return Disc(positive(f"radius of {part}", value))
        case Rectangle(length=length, width=width, angle=angle):
            of = f"of the {sort} of {part}"
            return Rectangle(
                positive(f"length {of}", length), positive(f"width {of}", width), finite(f"angle {of}", angle)
            )
    raise DescriptionError(part, f"{region!r} is not its {sort}", "Give Disc(…) or Rectangle(…)")


def _load_region(part: str, on: Link, region: object) -> Region | Face | None:
    if region is None:
        return None
    if not isinstance(on, FlexibleLink):
        problem = f"link {on.name!r} is rigid, on which forces on a region act like their resultant"
        raise DescriptionError(part, problem, "Leave out region, and give the point that the resultant acts at")
    if isinstance(region, Face):
        within = region.within
        return region if within is None else Face(_plane_region(part, "region", within))
    if not isinstance(region, Disc | Rectangle):
        remedy = "Give region=Disc(…), Rectangle(…) or Face(…)"
        raise DescriptionError(part, f"its region is {region!r}", remedy)
    return _plane_region(part, "region", region)
