"""What is printed of a link, seen along z: its smooth outline and the holes of its pins."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.checks import point, positive
from fenicsmech.errors import MeshingError
from fenicsmech.meshing.boundary import boundary_loops
from fenicsmech.meshing.link_mesh import LinkMesh, cell_measures
from fenicsmech.meshing.outline_curves import Curve, sampled
from fenicsmech.meshing.plan import plan_of
from fenicsmech.meshing.planform import distance, first_crossing, inside
from fenicsmech.meshing.smooth_outline import smooth_outline

_FINE = 1e-5  # of the link's extent: how far the polygons that checks look at deviate from the curves
_DRILLED = 1e-3  # of its radius: how much wider than the pin's hole one in the mesh may be, and still be the same hole
_SAME_DEPTH = 1e-6


@dataclass(frozen=True)
class PinHole:
    """A hole for a pin along z, all through a link.

    Attributes:
        centre: x and y of its axis.
        diameter: of the hole.
    """

    centre: tuple[float, float]
    diameter: float


@dataclass(frozen=True, eq=False)
class Section:
    """The section of an extruded link.

    Attributes:
        loops: closed loops of curves, each with the link to its left: the outline first, then the mesh's own holes.
        pins: round holes, inside the outline and apart from each other and from the loops.
    """

    loops: tuple[list[Curve], ...]
    pins: tuple[PinHole, ...]


def section_of(name: str, mesh: LinkMesh, depth: float, pins: Sequence[PinHole] = ()) -> Section:
    """The section of the link ``mesh``, smooth where the mesh stands for smooth curves.

    Args:
        name: the link's name, for messages.
        mesh: triangles, or tetrahedra in layers along z.
        depth: the link's extent along z.
        pins: holes to be drilled; a narrower one that the mesh has around the same axis gives way.

    Raises:
        MeshingError: cells are turned over, the outline crosses itself, the tetrahedra do not stand in layers or have
            another depth, or a pin hole leaves the link or meets another.
        DescriptionError: a number makes no sense.
    """
    link = f"link {name!r}"
    plan = _plan(link, mesh, depth)
    loops = tuple(smooth_outline(plan.points[loop]) for loop in boundary_loops(link, plan))
    allowed = _FINE * float(np.ptp(plan.points, axis=0).max())
    polygons = [sampled(loop, allowed) for loop in loops]
    _check_simple(link, polygons)
    pins = tuple(_checked(link, pin) for pin in pins)
    kept = [0, *(k for k in range(1, len(loops)) if not any(_drills(pin, polygons[k]) for pin in pins))]
    for number, pin in enumerate(pins):
        _check_room(link, pin, [polygons[k] for k in kept], pins[:number])
    return Section(tuple(loops[k] for k in kept), pins)


def _plan(link: str, mesh: LinkMesh, depth: float) -> LinkMesh:
    """The triangles of the section."""
    flat = np.count_nonzero(cell_measures(mesh.points, mesh.cells) <= 0.0)
    if flat:
        raise MeshingError(
            link,
            f"{flat} of its {len(mesh.cells)} cells are turned over",
            "Choose a design that deforms the mesh less",
        )
    if mesh.dim == 2:
        return mesh
    plan = plan_of(mesh).mesh
    if plan.dim == 3:
        raise MeshingError(
            link,
            "its tetrahedra do not stand in layers along z, so it has no section to extrude",
            "Mesh it with the axes of all its joints along z, or in the plane",
        )
    meshed = float(np.ptp(mesh.points[:, 2]))
    if not math.isclose(meshed, depth, rel_tol=_SAME_DEPTH):
        raise MeshingError(
            link, f"the mesh is {meshed:g} deep, not {depth:g}", "Give the depth that the link was meshed with"
        )
    return plan


def _check_simple(link: str, polygons: Sequence[np.ndarray]) -> None:
    """Refuse loops that cross themselves, and holes that reach beyond the outline."""
    outline, *holes = polygons
    crossings = [first_crossing(polygon) for polygon in polygons]
    crossings += [corner for hole in holes for corner in hole if not inside(outline, corner)]
    where = next((at for at in crossings if at is not None), None)
    if where is not None:
        raise MeshingError(
            link, f"its outline crosses itself near {_shown(where)}", "Choose a design that does not run into itself"
        )


def _checked(link: str, pin: PinHole) -> PinHole:
    part = f"pin hole of {link}"
    return PinHole(point(f"centre, {part}", pin.centre, dimensions=(2,)), positive(f"diameter, {part}", pin.diameter))


def _drills(pin: PinHole, hole: np.ndarray) -> bool:
    """Whether nothing is left of a hole of the mesh once the pin's hole is drilled."""
    reach = np.linalg.norm(hole - pin.centre, axis=1).max()
    return bool(inside(hole, np.array(pin.centre)) and reach <= (1.0 + _DRILLED) * 0.5 * pin.diameter)


def _check_room(link: str, pin: PinHole, polygons: Sequence[np.ndarray], others: Sequence[PinHole]) -> None:
    """Refuse a pin hole that the link does not surround."""
    centre, radius = np.array(pin.centre), 0.5 * pin.diameter
    part = f"pin hole at {_shown(centre)} in {link}"
    outline, *holes = polygons
    room = min(distance(polygon, centre) for polygon in polygons)
    if not inside(outline, centre) or any(inside(hole, centre) and distance(hole, centre) > radius for hole in holes):
        raise MeshingError(part, "its centre is not on the link", "Leave it out, or give the joint's place")
    if room <= radius:
        raise MeshingError(
            part,
            f"its diameter {pin.diameter:g} is too large: the link's edge is {room:g} away from its centre",
            f"Choose a pin of less than {2.0 * room:g} in diameter, or a link that is wider there",
        )
    for other in others:
        if math.dist(other.centre, pin.centre) <= radius + 0.5 * other.diameter:
            raise MeshingError(part, f"it meets the one at {_shown(other.centre)}", "Choose thinner pins")


def _shown(at: Sequence[float]) -> str:
    return f"({', '.join(f'{c:g}' for c in at)})"
