"""The curved edges of a mechanism's mesh as a field: c, by which curved cells differ from straight ones."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from dolfinx import fem

from fenicsmech.compat import cell_dofs, cell_nodes, original_nodes, vector_space
from fenicsmech.meshing.distribute import MechanismMesh


def bulge_field(mesh: MechanismMesh) -> fem.Function | None:
    """c as a quadratic vector field on ``mesh``; None if all edges are straight."""
    if not len(mesh.curved.ends):
        return None
    bulge = fem.Function(vector_space(mesh.mesh, 2), name="bulge")
    dim = mesh.vertices.shape[1]
    values, nodes = bulge.x.array.reshape(-1, dim), cell_dofs(bulge.function_space)
    found = mesh.curved.of_cells(original_nodes(mesh.mesh)[cell_nodes(mesh.mesh)])
    # edges of the reference simplex are numbered by the corners that they do not touch, from the last pair to the first
    order = len(list(combinations(range(dim + 1), 2))) - 1 - np.arange(found.shape[1])
    curved = np.flatnonzero(np.any(found != 0.0, axis=(1, 2)))
    values[nodes[curved, dim + 1 :]] = found[curved][:, order]
    return bulge
