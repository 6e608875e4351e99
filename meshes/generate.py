"""Generates the files of this folder: python3 meshes/generate.py [DIRECTORY].

curved_link.step   a solid: an arc 3 thick from (0, 0) to (60, 0), eyes of radius 4 with holes of radius 1.5 at both
                   ends, extruded from z = −5 to 5 (mm)
diagonal.step      a solid: between two arcs from (0, 0) to (40, 60), 2 thick at its ends and 4 in the middle, eyes of
                   radius 4 with holes of radius 1.5 at both ends, extruded from z = −10 to 10 (mm)
strip2d.msh        triangles: a straight strip, 60 by 3, with discs of radius 3 at both ends (gmsh 4.1)
strip3d.msh        tetrahedra: the same, 10 deep (gmsh 2.2)
"""

from __future__ import annotations

import math
import os
import re
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from fenicsmech.mechanism import Disc, strip
from fenicsmech.meshing import CircleArc, InterfaceSite, LinkMesh, gmsh, gmsh_session, mesh_link

SPAN, THICKNESS, DEPTH = 60.0, 3.0, 10.0
RADIUS = 50.0  # of the curved link's centreline
EYE, HOLE = 4.0, 1.5
FAR, RISE = np.array([40.0, 60.0]), 6.0  # end of the diagonal, and the rise of its middle
WIDEST, NARROWEST, BREADTH = 4.0, 2.0, 20.0  # in its middle, at its ends, and along z

_SIMPLEX = {2: 2, 3: 4}  # gmsh's numbers of the triangle and the tetrahedron


def draw_curved_link() -> None:
    """Draw the curved link in the current gmsh model."""
    occ = gmsh.model.occ
    centre = np.array([0.5 * SPAN, -math.sqrt(RADIUS**2 - (0.5 * SPAN) ** 2)])
    middle = occ.addPoint(*centre, 0.0)
    ends = [np.array([0.0, 0.0]), np.array([SPAN, 0.0])]
    corners = {}
    for radius in (RADIUS - 0.5 * THICKNESS, RADIUS + 0.5 * THICKNESS):
        corners[radius] = [occ.addPoint(*(centre + (end - centre) * radius / RADIUS), 0.0) for end in ends]
    (inner_start, inner_end), (outer_start, outer_end) = corners.values()
    edges = [
        occ.addCircleArc(inner_start, middle, inner_end),
        occ.addLine(inner_end, outer_end),
        occ.addCircleArc(outer_end, middle, outer_start),
        occ.addLine(outer_start, inner_start),
    ]
    band = (2, occ.addPlaneSurface([occ.addCurveLoop(edges)]))
    occ.remove([(0, middle)])
    extrude_with_eyes(band, ends, DEPTH)


def draw_diagonal() -> None:
    """Draw the tapered diagonal in the current gmsh model."""
    occ, along = gmsh.model.occ, FAR / np.linalg.norm(FAR)
    across, edges = np.array([-along[1], along[0]]), []
    sides = []
    for side in (-0.5, 0.5):
        vias = [(side * NARROWEST, 0.0), (RISE + side * WIDEST, 0.5), (side * NARROWEST, 1.0)]
        sides.append(CircleArc.through(*(at * FAR + offset * across for offset, at in vias)))
    corners = [[occ.addPoint(*place, 0.0) for place in arc.at(np.array([0.0, 1.0]))] for arc in sides]
    for arc, (start, end) in zip(sides, corners, strict=True):
        middle = occ.addPoint(*arc.centre, 0.0)
        edges.append(occ.addCircleArc(start, middle, end))
        occ.remove([(0, middle)])
    edges += [occ.addLine(corners[0][k], corners[1][k]) for k in (0, 1)]
    band = (2, occ.addPlaneSurface([occ.addCurveLoop([edges[0], edges[3], edges[1], edges[2]])]))
    extrude_with_eyes(band, [0.0 * FAR, FAR], BREADTH)


def extrude_with_eyes(band: tuple[int, int], ends: Sequence[np.ndarray], depth: float) -> None:
    """Make a solid, symmetric about z = 0, of a face with eyes at its ends."""
    occ = gmsh.model.occ
    eyes = [(2, occ.addDisk(*end, 0.0, EYE, EYE)) for end in ends]
    holes = [(2, occ.addDisk(*end, 0.0, HOLE, HOLE)) for end in ends]
    face, _ = occ.cut(occ.fuse([band], eyes)[0], holes)
    occ.translate(face, 0.0, 0.0, -0.5 * depth)
    occ.extrude(face, 0.0, 0.0, depth)
    occ.synchronize()


def draw_mesh(mesh: LinkMesh) -> None:
    """Put ``mesh`` into the current gmsh model as one discrete entity."""
    dim = mesh.dim
    points = np.zeros((len(mesh.points), 3))
    points[:, :dim] = mesh.points
    entity = gmsh.model.addDiscreteEntity(dim)
    gmsh.model.mesh.addNodes(dim, entity, np.arange(1, len(points) + 1), points.ravel())
    gmsh.model.mesh.addElementsByType(entity, _SIMPLEX[dim], [], (mesh.cells + 1).ravel())


def write(path: Path, draw: Callable[[], None], *, version: float = 4.1) -> None:
    """Draw in a gmsh model and write it to ``path``, the same bytes every time."""
    with gmsh_session(path.name), tempfile.TemporaryDirectory(dir=path.parent) as folder:
        draw()
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.SaveAll", 1)
        draft = Path(folder) / path.name
        gmsh.write(str(draft))
        # STEP headers carry the time of writing
        draft.write_text(re.sub(r"'\d{4}-\d\d-\d\dT[\d:]+'", "'2000-01-01T00:00:00'", draft.read_text()))
        os.replace(draft, path)


def generate(folder: Path) -> None:
    """Write all files into ``folder``."""
    line = strip([(0.0, 0.0), (SPAN, 0.0)], thickness=THICKNESS, depth=DEPTH)
    sites = [InterfaceSite(at, Disc(3.0), name=f"pin at {at}") for at in line.centreline]
    plane = mesh_link("strip", line, sites, dim=2, size=1.5)
    space = mesh_link("strip", line, sites, dim=3, size=2.0)
    write(folder / "curved_link.step", draw_curved_link)
    write(folder / "diagonal.step", draw_diagonal)
    write(folder / "strip2d.msh", lambda: draw_mesh(plane))
    write(folder / "strip3d.msh", lambda: draw_mesh(space), version=2.2)


if __name__ == "__main__":
    generate(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
