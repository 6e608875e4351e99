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
from fenicsmech.meshing.centreline import Centreline
from fenicsmech.meshing.interface_site import InterfaceSite
from fenicsmech.meshing.link_mesh import FREE, LinkMesh, cell_measures
from fenicsmech.meshing.link_mesher import check_link, mesh_link
from fenicsmech.meshing.plan import plan_of
from fenicsmech.meshing.quality import radius_ratios
from fenicsmech.meshing.section import PinHole
from fenicsmech.meshing.solid import write_step, write_stl

__all__ = [
    "FREE",
    "Centreline",
    "InterfaceSite",
    "LinkMesh",
    "PinHole",
    "boundary_loops",
    "cell_measures",
    "check_link",
    "mesh_link",
    "plan_of",
    "radius_ratios",
    "write_step",
    "write_stl",
]
