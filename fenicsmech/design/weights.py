"""Bounded biharmonic weights: how much each handle of a link moves each vertex of its mesh.

    min Σ_j ½ w_jᵀ (L M⁻¹ L + c D) w_j    with  0 ≤ w ≤ 1,  Σ_j w_j = 1,
    w_j = 1 at handle j and on the whole interface that it holds, 0 on those of all others,

L, M: stiffness and lumped mass of linear elements, D = ∫ ∂N_i/∂z ∂N_k/∂z. The weights of an extruded link are
sought on its plan, so that they do not change through its depth at all; D serves other solids. A. Jacobson, I. Baran,
J. Popović, O. Sorkine: Bounded biharmonic weights for real-time deformation (doi:10.1145/1964921.1964973).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix, diags

from fenicsmech.design.handles import BETWEEN, LinkHandles
from fenicsmech.design.insertion import insert, pierced
from fenicsmech.design.laplacian import lumped_mass, stiffness
from fenicsmech.design.partition import solve_partition
from fenicsmech.meshing import LinkMesh, plan_of

_OUT_OF_PLANE = 1000.0  # c, per square of the depth


def handle_weights(mesh: LinkMesh, handles: LinkHandles, *, part: str = "link") -> np.ndarray:
    """The weights of all handles at the vertices of ``mesh``, (n, handles).

    Args:
        mesh: the link's mesh.
        handles: its handles; intermediary ones must lie in free cells.
        part: the link's name, for messages.

    Raises:
        FenicsmechError: the weights could not be computed.
    """
    plan = plan_of(mesh)
    expanded, holder = _expand(plan.mesh, handles)
    Q, free = _energy(expanded), holder == BETWEEN
    weights = (holder[:, None] == np.arange(len(handles))).astype(float)
    weights[free] = solve_partition(Q[free][:, free], Q[free][:, ~free] @ weights[~free], part=part)
    # the solver keeps to bounds and sum up to its tolerance
    weights = np.maximum(weights, 0.0)
    weights /= weights.sum(axis=1, keepdims=True)
    return weights[plan.column]


def _expand(mesh: LinkMesh, handles: LinkHandles) -> tuple[LinkMesh, np.ndarray]:
    """``mesh`` with intermediary handles as further vertices, and the handle that holds each vertex or none."""
    held: list[tuple[int, np.ndarray | int]] = []
    for index, (site, centre) in enumerate(zip(handles.site, handles.centre, strict=True)):
        if site != BETWEEN:
            held.append((index, np.unique(mesh.cells_of(site))))
            continue
        for point in pierced(mesh, centre)[1]:
            mesh, vertex = insert(mesh, point)
            held.append((index, vertex))
    holder = np.full(len(mesh.points), BETWEEN)
    for index, vertices in held:
        holder[vertices] = index
    return mesh, holder


def _energy(mesh: LinkMesh) -> csr_matrix:
    """L M⁻¹ L + c D."""
    L = stiffness(mesh)
    Q = L @ diags(1.0 / lumped_mass(mesh)) @ L
    if mesh.dim == 3:
        depth = np.ptp(mesh.points[:, 2])
        Q = Q + _OUT_OF_PLANE / depth**2 * stiffness(mesh, axis=2)
    return csr_matrix(Q)
