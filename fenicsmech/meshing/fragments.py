"""Cutting the interface regions out of a CAD body, and meshing what results."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenicsmech.meshing.gmsh_session import gmsh
from fenicsmech.meshing.holders import sole_holder
from fenicsmech.meshing.link_mesh import LinkMesh
from fenicsmech.meshing.mesh_request import MeshRequest
from fenicsmech.meshing.regions import DimTag
from fenicsmech.meshing.sizing import set_element_size


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
    return _collect(dim, link, holders)


def _collect(dim: int, link: Sequence[DimTag], holders: Sequence[int]) -> LinkMesh:
    """The linear simplices of the entities ``link``, each with the number of the site that holds it."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    row_of = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    row_of[tags.astype(np.int64)] = np.arange(len(tags))
    cells, interface = [], []
    for piece, holder in zip(link, holders, strict=True):
        _, _, (nodes,) = gmsh.model.mesh.getElements(*piece)
        corners = row_of[nodes.astype(np.int64)].reshape(-1, dim + 1)
        cells.append(corners)
        interface.append(np.full(len(corners), holder))
    return LinkMesh.from_cells(coordinates.reshape(-1, 3)[:, :dim], np.concatenate(cells), np.concatenate(interface))
