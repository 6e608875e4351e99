"""Spherical joint: two bodies share a point."""

from fenicsmech.joints.kind import JointKind


class Spherical(JointKind):
    """x_b = x_a."""

    name = "spherical"

    def equations(self, a, b):
        return [*(b.origin - a.origin)]


SPHERICAL = Spherical()
