"""Universal (Cardan) joint: two bodies joined by a cross, whose arms each turn in one of them."""

from fenicsmech.joints.joint import JointKind


class Universal(JointKind):
    """x_b = x_a and e1_a ⟂ e2_b: arm e1 turns in body a, arm e2 in body b; e3 is the shaft as drawn."""

    name = "universal"
    shares_point = True

    def equations(self, a, b):
        return [*(b.origin - a.origin), a.e1.dot(b.e2)]


UNIVERSAL = Universal()
