"""Newton's method for an elastic body with or without a pressure of its own, some displacements prescribed; serial."""

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

from fenicsmech.elasticity import ElasticBody

ITERATIONS = 20


def solve(
    body: ElasticBody, fixed: np.ndarray, values: np.ndarray, force: np.ndarray | None = None, *, steps: int = 1
) -> None:
    """Brings ``body`` from its current fields to equilibrium, in equal steps of prescribed values and force.

    Args:
        fixed: prescribed components of u, (k,).
        values: what they are to be, (k,).
        force: dead forces on all components of u, (n,); none if left out.
        steps: the number of load steps.

    Raises:
        RuntimeError: no convergence.
    """
    size = len(body.u.x.array)
    start, force = body.u.x.array[fixed].copy(), np.zeros(size) if force is None else force
    for fraction in np.arange(1, steps + 1) / steps:
        _newton(body, fixed, start + fraction * (values - start), fraction * force)


def _newton(body: ElasticBody, fixed: np.ndarray, values: np.ndarray, force: np.ndarray) -> None:
    x = body.values()
    unknown = np.ones(len(x), dtype=bool)
    unknown[fixed] = False
    if body.pressure is not None:
        unknown[len(force) :] = body.pressure.unknown
    free = np.flatnonzero(unknown)
    for _ in range(ITERATIONS):
        residual, K = body.residuals(), tangent(body)
        residual[: len(force)] -= force
        change = np.zeros_like(x)
        change[fixed] = values - x[fixed]
        change[free] = splu(K[free][:, free].tocsc()).solve(-(residual + K @ change)[free])
        x = x + change
        body.take(x)
        body.update()
        u = np.abs(x[: len(force)]).max()
        if np.abs(change[: len(force)]).max() <= 1e-9 * u:
            return
    raise RuntimeError(f"last change {np.abs(change).max()}")


def tangent(body: ElasticBody) -> csr_matrix:
    """∂²E/∂(u, p)²."""
    matrix = body.create_tangent()
    body.tangent(matrix)
    matrix.assemble()
    starts, columns, values = matrix.getValuesCSR()
    matrix.destroy()
    return csr_matrix((values, columns, starts))
