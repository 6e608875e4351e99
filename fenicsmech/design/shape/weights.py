"""Bounded biharmonic weights of the handles of a link at the vertices of its mesh.

    min Σ_j ½ w_jᵀ (L M⁻¹ L + c D) w_j    with  0 ≤ w ≤ 1,  Σ_j w_j = 1,
    w_j = 1 at handle j and on the whole interface that it holds, 0 on those of all others,

L, M: stiffness and lumped mass of linear elements, D = ∫ ∂N_i/∂z ∂N_k/∂z, c = 1000 / depth². The weights of an extruded
link are computed on its plan and constant through its depth; D is for other solids. Handles between
joints are vertices of the mesh: the cells that hold them are split there. A. Jacobson, I. Baran, J. Popović,
O. Sorkine: Bounded biharmonic weights for real-time deformation (doi:10.1145/1964921.1964973).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from petsc4py import PETSc
from scipy.sparse import bmat, coo_matrix, csc_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu

from fenicsmech.design.shape.handles import BETWEEN, LinkHandles
from fenicsmech.equilibrium import Factor
from fenicsmech.errors import FenicsmechError
from fenicsmech.meshing import FREE, CurvedEdges, LinkMesh, cell_measures, plan_of


def handle_weights(mesh: LinkMesh, handles: LinkHandles, *, part: str = "link") -> np.ndarray:
    """The weights of all handles at the vertices of ``mesh``, (n, handles).

    Args:
        mesh: the link's mesh.
        handles: its handles; intermediate ones must lie in free cells.
        part: the link's name, for messages.

    Raises:
        FenicsmechError: the weights could not be computed.
    """
    plan = plan_of(mesh)
    expanded, holder = _expand(plan.mesh, handles)
    Q, free = _energy(expanded), holder == BETWEEN
    weights = (holder[:, None] == np.arange(len(handles))).astype(float)
    weights[free] = solve_partition(Q[free][:, free], Q[free][:, ~free] @ weights[~free], part=part)
    weights /= weights.sum(axis=1, keepdims=True)  # rounding
    return weights[plan.column]


def _expand(mesh: LinkMesh, handles: LinkHandles) -> tuple[LinkMesh, np.ndarray]:
    """``mesh`` with intermediate handles as further vertices, and the handle that holds each vertex or none."""
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
        Q = Q + 1000.0 / depth**2 * stiffness(mesh, axis=2)
    return csr_matrix(Q)


_INSIDE = 1e-9  # barycentric coordinates above minus this are inside: rounding


def pierced(mesh: LinkMesh, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The cells on the line along z through ``at`` (2,).

    Returns:
        The cells that it pierces, (k,), and a point of it inside each, (k, dim); a triangle holds the point itself.
    """
    if mesh.dim == 2:
        coordinates = _barycentric(mesh, at)
        inside = coordinates.min(axis=1) >= -_INSIDE
        cell = np.flatnonzero(inside)[:1]
        return cell, np.tile(at, (len(cell), 1))
    # λ(z) = λ(0) + z (λ(1) − λ(0)) ≥ 0 holds between the latest entry and the first exit
    start = _barycentric(mesh, np.append(at, 0.0))
    rise = _barycentric(mesh, np.append(at, 1.0)) - start
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = -start / rise
    enter = np.where(rise > 0.0, crossing, np.where((rise < 0.0) | (start >= -_INSIDE), -np.inf, np.inf)).max(axis=1)
    leave = np.where(rise < 0.0, crossing, np.inf).min(axis=1)
    height = np.ptp(mesh.points[mesh.cells, 2], axis=1)
    cells = np.flatnonzero(leave - enter > 0.05 * height)  # the line does more than touch a corner
    return cells, np.column_stack([np.tile(at, (len(cells), 1)), 0.5 * (enter + leave)[cells]])


