"""Planar joint: a plane of body b slides and turns on a plane of body a."""

from fenicsmech.joints.joint import JointKind


class PlanarJoint(JointKind):
    """(x_b − x_a) ⟂ e3_a and e3_b ⟂ e1_a, e2_a; e3 is the normal. In a planar model nothing remains."""

    name = "planar"
    planar = True

    def equations(self, a, b):
        return [(b.origin - a.origin).dot(a.e3), a.e1.dot(b.e3), a.e2.dot(b.e3)]

    def planar_equations(self, a, b):
        return []


PLANAR_JOINT = PlanarJoint()
