"""Cylindrical joint: two bodies slide along a common axis and turn about it."""

from fenicsmech.joints.joint import JointKind


class Cylindrical(JointKind):
    """(x_b − x_a) ⟂ e1_a, e2_a and e3_b ⟂ e1_a, e2_a."""

    name = "cylindrical"
    pin_along_axis = True

    def equations(self, a, b):
        apart = b.origin - a.origin
        return [apart.dot(a.e1), apart.dot(a.e2), a.e1.dot(b.e3), a.e2.dot(b.e3)]


CYLINDRICAL = Cylindrical()
