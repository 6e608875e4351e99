"""Reactions of joints and motors from the multipliers: the constraint force on s is Aᵀλ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.equilibrium.state import State
from fenicsmech.mechanism import Motor
from fenicsmech.multibody import JointSystem


@dataclass(frozen=True)
class Reaction:
    """Force and moment, about the joint's point, that a joint exerts on its second link.

    Attributes:
        force: (dim,).
        moment: (1,) in the plane, (3,) in space.
    """

    force: np.ndarray
    moment: np.ndarray


def joint_reactions(joints: JointSystem, state: State) -> dict[str, Reaction]:
    """The reaction of every joint, by name."""
    space, reactions = joints.space, {}
    for k, connection in enumerate(joints.connections):
        body, sign = (connection.b, 1.0) if connection.b in joints.columns else (connection.a, -1.0)
        if body not in joints.columns:
            continue
        force_on_pose = sign * joints.generalised_force(k, body, state.poses, state.motors, state.multipliers)
        force = force_on_pose[: space.dim]
        pose = state.poses[body]
        lever = space.rotate(pose, np.array(connection.at) - np.array(joints.bodies[body].centre))
        about_centre = space.rotation_rates(pose).T @ force_on_pose[space.dim :]
        reactions[connection.name] = Reaction(force, about_centre - _cross(lever, force))
    return reactions


def motor_torques(joints: JointSystem, state: State) -> dict[Motor, float]:
    """Torque of each revolute motor and force of each prismatic one, positive if it drives its coordinate up."""
    return {motor: float(state.multipliers[row]) for motor, row in joints.motor_rows.items()}


def _cross(lever: np.ndarray, force: np.ndarray) -> np.ndarray:
    if len(lever) == 2:
        return np.array([lever[0] * force[1] - lever[1] * force[0]])
    return np.cross(lever, force)
