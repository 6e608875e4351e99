"""Linear elasticity on isoparametric elements of any order, by gmsh, numpy and PETSc alone.

References for stresses where no closed form holds: a part of a body between planes of symmetry, meshed finely where the
stress is largest, its ends moved. Nothing of fenicsmech is used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import gmsh
import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_matrix


@dataclass(frozen=True)
class Held:
    """A component of the displacement that is prescribed on a plane.

    Attributes:
        axis: to which the plane is normal.
        at: coordinate of the plane.
        component: of the displacement.
        value: of it, at points (n, dim).
    """

    axis: int
    at: float
    component: int
    value: Callable[[np.ndarray], np.ndarray] = lambda points: np.zeros(len(points))

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Mask (n,) of the points on the plane."""
        return np.abs(points[:, self.axis] - self.at) < 1e-8 * np.ptp(points)


@dataclass(frozen=True, eq=False)
class FineSolution:
    """Stresses averaged over the elements at each node, and reactions.

    Attributes:
        points: nodes, (n, dim).
        stress: (n, 3, 3).
        forces: on the body where it is held, (n, dim).
    """

    points: np.ndarray
    stress: np.ndarray
    forces: np.ndarray

    @property
    def von_mises(self) -> np.ndarray:
        """√(3/2 dev σ : dev σ), (n,)."""
        deviator = self.stress - np.trace(self.stress, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
        return np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))


