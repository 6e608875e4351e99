"""The state of a mechanism: displacements, poses, multipliers, controlled force; and the fields that hold it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from fenicsmech.elasticity import ElasticBody
from fenicsmech.mechanism import Motor
from fenicsmech.multibody import InterfaceMap, JointChange, JointSystem


@dataclass(frozen=True, eq=False)
class State:
    """A point (s, λ, f) of the equilibrium equations.

    Attributes:
        u: displacements of this rank's owned nodes, then its owned pressures where links are in u–p form, flat (owned
            dofs,).
        poses: poses of all bodies, on every rank, (bodies, pose_size).
        multipliers: λ, one per constraint row, on every rank.
        force: magnitude f of the controlled force.
        motors: motor value per connection.
        load_factor: σ of the constant loads and effects, 0 … 1.
        minimum_shift: least shift δ of the KKT matrix, which zero-energy modes need, in units of the links' stiffness.
        constant: magnitudes f_k of the constant loads, which act times σ.
        unstable: whether the last equilibrium on the way here was unstable under its control.
        loose: whether links that loads or obstacles may keep from spinning could spin all but freely there.
    """

    u: np.ndarray
    poses: np.ndarray
    multipliers: np.ndarray
    force: float
    motors: np.ndarray
    load_factor: float = 1.0
    minimum_shift: float = 0.0
    constant: np.ndarray = field(default_factory=lambda: np.zeros(0))
    unstable: bool = False
    loose: bool = True

    @property
    def has_reactions(self) -> bool:
        """Whether joints carry forces or moments, which they do not in a rigid assembly."""
        return bool(np.any(self.multipliers))


@dataclass(frozen=True, eq=False)
class Step:
    """A change of state; ``z`` are the poses of the free bodies, flat.

    Solves give the unknowns u, z, λ and f; motors and load factor change where a control prescribes them.
    """

    u: np.ndarray
    z: np.ndarray
    multipliers: np.ndarray
    force: float
    motors: np.ndarray | float = 0.0
    load_factor: float = 0.0

    def scaled(self, factor: float) -> Step:
        """``factor`` times this step."""
        return Step(*(factor * values for values in vars(self).values()))

    def __add__(self, other: Step) -> Step:
        return Step(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))

    def slower(self, other: Step) -> Step:
        """This step; for every displacement and pose the smaller change of this step and ``other``."""

        pairs = ((self.u, other.u), (self.z, other.z))
        u, z = (np.where(np.abs(one) < np.abs(two), one, two) for one, two in pairs)
        return replace(self, u=u, z=z)

    def beyond(self, steps: Sequence[Step]) -> Step:
        """This step with how far every displacement and pose lies outside the span of those of ``steps``."""

        spans = ((self.u, [step.u for step in steps]), (self.z, [step.z for step in steps]))
        u, z = (value - np.clip(value, np.minimum.reduce(span), np.maximum.reduce(span)) for value, span in spans)
        return replace(self, u=u, z=z)


def load_fields(elastic: ElasticBody, interfaces: InterfaceMap, state: State) -> None:
    """Makes the fields of ``elastic`` hold ``state``, with interface nodes on their bodies."""
    elastic.take(state.u)
    elastic.load_factor.value = state.load_factor
    elastic.update()
    interfaces.place(state.poses)


@dataclass(frozen=True)
class Reaction:
    """Force and moment, about the joint's point, that a joint exerts on its second link.

    Attributes:
        force: (dim,).
        moment: (1,) in the plane, (3,) in space.
    """

    force: np.ndarray
    moment: np.ndarray


@dataclass(frozen=True, eq=False)
class ReactionSlopes:
    """Derivatives of a reaction by all pose unknowns z, (n, size), and by the multipliers, (n, rows)."""

    force: tuple[np.ndarray, np.ndarray]
    moment: tuple[np.ndarray, np.ndarray]


def joint_reactions(joints: JointSystem, state: State) -> dict[str, Reaction]:
    """The reaction of every joint, by name."""
    held = (k for k, own in enumerate(joints.connections) if own.a in joints.columns or own.b in joints.columns)
    return {joints.connections[k].name: joint_reaction(joints, k, state) for k in held}


def joint_reaction(joints: JointSystem, k: int, state: State) -> Reaction:
    """The reaction of connection ``k``, one of whose bodies can move.

    With the generalised force g = (g_t, g_r) on the pose of the body, ∂r/∂ω = B and the lever R a:

        F = g_t,     M = Bᵀ g_r − (R a) × F.
    """
    space, end = joints.space, _end(joints, k, state)
    force = end.g[: space.dim]
    return Reaction(force, space.rotation_rates(end.pose).T @ end.g[space.dim :] - _cross(end.lever, force))


def joint_reaction_slopes(joints: JointSystem, k: int, state: State) -> ReactionSlopes:
    """The derivatives of the reaction of connection ``k``."""
    space, end, dim = joints.space, _end(joints, k, state), joints.space.dim
    arm, rates, force, moment = joints.arm(k, end.body), space.rotation_rates(end.pose), [], []
    for by in joints.generalised_force_slopes(k, end.body, state.poses, state.motors, state.multipliers):
        force.append(end.sign * by[:dim])
        across = np.column_stack([_cross(end.lever, column) for column in force[-1].T])
        moment.append(end.sign * rates.T @ by[dim:] - across)
    # the body's own rotation changes B and its lever
    own = joints.columns[end.body][dim:]
    turned = [_cross(spin @ arm, end.g[:dim]) for spin in space.rotation_gradient(end.pose)]
    bent = np.einsum("abk,b->ka", space.rotation_rates_gradient(end.pose), end.g[dim:])
    moment[0][:, own] += bent - np.transpose(turned)
    return ReactionSlopes((force[0], force[1]), (moment[0], moment[1]))


def joint_reaction_rate(joints: JointSystem, k: int, state: State, changes: Mapping[int, JointChange]) -> Reaction:
    """The derivative of the reaction of connection ``k`` as the places of some connections change, at one state."""
    space, dim = joints.space, joints.space.dim
    if k not in changes:
        return Reaction(np.zeros(dim), np.zeros(1 if dim == 2 else 3))
    end = _end(joints, k, state)
    rates = joints.place_rates(k, changes[k], state.poses, state.motors, state.multipliers)[1]
    rate, lever_rate = end.sign * rates[end.body], space.rotate(end.pose, changes[k].shift)
    turned = space.rotation_rates(end.pose).T @ rate[dim:]
    return Reaction(rate[:dim], turned - _cross(lever_rate, end.g[:dim]) - _cross(end.lever, rate[:dim]))


class _End(NamedTuple):
    """The body whose pose gives the reaction of a connection, the sign of the reaction on it, and what acts there.

    Attributes:
        body: its index.
        sign: −1 where it is the joint's first link.
        pose: of the body, (pose_size,).
        g: generalised force of the reaction on the pose, (pose_size,).
        lever: R a, (dim,).
    """

    body: int
    sign: float
    pose: np.ndarray
    g: np.ndarray
    lever: np.ndarray


def _end(joints: JointSystem, k: int, state: State) -> _End:
    """The end of connection ``k`` that can move."""
    connection = joints.connections[k]
    body, sign = (connection.b, 1.0) if connection.b in joints.columns else (connection.a, -1.0)
    g = sign * joints.generalised_force(k, body, state.poses, state.motors, state.multipliers)
    return _End(body, sign, state.poses[body], g, joints.space.rotate(state.poses[body], joints.arm(k, body)))


def motor_torques(joints: JointSystem, state: State) -> dict[Motor, float]:
    """Torque of each revolute motor and force of each prismatic one, positive if it drives its coordinate up."""
    return {motor: float(state.multipliers[row]) for motor, row in joints.motor_rows.items()}


def _cross(lever: np.ndarray, force: np.ndarray) -> np.ndarray:
    if len(lever) == 2:
        return np.array([lever[0] * force[1] - lever[1] * force[0]])
    return np.cross(lever, force)
