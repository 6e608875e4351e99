"""Spherical joint: two bodies with a common point."""

from fenicsmech.joints.joint import JointKind


class Spherical(JointKind):
    """x_b = x_a."""

    name = "spherical"
    shares_point = True

    def equations(self, a, b):
        return [*(b.origin - a.origin)]


SPHERICAL = Spherical()
