"""Weld: two bodies move as one."""

from fenicsmech.joints.joint import JointKind


class Weld(JointKind):
    """x_b = x_a and equal orientation."""

    name = "weld"
    planar = True
    shares_point = True
    clamps = True

    def equations(self, a, b):
        return [*(b.origin - a.origin), a.e3.dot(b.e2), a.e1.dot(b.e3), a.e2.dot(b.e1)]

    def planar_equations(self, a, b):
        return [*(b.origin - a.origin), b.angle - a.angle]


WELD = Weld()