@contextmanager
def drawing() -> Iterator[None]:
    """A gmsh model of its own within."""
    gmsh.initialize([], False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
        gmsh.model.add("fine")
        yield
    finally:
        gmsh.finalize()


def solved(
    draw: Callable[[], int],
    size: str,
    held: Sequence[Held],
    *,
    order: int,
    modulus: float,
    poisson: float,
    depth: float | None = None,
    layers: int = 4,
) -> FineSolution:
    """The equilibrium of a body in plane stress, or of depth ``depth`` above the plane z = 0 of symmetry.

    Args:
        draw: draws a face in the plane z = 0 with gmsh's OpenCASCADE kernel, and returns its tag.
        size: of the elements as a gmsh expression of x, y, z.
        held: prescribed displacements; at z = 0 that along z is added.
        order: of the elements.
        modulus: Young's.
        poisson: Poisson's ratio.
        depth: above z = 0; None: plane stress.
        layers: through it.
    """
    with drawing():
        face, dim = draw(), 2 if depth is None else 3
        if depth is not None:
            gmsh.model.occ.extrude([(2, face)], 0.0, 0.0, depth, numElements=[layers])
        gmsh.model.occ.synchronize()
        field = gmsh.model.mesh.field.add("MathEval")
        gmsh.model.mesh.field.setString(field, "F", size)
        gmsh.model.mesh.field.setAsBackgroundMesh(field)
        gmsh.model.mesh.generate(dim)
        gmsh.model.mesh.setOrder(order)
        (kind,), _, (numbers,) = gmsh.model.mesh.getElements(dim)
        _, _, _, count, corners, _ = gmsh.model.mesh.getElementProperties(kind)
        inside, weights = gmsh.model.mesh.getIntegrationPoints(kind, f"Gauss{2 * order}")
        slopes = _slopes(kind, inside, count, dim)
        at_nodes = np.zeros((count, 3))
        at_nodes[:, :dim] = np.reshape(corners, (count, dim))
        nodal_slopes = _slopes(kind, at_nodes.ravel(), count, dim)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
    used, cells = np.unique(numbers, return_inverse=True)
    cells = cells.reshape(-1, count)
    row = np.zeros(int(tags.max()) + 1, dtype=int)
    row[tags] = np.arange(len(tags))
    points = coordinates.reshape(-1, 3)[row[used], :dim]
    stiffness = _stiffness(modulus, poisson, dim)
    matrix = _matrix(points, cells, slopes, weights, stiffness)
    conditions = [*held, *([Held(2, 0.0, 2)] if dim == 3 else [])]
    values, is_held = np.zeros_like(points), np.zeros(points.shape, dtype=bool)
    for own in conditions:
        on = own.holds(points)
        values[on, own.component], is_held[on, own.component] = own.value(points[on]), True
    fixed, free, values = np.flatnonzero(is_held), np.flatnonzero(~is_held), values.ravel()
    values[free] = _solve(matrix[free][:, free], -(matrix[free][:, fixed] @ values[fixed]))
    forces = (matrix @ values).reshape(-1, dim)
    stress = _nodal_stress(points, cells, nodal_slopes, stiffness, values.reshape(-1, dim))
    return FineSolution(points, stress, forces)


def _slopes(kind: int, places: np.ndarray, count: int, dim: int) -> np.ndarray:
    """Derivatives of the shape functions by reference coordinates, (places, nodes, dim)."""
    _, values, _ = gmsh.model.mesh.getBasisFunctions(kind, places, "GradLagrange")
    return np.reshape(values, (-1, count, 3))[..., :dim]


def _stiffness(modulus: float, poisson: float, dim: int) -> np.ndarray:
    """C with σ = C : ε of the components in the plane, or of all, (dim, dim, dim, dim)."""
    unit, shear = np.eye(dim), modulus / (2.0 * (1.0 + poisson))
    # λ, in plane stress 2 λ μ / (λ + 2 μ)
    lame = modulus * poisson / ((1.0 + poisson) * (1.0 - (2.0 if dim == 3 else 1.0) * poisson))
    pairs = np.einsum("ik,jl->ijkl", unit, unit)
    return lame * np.einsum("ij,kl->ijkl", unit, unit) + shear * (pairs + pairs.transpose(0, 1, 3, 2))


def _gradients(nodes: np.ndarray, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of shape functions in space, (cells, places, nodes, dim), and determinants, (cells, places)."""
    jacobian = np.einsum("mad,qar->mqdr", nodes, slopes)
    return np.einsum("qar,mqrd->mqad", slopes, np.linalg.inv(jacobian)), np.abs(np.linalg.det(jacobian))


def _matrix(
    points: np.ndarray, cells: np.ndarray, slopes: np.ndarray, weights: np.ndarray, stiffness: np.ndarray
) -> csr_matrix:
    """The stiffness matrix; unknowns are the components at each node in turn."""
    dim, count = points.shape[1], cells.shape[1]
    total, chunk = csr_matrix((points.size, points.size)), max(1, 2_000_000 // (count * dim) ** 2)
    for start in range(0, len(cells), chunk):
        own = cells[start : start + chunk]
        gradients, volumes = _gradients(points[own], slopes)
        force = np.einsum("ijkl,mqbl,mq->mqijbk", stiffness, gradients, volumes * weights, optimize=True)
        local = np.einsum("mqaj,mqijbk->maibk", gradients, force, optimize=True)
        unknowns = (dim * own[..., None] + np.arange(dim)).reshape(len(own), -1)
        size = unknowns.shape[1]
        place = np.repeat(unknowns, size, axis=1).ravel(), np.tile(unknowns, size).ravel()
        total += csr_matrix((local.ravel(), place), shape=total.shape)
    return total


def _solve(matrix: csr_matrix, right: np.ndarray) -> np.ndarray:
    """The solution by Cholesky's factorisation (MUMPS)."""
    comm = PETSc.COMM_SELF
    own = PETSc.Mat().createAIJ(matrix.shape, csr=(matrix.indptr, matrix.indices, matrix.data), comm=comm)
    solver = PETSc.KSP().create(comm)
    solver.setOperators(own)
    solver.setType("preonly")
    solver.getPC().setType("cholesky")
    solver.getPC().setFactorSolverType("mumps")
    solution = PETSc.Vec().createSeq(len(right), comm=comm)
    solver.solve(PETSc.Vec().createWithArray(right, comm=comm), solution)
    return solution.array.copy()


def _nodal_stress(
    points: np.ndarray, cells: np.ndarray, slopes: np.ndarray, stiffness: np.ndarray, moved: np.ndarray
) -> np.ndarray:
    """Means over the elements at each node of the stress, (n, 3, 3)."""
    dim = points.shape[1]
    gradients, _ = _gradients(points[cells], slopes)
    stress = np.einsum("ijkl,mak,mqal->mqij", stiffness, moved[cells], gradients, optimize=True)
    total, counts = np.zeros((len(points), 3, 3)), np.bincount(cells.ravel(), minlength=len(points))
    np.add.at(total[:, :dim, :dim], cells, stress)
    return total / counts[:, None, None]
