"""Bodies and constraints of a described mechanism: C(z), A = ∂C/∂z, Σ λ_k ∂²C_k/∂z².

Bodies are the rigid links and the interfaces of flexible ones. Rows: the connections in order (a motor's row last in
its connection), then the norm constraints of the unfixed bodies. Columns: the poses of the unfixed bodies in order.
Fixed bodies carry no columns.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import qr

from fenicsmech.joints import RIGID_SPACES, WELD, JointKind, constraint, constraint_rate
from fenicsmech.mechanism import (
    Configuration,
    FlexibleLink,
    Joint,
    Link,
    Mechanism,
    Motor,
    Region,
    in_dimension,
    same_place,
)
from fenicsmech.multibody.places import JointChange, JointPlaces
from fenicsmech.multibody.points import BodyPoint

RANK = 1e-9
"""Singular values of A below this are zero: rows and unknowns are scaled to one."""


@dataclass(frozen=True)
class Body:
    """A rigid link, or one interface of a flexible link, with the reference centre c of its pose.

    Its ``name``, for messages, is that of the rigid link, or of the first joint that an interface belongs to.
    Interfaces have a ``region`` around an ``axis``. What is ``fixed`` never moves and carries no unknowns.
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

    Args:
        bodies: rigid bodies.
        connections: joints between them.
        dim: 2 or 3.
        length: scales positions.
        places: constants of the connections' equations, and maybe of further ones; as drawn by default.

    Attributes:
        places: constants of the connections' equations, which designs change.
        size: number of pose unknowns.
        rows: number of constraints.
        offsets: φ₀ of motors, added to their prescribed positions φ in C(z, φ + φ₀), (connections,); zero as drawn.
        pose_scale: typical size of each pose unknown (``length`` or 1), (size,).
        row_scale: factors that make each constraint dimensionless and of unit gradient as drawn, (rows,).
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        connections: Sequence[Connection],
        *,
        dim: int,
        length: float,
        places: JointPlaces | None = None,
    ) -> None:
        self.bodies, self.connections, self.length = tuple(bodies), tuple(connections), length
        self.space = RIGID_SPACES[dim]
        self._constraints = [constraint(c.kind, dim, c.motor is not None) for c in self.connections]
        self.places = places or JointPlaces([c.drawn(self.bodies) for c in self.connections], dim)
        self.offsets = np.zeros(len(self.connections))

        pose_size = self.space.pose_size
        # both bodies of each connection, with the places of their poses among the variables of its equations
        first, second = slice(0, pose_size), slice(pose_size, 2 * pose_size)
        self._ends = [((c.a, first), (c.b, second)) for c in self.connections]
        self.free_bodies = [i for i, body in enumerate(self.bodies) if not body.fixed]
        self.columns = {body: np.arange(pose_size) + pose_size * k for k, body in enumerate(self.free_bodies)}
        self.size = pose_size * len(self.free_bodies)
        norms = len(self.space.norm_residual(self.space.identity))
        names = [(c.name, equations.size) for c, equations in zip(self.connections, self._constraints, strict=True)]
        names += [(f"norm of {self.bodies[i].name}", norms) for i in self.free_bodies]
        self.row_names = [name for name, count in names for _ in range(count)]
        self.rows = len(self.row_names)
        ends = np.cumsum([count for _, count in names], dtype=int)
        rows = [np.arange(end - count, end) for end, (_, count) in zip(ends, names, strict=True)]
        self._joint_rows = rows[: len(self.connections)]
        self._norm_rows = dict(zip(self.free_bodies, rows[len(self.connections) :], strict=True))
        # equations between unit vectors or quaternions: x_b − x_a keeps the digits of small motions
        self._products = np.ones(self.rows, dtype=bool)
        for connection, own_rows in zip(self.connections, self._joint_rows, strict=True):
            if connection.kind.shares_point:
                self._products[own_rows[:dim]] = False
        own = zip(self.connections, self._joint_rows, strict=True)
        self.motor_rows = {c.motor: int(rows[-1]) for c, rows in own if c.motor is not None}

        one = np.concatenate([np.full(dim, length), np.ones(self.space.rotation_size)])
        self.pose_scale = np.tile(one, len(self.free_bodies))
        as_drawn = self.gradient(self.drawn, np.zeros(len(self.connections))) * self.pose_scale
        norm = np.linalg.norm(as_drawn, axis=1)
        self.row_scale = 1.0 / np.where(norm > 0.0, norm, 1.0)

    @property
    def key(self) -> Hashable:
        """Equal where all equations are: places of joints and offsets of motors, which designs change."""
        return self.places.key, self.offsets.tobytes()

    @property
    def drawn(self) -> np.ndarray:
        """Poses of all bodies as drawn, (bodies, pose_size)."""
        return np.tile(self.space.identity, (len(self.bodies), 1))

    def is_ball(self, k: int) -> bool:
        """Whether connection ``k`` holds a point and nothing else, in space."""
        return self.space.dim == 3 and self.connections[k].kind.shares_point and len(self._joint_rows[k]) == 3

    def motor_values(self, positions) -> np.ndarray:
        """φ per connection from ``positions``, a function of a motor; 0 where there is none."""
        return np.array([0.0 if c.motor is None else positions(c.motor) for c in self.connections])

    def on_the_way(self, positions, fraction: float) -> np.ndarray:
        """φ (connections,) at a ``fraction`` of the way to ``positions`` from the drawn configuration, φ = −φ₀."""
        return fraction * self.motor_values(positions) - (1.0 - fraction) * self.offsets

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
            # their rounding of some ε would outweigh the smallest loads
            residual[self._products & (np.abs(self.row_scale * residual) <= 4.0 * np.finfo(float).eps)] = 0.0
        return residual

    def gradient(self, poses: np.ndarray, motors: np.ndarray) -> np.ndarray:
        """A, (rows, size)."""
        matrix = np.zeros((self.rows, self.size))
        for rows, columns, block in self.gradient_blocks(poses, motors):
            matrix[rows[:, None], columns] += block
        return matrix

    def scaled_gradient(self, poses: np.ndarray, motors: np.ndarray) -> np.ndarray:
        """A in units of ``pose_scale``, rows of the order of one."""
        return self.row_scale[:, None] * self.gradient(poses, motors) * self.pose_scale

    def gradient_blocks(self, poses: np.ndarray, motors: np.ndarray):
        """A as (rows, columns, block) triples; which blocks there are never changes."""
        for k, (ends, rows) in enumerate(zip(self._ends, self._joint_rows, strict=True)):
            both = self._constraints[k].gradient(*self._arguments(k, poses, motors))
            for body, own in ends:
                if body in self.columns:
                    yield rows, self.columns[body], both[:, own]
        for body, rows in self._norm_rows.items():
            yield rows, self.columns[body], self.space.norm_gradient(poses[body])

    def without_self_stress(
        self, multipliers: np.ndarray, poses: np.ndarray, motors: np.ndarray, compliances: np.ndarray
    ) -> np.ndarray:
        """The multipliers of least norm, rows scaled to one, with the same forces Aᵀλ and gaps c λ.

        Where constraints depend on each other, equilibrium leaves states of self-stress n open: Aᵀn = 0, c n = 0.

        Args:
            multipliers: λ, (rows,).
            poses: of all bodies, (bodies, pose_size).
            motors: φ per connection.
            compliances: c by constraint row, (rows,).
        """
        fixed = np.column_stack([self.scaled_gradient(poses, motors), np.eye(self.rows)[:, compliances != 0.0]])
        basis, triangle, _ = qr(fixed, mode="full", pivoting=True)
        free = basis[:, int(np.sum(np.abs(np.diag(triangle)) > RANK)) :]
        return multipliers - self.row_scale * (free @ (free.T @ (multipliers / self.row_scale)))

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

    def generalised_force_slopes(
        self, k: int, body: int, poses: np.ndarray, motors: np.ndarray, multipliers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of ``generalised_force`` by z, (pose_size, size), and by λ, (pose_size, rows)."""
        arguments, rows, own = self._arguments(k, poses, motors), self._joint_rows[k], dict(self._ends[k])[body]
        curvature = self._constraints[k].hessian(*arguments, multipliers[rows])[own]
        by_poses, by_multipliers = np.zeros((len(curvature), self.size)), np.zeros((len(curvature), self.rows))
        for other, place in self._ends[k]:
            if other in self.columns:
                by_poses[:, self.columns[other]] += curvature[:, place]
        by_multipliers[:, rows] = self._constraints[k].gradient(*arguments)[:, own].T
        return by_poses, by_multipliers

    def place_rates(
        self, k: int, change: JointChange, poses: np.ndarray, motors: np.ndarray, multipliers: np.ndarray
    ) -> tuple[np.ndarray, dict[int, np.ndarray]]:
        """Derivatives of C (rows,), and of Aᵀλ on each body of connection ``k`` (pose_size,), as its place changes."""
        connection, rows = self.connections[k], self._joint_rows[k]
        variables, constants = self._arguments(k, poses, motors)
        formula = constraint_rate(connection.kind, self.space.dim, connection.motor is not None)
        arguments = variables, np.concatenate([constants, self.places.rate(k, change)])
        rate = np.zeros(self.rows)
        rate[rows] = formula.value(*arguments)
        forces = multipliers[rows] @ formula.gradient(*arguments)
        return rate, {body: forces[own] for body, own in self._ends[k]}

    def arm(self, k: int, body: int) -> np.ndarray:
        """The point of connection ``k`` from the centre of one of its bodies, in the drawn configuration, (dim,)."""
        dim = self.space.dim
        return self.places[k][:dim] if body == self.connections[k].a else self.places[k][dim : 2 * dim]

    def place(self, k: int, body: int, poses: np.ndarray) -> np.ndarray:
        """Where the point of connection ``k`` on one of its bodies is at ``poses`` (bodies, pose_size), (dim,)."""
        arm = self.arm(k, body)
        return np.array(self.bodies[body].centre) + arm + self.space.displace(poses[body], arm[None])[0]

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
        c = self.connections[k]
        motor = [] if c.motor is None else [motors[k : k + 1] + self.offsets[k : k + 1]]
        return np.concatenate([poses[c.a], poses[c.b], *motor]), self.places[k]


@dataclass(frozen=True)
class Linkage:
    """Bodies and constraints of a mechanism.

    Attributes:
        dim: 2 or 3.
        length: size of the mechanism, diagonal of the box around its joints and points.
        bodies: rigid links first, then the interfaces, link by link.
        interfaces: indices of the interface bodies of each flexible link.
        joints: constraints of the mechanism itself: interfaces of a flexible link are independent.
        rigid: the same with every flexible link welded into one rigid body.
        assembled: what ``assemble`` has found at the last places of joints and offsets of motors, by configuration.
    """

    dim: int
    length: float
    bodies: tuple[Body, ...]
    interfaces: dict[FlexibleLink, tuple[int, ...]]
    joints: JointSystem
    rigid: JointSystem
    assembled: dict[Hashable, dict[Configuration, Any]] = field(default_factory=dict, compare=False, repr=False)

    def body_of(self, link: Link) -> int:
        """Index of the body that carries ``link``: itself if rigid, its first interface if flexible."""
        return next(i for i, body in enumerate(self.bodies) if body.link == link)

    def point(self, link: Link, at: Sequence[float]) -> BodyPoint:
        """The point drawn at ``at``, of two or three coordinates, that moves with the body that carries ``link``."""
        body = self.body_of(link)
        return BodyPoint(body, np.array(in_dimension(at, self.dim)) - self.bodies[body].centre, self.joints.space)

    def site(self, link: FlexibleLink, joint: Joint) -> int:
        """Which interface of a flexible link belongs to one of its joints."""
        connection = self.joints.connections[self.connection_of(joint)]
        own = self.interfaces[link]
        return next(own.index(body) for body in (connection.a, connection.b) if body in own)

    def connection_of(self, joint: Joint) -> int:
        """Index of a joint's connection."""
        return next(k for k, own in enumerate(self.joints.connections) if own.name == joint.name)

    def turns_about_z(self, body: int) -> bool:
        """Whether all joints of a body stay closed while it alone turns about the parallel to z through its centre.

        Motors do not count: they drive a freedom that the joint has.
        """
        joints, motors = self.joints, np.zeros(len(self.joints.connections))
        for spin in (0.3, 1.0, -2.0):  # several, since a single angle may close a joint by chance
            poses = joints.drawn
            poses[body, self.dim :] += joints.space.rotation_rates(poses[body])[:, -1] * spin
            residual = joints.row_scale * joints.value(joints.space.retract(poses), motors)
            if np.any(np.abs(np.delete(residual, list(joints.motor_rows.values()))) > 1e-12):
                return False
        return True


def build_linkage(mechanism: Mechanism, dim: int, changes: Mapping[Joint, JointChange] | None = None) -> Linkage:
    """The bodies and constraints of ``mechanism`` in ``dim`` dimensions.

    Args:
        mechanism: the mechanism.
        dim: 2 or 3.
        changes: of the places of joints; bodies, interfaces and connections are made at the changed ones.
    """
    length, joints = mechanism.length, mechanism.joints
    placed = {joint: _placed(joint, dim, (changes or {}).get(joint)) for joint in joints}
    bodies: list[Body] = []
    for link in mechanism.rigid_links:
        places = [placed[joint][0] for joint in joints if link in (joint.a, joint.b)]
        centre = tuple(np.mean(places, axis=0)) if places else (0.0,) * dim
        bodies.append(Body(link.name, link, centre, link.fixed))

    def body(joint: Joint, link: Link) -> int:
        """The body of ``link`` that a joint is on, −1 if there is none yet."""
        for i, known in enumerate(bodies):
            here = known.region is None or same_place(known.centre, placed[joint][0], dim=dim, length=length)
            if known.link == link and here:
                return i
        return -1

    interfaces: dict[FlexibleLink, tuple[int, ...]] = {}
    for flexible in mechanism.flexible_links:
        first = len(bodies)
        for joint in joints:
            if flexible in (joint.a, joint.b) and body(joint, flexible) < 0:
                region = joint.regions[(joint.a, joint.b).index(flexible)]
                axis = joint.axis if joint.kind.pin_along_axis else (0.0, 0.0, 1.0)
                bodies.append(Body(joint.name, flexible, placed[joint][0], False, region, axis))
        interfaces[flexible] = tuple(range(first, len(bodies)))
    driven = {motor.joint: motor for motor in mechanism.motors}
    connections = []
    for joint in joints:
        a, b, (at, triad) = body(joint, joint.a), body(joint, joint.b), placed[joint]
        connections.append(Connection(joint.name, joint.kind, a, b, at, triad, driven.get(joint)))
    identity = tuple(map(tuple, np.eye(dim)))
    welds = [
        Connection(f"link {link.name!r}", WELD, group[0], other, bodies[other].centre, identity)
        for link, group in interfaces.items()
        for other in group[1:]
    ]
    at_joints = JointPlaces([connection.drawn(bodies) for connection in (*connections, *welds)], dim)
    return Linkage(
        dim,
        length,
        tuple(bodies),
        interfaces,
        joints=JointSystem(bodies, connections, dim=dim, length=length, places=at_joints),
        rigid=JointSystem(bodies, [*connections, *welds], dim=dim, length=length, places=at_joints),
    )


def _placed(
    joint: Joint, dim: int, change: JointChange | None
) -> tuple[tuple[float, ...], tuple[tuple[float, ...], ...]]:
    """Place and triad of a joint that may have been changed."""
    at, triad = in_dimension(joint.at, dim), _triad(joint, dim)
    if change is None:
        return at, triad
    moved, turned = change.place(np.array(at), np.array(triad))
    return tuple(moved.tolist()), tuple(map(tuple, turned.tolist()))


def _triad(joint: Joint, dim: int) -> tuple[tuple[float, ...], ...]:
    """Unit vectors of a joint as rows: in space the axis last, in the plane (axis, normal), left-handed about −z."""
    axis = np.array(joint.axis)
    if dim == 2:
        first = axis[:2] if joint.kind.axis_in_plane else np.array([1.0, 0.0])
        sense = -1.0 if axis[2] < 0.0 and not joint.kind.axis_in_plane else 1.0
        return tuple(first), (-sense * first[1], sense * first[0])
    # the coordinate direction least aligned with the axis; the plane's x for axes along z
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    e1 = helper - (helper @ axis) * axis
    e1 /= np.linalg.norm(e1)
    return tuple(e1), tuple(np.cross(axis, e1)), tuple(axis)
