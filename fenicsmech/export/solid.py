"""Links for manufacture: their meshes, smoothed and extruded, as solids in STEP files and surfaces in STL files.

Both files describe the same body: the curves through the boundary vertices of the link's plan, minus the holes of its
pins, between z = −depth/2 and z = depth/2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from fenicsmech.errors import MeshingError, point, point_text, positive
from fenicsmech.export.outlines import smooth_outline
from fenicsmech.files import atomic_write
from fenicsmech.meshing import (
    CircleArc,
    Curve,
    LinkMesh,
    boundary_polygons,
    cell_measures,
    draw_loop,
    face_of,
    gmsh,
    gmsh_session,
    muted_output,
    plan_of,
    sampled,
    straight_line,
)
from fenicsmech.polygons import distance_to, first_crossing, is_inside

_SAME_SECTION = 0.01, 0.05
"""Largest difference of the area of both faces of a solid, and of its volume, over those of a prism: on coarse meshes
walls and faces are other polygons of one curve."""


@dataclass(frozen=True)
class PinHole:
    """A hole for a pin along z, all through a link.

    Attributes:
        centre: x and y of its axis.
        diameter: of the hole.
    """

    centre: tuple[float, ...]
    diameter: float


def write_step(
    path: str | Path, mesh: LinkMesh, *, depth: float, pins: Sequence[PinHole] = (), name: str | None = None
) -> None:
    """Writes a link as one solid in a STEP file.

    Its edges are B-spline curves through all boundary vertices of the mesh and the middles of its curved edges, divided
    at true corners, and straight lines and arcs of circles where these points are exactly on such; holes of pins are
    cylinders. Call it on one process only. The file appears complete or not at all.

    Args:
        path: the file; missing parent folders are created.
        mesh: the whole link, in mm (the unit of the file): triangles, or tetrahedra of one section all along z.
        depth: extent along z, symmetric about z = 0.
        pins: holes for pins.
        name: the link's name, for messages; None: that of the file.

    Raises:
        MeshingError: cells are turned over, the outline crosses itself, the tetrahedra do not stand in layers or have
            another depth, a pin hole leaves the link or meets another, or gmsh cannot make the solid.
        DescriptionError: the depth, or a pin's centre or diameter, is not finite or not positive.
        OSError: the file cannot be written.
    """
    name = name or Path(path).stem
    depth = positive(f"depth, link {name!r}", depth)
    loops = _section(name, mesh, depth, pins)
    with gmsh_session(f"link {name!r}"):
        _extrude(loops, depth)
        content = _written("step")
    with atomic_write(path, binary=True) as target:
        target.write(content)


def write_stl(
    path: str | Path,
    mesh: LinkMesh,
    *,
    depth: float,
    pins: Sequence[PinHole] = (),
    tolerance: float = 0.01,
    name: str | None = None,
) -> None:
    """Writes the closed surface of a link as a binary STL file; arguments and errors as for ``write_step``.

    Args:
        tolerance: how far its facets may deviate from the solid in the STEP file.
    """
    name = name or Path(path).stem
    depth, tolerance = positive(f"depth, link {name!r}", depth), positive(f"tolerance, link {name!r}", tolerance)
    polygons = [sampled(loop, tolerance) for loop in _section(name, mesh, depth, pins)]
    with gmsh_session(f"link {name!r}"):
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 2.0 * math.hypot(*np.ptp(polygons[0], axis=0)))  # no edge is divided
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
        loops = [[straight_line(*ends) for ends in pairwise([*polygon, polygon[0]])] for polygon in polygons]
        solid = _extrude(loops, depth, layers=[1])
        gmsh.model.mesh.setOutwardOrientation(solid)
        gmsh.model.mesh.generate(2)
        content = _written("stl")
    with atomic_write(path, binary=True) as target:
        target.write(f"link {name}, lengths in mm".encode("ascii", "replace")[:80].ljust(80) + content[80:])


def _extrude(loops: Sequence[Sequence[Curve]], depth: float, layers: Sequence[int] = ()) -> int:
    """The solid between ``loops``, the outline first, from z = −depth/2 to z = depth/2 in the current gmsh model."""
    occ = gmsh.model.occ
    face = 2, occ.addPlaneSurface([draw_loop(loop, -0.5 * depth) for loop in loops])
    entities = occ.extrude([face], 0.0, 0.0, depth, numElements=layers)
    occ.synchronize()
    return next(tag for dim, tag in entities if dim == 3)


def _written(kind: str) -> bytes:
    """The current gmsh model as the content of a file."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"link.{kind}"
        with muted_output():  # OpenCASCADE reports there, whatever gmsh's options say
            gmsh.write(str(file))
        return file.read_bytes()


