"""Shapes of links and of their interfaces, as plain data (lengths in the user's unit)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fenicsmech.checks import finite, point, points, positive
from fenicsmech.errors import DescriptionError

Point = tuple[float, ...]


@dataclass(frozen=True)
class Disc:
    """Interface region of a pin: all points within ``radius`` of the joint's axis."""

    radius: float


@dataclass(frozen=True)
class Rectangle:
    """Interface region of a clamp: a rectangle centred on the joint.

    ``length`` runs along the direction at ``angle`` (rad) from x, ``width`` across it.
    """

    length: float
    width: float
    angle: float = 0.0


Region = Disc | Rectangle


@dataclass(frozen=True)
class Strip:
    """A strip of constant thickness along a smooth centreline, extruded by ``depth``.

    Two points give a straight strip, more points the interpolating C² cubic spline (chord-length
    parameter). Ends are flat; each pinned joint adds a round eye. The mid-plane is z = 0.
    """

    centreline: tuple[Point, ...]
    thickness: float
    depth: float


@dataclass(frozen=True)
class Line:
    """Straight segment of an outline, from the end of the previous segment to ``end``."""

    end: Point


@dataclass(frozen=True)
class Arc:
    """Circular segment of an outline, through ``via``, to ``end``."""

    via: Point
    end: Point


@dataclass(frozen=True)
class Outline:
    """A closed planar outline of lines and arcs, extruded by ``depth``; the mid-plane is z = 0."""

    start: Point
    segments: tuple[Line | Arc, ...]
    depth: float


@dataclass(frozen=True)
class StepPart:
    """A solid from a STEP file; in 2D its section with the plane z = ``section``, of depth ``depth``.

    With mid-plane symmetry, the half above its middle, at whatever height it was drawn.
    """

    path: Path
    depth: float
    section: float = 0.0


@dataclass(frozen=True)
class MeshPart:
    """A link given as a gmsh mesh file of triangles (2D) or tetrahedra (3D)."""

    path: Path
    depth: float


Shape = Strip | Outline | StepPart | MeshPart


def strip(centreline: Sequence[Sequence[float]], *, thickness: float, depth: float) -> Strip:
    """A strip along ``centreline`` ((n, 2) points), ``thickness`` in the plane, ``depth`` out of it."""
    return Strip(
        points("strip centreline", centreline, least=2, dimensions=(2,)),
        positive("strip thickness", thickness),
        positive("strip depth", depth),
    )


def polygon(corners: Sequence[Sequence[float]], *, depth: float) -> Outline:
    """The closed polygon through ``corners`` ((n, 2), n ≥ 3), extruded by ``depth``."""
    corners = points("polygon", corners, least=3, dimensions=(2,))
    segments = tuple(Line(corner) for corner in (*corners[1:], corners[0]))
    return Outline(corners[0], segments, positive("polygon depth", depth))


def outline(start: Sequence[float], segments: Sequence[Line | Arc], *, depth: float) -> Outline:
    """The closed outline that runs from ``start`` along ``segments`` and back, extruded by ``depth``."""
    checked = []
    for segment in segments:
        match segment:
            case Line(end=end):
                checked.append(Line(point("outline segment end", end, dimensions=(2,))))
            case Arc(via=via, end=end):
                via = point("outline arc", via, dimensions=(2,))
                checked.append(Arc(via, point("outline segment end", end, dimensions=(2,))))
            case _:
                raise DescriptionError("outline", f"{segment!r} is no segment", "Give Line(…) or Arc(…)")
    return Outline(point("outline start", start, dimensions=(2,)), tuple(checked), positive("outline depth", depth))


def step(path: str | Path, *, depth: float, section: float = 0.0) -> StepPart:
    """The solid in the STEP file ``path``; ``depth`` and ``section`` serve the 2D models."""
    return StepPart(Path(path), positive("STEP depth", depth), finite("STEP section", section))


def gmsh_mesh(path: str | Path, *, depth: float) -> MeshPart:
    """The mesh in the gmsh file ``path``; ``depth`` serves the 2D models."""
    return MeshPart(Path(path), positive("mesh depth", depth))
