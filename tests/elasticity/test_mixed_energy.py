"""Energies of the u–p (mixed) formulation: the law's energy at the pressure that makes them stationary."""

import numpy as np
import pytest
import ufl

from fenicsmech.elasticity import PLANE_STRAIN, SPATIAL
from fenicsmech.laws import IsochoricNeoHookean, IsochoricSimoNeoHookean, Law, LogarithmicNeoHookean, NeoHookean

from . import textbook
from .cases import LAWS, each_law, name
from .pointwise import arguments, of_constants, pointwise, tensor
from .test_energies import random_gradients, rotations

each_bulky_case = pytest.mark.parametrize(
    ("model", "law"), [(model, law) for model in (SPATIAL, PLANE_STRAIN) for law in LAWS], ids=name
)


def tension(law: type[Law], j):
    """U′ of a law, by hand."""
    return {
        NeoHookean: ((1 + j) - 1 / (1 + j)) / 2,
        LogarithmicNeoHookean: ufl.ln(1 + j),
        IsochoricNeoHookean: j,
        IsochoricSimoNeoHookean: ((1 + j) - 1 / (1 + j)) / 2,
    }[law]


def at_stationary_pressure(model, law: type[Law], H: np.ndarray, young: float, poisson: float) -> np.ndarray:
    """Π, ∂Π/∂p and −p at p = −M U′, (n, 3)."""

    def build(E, nu, *entries):
        material = of_constants(law, E, nu)
        strain = model.strain(material, tensor(entries))
        tensile = material.volumetric_modulus * tension(law, strain.j)
        p = ufl.variable(-tensile)
        energy = material.mixed_energy(strain, p)
        return ufl.as_vector([energy, ufl.diff(energy, p), tensile])

    return pointwise(build, arguments(H, young, poisson))


@pytest.mark.thorough
@each_bulky_case
@pytest.mark.parametrize("size", [1e-9, 1e-4, 0.1, 0.8])
@pytest.mark.parametrize("poisson", [0.3, 0.4999])
def test_energy_is_that_of_the_displacement_where_the_pressure_is_stationary(model, law, size, poisson):
    H = random_gradients(model.dim, size)
    exact = [float(textbook.energy(model, law, h.tolist(), 1.9, poisson)) for h in H]
    energy, slope, _ = at_stationary_pressure(model, law, H, 1.9, poisson).T
    # U′ by hand has lost digits at small strain, of which Π sees the square
    assert energy == pytest.approx(np.array(exact), rel=1e-11)
    assert slope == pytest.approx(0.0, abs=1e-14)


@each_law
def test_pressure_balances_the_tension_of_pure_swelling_at_small_strain(law):
    """−p = M tr ε = 3 M e, and M is κ but for 2 μ/3 in laws with λ."""
    e, young, poisson = 1e-7, 1.9, 0.4999
    tension = at_stationary_pressure(SPATIAL, law, e * np.eye(3)[None], young, poisson)[0, 2]
    bulk = young / (3.0 * (1.0 - 2.0 * poisson))
    assert tension == pytest.approx(3.0 * bulk * e, rel=1e-3)


@each_law
def test_dilatation_is_the_relative_change_of_volume_at_small_strain_and_grows_with_it(law):
    def build(value):
        j = ufl.variable(value)
        g = law.volumetric.dilatation(j)
        return ufl.as_vector([g, ufl.diff(g, j)])

    g, slope = pointwise(build, np.array([-0.95, -0.5, -0.1, 0.0, 1e-12, 0.1, 0.5, 3.0])[:, None]).T
    assert (g[3], slope[3]) == (0.0, pytest.approx(1.0, rel=1e-15))
    assert g[4] == pytest.approx(1e-12, rel=1e-11)
    assert np.all(slope > 0.0) and np.all(np.diff(g) > 0.0)


@each_bulky_case
def test_energy_does_not_see_superposed_rotations(model, law):
    H = random_gradients(model.dim, 0.5)
    identity = np.eye(model.dim)
    turned = rotations(model.dim, len(H)) @ (identity + H) - identity

    def build(*entries):
        material = law(1.9, 0.4999)
        return material.mixed_energy(model.strain(material, tensor(entries)), 0.3)

    values = [pointwise(build, gradients.reshape(len(H), -1)) for gradients in (H, turned)]
    assert values[1] == pytest.approx(values[0], rel=1e-11, abs=1e-12)
