"""What every link mesh must satisfy, whatever it was made from."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from fenicsmech.errors import MeshingError
from fenicsmech.meshing.holders import overlap
from fenicsmech.meshing.interface_site import InterfaceSite, across, along
from fenicsmech.meshing.link_mesh import FREE, LinkMesh, cell_measures
from fenicsmech.meshing.mesh_request import MeshRequest

_ON_LINK = 1e-2  # how far, in element sizes, a joint may lie off its link: rounded coordinates, flattened arcs


def check_link_mesh(mesh: LinkMesh, request: MeshRequest) -> LinkMesh:
    """``mesh`` itself, once all checks have passed.

    Raises:
        MeshingError: a cell has no volume; the link falls apart; a joint is off the link or holds no cell; the
            regions of two joints touch; nothing is left to bend.
    """
    _check_volumes(mesh, request)
    _check_connected(mesh, request)
    for number, site in enumerate(request.sites):
        _check_holds(mesh, request, number, site)
    _check_apart(mesh, request)
    _check_flexible(mesh, request)
    return mesh


def _check_volumes(mesh: LinkMesh, request: MeshRequest) -> None:
    longest = np.ptp(mesh.points[mesh.cells], axis=1).max(axis=1)
    flat = np.flatnonzero(cell_measures(mesh.points, mesh.cells) <= 1e-12 * longest**mesh.dim)
    if len(flat):
        where = ", ".join(f"{c:g}" for c in mesh.points[mesh.cells[flat[0]]].mean(axis=0))
        raise MeshingError(
            request.part,
            f"{len(flat)} of {len(mesh.cells)} cells have no volume, one of them at ({where})",
            "Remove tiny features from the shape, or change the element size",
        )


def _check_connected(mesh: LinkMesh, request: MeshRequest) -> None:
    pieces = count_pieces(mesh.cells)
    if pieces > 1:
        raise MeshingError(
            request.part, f"the link falls into {pieces} separate pieces", "Describe each piece as a link of its own"
        )


def count_pieces(cells: np.ndarray) -> int:
    """Number of parts of the mesh that no edge (of triangles) or face (of tetrahedra) connects."""
    vertices = cells.shape[1]
    facets = np.concatenate([cells[:, list(kept)] for kept in combinations(range(vertices), vertices - 1)])
    _, facet = np.unique(np.sort(facets, axis=1), axis=0, return_inverse=True)
    cell = np.tile(np.arange(len(cells)), vertices)
    facet = facet.reshape(-1) + len(cells)
    total = int(facet.max()) + 1
    graph = coo_matrix((np.ones(len(cell)), (cell, facet)), shape=(total, total))
    return connected_components(graph, directed=False)[0]


def _check_holds(mesh: LinkMesh, request: MeshRequest, number: int, site: InterfaceSite) -> None:
    held = mesh.cells_of(number)
    tolerance = _ON_LINK * request.size
    offsets = across(site, mesh.points)
    away = _distance(offsets, mesh.cells)
    shown = ", ".join(f"{c:g}" for c in site.at)
    if away > tolerance and not _surrounds(offsets, held):
        raise MeshingError(
            request.part_at(site),
            f"the point ({shown}) is not on the link, but {away:g} away from it",
            "Move the joint onto the link, or change the link's shape",
        )
    if not len(held):
        raise MeshingError(
            request.part_at(site),
            f"no cell lies in {site.region} around ({shown})",
            "Make the region larger or the elements smaller",
        )
    if mesh.dim == len(site.at) == 3:
        heights = along(site, mesh.points[np.unique(held)])
        if heights.min() > tolerance or heights.max() < -tolerance:
            raise MeshingError(
                request.part_at(site),
                f"the point ({shown}) is not on the link: along the joint's axis the link lies between "
                f"{heights.min():g} and {heights.max():g} from it",
                "Move the joint along its axis onto the link",
            )


def _distance(offsets: np.ndarray, cells: np.ndarray) -> float:
    """Distance of the origin of the plane from the projection of the nearest cell; 0 inside one."""
    nearest = math.inf
    for kept in combinations(range(cells.shape[1]), 3):
        corners = offsets[cells[:, list(kept)]]
        edges = np.roll(corners, -1, axis=1) - corners
        squares = np.maximum(np.einsum("mkd,mkd->mk", edges, edges), np.finfo(float).tiny)
        # twice the area to the left of each edge, seen from the origin; their sum is twice the triangle's area
        left = edges[..., 1] * corners[..., 0] - edges[..., 0] * corners[..., 1]
        upright = np.abs(left.sum(axis=1)) <= 1e-9 * squares.max(axis=1)  # projected onto a line
        if np.any(~upright & (np.all(left >= 0.0, axis=1) | np.all(left <= 0.0, axis=1))):
            return 0.0
        foot = np.clip(-np.einsum("mkd,mkd->mk", corners, edges) / squares, 0.0, 1.0)
        nearest = min(nearest, float(np.linalg.norm(corners + foot[..., None] * edges, axis=2).min()))
    return nearest


def _surrounds(offsets: np.ndarray, cells: np.ndarray) -> bool:
    """Whether the projections of ``cells`` stand around the origin on all sides, as around a pin hole."""
    if not len(cells):
        return False
    angles = np.arctan2(offsets[cells, 1], offsets[cells, 0])
    # a cell beside the origin is seen under less than a half turn: measure it from its own first vertex
    relative = np.angle(np.exp(1j * (angles - angles[:, :1])))
    start = angles[:, 0] + relative.min(axis=1)
    width = np.ptp(relative, axis=1)
    start = np.mod(start, 2.0 * math.pi)
    order = np.argsort(start)
    start, reach = start[order], np.maximum.accumulate((start + width)[order])
    # the last arcs may run over into the next turn
    first_covered = max(reach[-1] - 2.0 * math.pi, 0.0)
    covered = np.maximum(reach[:-1], first_covered)
    gaps_inside = start[1:] - covered
    closes = start[0] + 2.0 * math.pi - reach[-1]
    return bool(np.all(gaps_inside <= 1e-6) and closes <= 1e-6)


def _check_apart(mesh: LinkMesh, request: MeshRequest) -> None:
    """No two interfaces may share a vertex: it could not follow both bodies."""
    held = mesh.interface != FREE
    holder = np.repeat(mesh.interface[held], mesh.dim + 1)
    vertex = mesh.cells[held].reshape(-1)
    pairs = np.unique(np.column_stack([vertex, holder]), axis=0)
    shared = np.flatnonzero(pairs[1:, 0] == pairs[:-1, 0])
    if len(shared):
        raise overlap(request, int(pairs[shared[0], 1]), int(pairs[shared[0] + 1, 1]))


def _check_flexible(mesh: LinkMesh, request: MeshRequest) -> None:
    if not np.any(mesh.interface == FREE):
        raise MeshingError(
            request.part,
            "the interface regions of its joints cover the whole link, so nothing of it can bend",
            "Make the regions smaller, or the link rigid",
        )
