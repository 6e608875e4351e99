"""Meshes of single links: conforming to the regions where joints hold the link, made by gmsh, kept as plain arrays.

Ask for a mesh
    ``mesh_link``       shape + interface sites → ``LinkMesh``
    ``check_link``      what can be refused before anything is meshed
    ``InterfaceSite``   where a joint takes hold of the link
    ``LinkMesh``        points, cells, and which interface holds each cell (``FREE``: none)

Ask for a file to print or to machine a link from
    ``write_step``      the solid: smooth curves through the mesh's boundary, extruded, with ``PinHole``s
    ``write_stl``       its surface

Geometry that other layers use too
    ``Centreline``      the smooth curve of a strip
    ``radius_ratios``   shape quality of cells
    ``cell_measures``   signed areas and volumes of cells
    ``boundary_loops``  outline and holes of a plane mesh
    ``plan_of``         the plane mesh that an extruded one repeats

One file per kind of link: ``strip`` (with ``strip_outline`` and ``strip_pins``), ``outline``, ``step``, ``mesh_file``.
What is the same all through its depth is drawn and cut in the plane (``plan_view``, ``regions``, ``fragments``,
``sizing``) and then extruded (``extrude``). ``mesh_checks`` says what every mesh must satisfy. What ``solid`` writes is
the ``section`` between curves (``outline_curves``, ``smooth_outline``) from corner to corner (``corners``) of the
``boundary``. ``gmsh_session`` is the only place that starts gmsh. Nothing here knows of finite elements or of parallel
ranks.
"""

from fenicsmech.meshing import mesh_file, outline, step, strip  # noqa: F401  (each registers its shape)
from fenicsmech.meshing.boundary import boundary_loops
from fenicsmech.meshing.bulge import bulge_field
from fenicsmech.meshing.centreline import Centreline
from fenicsmech.meshing.corners import corners_of
from fenicsmech.meshing.curved_edges import CurvedEdges
from fenicsmech.meshing.distribute import MechanismMesh, distribute
from fenicsmech.meshing.extrude import extrude, extrude_half, layer_count
from fenicsmech.meshing.gmsh_session import gmsh, gmsh_session
from fenicsmech.meshing.interface_site import InterfaceSite, across
from fenicsmech.meshing.link_mesh import FREE, LinkMesh, cell_measures
from fenicsmech.meshing.link_mesher import check_link, mesh_link
from fenicsmech.meshing.mesh_checks import count_pieces
from fenicsmech.meshing.mid_plane import on_mid_plane
from fenicsmech.meshing.outline_curves import CircleArc, sampled, start_of
from fenicsmech.meshing.plan import plan_of
from fenicsmech.meshing.planform import distance
from fenicsmech.meshing.quality import radius_ratios
from fenicsmech.meshing.section import PinHole
from fenicsmech.meshing.sizing import LEAST_SEGMENTS, circle_segments
from fenicsmech.meshing.smooth_outline import smooth_outline
from fenicsmech.meshing.solid import write_step, write_stl
from fenicsmech.meshing.thickness import typical_thickness

__all__ = [
    "Centreline",
    "CircleArc",
    "CurvedEdges",
    "FREE",
    "InterfaceSite",
    "LEAST_SEGMENTS",
    "LinkMesh",
    "MechanismMesh",
    "PinHole",
    "across",
    "boundary_loops",
    "bulge_field",
    "cell_measures",
    "check_link",
    "circle_segments",
    "corners_of",
    "count_pieces",
    "distance",
    "distribute",
    "extrude",
    "extrude_half",
    "gmsh",
    "gmsh_session",
    "layer_count",
    "mesh_link",
    "on_mid_plane",
    "plan_of",
    "radius_ratios",
    "sampled",
    "smooth_outline",
    "start_of",
    "typical_thickness",
    "write_step",
    "write_stl",
]
