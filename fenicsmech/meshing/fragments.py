"""Cutting the interface regions out of a CAD body, and meshing what results."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenicsmech.meshing.curved_edges import CurvedEdges
from fenicsmech.meshing.gmsh_session import gmsh
from fenicsmech.meshing.holders import sole_holder
from fenicsmech.meshing.link_mesh import LinkMesh
from fenicsmech.meshing.mesh_request import MeshRequest
from fenicsmech.meshing.regions import DimTag
from fenicsmech.meshing.sizing import set_element_size

# corners between which gmsh's cells of second order have their further nodes, in order
_EDGES = {2: [(0, 1), (1, 2), (2, 0)], 3: [(0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3)]}


def mesh_fragments(
    request: MeshRequest,
    bodies: Sequence[DimTag],
    cutters: Sequence[DimTag],
    *,
    size: float,
    refinements: Sequence[str] = (),
) -> LinkMesh:
    """Mesh ``bodies``, conforming to ``cutters``, in the current gmsh model.

    Args:
        bodies: faces or solids of the link.
        cutters: one face or solid per site of the request; only what lies in the link counts.
        size: element size, in the model's unit of length.
        refinements: smaller element sizes, as gmsh expressions.

    Returns:
        The mesh in the model's coordinates; ``interface`` counts the cutters.

    Raises:
        MeshingError: two cutters share a part of the link.
    """
    occ = gmsh.model.occ
    pieces, origins = occ.fragment(bodies, cutters) if cutters else (bodies, [[body] for body in bodies])
    link = sorted(set().union(*origins[: len(bodies)]))
    held = [set(origin) for origin in origins[len(bodies) :]]
    # what sticks out of the link goes, with its boundary: recursion spares entities that the link still needs
    occ.remove(sorted(set(pieces) - set(link)), recursive=True)
    occ.synchronize()
    holders = [sole_holder(request, [k for k, origin in enumerate(held) if piece in origin]) for piece in link]
    set_element_size(size, refinements)
    dim = bodies[0][0]
    gmsh.model.mesh.generate(dim)
    gmsh.model.mesh.setOrder(2)  # puts the middles of edges on the curves and surfaces they belong to
    return _collect(dim, link, holders)


def _collect(dim: int, link: Sequence[DimTag], holders: Sequence[int]) -> LinkMesh:
    """The simplices of the entities ``link``, each with the number of the site that holds it."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    row_of = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    row_of[tags.astype(np.int64)] = np.arange(len(tags))
    rows, interface = [], []
    for piece, holder in zip(link, holders, strict=True):
        _, _, (nodes,) = gmsh.model.mesh.getElements(*piece)
        rows.append(row_of[nodes.astype(np.int64)].reshape(-1, dim + 1 + len(_EDGES[dim])))
        interface.append(np.full(len(rows[-1]), holder))
    points, rows = coordinates.reshape(-1, 3)[:, :dim], np.concatenate(rows)
    cells, ends, middles = rows[:, : dim + 1], rows[:, _EDGES[dim]], rows[:, dim + 1 :]
    curved = CurvedEdges.through(points, ends.reshape(-1, 2), points[middles.ravel()])
    return LinkMesh.from_cells(points, cells, np.concatenate(interface), curved)
