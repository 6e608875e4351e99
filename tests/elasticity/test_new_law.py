"""A law from outside the package, one class with an energy: exact stresses in 3D, plane strain and plane stress."""

from dataclasses import dataclass

import numpy as np
import pytest
import ufl
from scipy.optimize import brentq

import fenicsmech as fm
from fenicsmech.elasticity import PLANE_STRAIN, PLANE_STRESS, SPATIAL, MixedFormulation, cauchy_stress
from fenicsmech.laws import NeoHookean
from fenicsmech.mechanism import Force

from .pointwise import pointwise, tensor


@dataclass(frozen=True)
class MooneyRivlin(fm.Law):
    """W = C₁ (J^(−2/3) I₁ − 3) + C₂ (J^(−4/3) I₂ − 3) + κ/2 (J − 1)²."""

    C1: float
    C2: float
    bulk: float

    def energy(self, strain):
        i1, i2 = strain.J ** (-2 / 3) * strain.I1 - 3, strain.J ** (-4 / 3) * strain.I2 - 3
        return self.C1 * i1 + self.C2 * i2 + self.bulk / 2 * strain.j**2

    @property
    def E(self):
        mu = 2 * (self.C1 + self.C2)
        return 9 * self.bulk * mu / (3 * self.bulk + mu)

    @property
    def nu(self):
        mu = 2 * (self.C1 + self.C2)
        return (3 * self.bulk - 2 * mu) / (6 * self.bulk + 2 * mu)


RUBBER = MooneyRivlin(0.4, 0.1, 10.0)


def cauchy(stretches) -> np.ndarray:
    """Principal Cauchy stresses (3,) of principal stretches (3,), differentiated by hand."""
    squares, J = np.square(stretches), np.prod(stretches)
    i1, i2 = squares.sum(), (squares.sum() ** 2 - np.sum(squares**2)) / 2
    first = 2 * RUBBER.C1 * J ** (-2 / 3) * (squares - i1 / 3)
    second = 2 * RUBBER.C2 * J ** (-4 / 3) * (squares * (i1 - squares) - 2 * i2 / 3)
    return (first + second) / J + RUBBER.bulk * (J - 1)


def stresses(model, law, stretches) -> np.ndarray:
    """Principal stresses (n, 3) of principal stretches on the mesh (n, dim)."""
    H = np.array([np.diag(row) - np.eye(model.dim) for row in stretches])

    def build(*entries):
        stress = cauchy_stress(model, law, tensor(entries))
        return ufl.as_vector([stress[k, k] for k in range(3)])

    return pointwise(build, H.reshape(len(H), -1))


def free(of, low=0.3, high=2.0) -> float:
    return brentq(of, low, high, xtol=1e-15, rtol=1e-14)


@pytest.mark.parametrize("stretch", [0.7, 1.0001, 1.5, 2.5])
def test_uniaxial_and_equibiaxial_tension(stretch):
    side = free(lambda s: cauchy([stretch, s, s])[1])
    across = free(lambda s: cauchy([stretch, stretch, s])[2], 0.15, 2.5)
    expected = np.array([cauchy([stretch, side, side]), cauchy([stretch, stretch, across])])
    in_space = stresses(SPATIAL, RUBBER, [[stretch, side, side], [stretch, stretch, across]])
    assert in_space == pytest.approx(expected, rel=1e-10, abs=1e-12)
    # the local solve finds the free sides
    flat = stresses(PLANE_STRESS, RUBBER, [[stretch, side], [stretch, stretch]])
    assert flat == pytest.approx(expected, rel=1e-10, abs=1e-12)
    held = stresses(PLANE_STRAIN, RUBBER, [[stretch, 1.0 / stretch]])
    assert held[0] == pytest.approx(cauchy([stretch, 1.0 / stretch, 1.0]), rel=1e-10)


@dataclass(frozen=True)
class WithoutClosedForm(NeoHookean):
    """The neo-Hookean law, its plane stress found point by point."""

    def contraction(self, H):
        return None


def test_closed_plane_stress_is_that_of_the_local_solve():
    stretches = [[0.6, 1.2], [1.0 + 1e-7, 1.0], [1.5, 1.4], [2.0, 0.8]]
    for nu in (0.0, 0.3, 0.4999):
        closed, solved = (stresses(PLANE_STRESS, law(2.0, nu), stretches) for law in (NeoHookean, WithoutClosedForm))
        assert solved == pytest.approx(closed, rel=1e-9, abs=1e-10)


def bar(law: fm.Law, space: str) -> tuple[fm.Simulation, Force]:
    """A strip clamped at one end and pulled at the other, which is free to move along x only."""
    mechanism = fm.Mechanism("bar")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    strip = mechanism.flexible("strip", fm.strip([(0, 0), (40, 0)], thickness=4, depth=2), fm.Material("new", law=law))
    clamp = fm.Rectangle(4.0, 6.0)
    mechanism.weld(base, strip, at=(2, 0), region=clamp)
    mechanism.weld(strip, hand, at=(38, 0), region=clamp)
    force = mechanism.force(on=hand, at=(38, 0), direction=(1, 0))
    return fm.Simulation(fm.Scene(mechanism), space=space, size=4.0), force


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["plane-strain", "3d"])
def test_a_new_law_goes_through_simulations(space):
    # clamps hold the ends: softer than a free bar under the ends, stiffer by their hold, by at most some per cent
    simulation, force = bar(RUBBER, space)
    law_of_hooke = bar(NeoHookean(RUBBER.E, RUBBER.nu), space)
    pull = 0.02
    mine = simulation.load_displacement(force, forces=[pull]).displacements[-1]
    theirs = law_of_hooke[0].load_displacement(law_of_hooke[1], forces=[pull]).displacements[-1]
    assert mine == pytest.approx(theirs, rel=2e-3)  # the same at small strain
    assert 0.0 < mine < 1.0


def test_a_law_without_a_mixed_form_is_named_where_one_is_needed():
    material = fm.Material("new", law=MooneyRivlin(0.4, 0.1, 500.0))
    with pytest.raises(fm.DescriptionError, match="'new'.*MooneyRivlin has no mixed_energy"):
        MixedFormulation().mixed([material], SPATIAL, 2)
    assert MixedFormulation().mixed([material], PLANE_STRESS, 2) == (False,)


def test_parameters_have_names_and_tuples_are_counted():
    @dataclass(frozen=True)
    class Ogden(fm.Law):
        mu: tuple[float, ...]
        alpha: tuple[float, ...]
        bulk: float
        E, nu = 1.0, 0.4

        def energy(self, strain):
            return sum(m / a**2 * strain.I1 for m, a in zip(self.mu, self.alpha, strict=True)) + self.bulk * strain.j**2

    law = Ogden((1.0, 2.0), (3.0, -4.0), 5.0)
    assert law.parameters == {"mu0": 1.0, "mu1": 2.0, "alpha0": 3.0, "alpha1": -4.0, "bulk": 5.0}
    doubled = law.with_parameters({name: 2.0 * value for name, value in law.parameters.items()})
    assert doubled == Ogden((2.0, 4.0), (6.0, -8.0), 10.0)


def test_material_takes_a_law_or_two_constants():
    assert fm.Material("a", 2.0, 0.3) == fm.Material("a", law=NeoHookean(2.0, 0.3))
    for arguments in ({}, {"E": 1.0}, {"E": 1.0, "nu": 0.3, "law": RUBBER}):
        with pytest.raises(fm.DescriptionError, match="material 'a'"):
            fm.Material("a", **arguments)
