"""Revolute joint: two bodies share a point and an axis, and turn about it."""

import sympy

from fenicsmech.joints.kind import JointKind


class Revolute(JointKind):
    """x_b = x_a, e3_b ⟂ e1_a, e2_a; a motor prescribes the angle φ: sin(angle − φ) = 0."""

    name = "revolute"
    bored = True
    planar = True
    motorised = True

    def equations(self, a, b):
        return [*(b.origin - a.origin), a.e1.dot(b.e3), a.e2.dot(b.e3)]

    def planar_equations(self, a, b):
        return [*(b.origin - a.origin)]

    def motor(self, a, b, value):
        return b.e1.dot(sympy.cos(value) * a.e2 - sympy.sin(value) * a.e1)

    def planar_motor(self, a, b, value):
        return b.angle - a.angle - value


REVOLUTE = Revolute()
