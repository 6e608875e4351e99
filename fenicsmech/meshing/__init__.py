"""Meshes of single links: conforming to the regions where joints hold the link, made by gmsh, kept as plain arrays.

Meshes
    ``mesh_link``       shape + interface sites → ``LinkMesh``
    ``check_link``      checks of the shape before anything is meshed
    ``InterfaceSite``   region of a link that a joint holds
    ``LinkMesh``        points, cells, and which interface holds each cell (``FREE``: none)
    ``distribute``      the meshes of all links as one dolfinx mesh

Geometry that other layers use too
    ``radius_ratios``   shape quality of cells
    ``cell_measures``   signed areas and volumes of cells
    ``boundary_loops``  outline and holes of a plane mesh
    ``plan_of``         the plane mesh that an extruded one repeats

Each kind of link has its file: ``strip``, ``outline`` (with ``plane_curves``) and ``part_files``. It implements the
functions of ``request``, which ``link_mesher`` calls before it checks what every mesh must satisfy. Links that are the
same all through their depth are drawn in the plane, cut by their interfaces (``cutting``) and extruded (``planar``).
Only ``gmsh_session`` starts gmsh; only ``distribute`` makes dolfinx meshes, over parallel ranks.
"""

from fenicsmech.meshing import outline, part_files, strip  # noqa: F401  (each registers its shapes)
from fenicsmech.meshing.cutting import circle_segments
from fenicsmech.meshing.distribute import MechanismMesh, bulge_field, distribute, on_mid_plane
from fenicsmech.meshing.gmsh_session import gmsh, gmsh_session, muted_output
from fenicsmech.meshing.link_mesh import (
    FREE,
    CurvedEdges,
    LinkMesh,
    boundary_loops,
    cell_measures,
    count_pieces,
    radius_ratios,
)
from fenicsmech.meshing.link_mesher import check_link, mesh_link, typical_thickness
from fenicsmech.meshing.planar import extrude, extrude_half, layer_count, plan_of
from fenicsmech.meshing.plane_curves import (
    CircleArc,
    Curve,
    draw_loop,
    sampled,
    start_of,
    straight_line,
)
from fenicsmech.meshing.request import LEAST_SEGMENTS, InterfaceSite

__all__ = [
    "CircleArc",
    "Curve",
    "CurvedEdges",
    "FREE",
    "InterfaceSite",
    "LEAST_SEGMENTS",
    "LinkMesh",
    "MechanismMesh",
    "boundary_loops",
    "bulge_field",
    "cell_measures",
    "check_link",
    "circle_segments",
    "count_pieces",
    "distribute",
    "draw_loop",
    "extrude",
    "extrude_half",
    "gmsh",
    "gmsh_session",
    "layer_count",
    "mesh_link",
    "muted_output",
    "on_mid_plane",
    "plan_of",
    "radius_ratios",
    "sampled",
    "start_of",
    "straight_line",
    "typical_thickness",
]
