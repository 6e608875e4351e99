"""Bodies that move rigidly, and all constraints between them: C(z), A = ∂C/∂z, Σ λ_k ∂²C_k/∂z².

Rows: the connections in order (a motor's row last in its connection), then the norm constraints of the
unfixed bodies. Columns: the poses of the unfixed bodies in order. Fixed bodies carry no columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.joints import RIGID_SPACES, JointKind, constraint
from fenicsmech.mechanism import Link, Motor, Region


@dataclass(frozen=True)
class Body:
    """A rigid link, or one interface of a flexible link.

    Attributes:
        name: for messages: of the rigid link, or of the (first) joint that an interface belongs to.
        link: the link it is, or is part of.
        centre: reference centre c of its pose, (dim,).
        fixed: it never moves and carries no unknowns.
        region: interface region (None for rigid links).
        axis: axis of the interface region.
    """

    name: str
    link: Link
    centre: tuple[float, ...]
    fixed: bool
    region: Region | None = None
    axis: tuple[float, ...] = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Connection:
    """One joint between body ``a`` and body ``b`` (indices), drawn at ``at`` with unit vectors ``triad`` (rows)."""

    name: str
    kind: JointKind
    a: int
    b: int
    at: tuple[float, ...]
    triad: tuple[tuple[float, ...], ...]
    motor: Motor | None = None

    def drawn(self, bodies: Sequence[Body]) -> np.ndarray:
        """The constants of the connection's equations: ``at`` from the centres of both bodies, then the triad."""
        anchors = np.array(self.at) - np.array([bodies[self.a].centre, bodies[self.b].centre])
        return np.concatenate([anchors.ravel(), np.ravel(self.triad)])


