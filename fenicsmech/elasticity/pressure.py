"""The pressure field of links that have one, continuous, a degree below the displacement.

Its nodes that touch only cells of other links, or of interfaces, where nothing deforms, are no unknowns.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh

from fenicsmech.compat import add_ghosts, cell_dofs, owned_values, scalar_space


class PressureField:
    """p and which of its nodes are unknowns.

    Args:
        mesh: reference mesh.
        degree: of p.
        cells: local cells in which p acts.

    Attributes:
        p: the field, zero where it does not act.
        unknown: whether each owned node is an unknown, (owned,).
        count: number of unknowns on all ranks.
    """

    def __init__(self, mesh: dmesh.Mesh, degree: int, cells: np.ndarray) -> None:
        V = scalar_space(mesh, degree)
        self.p = fem.Function(V, name="pressure")
        marker = fem.Function(V)
        marker.x.array[cell_dofs(V)[cells]] = 1.0
        # a node may touch such a cell only on another rank
        add_ghosts(marker)
        self.unknown = owned_values(marker) > 0.0
        self.count = int(mesh.comm.allreduce(int(self.unknown.sum())))
