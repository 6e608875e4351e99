"""Newton's method for an elastic body, u–p or in displacements alone, some displacements prescribed.

Every rank holds the whole matrix, in the order of ranks, and solves the same system.
"""

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

from fenicsmech.elasticity import ElasticBody

ITERATIONS = 20


def solve(
    body: ElasticBody, fixed: np.ndarray, values: np.ndarray, force: np.ndarray | None = None, *, steps: int = 1
) -> None:
    """Brings ``body`` from its current fields to equilibrium, in equal steps of prescribed values and force.

    Args:
        fixed: prescribed components of u among this rank's own, (k,).
        values: what they are to be, (k,).
        force: dead forces on all of this rank's components of u, (n,); none if left out.
        steps: the number of load steps.

    Raises:
        RuntimeError: no convergence.
    """
    space = body.u.function_space
    size = space.dofmap.index_map.size_local * space.dofmap.index_map_bs
    start, force = body.u.x.array[fixed].copy(), np.zeros(size) if force is None else force
    for fraction in np.arange(1, steps + 1) / steps:
        _newton(body, fixed, start + fraction * (values - start), fraction * force)


def _newton(body: ElasticBody, fixed: np.ndarray, values: np.ndarray, force: np.ndarray) -> None:
    x = body.values()
    unknown, moving = np.ones(len(x), dtype=bool), np.zeros(len(x), dtype=bool)
    unknown[fixed] = False
    if body.pressure is not None:
        unknown[len(force) :] = body.pressure.unknown
    moving[: len(force)] = True
    comm = body.mesh.comm
    free, moving = np.flatnonzero(_joined(comm, unknown)), _joined(comm, moving)
    own = slice(comm.exscan(len(x)) or 0, None)
    for _ in range(ITERATIONS):
        residual, change = body.residuals(), np.zeros_like(x)
        residual[: len(force)] -= force
        change[fixed] = values - x[fixed]
        residual, change, K = _joined(comm, residual), _joined(comm, change), stiffness_matrix(body)
        change[free] = splu(K[free][:, free].tocsc()).solve(-(residual + K @ change)[free])
        x = x + change[own][: len(x)]
        body.take(x)
        body.update()
        if np.abs(change[moving]).max() <= 1e-9 * np.abs(_joined(comm, x)[moving]).max():
            return
    raise RuntimeError(f"last change {np.abs(change).max()}")


def stiffness_matrix(body: ElasticBody) -> csr_matrix:
    """∂²E/∂(u, p)² of all ranks, on each of them (collective)."""
    matrix = body.create_stiffness()
    body.add_stiffness(matrix)
    matrix.assemble()
    starts, columns, values = matrix.getValuesCSR()
    matrix.destroy()
    comm = body.mesh.comm
    starts = np.concatenate([[0], np.cumsum(_joined(comm, np.diff(starts)))])
    return csr_matrix((_joined(comm, values), _joined(comm, columns), starts))


def _joined(comm: MPI.Comm, array: np.ndarray) -> np.ndarray:
    """The arrays of all ranks, one after the other."""
    return np.concatenate(comm.allgather(array))
