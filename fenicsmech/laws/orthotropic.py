"""Material with three planes of symmetry, such as printed layers of parallel strands."""

from dataclasses import dataclass

from ufl import as_vector, dot

from fenicsmech.errors import DescriptionError, point_text, set_fields
from fenicsmech.laws.directed import Directed, Vector, unit


@dataclass(frozen=True)
class Orthotropic(Directed):
    """W = ½ E : (ℂ − K 1 ⊗ 1) : E + K (J² − 1 − 2 ln J) / 4, ℂ of nine engineering constants along three axes.

    Axis 1 is ``along``, axis 2 ``across``, axis 3 normal to both. νᵢⱼ is the contraction along j over the strain along
    i under tension along i, so that νᵢⱼ / Eᵢ = νⱼᵢ / Eⱼ. For moderate strains, see ``directed``.

    Attributes:
        E1, E2, E3: Young's moduli, force per area.
        nu12, nu13, nu23: Poisson's ratios.
        G12, G13, G23: shear moduli, force per area.
        along, across: directions of the link as drawn, normal to each other, of two or three coordinates; kept as unit
            vectors in space. In the plane one axis is z. By default ``across`` is z × ``along`` in the plane, and
            y where ``along`` is z.

    Raises:
        DescriptionError: a modulus is not positive, the constants are not positive definite, the directions have no
            length or are not normal to each other, or not numbers.
    """

    E1: float
    E2: float
    E3: float
    nu12: float
    nu13: float
    nu23: float
    G12: float
    G13: float
    G23: float
    along: Vector = (1.0, 0.0, 0.0)
    across: Vector = ()

    moduli = ("E1", "E2", "E3", "G12", "G13", "G23")
    directions = ("along", "across")

    def __post_init__(self) -> None:
        law = "law Orthotropic"
        set_fields(self, along=unit(law, "along", self.along))
        across = self.across if len(self.across) else self._across(law)
        set_fields(self, across=unit(law, "across", across))
        cosine = sum(a * b for a, b in zip(self.along, self.across, strict=True))
        if abs(cosine) > 1e-9:
            problem = f"its directions {self.along} and {self.across} are not normal to each other"
            raise DescriptionError(law, problem, "Give across=(…) at a right angle to along=(…)")
        ratios = (("nu12", "E1", "E2"), ("nu13", "E1", "E3"), ("nu23", "E2", "E3"))
        self.check_constants(ratios)

    def _across(self, law: str) -> Vector:
        """The default of ``across``."""
        x, y, z = self.along
        if x == y == 0.0:
            return 0.0, 1.0, 0.0
        if z:
            raise DescriptionError(law, f"along {point_text(self.along)} leaves the plane", "Give across=(…) too")
        return 0.0 - y, x, 0.0

    @property
    def compliance(self):
        S12, S13, S23 = -self.nu12 / self.E1, -self.nu13 / self.E1, -self.nu23 / self.E2
        return (1 / self.E1, S12, S13), (S12, 1 / self.E2, S23), (S13, S23, 1 / self.E3)

    @property
    def shear_moduli(self):
        return self.G12, self.G13, self.G23

    @property
    def axes(self):
        a, b = self.along, self.across
        return a, b, tuple(a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3))

    @property
    def E_across_plane(self):
        return sum(axis[2] ** 2 * E for axis, E in zip(self.axes, (self.E1, self.E2, self.E3), strict=True))

    def across_plane(self, green):
        C, axes = self.bounded_stiffness(), [as_vector(axis) for axis in self.axes]
        # 1 of the axis across the plane, 0 of the others
        across = [axis[2] ** 2 for axis in axes]
        e = [dot(axis, dot(green, axis)) for axis in axes]
        return (
            sum(C[i][i] * across[i] for i in range(3)),
            sum(C[i][j] * across[i] * e[j] for i in range(3) for j in range(3)),
        )

    def distortion(self, strain):
        green, C = strain.excess / 2, self.bounded_stiffness()
        axes = [as_vector(axis) for axis in self.axes]
        e = [[dot(a, dot(green, b)) for b in axes] for a in axes]
        normal = sum(C[i][j] * e[i][i] * e[j][j] for i in range(3) for j in range(3)) / 2
        return normal + 2 * (self.G12 * e[0][1] ** 2 + self.G13 * e[0][2] ** 2 + self.G23 * e[1][2] ** 2)
