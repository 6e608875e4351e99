"""Forces of an equilibrium: the force at a prescribed displacement, torques of motors, reactions of joints.

They are unknowns of the equilibrium, the controlled force f and the multipliers λ, or linear in these:

    force and moment of a joint     F = (Aᵀλ)_t,     M = Bᵀ (Aᵀλ)_r − (R a) × F

with the parts of Aᵀλ on translation and rotation parameters r of the second body, B = ∂r/∂ω, and the joint at a from
the body's centre.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from fenicsmech.equilibrium import State, joint_reaction, joint_reaction_rate, joint_reaction_slopes
from fenicsmech.errors import DescriptionError, expect
from fenicsmech.mechanism import Drive, Force, Joint, Motor
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import JointChange
from fenicsmech.quantities.quantity import Observable, Partial, Quantity, border_of


@dataclass(frozen=True)
class ForceMagnitude(Quantity):
    """The magnitude of a force where the displacement of its point is prescribed.

    Attributes:
        force: the force.

    Raises:
        DescriptionError: it is not a force.
    """

    force: Force

    def __post_init__(self) -> None:
        expect("magnitude of a force", self.force, Force, "a force")

    @property
    def name(self):
        return f"magnitude of {self.force.name!r}"

    def unit(self, units):
        return units.force

    def on(self, model):
        return _Controlled()


class _Controlled(Observable):
    """f."""

    def values(self, state):
        return np.array([state.force])

    def partials(self, system, state):
        return [Partial(border=border_of(system, load=([0], 1.0)))]


@dataclass(frozen=True)
class MotorTorque(Quantity):
    """The torque of a motor that turns, the force of one that slides, positive if it drives its coordinate up.

    Attributes:
        motor: the motor, or a drive of several: the work of its motors over its motion.

    Raises:
        DescriptionError: it is not a motor.
    """

    motor: Motor | Drive

    def __post_init__(self) -> None:
        expect("torque of a motor", self.motor, Motor | Drive, "a motor")

    @property
    def name(self):
        return f"{'force' if self.motor.sliding else 'torque'} of {self.motor.name!r}"

    def unit(self, units):
        return units.force if self.motor.sliding else f"{units.force} {units.length}"

    def check(self, scene, dim):
        for motor, _ in self.motor.ratios:
            if motor not in scene.mechanism.motors:
                raise DescriptionError(
                    self.name, f"{motor.name!r} is not a motor of {scene.mechanism.name!r}", "Name one of its motors"
                )

    def on(self, model):
        rows = model.linkage.joints.motor_rows
        return _Multipliers([rows[motor] for motor, _ in self.motor.ratios], [r for _, r in self.motor.ratios])


class _Multipliers(Observable):
    """Σ ratio λ."""

    def __init__(self, rows: list[int], ratios: list[float]) -> None:
        self._rows, self._ratios = rows, np.array(ratios)

    def values(self, state):
        return np.array([self._ratios @ state.multipliers[self._rows]])

    def partials(self, system, state):
        return [Partial(border=border_of(system, multipliers=(self._rows, self._ratios)))]


@dataclass(frozen=True)
class JointForce(Quantity):
    """The force that a joint exerts on its second link, a vector in space.

    Attributes:
        joint: the joint.

    Raises:
        DescriptionError: it is not a joint.
    """

    joint: Joint

    def __post_init__(self) -> None:
        expect("reaction of a joint", self.joint, Joint, "a joint")

    @property
    def name(self):
        return f"force of {self.joint.name!r}"

    def unit(self, units):
        return units.force

    def size(self, dim):
        return dim

    def check(self, scene, dim):
        super().check(scene, dim)
        if all(getattr(link, "fixed", False) for link in (self.joint.a, self.joint.b)):
            raise DescriptionError(self.name, "it joins parts of the ground", "Name a joint that holds something")

    def on(self, model):
        return _Reaction(model, self.joint, force=True)


@dataclass(frozen=True)
class JointMoment(JointForce):
    """The moment, about the joint's point, that a joint exerts on its second link: a number in the plane.

    Attributes:
        joint: the joint.

    Raises:
        DescriptionError: it is not a joint.
    """

    @property
    def name(self):
        return f"moment of {self.joint.name!r}"

    def unit(self, units):
        return f"{units.force} {units.length}"

    def size(self, dim):
        return 1 if dim == 2 else 3

    def on(self, model):
        return _Reaction(model, self.joint, force=False)


class _Reaction(Observable):
    """Force or moment of one joint."""

    def __init__(self, model: MechanismModel, joint: Joint, *, force: bool) -> None:
        self._joints, self._force = model.linkage.joints, force
        self._connection, dim = model.linkage.connection_of(joint), self._joints.space.dim
        self.size = dim if force or dim == 3 else 1

    def values(self, state):
        reaction = joint_reaction(self._joints, self._connection, state)
        return reaction.force if self._force else reaction.moment

    def partials(self, system, state):
        slopes = joint_reaction_slopes(self._joints, self._connection, state)
        poses, multipliers = slopes.force if self._force else slopes.moment
        every = slice(None)
        return [
            Partial(
                border=border_of(system, poses=(every, by_poses), multipliers=(every, by_multipliers)),
                by_places=((1.0, partial(self._rate, state, row)),),
            )
            for row, (by_poses, by_multipliers) in enumerate(zip(poses, multipliers, strict=True))
        ]

    def _rate(self, state: State, row: int, changes: Mapping[int, JointChange]) -> float:
        rate = joint_reaction_rate(self._joints, self._connection, state, changes)
        return float((rate.force if self._force else rate.moment)[row])
