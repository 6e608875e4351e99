"""Joint compliance: elastic pins.

A force λ across the pin moves its two ends apart by c λ. With the constraint C = x_b − x_a of a rigid pin,

    C + c λ = 0,    V = ½ |C|² / c,

so that c enters the KKT matrix as −c on the diagonal of the multipliers, and c → 0 is the rigid pin.
"""

from __future__ import annotations

from dataclasses import dataclass

from fenicsmech.errors import DescriptionError, expect, positive, set_fields
from fenicsmech.mechanism import Effect, Joint


@dataclass(frozen=True)
class JointCompliance(Effect):
    """Compliance of a joint at the shared point of its links, isotropic; its axis stays aligned.

    Two compliances of one joint act in series. The energy of the joint is not part of a frame's strain energy.

    Attributes:
        joint: a revolute, spherical, universal or weld joint.
        compliance: c; with N and mm in mm/N.

    Raises:
        DescriptionError: this is not a joint, or the compliance is not positive.
    """

    joint: Joint
    compliance: float

    def __post_init__(self) -> None:
        expect("joint compliance", self.joint, Joint, "a joint")
        set_fields(self, compliance=positive(f"compliance of {self.joint.name!r}", self.compliance))

    def check(self, mechanism, dim):
        super().check(mechanism, dim)
        if not self.joint.kind.shares_point:
            raise DescriptionError(
                f"compliance of {self.joint.name!r}",
                f"the links of a {self.joint.kind.name} joint share no point",
                "Soften revolute, spherical, universal or weld joints",
            )

    def explain(self):
        return f"compliance {self.compliance:g} of {self.joint.name!r}"

    def soften(self, linkage):
        rows = [row for row, name in enumerate(linkage.joints.row_names) if name == self.joint.name]
        return dict.fromkeys(rows[: linkage.dim], self.compliance)
