"""Joints: equations between a marker on body a and a marker on body b, from which all their numbers are derived.

With the poses z = (z_a, z_b) of both bodies and the value φ of a motor,

    C(z, φ) = 0,    A = ∂C/∂(z, φ),    Σ_k λ_k ∂²C_k/∂(z, φ)².

Both markers coincide in the drawn configuration. Equations are written so that the derivative of a motor
equation with respect to the joint's free coordinate is one: its multiplier is then the motor's force or torque.

Another joint is one subclass of ``JointKind`` and its instance:

    class PinInSlot(JointKind):
        name = "pin in slot"
        planar = motorised = sliding = axis_in_plane = True

        def equations(self, a, b):
            apart = b.origin - a.origin
            return [apart.dot(a.e1), apart.dot(a.e2)]

        def planar_equations(self, a, b):
            return [(b.origin - a.origin).dot(a.normal)]

        def coordinate(self, a, b):
            return (b.origin - a.origin).dot(a.axis)

    mechanism.join(PinInSlot(), yoke, crank, at=(3, 0), axis=(0, 1))
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cache

import sympy

from fenicsmech.joints.rotations import RIGID_SPACES
from fenicsmech.symbolic import SmoothFunction


@dataclass(frozen=True)
class PlanarMarker:
    """A joint on one body of a planar model.

    Attributes:
        origin: displacement of its origin from where it was drawn.
        axis: unit vector, the joint's axis if that lies in the plane, else x.
        normal: unit vector, a quarter turn from ``axis``, about the joint's axis if that is normal to the plane.
        angle: by which the body has turned, about the same.
    """

    origin: sympy.Matrix
    axis: sympy.Matrix
    normal: sympy.Matrix
    angle: sympy.Expr

    def angle_to(self, other: PlanarMarker) -> sympy.Expr:
        """The angle from this marker to the other; it counts full turns."""
        return other.angle - self.angle

    def angle_beyond(self, other: PlanarMarker, value: sympy.Expr) -> sympy.Expr:
        """The angle from this marker to the other less ``value``."""
        return self.angle_to(other) - value


@dataclass(frozen=True)
class SpatialMarker:
    """A joint on one body in space.

    Attributes:
        origin: displacement of its origin from where it was drawn.
        e1: first vector of an orthonormal triad.
        e2: second vector.
        e3: third vector, the joint's axis.
        drawn_axis: e3 as drawn.
        quaternion: rotation of the body, (w, v) with v of shape (3, 1).
    """

    origin: sympy.Matrix
    e1: sympy.Matrix
    e2: sympy.Matrix
    e3: sympy.Matrix
    drawn_axis: sympy.Matrix
    quaternion: tuple[sympy.Expr, sympy.Matrix]

    @property
    def axis(self) -> sympy.Matrix:
        """e3, as a planar marker calls it."""
        return self.e3

    def angle_to(self, other: SpatialMarker) -> sympy.Expr:
        """The angle about e3 from this marker to the other, φ = 2 atan2(e3 · v, w) with (w, v) = q̄_a q_b.

        The half angle makes φ smooth for |φ| < 2π; at ±2π it jumps by 4π. If e3 of both markers differ, φ is the
        twist about e3.
        """
        (wa, va), (wb, vb) = self.quaternion, other.quaternion
        return 2 * sympy.atan2((wa * vb - wb * va - va.cross(vb)).dot(self.drawn_axis), wa * wb + va.dot(vb))

    def angle_beyond(self, other: SpatialMarker, value: sympy.Expr) -> sympy.Expr:
        """sin(φ − ``value``) where e3 of both markers agree: smooth, and zero for any number of turns."""
        return other.e1.dot(sympy.cos(value) * self.e2 - sympy.sin(value) * self.e1)


Marker = PlanarMarker | SpatialMarker


class JointKind(ABC):
    """A kind of joint between two bodies, given by its equations.

    Attributes:
        name: for messages.
        planar: whether it exists in planar models, with ``planar_equations``.
        motorised: whether it has one free coordinate, ``coordinate``, for motors and springs.
        sliding: whether that coordinate is a length, scaled by the mechanism's length; otherwise it is an angle.
        axis_in_plane: whether its axis lies in the plane of a planar model; otherwise it is normal to the plane.
        pin_along_axis: whether it holds flexible links by a pin along its axis; otherwise along z.
        shares_point: whether its first equations are x_b − x_a = 0.
        clamps: whether it clamps flexible links; pictures show it as a weld.
    """

    name: str
    planar: bool = False
    motorised: bool = False
    sliding: bool = False
    axis_in_plane: bool = False
    pin_along_axis: bool = False
    shares_point: bool = False
    clamps: bool = False

    def __repr__(self) -> str:
        return f"<{self.name} joint>"

    @abstractmethod
    def equations(self, a: SpatialMarker, b: SpatialMarker) -> list[sympy.Expr]:
        """C in space."""

    def planar_equations(self, a: PlanarMarker, b: PlanarMarker) -> list[sympy.Expr]:
        """C in the plane (only for joints with ``planar``)."""
        raise NotImplementedError(f"a {self.name} joint has no planar form")

    def coordinate(self, a: Marker, b: Marker) -> sympy.Expr:
        """The free coordinate φ, zero as drawn (only for joints with ``motorised``)."""
        raise NotImplementedError(f"a {self.name} joint takes no motor")

    def motor(self, a: Marker, b: Marker, value: sympy.Symbol) -> sympy.Expr:
        """Motor equation, by default φ − ``value``."""
        return self.coordinate(a, b) - value


class Revolute(JointKind):
    """x_b = x_a, e3_b ⟂ e1_a, e2_a; a motor prescribes the angle φ, in space by sin(angle − φ) = 0."""

    name = "revolute"
    planar = motorised = pin_along_axis = shares_point = True

    def equations(self, a, b):
        return [*(b.origin - a.origin), a.e1.dot(b.e3), a.e2.dot(b.e3)]

    def planar_equations(self, a, b):
        return [*(b.origin - a.origin)]

    def coordinate(self, a, b):
        return a.angle_to(b)

    def motor(self, a, b, value):
        return a.angle_beyond(b, value)


class Prismatic(JointKind):
    """(x_b − x_a) ⟂ e1_a, e2_a and equal orientation; a motor prescribes the travel along e3_a."""

    name = "prismatic"
    planar = motorised = sliding = axis_in_plane = True

    def equations(self, a, b):
        apart = b.origin - a.origin
        return [apart.dot(a.e1), apart.dot(a.e2), a.e3.dot(b.e2), a.e1.dot(b.e3), a.e2.dot(b.e1)]

    def planar_equations(self, a, b):
        return [(b.origin - a.origin).dot(a.normal), b.angle - a.angle]

    def coordinate(self, a, b):
        return (b.origin - a.origin).dot(a.axis)


class Cylindrical(JointKind):
    """(x_b − x_a) ⟂ e1_a, e2_a and e3_b ⟂ e1_a, e2_a: both bodies slide along a common axis and turn about it."""

    name = "cylindrical"
    pin_along_axis = True

    def equations(self, a, b):
        apart = b.origin - a.origin
        return [apart.dot(a.e1), apart.dot(a.e2), a.e1.dot(b.e3), a.e2.dot(b.e3)]


class Spherical(JointKind):
    """x_b = x_a."""

    name = "spherical"
    shares_point = True

    def equations(self, a, b):
        return [*(b.origin - a.origin)]


class Universal(JointKind):
    """x_b = x_a and e1_a ⟂ e2_b (Cardan): arm e1 turns in body a, arm e2 in body b; e3 is the shaft as drawn."""

    name = "universal"
    shares_point = True

    def equations(self, a, b):
        return [*(b.origin - a.origin), a.e1.dot(b.e2)]


class PlanarJoint(JointKind):
    """(x_b − x_a) ⟂ e3_a and e3_b ⟂ e1_a, e2_a; e3 is the normal. In a planar model nothing remains."""

    name = "planar"
    planar = True

    def equations(self, a, b):
        return [(b.origin - a.origin).dot(a.e3), a.e1.dot(b.e3), a.e2.dot(b.e3)]

    def planar_equations(self, a, b):
        return []


class Weld(JointKind):
    """x_b = x_a and equal orientation."""

    name = "weld"
    planar = shares_point = clamps = True

    def equations(self, a, b):
        return [*(b.origin - a.origin), a.e3.dot(b.e2), a.e1.dot(b.e3), a.e2.dot(b.e1)]

    def planar_equations(self, a, b):
        return [*(b.origin - a.origin), b.angle - a.angle]


REVOLUTE = Revolute()
PRISMATIC = Prismatic()
CYLINDRICAL = Cylindrical()
SPHERICAL = Spherical()
UNIVERSAL = Universal()
PLANAR_JOINT = PlanarJoint()
WELD = Weld()

JOINT_KINDS = {kind.name: kind for kind in (REVOLUTE, PRISMATIC, CYLINDRICAL, SPHERICAL, UNIVERSAL, PLANAR_JOINT, WELD)}
"""The kinds of the package by their names."""


@cache
def constraint(kind: JointKind, dim: int, driven: bool) -> SmoothFunction:
    """The equations C of ``kind`` in ``dim`` dimensions, with that of its motor last if ``driven``.

    Variables are the poses z_a and z_b and, if ``driven``, φ, (2 pose_size,) or (2 pose_size + 1,). Constants are the
    joint's position minus the centres of both bodies and the rows of its triad, all as drawn, (2 dim + dim²,).
    """
    return SmoothFunction(*_equations(kind, dim, driven))


@cache
def constraint_rate(kind: JointKind, dim: int, driven: bool) -> SmoothFunction:
    """∂C/∂c · ċ of a ``constraint``; its constants are those c of that, then their rates ċ."""
    return _rate(*_equations(kind, dim, driven))


@cache
def coordinate_rate(kind: JointKind, dim: int) -> SmoothFunction:
    """∂φ/∂c · ċ of a ``free_coordinate``, (1,); arguments as for ``constraint_rate``."""
    poses, constants, a, b = _markers(dim)
    return _rate([kind.coordinate(a, b)], poses, constants)


def _equations(kind: JointKind, dim: int, driven: bool):
    """The equations of a ``constraint``, its variables and its constants."""
    poses, constants, a, b = _markers(dim)
    equations = kind.equations(a, b) if dim == 3 else kind.planar_equations(a, b)
    if not driven:
        return equations, poses, constants
    value = sympy.Symbol("phi", real=True)
    return [*equations, kind.motor(a, b, value)], (*poses, value), constants


def _rate(formulae, variables, constants) -> SmoothFunction:
    """Σ ∂f/∂c ċ as a function of the variables of f, with constants (c, ċ)."""
    rates = sympy.symbols(f"d0:{len(constants)}", real=True)
    along = [
        sum((sympy.diff(f, c) * rate for c, rate in zip(constants, rates, strict=True)), sympy.S.Zero) for f in formulae
    ]
    return SmoothFunction(along, variables, (*constants, *rates))


@cache
def free_coordinate(kind: JointKind, dim: int) -> SmoothFunction:
    """The free coordinate φ of ``kind``, (1,); variables and constants are those of a ``constraint`` without motor."""
    poses, constants, a, b = _markers(dim)
    return SmoothFunction([kind.coordinate(a, b)], poses, constants)


def _markers(dim: int):
    """Symbols of both poses and of the constants, and the markers on both bodies."""
    space = RIGID_SPACES[dim]
    poses = sympy.symbols(f"z0:{2 * space.pose_size}", real=True)
    constants = sympy.symbols(f"c0:{2 * dim + dim * dim}", real=True)
    triad = sympy.Matrix(dim, dim, constants[2 * dim :])

    def marker(z: list[sympy.Symbol], anchor: tuple[sympy.Symbol, ...]):
        rotation = space.symbolic_rotation(z[dim:])
        # both origins are counted from where the joint was drawn, which needs R − I only
        origin = sympy.Matrix(z[:dim]) + (rotation - sympy.eye(dim)) * sympy.Matrix(anchor)
        vectors = [rotation * triad[k, :].T for k in range(dim)]
        if dim == 2:
            axis, normal = vectors
            return PlanarMarker(origin, axis, normal, triad.det() * z[2])
        e1, e2, e3 = vectors
        return SpatialMarker(origin, e1, e2, e3, triad[2, :].T, (z[3], sympy.Matrix(z[4:])))

    a = marker(list(poses[: space.pose_size]), constants[:dim])
    b = marker(list(poses[space.pose_size :]), constants[dim : 2 * dim])
    return poses, constants, a, b
