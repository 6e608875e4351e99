"""Checks of a whole mechanism, before anything is meshed or compiled."""

from __future__ import annotations

from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism.mechanism import Mechanism
from fenicsmech.mechanism.parts import FlexibleLink, Joint, Link, RigidLink, same_place
from fenicsmech.mechanism.shapes import Region


def validate(mechanism: Mechanism, dim: int) -> None:
    """Checks that ``mechanism`` can be simulated in ``dim`` dimensions.

    Raises:
        DescriptionError: no ground, an unconnected link, no load path to ground, a force on a fixed link, a joint
            or direction that does not exist in the plane, two interfaces of different shape at one place of a link.
    """
    _check_ground(mechanism)
    _check_forces(mechanism)
    _check_interfaces(mechanism, dim)
    if dim == 2:
        _check_planar(mechanism)


def _check_ground(mechanism: Mechanism) -> None:
    part = f"mechanism {mechanism.name!r}"
    if not mechanism.links:
        raise DescriptionError(part, "it has no links", "Add links with rigid() and flexible()")
    grounded: set[Link] = {link for link in mechanism.rigid_links if link.fixed}
    if not grounded:
        raise DescriptionError(
            part,
            "no link is fixed, so no load has a path to ground",
            "Make one rigid link the ground: rigid(name, fixed=True)",
        )
    pairs = [{joint.a, joint.b} for joint in mechanism.joints]
    for link in mechanism.links:
        if link not in grounded.union(*pairs):
            raise DescriptionError(
                f"link {link.name!r}", "it is not connected: no joint holds it", "Join it to another link or remove it"
            )
    while reached := [pair for pair in pairs if pair & grounded and pair - grounded]:
        grounded = grounded.union(*reached)
    adrift = [link.name for link in mechanism.links if link not in grounded]
    if adrift:
        raise DescriptionError(
            f"link {adrift[0]!r}",
            f"no load path to ground: no joint connects {', '.join(map(repr, adrift))} with a fixed link",
            "Join one of them to a fixed link",
        )


def _check_forces(mechanism: Mechanism) -> None:
    for force in mechanism.forces:
        if isinstance(force.on, RigidLink) and force.on.fixed:
            raise DescriptionError(
                f"force {force.name!r}",
                f"it acts on the fixed link {force.on.name!r}",
                "Give a link that moves",
            )


def _check_interfaces(mechanism: Mechanism, dim: int) -> None:
    found: list[tuple[FlexibleLink, Joint, Region]] = []
    for joint in mechanism.joints:
        for link, region in zip((joint.a, joint.b), joint.regions, strict=True):
            if not isinstance(link, FlexibleLink) or region is None:
                continue
            for owner, first, known in found:
                same = owner == link and same_place(first.at, joint.at, dim=dim, length=mechanism.length)
                if same and known != region:
                    raise DescriptionError(
                        f"{joint.name!r}",
                        f"its interface on {link.name!r} is {region}, but {first.name!r} has {known} at the same place",
                        "Give joints at one place of a link the same interface radius or region",
                    )
            found.append((link, joint, region))


def _check_planar(mechanism: Mechanism) -> None:
    for joint in mechanism.joints:
        part = f"{joint.name!r}"
        if not joint.kind.planar:
            raise DescriptionError(
                part, f"a {joint.kind.name} joint does not exist in a planar model", "Use space='3d' or a planar joint"
            )
        out_of_plane = abs(joint.axis[2])
        if joint.kind.axis_in_plane and out_of_plane > 1e-12:
            raise DescriptionError(
                part, f"its axis {joint.axis} leaves the plane", "Give an axis (x, y) or use space='3d'"
            )
        if not joint.kind.axis_in_plane and out_of_plane < 1.0 - 1e-12:
            raise DescriptionError(
                part, f"its axis {joint.axis} is not normal to the plane", "Leave it at (0, 0, 1) or use space='3d'"
            )
    for load in (*mechanism.forces, *mechanism.outputs):
        if len(load.direction) == 3 and abs(load.direction[2]) > 1e-12:
            raise DescriptionError(
                f"{load.name!r}", f"its direction {load.direction} leaves the plane", "Give (x, y) or use space='3d'"
            )