def insert(mesh: LinkMesh, at: np.ndarray) -> tuple[LinkMesh, int]:
    """``mesh`` with a vertex at the point ``at`` (dim,), which must be in a free cell, and the number of that vertex.

    The vertex splits the cell, or an edge or face that it is close to with all cells around it; or a vertex close to
    it moves there. Of these ways, the one whose smallest cell is largest is taken. Interfaces are not touched.
    """
    cells = mesh.cells
    coordinates = _barycentric(mesh, at)
    home = int(np.argmax(coordinates.min(axis=1)))
    nearest = np.argsort(coordinates[home])[::-1]
    least = np.count_nonzero(coordinates[home] > 0.05)  # below, the point is close to the opposite face
    ways = []
    for count in range(least, len(nearest) + 1):
        near = cells[home][nearest[:count]]
        around = np.isin(cells, near).sum(axis=1) == count
        if np.all(mesh.interface[around] == FREE):
            ways.append(_move(mesh, near[0], at) if count == 1 else _split(mesh, near, around, at))
    return max(ways, key=_smallest_cell)


def _smallest_cell(way: tuple[LinkMesh, int]) -> float:
    """The least volume among the cells at the new vertex."""
    mesh, vertex = way
    return float(cell_measures(mesh.points, mesh.cells[np.any(mesh.cells == vertex, axis=1)]).min())


def _move(mesh: LinkMesh, vertex: int, at: np.ndarray) -> tuple[LinkMesh, int]:
    points = mesh.points.copy()
    points[vertex] = at
    return replace(mesh, points=points, curved=CurvedEdges.none(mesh.dim)), int(vertex)


def _split(mesh: LinkMesh, near: np.ndarray, around: np.ndarray, at: np.ndarray) -> tuple[LinkMesh, int]:
    """Each cell ``around`` the vertices ``near`` becomes one cell per such vertex, with the new vertex in its place."""
    vertex = len(mesh.points)
    parts = [np.where(mesh.cells[around] == old, vertex, mesh.cells[around]) for old in near]
    cells = np.concatenate([mesh.cells[~around], *parts])
    interface = np.concatenate([mesh.interface[~around], np.full(len(cells) - np.sum(~around), FREE)])
    return LinkMesh(np.vstack([mesh.points, at]), cells, interface, CurvedEdges.none(mesh.dim)), vertex


def _barycentric(mesh: LinkMesh, at: np.ndarray) -> np.ndarray:
    """Barycentric coordinates of a point (dim,) in every cell, (m, dim + 1)."""
    corners = mesh.points[mesh.cells]
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    inner = np.linalg.solve(edges, (at - corners[:, 0])[..., None])[..., 0]
    return np.column_stack([1.0 - inner.sum(axis=1), inner])


def lumped_mass(mesh: LinkMesh) -> np.ndarray:
    """∫ N_i dx, (n,)."""
    corner = np.abs(cell_measures(mesh.points, mesh.cells)) / (mesh.dim + 1)
    return np.bincount(mesh.cells.ravel(), np.repeat(corner, mesh.dim + 1), minlength=len(mesh.points))


def stiffness(mesh: LinkMesh, *, axis: int | None = None) -> csr_matrix:
    """∫ ∇N_i · ∇N_j dx, (n, n); with the derivatives along one coordinate ``axis`` only if given."""
    corners = mesh.points[mesh.cells]
    edges = corners[:, 1:] - corners[:, :1]
    # rows of inverse(edges)ᵀ are ∇N_1 … ∇N_dim
    inner = np.linalg.inv(edges).transpose(0, 2, 1)
    gradients = np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)
    if axis is not None:
        gradients = gradients[..., [axis]]
    local = np.abs(cell_measures(mesh.points, mesh.cells))[:, None, None] * gradients @ gradients.transpose(0, 2, 1)
    k, count = mesh.cells.shape[1], len(mesh.points)
    rows, columns = np.repeat(mesh.cells, k, axis=1), np.tile(mesh.cells, (1, k))
    return csr_matrix(coo_matrix((local.ravel(), (rows.ravel(), columns.ravel())), shape=(count, count)))


_PATIENCE = 5  # whole exchanges in a row that leave no fewer violations than the best so far


