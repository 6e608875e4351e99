"""The protocol of a joint: equations between a marker on body a and a marker on body b.

Both markers coincide in the drawn configuration. Equations are written so that the derivative of a motor
equation with respect to its free coordinate is one: its multiplier is then the motor's force or torque.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import sympy


@dataclass(frozen=True)
class SpatialMarker:
    """Displaced origin (from where it was drawn) and triad of a joint on one body; e3 is its axis."""

    origin: sympy.Matrix
    e1: sympy.Matrix
    e2: sympy.Matrix
    e3: sympy.Matrix


@dataclass(frozen=True)
class PlanarMarker:
    """Displaced origin (from where it was drawn), axis and normal of a joint on one body, and its angle."""

    origin: sympy.Matrix
    axis: sympy.Matrix
    normal: sympy.Matrix
    angle: sympy.Expr


class JointKind(ABC):
    """A joint between two bodies. A new joint is one file with one subclass and its instance.

    Attributes:
        name: what users call it.
        sliding: whether its free coordinate is a travel along the axis, which then lies in the plane of a
            planar model; otherwise the axis is normal to the plane.
        planar: whether the joint exists in planar models.
        motorised: whether a motor can prescribe its free coordinate.
        bored: whether it holds flexible links by a pin along its axis; others hold them along z.
    """

    name: str
    planar: bool = False
    sliding: bool = False
    motorised: bool = False
    bored: bool = False

    @abstractmethod
    def equations(self, a: SpatialMarker, b: SpatialMarker) -> list[sympy.Expr]:
        """What must vanish in space."""

    def planar_equations(self, a: PlanarMarker, b: PlanarMarker) -> list[sympy.Expr]:
        """What must vanish in the plane (only for joints with ``planar``)."""
        raise NotImplementedError(f"a {self.name} joint has no planar form")

    def motor(self, a: SpatialMarker, b: SpatialMarker, value: sympy.Symbol) -> sympy.Expr:
        """Motor equation in space (only for joints with ``motorised``)."""
        raise NotImplementedError(f"a {self.name} joint takes no motor")

    def planar_motor(self, a: PlanarMarker, b: PlanarMarker, value: sympy.Symbol) -> sympy.Expr:
        """Motor equation in the plane (only for joints with ``motorised`` and ``planar``)."""
        raise NotImplementedError(f"a {self.name} joint takes no motor")
