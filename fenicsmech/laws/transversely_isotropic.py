"""Material with one direction, such as parallel fibres, or layers by their normal."""

from dataclasses import dataclass

import numpy as np
from ufl import as_vector, dot, inner, tr

from fenicsmech.errors import set_fields
from fenicsmech.laws.directed import Directed, Vector, unit


@dataclass(frozen=True)
class TransverselyIsotropic(Directed):
    """As ``Orthotropic``, the same in all directions across one axis a.

    With e = a · E a,  μ = E_across / 2(1 + ν_across)  and entries of ℂ, of which axis 1 is a,

        ½ E : ℂ : E = ½ ℂ₂₃ (tr E)² + μ E : E + (ℂ₁₂ − ℂ₂₃) e tr E + 2 (G_along − μ) |E a|² + ½ β e²,
        β = ℂ₁₁ + ℂ₂₃ − 2 ℂ₁₂ − 4 G_along + 2 μ.

    Attributes:
        E_along, E_across: Young's moduli along the axis and across it, force per area.
        nu_along: contraction across the axis over the strain along it, under tension along it.
        nu_across: Poisson's ratio between directions across the axis.
        G_along: modulus of shear along the axis, force per area.
        along: the axis, a direction of the link as drawn, of two or three coordinates; kept as a unit vector in space.
            In the plane it is in the plane, or z.

    Raises:
        DescriptionError: a modulus is not positive, the constants are not positive definite, the direction has no
            length, or not numbers.
    """

    E_along: float
    E_across: float
    nu_along: float
    nu_across: float
    G_along: float
    along: Vector = (1.0, 0.0, 0.0)

    moduli = ("E_along", "E_across", "G_along")
    directions = ("along",)

    def __post_init__(self) -> None:
        set_fields(self, along=unit("law TransverselyIsotropic", "along", self.along))
        ratios = (("nu_along", "E_along", "E_across"), ("nu_across", "E_across", "E_across"))
        self.check_constants(ratios)

    @property
    def compliance(self):
        along, across = 1 / self.E_along, 1 / self.E_across
        S12, S23 = -self.nu_along * along, -self.nu_across * across
        return (along, S12, S12), (S12, across, S23), (S12, S23, across)

    @property
    def shear_moduli(self):
        return self.G_along, self.G_along, self.E_across / (2 * (1 + self.nu_across))

    @property
    def axes(self):
        # any two directions across do
        a = np.asarray(self.along)
        b = np.cross(a, np.eye(3)[np.abs(a).argmin()])
        b /= np.linalg.norm(b)
        return tuple(a.tolist()), tuple(b.tolist()), tuple(np.cross(a, b).tolist())

    @property
    def E_across_plane(self):
        n = self.along[2] ** 2
        return n * self.E_along + (1 - n) * self.E_across

    def across_plane(self, green):
        C, a = self.bounded_stiffness(), as_vector(self.along)
        e, area = dot(a, dot(green, a)), tr(green)
        # 1 where the axis is across the plane, 0 where it is in it; e is 0 in the former case
        n = a[2] ** 2
        return n * C[0][0] + (1 - n) * C[1][1], C[0][1] * (n * area + e) + (1 - n) * C[1][2] * (area - e)

    def distortion(self, strain):
        green, C, a = strain.excess / 2, self.bounded_stiffness(), as_vector(self.along)
        G, _, mu = self.shear_moduli
        drawn = dot(green, a)
        e, volume = dot(a, drawn), tr(green)
        beta = C[0][0] + C[1][2] - 2 * C[0][1] - 4 * G + 2 * mu
        isotropic = C[1][2] * volume**2 / 2 + mu * inner(green, green)
        return isotropic + (C[0][1] - C[1][2]) * e * volume + 2 * (G - mu) * dot(drawn, drawn) + beta * e**2 / 2