def _section(name: str, mesh: LinkMesh, depth: float, pins: Sequence[PinHole]) -> list[list[Curve]]:
    """The section of the link ``mesh`` along z, smooth where the mesh approximates smooth curves.

    Returns:
        Closed loops of curves: the outline, the mesh's own holes, and the circles of the pins, inside the outline and
        apart from each other and from the others. Pins replace narrower holes of the mesh around the same axis.
    """
    link = f"link {name!r}"
    plan = _plan(link, mesh, depth)
    loops = [smooth_outline(polygon) for polygon in boundary_polygons(link, plan)]
    polygons = [sampled(loop, 1e-5 * float(np.ptp(plan.points, axis=0).max())) for loop in loops]
    _check_simple(link, polygons)
    part = f"pin hole of {link}"
    pins = tuple(
        PinHole(point(f"centre, {part}", pin.centre, dimensions=(2,)), positive(f"diameter, {part}", pin.diameter))
        for pin in pins
    )
    kept = [0, *(k for k in range(1, len(loops)) if not any(_drills(pin, polygons[k]) for pin in pins))]
    for number, pin in enumerate(pins):
        _check_room(link, pin, [polygons[k] for k in kept], pins[:number])
    circles = [[CircleArc(np.array(pin.centre), 0.5 * pin.diameter, 0.0, 2.0 * math.pi)] for pin in pins]
    return [*(loops[k] for k in kept), *circles]


def _plan(link: str, mesh: LinkMesh, depth: float) -> LinkMesh:
    """The triangles of the section."""
    flat = np.count_nonzero(cell_measures(mesh.points, mesh.cells) <= 0.0)
    if flat:
        problem = f"cells are turned over: {flat} of {len(mesh.cells)}"
        raise MeshingError(link, problem, "Choose a design that deforms the mesh less")
    if mesh.dim == 2:
        return mesh
    plan, meshed = plan_of(mesh).mesh, float(np.ptp(mesh.points[:, 2]))
    if plan.dim == 3:
        plan, below = face_of(mesh, 1.0), face_of(mesh, -1.0)
        volume, area, other = (cell_measures(own.points, own.cells).sum() for own in (mesh, plan, below))
        faces, whole = _SAME_SECTION
        if abs(area - other) > faces * area or abs(volume - area * meshed) > whole * volume:
            problem = "its section along z is not the same all through its depth, so it has none to extrude"
            raise MeshingError(link, problem, "Write it from a mesh in the plane")
    if not math.isclose(meshed, depth, rel_tol=1e-6):
        problem = f"the mesh is {meshed:g} deep, not {depth:g}"
        raise MeshingError(link, problem, "Give the depth that the link was meshed with")
    return plan


def _check_simple(link: str, polygons: Sequence[np.ndarray]) -> None:
    """Refuses loops that cross themselves, and holes that reach beyond the outline."""
    outline, *holes = polygons
    crossings = [at for polygon in polygons if (at := first_crossing(polygon)) is not None]
    crossings += [corner for hole in holes for corner in hole if not is_inside(outline, corner)]
    if crossings:
        problem = f"its outline crosses itself near {point_text(crossings[0])}"
        raise MeshingError(link, problem, "Choose a design whose outline does not cross itself")


def _drills(pin: PinHole, hole: np.ndarray) -> bool:
    """Whether a pin's hole covers a hole of the mesh, to 0.1 % of its width."""
    reach = np.linalg.norm(hole - pin.centre, axis=1).max()
    return bool(is_inside(hole, np.array(pin.centre)) and reach <= 1.001 * 0.5 * pin.diameter)


def _check_room(link: str, pin: PinHole, polygons: Sequence[np.ndarray], others: Sequence[PinHole]) -> None:
    """Refuses a pin hole that the link does not surround."""
    centre, radius = np.array(pin.centre), 0.5 * pin.diameter
    part = f"pin hole at {point_text(centre)} in {link}"
    outline, *holes = polygons
    room = min(distance_to(polygon, centre) for polygon in polygons)
    around = [hole for hole in holes if is_inside(hole, centre)]
    if not is_inside(outline, centre) or any(distance_to(hole, centre) > radius for hole in around):
        raise MeshingError(part, "its centre is not on the link", "Leave it out, or give the joint's place")
    if room <= radius:
        problem = f"its diameter {pin.diameter:g} is too large: the link's edge is {room:g} away from its centre"
        remedy = f"Choose a pin of less than {2.0 * room:g} in diameter, or a link that is wider there"
        raise MeshingError(part, problem, remedy)
    for other in others:
        if math.dist(other.centre, pin.centre) <= radius + 0.5 * other.diameter:
            raise MeshingError(part, f"it meets the one at {point_text(other.centre)}", "Choose thinner pins")
