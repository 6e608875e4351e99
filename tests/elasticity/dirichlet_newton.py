"""Newton's method for an elastic body with some components of displacement prescribed, for small serial meshes."""

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from fenicsmech.elasticity import ElasticBody

ITERATIONS = 20


def solve(
    body: ElasticBody, fixed: np.ndarray, values: np.ndarray, force: np.ndarray | None = None, *, steps: int = 1
) -> list[float]:
    """Brings ``body`` from its current u to equilibrium, in equal steps of the prescribed values and of the force.

    Args:
        fixed: prescribed components of u.x.array, (k,).
        values: what they are to be, (k,).
        force: dead forces on all components, (n,); none if left out.
        steps: the number of load steps.

    Returns:
        the residual norms of the last step, relative to the first, of the free components.

    Raises:
        RuntimeError: no convergence.
    """
    u = body.u.x.array
    force = np.zeros_like(u) if force is None else force
    start = u[fixed].copy()
    for fraction in np.arange(1, steps + 1) / steps:
        norms = _newton(body, fixed, start + fraction * (values - start), fraction * force)
    return norms


def _newton(body: ElasticBody, fixed: np.ndarray, values: np.ndarray, force: np.ndarray) -> list[float]:
    u = body.u.x.array
    matrix = fem.petsc.create_matrix(body.stiffness_forms[0][0])
    change, right = matrix.createVecs()
    solver = PETSc.KSP().create(matrix.comm)
    solver.setType(PETSc.KSP.Type.PREONLY)
    solver.getPC().setType(PETSc.PC.Type.LU)
    solver.getPC().setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
    norms: list[float] = []
    try:
        for _ in range(ITERATIONS):
            missing = values - u[fixed]
            right.array[:] = force - body.assembled(body.residual_forms[0])
            matrix.zeroEntries()
            body.add_stiffness(matrix)
            matrix.assemble()
            change.set(0.0)
            change.array[fixed] = missing
            matrix.zeroRowsColumns(fixed.astype(np.int32), 1.0, change, right)
            residual = right.array.copy()
            residual[fixed] = 0.0
            norms.append(float(np.linalg.norm(residual)))
            solver.setOperators(matrix)
            solver.solve(right, change)
            u += change.array
            u[fixed] = values
            # the error left is of the order of the square of this change
            if np.abs(change.array).max() <= 1e-8 * np.abs(u).max():
                return [norm / norms[0] for norm in norms]
    finally:
        for thing in (matrix, right, change, solver):
            thing.destroy()
    raise RuntimeError(f"residual norms {norms}")
