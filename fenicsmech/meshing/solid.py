"""Links to make: their meshes, smoothed and extruded, as solids in STEP files and as surfaces in STL files.

Both files describe the same body: the curves through the boundary vertices of the link's plan, minus the holes of its
pins, between z = −depth/2 and z = depth/2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import singledispatch
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.interpolate import BSpline

from fenicsmech.checks import positive
from fenicsmech.files import atomic_write
from fenicsmech.meshing.boundary import boundary_loops
from fenicsmech.meshing.fragments import mesh_fragments
from fenicsmech.meshing.gmsh_session import gmsh, gmsh_session
from fenicsmech.meshing.link_mesh import LinkMesh
from fenicsmech.meshing.mesh_request import MeshRequest
from fenicsmech.meshing.muting import muted_output
from fenicsmech.meshing.outline_curves import CircleArc, Curve, sampled, start_of
from fenicsmech.meshing.regions import DimTag
from fenicsmech.meshing.section import PinHole, Section, section_of

_WIDEST_ARC = 0.75 * math.pi  # arcs are drawn in pieces below a half turn, whose ends tell on which side they run

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


def write_step(
    path: str | Path, mesh: LinkMesh, *, depth: float, pins: Sequence[PinHole] = (), name: str | None = None
) -> None:
    """Write a link as one solid in a STEP file.

    Its edges are B-spline curves through all boundary vertices of the mesh, divided at true corners, and straight
    lines and arcs of circles where the vertices are exactly on these; holes of pins are cylinders. Call it on one
    process only. The file appears complete or not at all.

    Args:
        path: the file; missing parent folders are created.
        mesh: the whole link, in mm (the unit of the file): triangles, or tetrahedra in layers along z.
        depth: extent along z, symmetric about z = 0.
        pins: holes to be left for pins.
        name: the link's name, for messages; None: that of the file.

    Raises:
        MeshingError: cells are turned over, the outline crosses itself, the tetrahedra do not stand in layers or have
            another depth, a pin hole leaves the link or meets another, or gmsh cannot make the solid.
        DescriptionError: the depth, or a pin's centre or diameter, makes no sense.
        OSError: the file cannot be written.
    """
    name = name or Path(path).stem
    depth = positive(f"depth, link {name!r}", depth)
    section = section_of(name, mesh, depth, pins)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "link.step"
        with gmsh_session(f"link {name!r}"):
            gmsh.model.occ.extrude([_face(section, -0.5 * depth)], 0.0, 0.0, depth)
            gmsh.model.occ.synchronize()
            with muted_output():  # OpenCASCADE reports there, whatever gmsh's options say
                gmsh.write(str(file))
        content = file.read_bytes()
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
    """Write the closed surface of a link as a binary STL file; arguments and errors as for ``write_step``.

    Args:
        tolerance: how far its facets may deviate from the solid in the STEP file.
    """
    name = name or Path(path).stem
    depth, tolerance = (
        positive(f"{what}, link {name!r}", value) for what, value in (("depth", depth), ("tolerance", tolerance))
    )
    section = section_of(name, mesh, depth, pins)
    polygons = [sampled(loop, tolerance) for loop in section.loops]
    circles = [CircleArc(np.array(pin.centre), 0.5 * pin.diameter, 0.0, 2.0 * math.pi) for pin in section.pins]
    polygons += [sampled([circle], tolerance) for circle in circles]
    corners = _prism(f"link {name!r}", _triangulated(name, polygons), depth)
    facets = np.zeros(len(corners), dtype=_FACET)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facets["corners"], facets["normal"] = corners, normals / np.linalg.norm(normals, axis=1, keepdims=True)
    with atomic_write(path, binary=True) as target:
        target.write(f"link {name}, lengths in mm".encode("ascii", "replace")[:80].ljust(80))
        target.write(np.uint32(len(facets)).astype("<u4").tobytes())
        target.write(facets.tobytes())


def _face(section: Section, height: float) -> DimTag:
    """The section as a face of the plane z = ``height`` in the current gmsh model."""
    occ = gmsh.model.occ
    wires = [occ.addCurveLoop(_edges(loop, height)) for loop in section.loops]
    wires += [occ.addCurveLoop([occ.addCircle(*pin.centre, height, 0.5 * pin.diameter)]) for pin in section.pins]
    return 2, occ.addPlaneSurface(wires)


def _edges(loop: Sequence[Curve], height: float) -> list[int]:
    """The curves of a closed loop in the current gmsh model; each ends in the point where the next begins."""
    starts = [gmsh.model.occ.addPoint(*start_of(curve), height) for curve in loop]
    ends = zip(starts, [*starts[1:], starts[0]], strict=True)
    return [edge for curve, pair in zip(loop, ends, strict=True) for edge in _drawn(curve, pair, height)]


@singledispatch
def _drawn(curve: Curve, ends: tuple[int, int], height: float) -> list[int]:
    """The curves that draw one of the outline between two points of the current gmsh model."""
    raise TypeError(f"{type(curve).__name__} is not a curve of an outline")


@_drawn.register
def _(curve: BSpline, ends: tuple[int, int], height: float) -> list[int]:
    occ = gmsh.model.occ
    if curve.k == 1:
        return [occ.addLine(*ends)]
    inner = [occ.addPoint(*at, height) for at in curve.c[1:-1]]
    knots, repeats = (a.tolist() for a in np.unique(curve.t, return_counts=True))
    spline = occ.addBSpline([ends[0], *inner, ends[1]], degree=curve.k, knots=knots, multiplicities=repeats)
    _forget(inner)
    return [spline]


@_drawn.register
def _(curve: CircleArc, ends: tuple[int, int], height: float) -> list[int]:
    occ = gmsh.model.occ
    pieces = math.ceil(abs(curve.sweep) / _WIDEST_ARC)
    between = [occ.addPoint(*at, height) for at in curve.at(np.arange(1, pieces) / pieces)]
    middle = occ.addPoint(*curve.centre, height)
    arcs = [occ.addCircleArc(a, middle, b) for a, b in pairwise([ends[0], *between, ends[1]])]
    _forget([middle])
    return arcs


def _forget(points: Sequence[int]) -> None:
    """Remove points that no curve begins or ends in: they would go into the file."""
    gmsh.model.occ.remove([(0, at) for at in points])


def _triangulated(name: str, polygons: Sequence[np.ndarray]) -> LinkMesh:
    """Triangles between closed polygons, the first of them the outline; their edges are kept."""
    size = 2.0 * float(np.ptp(polygons[0], axis=0).max())  # more than any edge: nothing is divided
    with gmsh_session(f"link {name!r}"):
        occ = gmsh.model.occ
        wires = []
        for polygon in polygons:
            points = [occ.addPoint(*at, 0.0) for at in polygon]
            ends = zip(points, [*points[1:], points[0]], strict=True)
            wires.append(occ.addCurveLoop([occ.addLine(*pair) for pair in ends]))
        return mesh_fragments(MeshRequest(name, (), 2, size), [(2, occ.addPlaneSurface(wires))], [], size=size)


def _prism(part: str, plan: LinkMesh, depth: float) -> np.ndarray:
    """The corners (m, 3, 3) of the facets around the body over ``plan``, counter-clockwise seen from outside."""
    count = len(plan.points)
    heights = np.repeat([-0.5 * depth, 0.5 * depth], count)
    points = np.column_stack([np.tile(plan.points, (2, 1)), heights])
    # the link lies to the left of every edge a → b: with a′, b′ above them, a b b′ and a b′ a′ look to the right
    a = np.concatenate(boundary_loops(part, plan))
    b = np.concatenate([np.roll(loop, -1) for loop in boundary_loops(part, plan)])
    walls = [np.column_stack([a, b, b + count]), np.column_stack([a, b + count, a + count])]
    return points[np.concatenate([plan.cells[:, ::-1], plan.cells + count, *walls])]