def solve_partition(
    Q: csr_matrix, c: np.ndarray, *, part: str, tolerance: float = 1e-10, rounds: int = 1000
) -> np.ndarray:
    """The bounded weights that sum to one and minimise a quadratic energy, by block principal pivoting, (n, k).

        min  Σ_j ½ w_jᵀ Q w_j + c_jᵀ w_j   over w ≥ 0 with Σ_j w_j = 1,
        Q w_j + c_j + λ = μ_j,     w ≥ 0,  μ ≥ 0,  w μ = 0

    With w = 0 outside a set of free weights and μ = 0 inside, one linear system gives w and λ. Free weights below zero
    and others of negative μ change sides, all at once, until there are none. Where their number does not fall, one
    changes at a time, which ends (J. J. Júdice, F. M. Pires: A block principal pivoting algorithm for large-scale
    strictly monotone linear complementarity problems, doi:10.1016/0305-0548(94)90106-6).

    Args:
        Q: symmetric positive definite, (n, n), sparse.
        c: linear terms, (n, k).
        part: what the weights belong to, for messages.
        tolerance: −w, and −μ over the diagonal of Q, that count as zero.
        rounds: maximum number of exchanges.

    Raises:
        FenicsmechError: weights keep changing sides, or Q is singular.
    """
    stiff, count, least, patience = Q.diagonal()[:, None], c.size, c.size + 1, _PATIENCE
    w = splu(csc_matrix(Q), permc_spec="MMD_AT_PLUS_A").solve(-c)  # without bounds; weights of handles sum to one so
    free = w > tolerance
    for _ in range(rounds):
        empty = ~free.any(axis=1)
        free[empty, w[empty].argmax(axis=1)] = True  # one at least carries the sum
        w, mu = _with_free(Q, c, free)
        if not np.isfinite(w).all():
            break
        violated = np.where(free, w < -tolerance, mu < -tolerance * stiff)
        count = np.count_nonzero(violated)
        if count == 0:
            return np.maximum(w, 0.0)
        least, patience = (count, _PATIENCE) if count < least else (least, patience - 1)
        if patience < 0:
            violated.ravel()[: np.flatnonzero(violated)[-1]] = False
        free ^= violated
    raise FenicsmechError(
        part, f"the weights of its handles have not been found: {count} of {w.size} keep changing", "Use fewer handles"
    )


def _with_free(Q: csr_matrix, c: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """w and μ if only some weights are ``free`` of zero, (n, k): K w + Eᵀ λ = −c, E w = 1 over these."""
    vertex, number = np.nonzero(free)[0], np.full(free.shape, -1)
    number[free] = np.arange(len(vertex))
    entries = Q.tocoo()
    row, column = number[entries.row], number[entries.col]
    both = (row >= 0) & (column >= 0)
    values = np.broadcast_to(entries.data[:, None], both.shape)[both]
    K = csr_matrix((values, (row[both], column[both])), shape=(len(vertex), len(vertex)))
    E = csr_matrix((np.ones(len(vertex)), (vertex, np.arange(len(vertex)))), shape=(len(free), len(vertex)))
    stiffest = np.abs(entries.data).max()
    kkt = csr_matrix(bmat([[K / stiffest, E.T], [E, None]]))
    kkt.sort_indices()
    structure = (part.astype(PETSc.IntType) for part in (kkt.indptr, kkt.indices))
    matrix = PETSc.Mat().createAIJ(kkt.shape, csr=(*structure, kkt.data), comm=PETSc.COMM_SELF)
    factor = Factor(matrix)
    solution, right = matrix.createVecs()
    right.array[:] = np.append(-c[free] / stiffest, np.ones(len(free)))
    try:
        factor.refactor()
        factor.solve(right, solution)
        w = np.zeros(free.shape)
        w[free] = solution.array_r[: len(vertex)]
        mu = Q @ w + c + stiffest * solution.array_r[len(vertex) :, None]
    finally:
        for used in (solution, right, matrix):
            used.destroy()
    return w, np.where(free, 0.0, mu)
