"""Prismatic joint: two bodies slide along a common axis without turning."""

from fenicsmech.joints.joint import JointKind


class Prismatic(JointKind):
    """(x_b − x_a) ⟂ e1_a, e2_a and equal orientation; a motor prescribes the travel along e3_a."""

    name = "prismatic"
    planar = True
    motorised = True
    sliding = True
    axis_in_plane = True

    def equations(self, a, b):
        apart = b.origin - a.origin
        return [apart.dot(a.e1), apart.dot(a.e2), a.e3.dot(b.e2), a.e1.dot(b.e3), a.e2.dot(b.e1)]

    def planar_equations(self, a, b):
        return [(b.origin - a.origin).dot(a.normal), b.angle - a.angle]

    def coordinate(self, a, b):
        return (b.origin - a.origin).dot(a.axis)


PRISMATIC = Prismatic()
