"""Number of unstable directions of an equilibrium, from second differences of the potential alone.

    L(u, z) = Π − λᵀ C,    Aᵀ λ = ∂Π/∂z,    A = ∂C/∂z,

its second derivative restricted to admissible directions (free nodes, and motions of bodies that keep joints closed)
has a negative eigenvalue for each. Congruence with a diagonal keeps the signs and brings eigenvalues near one another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh, splu

import fenicsmech as fm

from .closure import Place
from .motions import moved
from .potential import Potential
from .thresholds import THRESHOLDS

_IMAGINARY, _REAL = 1e-30, 1e-5
_NEAR = 1e-10  # over the mechanism's length: less than penetrations, at the end of which contact has kinks
# unknowns up to which all eigenvalues are found; beyond, the four nearest to zero, unless some are negative
_DENSE = 500


@dataclass(frozen=True)
class _Second:
    """Second derivative of L on admissible directions.

    Attributes:
        hessian: by displacements of free nodes, then motions of bodies.
        slope: of the travel that is led, by the same.
        motions: basis of the motions that keep joints closed, (motions of all free bodies, ways).
    """

    hessian: sparse.csc_matrix
    slope: np.ndarray
    motions: np.ndarray

    @property
    def scale(self) -> np.ndarray:
        """1 / √ of the diagonal."""
        diagonal = np.abs(self.hessian.diagonal())
        return 1.0 / np.sqrt(np.maximum(diagonal, THRESHOLDS.scaled * diagonal.max()))


def unstable_directions(potential: Potential, frame: fm.Frame) -> int | None:
    """The number of negative eigenvalues; None if one is too small to have a sign."""
    every = bool(frame.unstable_modes)
    values = eigenvalues(potential, frame.state.u, frame.state.poses, frame.force, every=every)
    signless = np.abs(values).min() < THRESHOLDS.signless * max(1.0, values.max())
    return None if signless else int(np.sum(values < 0.0))


def checkable(potential: Potential) -> bool:
    """Whether stability can be judged: pressures, at which potentials have saddles, are not eliminated here."""
    return not len(potential.free_pressures) and int(potential.free.sum()) <= THRESHOLDS.unknowns


def eigenvalues(
    potential: Potential, u: np.ndarray, poses: np.ndarray, magnitude: float, *, every: bool = False, led: bool = False
) -> np.ndarray:
    """Of the scaled second derivative on admissible directions, ascending; of large scenes those nearest to zero,
    unless ``every`` one is wanted or some of these are negative.

    Idle spins are left out: as many eigenvalues as there are, those nearest to zero. Links in u–p form count with the
    law in displacements.

    Args:
        potential: of the scene.
        u: nodal displacements, flat, (n dim,).
        poses: of the bodies.
        magnitude: of the force that changes.
        every: whether all are wanted.
        led: whether directions that take the force's point along are left out, as where its displacement is prescribed.
    """
    second = _second(potential, u, poses, magnitude)
    return _lowest(potential, second, second.scale, every=every, led=led)


def stiffness_left(
    potential: Potential, frame: fm.Frame, unloaded: Potential, drawn: np.ndarray, *, led: bool
) -> float | None:
    """Stiffness of the softest mode of a frame over that of the softest one of the unloaded scene; ``led`` as in
    ``eigenvalues``.

    Both are those of matrices scaled by the diagonal of the latter, the bases of motions as near each other as may be.

    Returns:
        None where a number says nothing: the unloaded scene has a mode without stiffness, or other freedoms; or the
        frame is unstable, or second differences count other modes than it does.

    Args:
        potential: of the scene as it is loaded.
        frame: what was found.
        unloaded: the scene without loads.
        drawn: poses of bodies as drawn.
        led: whether the displacement is prescribed.
    """
    if not checkable(potential) or not frame.stable_under_control:
        return None
    if unstable_directions(potential, frame) not in (None, frame.unstable_modes):  # near a limit one is signless
        return None
    at_rest = _second(unloaded, np.zeros(unloaded.mesh.nodes.size), drawn, 0.0)
    loaded = _second(potential, frame.state.u, frame.state.poses, frame.force, near=at_rest.motions)
    if loaded.hessian.shape != at_rest.hessian.shape:
        return None
    before = _lowest(unloaded, at_rest, at_rest.scale, led=led)
    if before[0] <= THRESHOLDS.signless * max(1.0, before[-1]):
        return None
    return float(_lowest(potential, loaded, at_rest.scale, led=led)[0] / before[0])


def _lowest(
    potential: Potential, second: _Second, scale: np.ndarray, *, every: bool = False, led: bool = False
) -> np.ndarray:
    """``eigenvalues`` of a second derivative, scaled."""
    scaled = (sparse.diags(scale) @ second.hessian @ sparse.diags(scale)).tocsc()
    slope = scale * second.slope if led else None
    values = None if every or scaled.shape[0] <= _DENSE or potential.blueprint.spins else _nearest(scaled, slope)
    if values is None or values.min() < 0.0:
        values = np.linalg.eigvalsh(_restricted(scaled.toarray(), slope))
    return np.sort(values[np.argsort(np.abs(values))[potential.blueprint.idle_spins :]])


def _second(
    potential: Potential, u: np.ndarray, poses: np.ndarray, magnitude: float, near: np.ndarray | None = None
) -> _Second:
    """Second derivative of L; the basis of motions is the one next to ``near``, if given."""
    places = potential.places(poses)
    u = potential.nodal(potential.fields(u)[0], places)
    free = np.flatnonzero(potential.free)
    bodies = [i for i, fixed in enumerate(potential.fixed) if not fixed]
    stiffness = _stiffness(potential, u)
    curvature, null = _body_curvature(potential, u, places, bodies, magnitude)
    if near is not None and near.shape == null.shape:
        left, _, right = np.linalg.svd(null.T @ near)  # the rotation that takes one basis next to the other
        turn = left @ right
        curvature, null = turn.T @ curvature @ turn, null @ turn
    follow = _interface_motion(potential, places, bodies) @ null
    stiff = stiffness[free]
    hessian = sparse.bmat(
        [[stiff[:, free], stiff @ follow], [follow.T @ stiff.T, follow.T @ (stiffness @ follow) + curvature]]
    ).tocsc()
    ways = np.tensordot(null.T, np.array(_motions(potential, bodies)), axes=1)
    slope = np.concatenate([potential.led_slope().ravel()[free], _travel_rates(potential, u, places, ways)])
    return _Second((0.5 * (hessian + hessian.T)).tocsc(), slope, null)


def _travel_rates(potential: Potential, u: np.ndarray, places: list[Place], ways: np.ndarray) -> np.ndarray:
    """Travel of the force's point along motions of bodies, (ways,)."""
    there = [moved(places, 1j * _IMAGINARY * way) for way in ways]
    return np.array([float(np.imag(potential.led_travel(potential.nodal(u, at), at))) for at in there]) / _IMAGINARY


