"""Numbers of joints: stiffness and rest position of springs, and offsets of motors.

A motor with the offset φ₀ and the prescribed position φ is at φ + φ₀. Configurations are assembled with it,
C(z, φ + φ₀) = 0, and with the parts ẑ and λ̂ of the adjoint that belong to poses and multipliers

    −xᵀ ∂F/∂φ₀ = ẑ · ∂(Aᵀλ)/∂φ + λ̂ · ∂C/∂φ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.effects import JointSpring
from fenicsmech.errors import finite
from fenicsmech.mechanism import Configuration, Motor, Scene
from fenicsmech.model import MechanismModel
from fenicsmech.quantities.number import EffectNumber, ModelNumber, NumberKind, NumberTerms


class _OfSprings(NumberKind):
    """A number of springs in joints."""

    number: str
    parts: tuple[JointSpring, ...]

    @staticmethod
    def candidates(scene: Scene) -> Sequence[JointSpring]:
        return [effect for effect in scene.effects if isinstance(effect, JointSpring)]

    @staticmethod
    def label(part):
        return part.joint.name if isinstance(part, JointSpring) else repr(part)

    def described(self, part):
        return getattr(part, self.number)

    def on(self, model):
        return EffectNumber(model, self.parts, self.number)


@dataclass(frozen=True, init=False)
class SpringStiffness(_OfSprings):
    """The stiffness of springs in joints: ``SpringStiffness(spring)``.

    Args:
        parts: a ``JointSpring`` of the scene, or several that share it.

    Raises:
        DescriptionError: there are no springs, or one is given twice.
    """

    what = "stiffness of the spring"
    number = "stiffness"

    def unit(self, units):
        sliding = self.parts[0].joint.kind.sliding
        return f"{units.force}/{units.length}" if sliding else f"{units.force} {units.length}/rad"


@dataclass(frozen=True, init=False)
class SpringRest(_OfSprings):
    """The rest position of springs in joints: ``SpringRest(spring)``.

    Args:
        parts: a ``JointSpring`` of the scene, or several that share it.

    Raises:
        DescriptionError: there are no springs, or one is given twice.
    """

    what = "rest position of the spring"
    number = "rest"

    def unit(self, units):
        return units.length if self.parts[0].joint.kind.sliding else "rad"

    def check_value(self, value):
        finite(self.name, value)


@dataclass(frozen=True, init=False)
class MotorOffset(NumberKind):
    """The offset φ₀ of motors from each prescribed position: ``MotorOffset(motor)``; rad or length, zero as drawn.

    It counts at the position zero too. Configurations are assembled with it, and displacements count from there.

    Args:
        parts: a motor of the mechanism, or several that share it.

    Raises:
        DescriptionError: there are no motors, or one is given twice.
    """

    what = "offset of the motor"
    parts: tuple[Motor, ...]

    @staticmethod
    def candidates(scene: Scene) -> Sequence[Motor]:
        return scene.mechanism.motors

    def described(self, part):
        return 0.0

    def unit(self, units):
        return units.length if self.parts[0].sliding else "rad"

    def moves_unloaded(self, configuration: Configuration) -> bool:
        return True

    def check_value(self, value):
        finite(self.name, value)

    def on(self, model):
        return _MotorOffset(model, self.parts)


class _MotorOffset(ModelNumber):
    """The offset of some motors."""

    drawn = value = 0.0

    def __init__(self, model: MechanismModel, motors: Sequence[Motor]) -> None:
        self._linkage = model.linkage
        self._chosen = model.linkage.joints.motor_values(lambda motor: float(motor in motors))

    def set(self, value):
        self.value = value
        for system in (self._linkage.joints, self._linkage.rigid):
            system.offsets[np.flatnonzero(self._chosen)] = value

    def slope(self, terms: NumberTerms) -> float:
        return 0.0 if terms.adjoint is None else terms.adjoint.by_motors(self._chosen)
