"""What changes the rest shape of one link: its spline's handles and their weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.collective import from_one
from fenicsmech.compat import original_cells
from fenicsmech.design.handle_placement import place_handles
from fenicsmech.design.handles import LinkHandles
from fenicsmech.design.spline_fit import fit_spline
from fenicsmech.design.weights import handle_weights
from fenicsmech.mechanism import Centreline
from fenicsmech.meshing import FREE, LinkMesh, MechanismMesh, cell_measures, plan_of

_SPACING = 1.0  # of handles, in mean widths of the link


@dataclass(frozen=True, eq=False)
class ShapeRequest:
    """How the shape of one link may change.

    Attributes:
        link: index of the flexible link.
        name: its name, for messages.
        centreline: what its spline follows.
        joints: positions of its interfaces, in the order of the mesh, (sites, 2).
        turns: whether each interface may turn about its joint; a clamp may not, (sites,).
        interior: control points between each joint and the next along the centreline, (sites − 1,).
        thickness: in the plane, where δ = 1; None: the mean width of the link.
        spacing: arc length between handles; None: the mean width of the link.
    """

    link: int
    name: str
    centreline: Centreline
    joints: tuple[tuple[float, float], ...]
    turns: tuple[bool, ...]
    interior: tuple[int, ...]
    thickness: float | None = None
    spacing: float | None = None


@dataclass(frozen=True, eq=False)
class LinkShape:
    """The handles of one link and what they move.

    Attributes:
        link: index of the flexible link.
        handles: its handles.
        weights: of each handle at each vertex of the link, (n, handles).
        deviation: largest distance from the spline to the centreline it follows.
        thickness: in the plane, where δ = 1.
    """

    link: int
    handles: LinkHandles
    weights: np.ndarray
    deviation: float
    thickness: float


def shape_link(mesh: LinkMesh, request: ShapeRequest) -> LinkShape:
    """Spline, handles and weights of one link.

    Raises:
        DescriptionError: the spline does not fit the link.
    """
    part = f"link {request.name!r}"
    fit = fit_spline(request.centreline, request.joints, request.interior, part=f"spline of {part}")
    width = _mean_width(mesh, request.centreline.length)
    handles = place_handles(mesh, fit, spacing=request.spacing or _SPACING * width, turns=request.turns, part=part)
    weights = handle_weights(mesh, handles, part=part)
    return LinkShape(request.link, handles, weights, fit.deviation, request.thickness or width)


def shape_links(mesh: MechanismMesh, requests: Sequence[ShapeRequest], *, root: int = 0) -> list[LinkShape]:
    """The shapes of some links, computed on ``root`` and the same on all ranks; errors too (collective)."""
    comm = mesh.mesh.comm
    links = gather_links(mesh)
    return from_one(comm, lambda: [shape_link(links[request.link], request) for request in requests], root=root)


def gather_links(mesh: MechanismMesh, vertices: np.ndarray | None = None) -> list[LinkMesh]:
    """The mesh of every flexible link with its own numbering of interfaces, on every rank (collective).

    Args:
        mesh: the mechanism's mesh.
        vertices: where its vertices are, (vertices, dim); as drawn by default.
    """
    points = mesh.vertices if vertices is None else vertices
    interface = np.full(len(mesh.cells), FREE)
    topology = mesh.mesh.topology
    owned = topology.index_map(topology.dim).size_local
    for cells, numbers in mesh.mesh.comm.allgather((original_cells(mesh.mesh)[:owned], mesh.interface[:owned])):
        interface[cells] = numbers
    links = []
    for link in range(mesh.link_of_cell.max() + 1):
        mine = mesh.link_of_cell == link
        numbers = interface[mine]
        numbers[numbers != FREE] -= numbers[numbers != FREE].min(initial=np.iinfo(int).max)
        links.append(LinkMesh.from_cells(points, mesh.cells[mine].copy(), numbers))
    return links


def _mean_width(mesh: LinkMesh, length: float) -> float:
    """Area of the link in the plane over the length of its centreline."""
    plan = plan_of(mesh).mesh
    size = np.abs(cell_measures(plan.points, plan.cells)).sum()
    return size / length if plan.dim == 2 else size / length / np.ptp(plan.points[:, 2])
