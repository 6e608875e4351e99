"""The quadratic program of bounded weights that sum to one, solved by PETSc/TAO.

    min  Σ_j ½ w_jᵀ Q w_j + c_jᵀ w_j   over w ≥ 0 with Σ_j w_j = 1

by the method of multipliers: the trust-region Newton method TRON minimises, within the bounds,

    Σ_j (½ w_jᵀ Q w_j + c_jᵀ w_j) + λᵀ s + κ/2 sᵀ D s,     s = Σ_j w_j − 1,  D = diag Q,

and then λ ← λ + κ D s. Every round shrinks s by a factor that does not depend on the mesh.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_matrix, diags, identity, kron

from fenicsmech.errors import FenicsmechError

_PENALTY = 3.0  # κ: larger ones save rounds, but their minimisations take longer
_CLOSE = 1e-9
_ROUNDS = 100


def solve_partition(Q: csr_matrix, c: np.ndarray, *, part: str) -> np.ndarray:
    """The weights w (n, k), to about 1e-9.

    Args:
        Q: symmetric positive definite, (n, n), sparse.
        c: linear terms, (n, k).
        part: what the weights belong to, for messages.

    Raises:
        FenicsmechError: the multipliers did not converge.
    """
    n, k = c.shape
    scale = Q.diagonal().mean()
    Q, c = Q / scale, c / scale
    penalty = _PENALTY * Q.diagonal()
    # unknowns weight by weight, vertex by vertex: w_11, w_12, …, w_1k, w_21, …
    hessian = csr_matrix(kron(Q, identity(k)) + kron(diags(penalty), np.ones((k, k))))
    hessian.sort_indices()
    H = PETSc.Mat().createAIJ(hessian.shape, csr=(hessian.indptr, hessian.indices, hessian.data), comm=PETSc.COMM_SELF)
    linear = H.createVecRight()

    def objective(tao: PETSc.TAO, w: PETSc.Vec, gradient: PETSc.Vec) -> float:
        H.mult(w, gradient)
        value = 0.5 * w.dot(gradient) + linear.dot(w)
        gradient.axpy(1.0, linear)
        return value

    w, lower, upper, slope = (H.createVecRight() for _ in range(4))
    w.set(1.0 / k)
    upper.set(PETSc.INFINITY)
    tao = PETSc.TAO().create(PETSc.COMM_SELF)
    tao.setType(PETSc.TAO.Type.TRON)
    tao.setObjectiveGradient(objective, slope)
    tao.setHessian(lambda *_: None, H)
    tao.setVariableBounds((lower, upper))
    tao.setTolerances(gatol=1e-2 * _CLOSE, grtol=0.0, gttol=0.0)
    tao.getKSP().getPC().setType(PETSc.PC.Type.ICC)
    tao.setSolution(w)

    multipliers = np.zeros(n)
    try:
        for _ in range(_ROUNDS):
            linear.array[:] = (c + (multipliers - penalty)[:, None]).ravel()
            tao.solve()
            excess = w.array.reshape(n, k).sum(axis=1) - 1.0
            multipliers += penalty * excess
            if np.abs(excess).max() < _CLOSE:
                return w.array.reshape(n, k).copy()
    finally:
        # at once: PETSc forgets what the functions of a solver hold if the solver itself was queued
        for thing in (tao, w, lower, upper, slope, linear, H):
            thing.destroy()
    raise FenicsmechError(
        part, f"the weights of its handles add up to 1 ± {np.abs(excess).max():.1e} only", "Use fewer handles"
    )
