"""Links that are the same all through their depth: drawn, cut and meshed in the plane, then given their depth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from fenicsmech.meshing.extrude import extrude, extrude_half, layer_count
from fenicsmech.meshing.fragments import mesh_fragments
from fenicsmech.meshing.gmsh_session import gmsh, gmsh_session
from fenicsmech.meshing.interface_site import InterfaceSite
from fenicsmech.meshing.link_mesh import LinkMesh
from fenicsmech.meshing.mesh_request import MeshRequest
from fenicsmech.meshing.regions import DimTag, region_face, region_prism, solid_reach
from fenicsmech.meshing.scaling import in_units_of
from fenicsmech.meshing.sizing import pin_refinements


@dataclass(frozen=True)
class PlanView:
    """A link seen along z, as faces of the current gmsh model, in units of the element size.

    Attributes:
        faces: faces of the plane z = 0 that make up the link.
        sites: the sites, with regions as they shall be cut.
        corners: for each site the angles (rad) at which the outline of its disc has vertices.
        refinements: element sizes for small features, as gmsh expressions.
    """

    faces: list[DimTag]
    sites: tuple[InterfaceSite, ...]
    corners: tuple[tuple[float, ...], ...]
    refinements: tuple[str, ...] = ()


def mesh_plan_view(
    request: MeshRequest, depth: float, draw: Callable[[tuple[InterfaceSite, ...]], PlanView]
) -> LinkMesh:
    """Mesh a link of constant section.

    In space the plan's triangulation is extruded, so that plane and spatial models share it. Only where a joint's
    axis is not along z is the link meshed as a solid.

    Args:
        request: what is asked for.
        depth: extent along z, symmetric about z = 0.
        draw: draws the link in the current gmsh model in units of the element size, given the sites in these units.

    Raises:
        MeshingError: the mesh cannot be made.
    """
    sites = in_units_of(request.sites, request.size)
    with gmsh_session(request.part):
        plan = draw(sites)
        if all(site.is_planar for site in sites):
            mesh = _mesh_plan(request, plan)
        else:
            mesh = _mesh_solid(request, plan, in_units_of(depth, request.size))
    mesh = replace(mesh, points=mesh.points * request.size, curved=mesh.curved.times(request.size))
    if request.dim == mesh.dim:
        return mesh
    if request.half:
        return extrude_half(mesh, depth, request.layers or layer_count(0.5 * depth, request.size))
    return extrude(mesh, depth, request.layers or layer_count(depth, request.size))


def _mesh_plan(request: MeshRequest, plan: PlanView) -> LinkMesh:
    cutters = [region_face(site, corners=c) for site, c in zip(plan.sites, plan.corners, strict=True)]
    refinements = [*plan.refinements, *pin_refinements(plan.sites, 1.0, request.segments)]
    return mesh_fragments(request, plan.faces, cutters, size=1.0, refinements=refinements)


def _mesh_solid(request: MeshRequest, plan: PlanView, depth: float) -> LinkMesh:
    occ = gmsh.model.occ
    occ.translate(plan.faces, 0.0, 0.0, -0.5 * depth)
    solids = [entity for entity in occ.extrude(plan.faces, 0.0, 0.0, depth) if entity[0] == 3]
    cutters = [region_prism(site, solid_reach(solids, site)) for site in plan.sites]
    refinements = [*plan.refinements, *pin_refinements(plan.sites, 1.0, request.segments)]
    return mesh_fragments(request, solids, cutters, size=1.0, refinements=refinements)
