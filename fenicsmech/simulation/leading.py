"""What leads a curve, a force or motors: how its path is parametrised, and what its axes are called."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from fenicsmech.equilibrium import ForceLead, Lead, MotorLead, PointLoad
from fenicsmech.mechanism import Drive, Force, Leader, Motor, Units
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import JointSystem, body_point


@dataclass(frozen=True)
class Axis:
    """A quantity and its unit."""

    quantity: str
    unit: str

    @property
    def label(self) -> str:
        """As on plots and over columns."""
        return f"{self.quantity} [{self.unit}]"

    def __call__(self, value: float, digits: int = 3) -> str:
        """A value with its unit."""
        return f"{value:.{digits}g} {self.unit}"


class Leading(ABC):
    """What a curve needs to know of the part that leads it.

    Attributes:
        across, up: names of the displacement and of the force that lie along its axes.
    """

    across: str
    up: str

    @abstractmethod
    def lead(self, joints: JointSystem) -> Lead:
        """The parameter of the path."""

    @abstractmethod
    def load(self, model: MechanismModel) -> PointLoad:
        """The load whose magnitude is an unknown of the equilibrium."""

    @abstractmethod
    def axes(self, units: Units) -> tuple[Axis, Axis]:
        """What lies across and up."""


@dataclass(frozen=True)
class LeadingForce(Leading):
    """A force leads."""

    part: Force
    across, up = "displacement", "force"

    def lead(self, joints):
        return ForceLead()

    def load(self, model):
        return model.point_load(self.part)

    def axes(self, units):
        return Axis(self.across, units.length), Axis(self.up, units.force)


@dataclass(frozen=True)
class LeadingDrive(Leading):
    """Motors lead, one or several that move together."""

    part: Drive

    def lead(self, joints):
        ratios = dict(self.part.ratios)
        return MotorLead(joints.motor_values(lambda motor: ratios.get(motor, 0.0)))

    def load(self, model):
        """One that does nothing, on a link that a motor moves."""
        joints, dim = model.linkage.joints, model.linkage.dim
        motor, _ = self.part.ratios[0]
        (connection,) = (connection for connection in joints.connections if connection.motor == motor)
        body = next(body for body in (connection.b, connection.a) if body in joints.columns)
        centre = np.array(joints.bodies[body].centre)
        return PointLoad("no force", body_point(centre, body, centre, joints.space), np.zeros(dim))

    @property
    def across(self):
        return "position" if self.part.sliding else "angle"

    @property
    def up(self):
        return "force" if self.part.sliding else "torque"

    def axes(self, units):
        if self.part.sliding:
            return Axis(self.across, units.length), Axis(self.up, units.force)
        return Axis(self.across, "rad"), Axis(self.up, f"{units.force} {units.length}")


def leading(part: Leader) -> Leading:
    """The one for a part."""
    if isinstance(part, Motor):
        part = Drive(part.name, ((part, 1.0),))
    return LeadingDrive(part) if isinstance(part, Drive) else LeadingForce(part)