class JointSystem:
    """Constraints of ``connections`` between ``bodies`` in ``dim`` dimensions; ``length`` scales positions.

    Attributes:
        size: number of pose unknowns.
        rows: number of constraints.
        pose_scale: typical size of each pose unknown (``length`` or 1), (size,).
        row_scale: factors that make each constraint dimensionless and of unit gradient as drawn, (rows,).
    """

    def __init__(self, bodies: Sequence[Body], connections: Sequence[Connection], *, dim: int, length: float) -> None:
        self.bodies, self.connections, self.length = tuple(bodies), tuple(connections), length
        self.space = RIGID_SPACES[dim]
        self._constraints = [constraint(c.kind, dim, c.motor is not None) for c in self.connections]
        self._drawn = [c.drawn(self.bodies) for c in self.connections]

        pose_size = self.space.pose_size
        # both bodies of each connection, with the places of their poses among the variables of its equations
        first, second = slice(0, pose_size), slice(pose_size, 2 * pose_size)
        self._ends = [((c.a, first), (c.b, second)) for c in self.connections]
        self.free_bodies = [i for i, body in enumerate(self.bodies) if not body.fixed]
        start = {body: pose_size * k for k, body in enumerate(self.free_bodies)}
        self.columns = {body: np.arange(first, first + pose_size) for body, first in start.items()}
        self.size = pose_size * len(self.free_bodies)
        counts = [c.size for c in self._constraints]
        norms = len(self.space.norm_residual(self.space.identity))
        offsets = np.concatenate([[0], np.cumsum(counts)]).astype(int)
        self._joint_rows = [np.arange(first, first + n) for first, n in zip(offsets[:-1], counts, strict=True)]
        self._norm_rows = {body: np.arange(norms) + offsets[-1] + norms * k for k, body in enumerate(self.free_bodies)}
        self.rows = int(offsets[-1]) + norms * len(self.free_bodies)
        self.row_names = [c.name for c, n in zip(self.connections, counts, strict=True) for _ in range(n)]
        self.row_names += [f"norm of {self.bodies[i].name}" for i in self.free_bodies for _ in range(norms)]
        self.motor_rows = {
            c.motor: int(rows[-1])
            for c, rows in zip(self.connections, self._joint_rows, strict=True)
            if c.motor is not None
        }

        one = np.concatenate([np.full(dim, length), np.ones(self.space.rotation_size)])
        self.pose_scale = np.tile(one, len(self.free_bodies))
        as_drawn = self.gradient(self.drawn, np.zeros(len(self.connections))) * self.pose_scale
        norm = np.linalg.norm(as_drawn, axis=1)
        self.row_scale = 1.0 / np.where(norm > 0.0, norm, 1.0)

    @property
    def drawn(self) -> np.ndarray:
        """Poses of all bodies as drawn, (bodies, pose_size)."""
        return np.tile(self.space.identity, (len(self.bodies), 1))

    def motor_values(self, positions) -> np.ndarray:
        """φ per connection from ``positions``, a function of a motor; 0 where there is none."""
        return np.array([0.0 if c.motor is None else positions(c.motor) for c in self.connections])

    def unknowns(self, poses: np.ndarray) -> np.ndarray:
        """The pose unknowns z of the free bodies, (size,)."""
        return poses[self.free_bodies].ravel()

    def with_unknowns(self, poses: np.ndarray, z: np.ndarray) -> np.ndarray:
        """``poses`` with those of the free bodies replaced by ``z`` (size,), put back on the rotations."""
        moved = poses.copy()
        moved[self.free_bodies] = self.space.retract(z.reshape(-1, self.space.pose_size))
        return moved

    def travel(self, motors: np.ndarray) -> float:
        """The largest of ``motors`` (values per connection): rad, or travel over the mechanism's length."""
        scale = [self.length if connection.kind.sliding else 1.0 for connection in self.connections]
        return float(np.max(np.abs(motors / np.array(scale)), initial=0.0))

    def value(self, poses: np.ndarray, motors: np.ndarray) -> np.ndarray:
        """C, (rows,)."""
        residual = np.empty(self.rows)
        for k, rows in enumerate(self._joint_rows):
            residual[rows] = self._constraints[k].value(*self._arguments(k, poses, motors))
        for body, rows in self._norm_rows.items():
            residual[rows] = self.space.norm_residual(poses[body])
        if self.space.dim == 3:
            # products of unit vectors and quaternions: their rounding of some ε would outweigh the smallest loads
            residual[np.abs(self.row_scale * residual) <= 4.0 * np.finfo(float).eps] = 0.0
        return residual

    def gradient(self, poses: np.ndarray, motors: np.ndarray) -> np.ndarray:
        """A, (rows, size)."""
        matrix = np.zeros((self.rows, self.size))
        for rows, columns, block in self.gradient_blocks(poses, motors):
            matrix[np.ix_(rows, columns)] += block
        return matrix

    def gradient_blocks(self, poses: np.ndarray, motors: np.ndarray):
        """A as (rows, columns, block) triples; which blocks there are never changes."""
        for k, (ends, rows) in enumerate(zip(self._ends, self._joint_rows, strict=True)):
            both = self._constraints[k].gradient(*self._arguments(k, poses, motors))
            for body, own in ends:
                if body in self.columns:
                    yield rows, self.columns[body], both[:, own]
        for body, rows in self._norm_rows.items():
            yield rows, self.columns[body], self.space.norm_gradient(poses[body])

    def hessian_blocks(self, poses: np.ndarray, motors: np.ndarray, multipliers: np.ndarray):
        """Σ λ_k ∂²C_k/∂z² as (columns, columns, block) triples; which blocks there are never changes."""
        for k, (ends, rows) in enumerate(zip(self._ends, self._joint_rows, strict=True)):
            both = self._constraints[k].hessian(*self._arguments(k, poses, motors), multipliers[rows])
            for i, own_i in ends:
                for j, own_j in ends:
                    if i in self.columns and j in self.columns:
                        yield self.columns[i], self.columns[j], both[own_i, own_j]
        for body, rows in self._norm_rows.items():
            curvature = np.einsum("k,kij->ij", multipliers[rows], self.space.norm_hessian())
            yield self.columns[body], self.columns[body], curvature

    def generalised_force(
        self, k: int, body: int, poses: np.ndarray, motors: np.ndarray, multipliers: np.ndarray
    ) -> np.ndarray:
        """Generalised force Aᵀλ of connection ``k`` on the pose of ``body``, (pose_size,)."""
        both = self._constraints[k].gradient(*self._arguments(k, poses, motors))
        return both[:, dict(self._ends[k])[body]].T @ multipliers[self._joint_rows[k]]

    def motor_rate(
        self, poses: np.ndarray, motors: np.ndarray, multipliers: np.ndarray, direction: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """∂C/∂φ (rows,) and ∂(Aᵀλ)/∂φ (size,), times ``direction`` (per connection)."""
        rate, force_rate = np.zeros(self.rows), np.zeros(self.size)
        for k in np.flatnonzero(direction):
            if self.connections[k].motor is None:
                continue
            # φ is the last variable of the connection's equations
            arguments, rows = self._arguments(k, poses, motors), self._joint_rows[k]
            rate[rows] = self._constraints[k].gradient(*arguments)[:, -1] * direction[k]
            mixed = self._constraints[k].hessian(*arguments, multipliers[rows])[-1] * direction[k]
            for body, own in self._ends[k]:
                if body in self.columns:
                    force_rate[self.columns[body]] += mixed[own]
        return rate, force_rate

    def _arguments(self, k: int, poses: np.ndarray, motors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Variables and constants of the equations of connection ``k``."""
        connection = self.connections[k]
        ends = [poses[connection.a], poses[connection.b]]
        if connection.motor is not None:
            ends.append(motors[k : k + 1])
        return np.concatenate(ends), self._drawn[k]
