"""Bodies that move rigidly: rigid links, and the interfaces of flexible links."""

from __future__ import annotations

from dataclasses import dataclass

from fenicsmech.mechanism import Link, Region, RigidLink


@dataclass(frozen=True)
class Body:
    """A rigid link, or one interface of a flexible link.

    Attributes:
        name: for messages: of the rigid link, or of the (first) joint that an interface belongs to.
        link: the link it is, or is part of.
        centre: reference centre c of its pose, (dim,).
        fixed: it never moves and carries no unknowns.
        region: interface region (None for rigid links).
        axis: axis of the interface region.
    """

    name: str
    link: Link
    centre: tuple[float, ...]
    fixed: bool
    region: Region | None = None
    axis: tuple[float, ...] = (0.0, 0.0, 1.0)


def rigid_body(link: RigidLink, centre: tuple[float, ...]) -> Body:
    """The body of a rigid link."""
    return Body(link.name, link, centre, link.fixed)
