"""Revolute joint: two bodies share a point and an axis, and turn about it."""

import sympy

from fenicsmech.joints.joint import JointKind


class Revolute(JointKind):
    """x_b = x_a, e3_b ⟂ e1_a, e2_a; a motor prescribes the angle φ, in space by sin(angle − φ) = 0."""

    name = "revolute"
    planar = True
    motorised = True
    pin_along_axis = True
    shares_point = True

    def equations(self, a, b):
        return [*(b.origin - a.origin), a.e1.dot(b.e3), a.e2.dot(b.e3)]

    def planar_equations(self, a, b):
        return [*(b.origin - a.origin)]

    def coordinate(self, a, b):
        return a.angle_to(b)

    def motor(self, a, b, value):
        # holds for any number of turns
        return b.e1.dot(sympy.cos(value) * a.e2 - sympy.sin(value) * a.e1)


REVOLUTE = Revolute()
