"""Revolute joint: two bodies with a common point and axis, about which they turn."""

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
        return a.angle_beyond(b, value)


REVOLUTE = Revolute()