def _nearest(matrix: sparse.csc_matrix, slope: np.ndarray | None) -> np.ndarray | None:
    """Four eigenvalues, those nearest to zero; ``slope`` as in ``_restricted``. None where the matrix is singular."""
    try:
        if slope is None:
            solve = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve
        else:
            bordered = _bordered(matrix, slope)

            def solve(b: np.ndarray) -> np.ndarray:
                return bordered(np.append(b, 0.0))[:-1]

    except RuntimeError as singular:
        if "singular" not in str(singular):
            raise
        return None
    return eigsh(matrix, k=4, sigma=0.0, OPinv=LinearOperator(matrix.shape, matvec=solve), return_eigenvectors=False)


def _bordered(matrix: sparse.csc_matrix, slope: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """The inverse of [[A, s], [sᵀ, 0]]."""
    column = sparse.csc_matrix(slope[:, None])
    return splu(sparse.bmat([[matrix, column], [column.T, None]]).tocsc()).solve


def _restricted(matrix: np.ndarray, slope: np.ndarray | None) -> np.ndarray:
    """A matrix on the directions x with slope · x = 0, by a reflection; on all if there is no slope."""
    if slope is None or not np.any(slope):
        return matrix
    mirror = slope / np.linalg.norm(slope)
    mirror[0] += np.copysign(1.0, mirror[0])
    mirror /= np.linalg.norm(mirror)
    matrix = matrix - 2.0 * np.outer(mirror, mirror @ matrix)
    return (matrix - 2.0 * np.outer(matrix @ mirror, mirror))[1:, 1:]


def _motions(potential: Potential, bodies: list[int]) -> list[np.ndarray]:
    """Unit velocities of the free bodies, angles times length."""
    dim = potential.blueprint.dim
    size = 3 if dim == 2 else 6
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
    blocks = [
        (cells, np.einsum("mqka,mqiajb,mqlb->mkilj", slopes, tangent, slopes, optimize=True))
        for cells, slopes, tangent in potential.tangents(u, imaginary=_IMAGINARY, real=_REAL)
    ]
    for touch in potential.touches:
        found = touch.tangents(mesh, u, imaginary=_IMAGINARY, real=_NEAR * potential.blueprint.length)
        blocks += [(cells, potential.load_factor * block) for cells, block in found]
    for cells, block in blocks:
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
    """Second derivative of L on the null space of A by the motion of bodies, nodal forces frozen; and that space."""
    motions = _motions(potential, bodies)
    dim = potential.blueprint.dim
    # held nodes move by affine maps: resultants and first moments of the forces on them are enough
    forces = {body: np.zeros((dim, dim + 1)) for body in np.unique(potential.held[potential.held >= 0])}
    for body, sums in forces.items():
        nodes = np.flatnonzero(potential.held == body)
        arms = potential.mesh.nodes[nodes, :dim] - potential.centres[body]
        for axis in range(dim):
            for k, rate in enumerate([np.ones(len(nodes)), *arms.T]):
                step = np.zeros(u.shape, dtype=complex)
                step[nodes, axis] = 1j * _IMAGINARY * rate
                sums[axis, k] = potential.value(u + step, places, magnitude, None).imag / _IMAGINARY

    def work(there: list[Place]) -> complex:
        """Part of Π that changes with bodies while nodal forces and effects on links stay."""
        value = 0.0
        for body, sums in forces.items():
            turn = there[body].turn - np.eye(dim)
            value = value + sums[:, 0] @ there[body].shift + np.sum(sums[:, 1:] * turn)
        value = value + potential.body_energy(there)
        for force, size in potential.acting(magnitude):
            if force.on not in potential.rows:
                value = value - size * potential.travel(force, u, there)
        return value

    def slopes(function, motions: list[np.ndarray], there: np.ndarray) -> np.ndarray:
        """Derivatives along motions, after real velocities ``there``."""
        return np.array(
            [
                np.imag(function(moved(places, there + 1j * _IMAGINARY * motion))).astype(float) / _IMAGINARY
                for motion in motions
            ]
        )

    still = np.zeros_like(motions[0])
    jacobian = slopes(potential.closure.residual, motions, still).T
    multipliers = np.linalg.lstsq(jacobian.T, slopes(work, motions, still), rcond=THRESHOLDS.rank)[0]
    _, values, right = np.linalg.svd(jacobian, full_matrices=True)
    null = right[int(np.sum(values > THRESHOLDS.rank * max(values.max(initial=0.0), 1e-300))) :].T

    def lagrangian(there: list[Place]) -> complex:
        return work(there) - multipliers @ potential.closure.residual(there)

    ways = [np.tensordot(way, motions, axes=1) for way in null.T]
    rows = [(slopes(lagrangian, ways, _REAL * way) - slopes(lagrangian, ways, -_REAL * way)) for way in ways]
    return np.array(rows).reshape(len(ways), len(ways)) / (2 * _REAL), null
