"""Meshes of single links: conforming to the regions where joints hold the link, made by gmsh, kept as plain arrays.

Meshes
    ``mesh_link``       shape + interface sites → ``LinkMesh``
    ``plan_size``       how much there is to mesh of a link from a file
    ``check_link``      checks of the shape before anything is meshed
    ``InterfaceSite``   region of a link that a joint holds
    ``LinkMesh``        points, cells, and which interface holds each cell (``FREE``: none)
    ``distribute``      the meshes of all links as one dolfinx mesh

Geometry that other layers use too
    ``radius_ratios``   shape quality of cells
    ``cell_measures``   signed areas and volumes of cells
    ``boundary_loops``  outline and holes of a plane mesh
    ``link_outline``    the curves around a link, as they were drawn
    ``matches``         motions that make a link the image of another one
    ``plan_of``         the plane mesh that an extruded one repeats
    ``section_of``      that, or a solid's face

Each kind of link has its file: ``strip``, ``outline`` and ``part_files``. It registers the functions with which
``link_mesher`` checks and meshes it. Links that are the same all through their depth are drawn in the plane, cut by
their interfaces (``cutting``) and extruded. Only ``session`` starts gmsh; ``link_mesh`` holds the arrays
and makes dolfinx meshes of them, over parallel ranks.
"""

from fenicsmech.meshing import outline, part_files, strip  # each registers its shapes
from fenicsmech.meshing.centreline import LinkOutline, find_centreline, thinnest_stretch
from fenicsmech.meshing.cutting import circle_segments
from fenicsmech.meshing.images import Figure, Isometry, Match, has_plain_outline, image_of, matches, same_mesh
from fenicsmech.meshing.link_mesh import (
    FREE,
    CurvedEdges,
    LinkMesh,
    MechanismMesh,
    boundary_loops,
    boundary_polygons,
    bulge_field,
    cell_measures,
    count_pieces,
    distribute,
    edge_corners,
    edge_rows,
    extrude,
    face_of,
    least_stretches,
    node_ends,
    on_mid_plane,
    parts_of,
    plan_of,
    radius_ratios,
    section_of,
)
from fenicsmech.meshing.link_mesher import LEAST_SEGMENTS, InterfaceSite, check_link, mesh_link
from fenicsmech.meshing.outline import (
    CircleArc,
    Curve,
    draw_loop,
    link_outline,
    link_thickness,
    points_on,
    sample_parameters,
    sampled,
    start_of,
    straight_line,
)
from fenicsmech.meshing.part_files import plan_size
from fenicsmech.meshing.session import gmsh, gmsh_session, muted_output
