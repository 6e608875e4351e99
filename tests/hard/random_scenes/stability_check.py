"""Number of unstable directions of an equilibrium, from second differences of the potential alone.

    L(u, z) = Π − λᵀ C,    Aᵀ λ = ∂Π/∂z,    A = ∂C/∂z,

its second derivative restricted to admissible directions (free nodes, and motions of bodies that keep joints closed)
has a negative eigenvalue for each. Congruence with a diagonal keeps the signs and brings eigenvalues near one another.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

import fenicsmech as fm

from .closure import Place
from .motions import moved
from .potential import Potential

_IMAGINARY, _REAL = 1e-30, 1e-5
_DIGITS = 1e-10  # of the largest eigenvalue, after scaling: smaller ones have no sign
_DENSE = 1500  # unknowns up to which all eigenvalues are found; beyond, the four nearest to zero


def unstable_directions(potential: Potential, frame: fm.Frame) -> int | None:
    """The number of negative eigenvalues; None if one is too small to have a sign."""
    values = eigenvalues(potential, frame.state.u, frame.state.poses, frame.force)
    return None if np.abs(values).min() < _DIGITS * values.max() else int(np.sum(values < 0.0))


def eigenvalues(potential: Potential, u: np.ndarray, poses: np.ndarray, magnitude: float) -> np.ndarray:
    """Of the scaled second derivative on admissible directions, ascending; those nearest to zero of large scenes.

    Args:
        potential: of the scene.
        u: nodal displacements, flat, (n dim,).
        poses: of the bodies.
        magnitude: of the force that changes.
    """
    mesh, places = potential.mesh, potential.places(poses)
    u = potential.nodal(np.array(u).reshape(mesh.nodes.shape), places)
    free = np.flatnonzero(np.repeat(potential.held < 0, mesh.dim))
    bodies = [i for i, fixed in enumerate(potential.fixed) if not fixed]
    stiffness = _stiffness(potential, u)
    curvature, null = _body_curvature(potential, u, places, bodies, magnitude)
    follow, curvature = _interface_motion(potential, places, bodies) @ null, null.T @ curvature @ null
    stiff = stiffness[free]
    hessian = sparse.bmat(
        [[stiff[:, free], stiff @ follow], [follow.T @ stiff.T, follow.T @ (stiffness @ follow) + curvature]]
    ).tocsc()
    diagonal = np.abs(hessian.diagonal())
    scale = sparse.diags(1.0 / np.sqrt(np.maximum(diagonal, 1e-14 * diagonal.max())))
    scaled = scale @ (0.5 * (hessian + hessian.T)) @ scale
    if scaled.shape[0] <= _DENSE:
        return np.linalg.eigvalsh(scaled.toarray())
    return np.sort(eigsh(scaled.tocsc(), k=4, sigma=0.0, return_eigenvectors=False))


def _motions(potential: Potential, bodies: list[int]) -> list[np.ndarray]:
    """Unit velocities of the free bodies, angles times length."""
    size, dim = (3 if potential.mesh.dim == 2 else 6), potential.mesh.dim
    motions = []
    for body in bodies:
        for k in range(size):
            velocity = np.zeros((len(potential.fixed), size))
            velocity[body, k] = 1.0 if k < dim else 1.0 / potential.blueprint.length
            motions.append(velocity)
    return motions


def _interface_motion(potential: Potential, places: list[Place], bodies: list[int]) -> np.ndarray:
    """∂u/∂z of all nodes, (n dim, z)."""
    zero = np.zeros(potential.mesh.nodes.shape)
    columns = [
        potential.nodal(zero, moved(places, 1j * _IMAGINARY * motion)).imag.ravel() / _IMAGINARY
        for motion in _motions(potential, bodies)
    ]
    return np.array(columns, dtype=float).T


def _stiffness(potential: Potential, u: np.ndarray) -> sparse.csr_matrix:
    """∂²E/∂u² of all nodes, (n dim, n dim), cell by cell."""
    mesh, rows, columns, entries = potential.mesh, [], [], []
    for cells, slopes, tangent in potential.tangents(u, imaginary=_IMAGINARY, real=_REAL):
        block = np.einsum("mqka,mqiajb,mqlb->mkilj", slopes, tangent, slopes, optimize=True)
        dofs = (mesh.cells[cells][..., None] * mesh.dim + np.arange(mesh.dim)).reshape(len(cells), -1)
        size = dofs.shape[1]
        rows.append(np.repeat(dofs, size, axis=1).ravel())
        columns.append(np.tile(dofs, (1, size)).ravel())
        entries.append(block.ravel())
    data = np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))
    return sparse.coo_matrix(data, shape=(u.size, u.size)).tocsr()


def _body_curvature(
    potential: Potential, u: np.ndarray, places: list[Place], bodies: list[int], magnitude: float
) -> tuple[np.ndarray, np.ndarray]:
    """Second derivative of L by the motion of bodies alone, nodal forces frozen, and the null space of A."""
    motions = _motions(potential, bodies)
    held = np.argwhere((potential.held >= 0)[:, None] & np.ones(u.shape, dtype=bool))
    forces = np.zeros(u.shape)
    for node, axis in held:
        step = np.zeros(u.shape, dtype=complex)
        step[node, axis] = 1j * _IMAGINARY
        forces[node, axis] = potential.value(u + step, places, magnitude).imag / _IMAGINARY

    def work(there: list[Place]) -> complex:
        """Part of Π that changes with bodies while nodal forces and effects on links stay."""
        value = np.sum(forces * potential.nodal(np.zeros(u.shape), there))
        value = value + potential.body_potential(np.zeros(u.shape), there)
        for force, size in potential.acting(magnitude):
            if force.on not in potential.rows:
                value = value - size * potential.travel(force, u, there)
        return value

    def slopes(function, there: np.ndarray) -> np.ndarray:
        """Derivatives along all motions, after real velocities ``there``."""
        return np.array(
            [
                np.imag(function(moved(places, there + 1j * _IMAGINARY * motion))).astype(float) / _IMAGINARY
                for motion in motions
            ]
        )

    still = np.zeros_like(motions[0])
    jacobian = slopes(potential.closure.residual, still).T
    multipliers = np.linalg.lstsq(jacobian.T, slopes(work, still), rcond=1e-10)[0]
    _, values, right = np.linalg.svd(jacobian, full_matrices=True)
    null = right[int(np.sum(values > 1e-9 * max(values.max(initial=0.0), 1e-300))) :].T

    def lagrangian(there: list[Place]) -> complex:
        return work(there) - multipliers @ potential.closure.residual(there)

    rows = [
        (slopes(lagrangian, _REAL * motion) - slopes(lagrangian, -_REAL * motion)) / (2 * _REAL) for motion in motions
    ]
    return np.array(rows), null
