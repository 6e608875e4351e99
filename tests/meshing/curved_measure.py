"""Areas and volumes of meshes whose edges are curved, and how much their cells are squeezed."""

from itertools import combinations

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import compile_form
from fenicsmech.meshing import CurvedEdges, LinkMesh, bulge_field, distribute


def measure(mesh: LinkMesh, comm: MPI.Comm = MPI.COMM_SELF) -> float:
    """∫ det(I + ∇c) dX₀, exact (collective)."""
    shared = distribute(comm, [mesh] if comm.rank == 0 else None)
    bulge = bulge_field(shared)
    volume = fem.Constant(shared.mesh, 1.0) if bulge is None else ufl.det(ufl.Identity(mesh.dim) + ufl.grad(bulge))
    dx = ufl.Measure("dx", domain=shared.mesh, metadata={"quadrature_degree": mesh.dim})
    return float(comm.allreduce(fem.assemble_scalar(compile_form(volume * dx))))


def least_jacobian(points: np.ndarray, cells: np.ndarray, edges: CurvedEdges, *, steps: int = 8) -> float:
    """The least det(I + ∇c) on a grid of ``steps`` + 1 points along every edge of the cells.

    c is differentiated here as a polynomial in the coordinates of the cell: x = x₀ + J ξ, λ = (1 − Σ ξ, ξ).
    """
    dim = points.shape[1]
    corners = points[cells]
    jacobians = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    slopes = np.vstack([-np.ones(dim), np.eye(dim)])  # ∂λ/∂ξ
    bulge_of = {tuple(end): w for end, w in zip(edges.ends.tolist(), edges.bulges, strict=True)}
    least = np.inf
    for place in np.ndindex(*[steps + 1] * dim):
        if sum(place) > steps:
            continue
        xi = np.array(place) / steps
        weights = np.concatenate([[1.0 - xi.sum()], xi])
        for cell, jacobian in zip(cells.tolist(), jacobians, strict=True):
            gradient = np.zeros((dim, dim))
            for i, j in combinations(range(dim + 1), 2):
                w = bulge_of.get(tuple(sorted((cell[i], cell[j]))))
                if w is not None:
                    gradient += 4.0 * np.outer(w, weights[i] * slopes[j] + weights[j] * slopes[i])
            least = min(least, np.linalg.det(jacobian + gradient) / np.linalg.det(jacobian))
    return least
