"""The element size over a link: the requested one, finer only where small features need it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from fenicsmech.mechanism import Disc
from fenicsmech.meshing.gmsh_session import gmsh
from fenicsmech.meshing.interface_site import InterfaceSite, axis_frame

LEAST_SEGMENTS = 8
"""Of a circle."""

_GROWTH = 1.0  # of the element size per unit of distance
_GAP_ASPECT = 4.0  # length over height of the elements in a narrow gap
_LEAST_GAP_SIZE = 0.25  # of the size next to it: bounds what a vanishing gap may cost


def circle_segments(radius: float, size: float) -> int:
    """Number of segments that stand for a whole circle."""
    return max(LEAST_SEGMENTS, math.ceil(2.0 * math.pi * radius / size))


def _segment_length(radius: float, segments: int = LEAST_SEGMENTS) -> float:
    """Greatest length of a segment of a circle of ``segments``."""
    return 2.0 * math.pi * radius / segments


def pin_refinements(sites: Iterable[InterfaceSite], size: float, segments: int = LEAST_SEGMENTS) -> list[str]:
    """Element sizes, as gmsh expressions, that give pins at least so many ``segments``."""
    expressions = []
    for site in sites:
        if isinstance(site.region, Disc) and _segment_length(site.region.radius, segments) < size:
            distance = _distance_from_axis(site)
            fine = 0.999 * _segment_length(site.region.radius, segments)
            expressions.append(f"{fine!r} + {_GROWTH} * max(0, {distance} - {site.region.radius!r})")
    return expressions


def gap_refinement(at: Sequence[float], gap: float, radius: float, widening: Sequence[Sequence[float]]) -> str:
    """Element size, as a gmsh expression, in the narrow gap around a disc. Lengths are in element sizes.

    Where the gap widens along straight sides, it has grown to gap + a²/(2 radius) at the distance a; the element
    size follows it, down to a least size, and grows with the distance from the gap.

    Args:
        at: centre of the disc.
        gap: width of the gap where it is narrowest.
        radius: radius of the disc.
        widening: unit vectors along which the gap widens; none if it goes evenly all around.
    """
    dx, dy = (f"({name} - ({float(c)!r}))" for name, c in zip("xy", at, strict=True))
    widened = "".join(
        f" + max(0, ({float(u)!r}) * {dx} + ({float(v)!r}) * {dy})^2 / {2.0 * radius!r}" for u, v in widening
    )
    least = _LEAST_GAP_SIZE * min(1.0, _segment_length(radius))
    narrow = f"max({least!r}, {_GAP_ASPECT!r} * ({gap!r}{widened}))"
    away = f"max(0, abs(sqrt({dx}^2 + {dy}^2) - {radius + 0.5 * gap!r}) - {0.5 * gap!r})"
    return f"{narrow} + {_GROWTH!r} * {away}"


def set_element_size(size: float, refinements: Sequence[str]) -> None:
    """Make the smallest of ``size`` and ``refinements`` the element size of the current gmsh model."""
    field = gmsh.model.mesh.field
    tag = field.add("MathEval")
    field.setString(tag, "F", f"min({', '.join([repr(float(size)), *refinements])})" if refinements else repr(size))
    field.setAsBackgroundMesh(tag)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)


def _distance_from_axis(site: InterfaceSite) -> str:
    squares = []
    for row in axis_frame(site.axis)[:2]:
        terms = [
            f"({float(c)!r}) * ({name} - ({float(o)!r}))" for c, name, o in zip(row, "xyz", site.centre, strict=True)
        ]
        squares.append(f"({' + '.join(terms)})^2")
    return f"sqrt({' + '.join(squares)})"
