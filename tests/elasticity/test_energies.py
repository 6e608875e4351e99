"""Strain energy densities: hand-computed values, textbook forms from rounding-size to large strain, invariances."""

import numpy as np
import pytest
from numpy import log

from fenicsmech.elasticity import PLANE_STRAIN, PLANE_STRESS, SPATIAL, cauchy_stress
from fenicsmech.laws import IsochoricNeoHookean, IsochoricSimoNeoHookean, LogarithmicNeoHookean, NeoHookean

from . import textbook
from .cases import each_case, each_law
from .pointwise import arguments, energies, of_constants, pointwise, tensor

# μ = 1, λ = 2, κ = 8/3
YOUNG, POISSON = 8.0 / 3.0, 1.0 / 3.0

SHEARED = [[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]  # J = 1, tr FᵀF = 4
STRETCHED = np.diag([2.0, 1.0, 1.0])  # J = 2, tr FᵀF = 6
SWOLLEN = np.diag([2.0, 2.0, 2.0])  # J = 8, tr FᵀF = 12
ISOCHORIC = 0.5 * (6.0 * 2.0 ** (-2.0 / 3.0) - 3.0)  # of STRETCHED

HAND_COMPUTED = {
    NeoHookean: (0.5, 3.0 - 2.0 * log(2.0), 36.0 - 6.0 * log(2.0)),
    LogarithmicNeoHookean: (0.5, 1.5 - log(2.0) + log(2.0) ** 2, 4.5 - 3.0 * log(2.0) + 9.0 * log(2.0) ** 2),
    IsochoricNeoHookean: (0.5, ISOCHORIC + 4.0 / 3.0, 196.0 / 3.0),
    IsochoricSimoNeoHookean: (0.5, ISOCHORIC + 2.0 - 4.0 / 3.0 * log(2.0), 42.0 - 4.0 * log(2.0)),
}


def random_gradients(dim: int, size: float, count: int = 12) -> np.ndarray:
    """H (count, dim, dim) of about the given size, strain and rotation mixed, J well above zero."""
    H = np.random.default_rng(1).uniform(-1.0, 1.0, (10 * count, dim, dim)) * size
    return H[np.linalg.det(np.eye(dim) + H) > 0.3][:count]


def rotations(dim: int, count: int) -> np.ndarray:
    """Proper rotations (count, dim, dim), large and small ones."""
    Q = np.linalg.qr(np.random.default_rng(2).normal(size=(count, dim, dim)))[0]
    Q[np.linalg.det(Q) < 0.0, :, 0] *= -1.0
    return Q


@each_law
def test_values_computed_by_hand(law):
    H = np.array([SHEARED, STRETCHED, SWOLLEN]) - np.eye(3)
    assert energies(SPATIAL, law, H, YOUNG, POISSON) == pytest.approx(HAND_COMPUTED[law], rel=1e-14)
    in_plane = energies(PLANE_STRAIN, law, H[:2, :2, :2], YOUNG, POISSON)
    assert in_plane == pytest.approx(HAND_COMPUTED[law][:2], rel=1e-14)


@pytest.mark.thorough
@each_case
@pytest.mark.parametrize("size", [1e-12, 1e-9, 1e-6, 1e-3, 0.1, 0.8])
def test_no_digits_are_lost_at_any_strain(model, law, size):
    H = random_gradients(model.dim, size)
    young, poisson = 1770.0, np.resize([0.3, 0.0, 0.475, -0.2, 0.4999], len(H))
    exact = [textbook.energy(model, law, h.tolist(), young, nu) for h, nu in zip(H, poisson, strict=True)]
    computed = energies(model, law, H, young, poisson)
    assert computed == pytest.approx(np.array(exact, dtype=float), rel=1e-12, abs=0.0)


@each_case
@pytest.mark.parametrize("mode", [np.diag([1.0, 0.0, 0.0]), np.eye(3), np.eye(3, k=1)], ids=["pull", "swell", "shear"])
def test_no_digits_are_lost_in_pure_modes(model, law, mode):
    H = np.multiply.outer([1e-9, -1e-9, 1e-5, 1e-2, -1e-1], mode[: model.dim, : model.dim])
    exact = [textbook.energy(model, law, h.tolist(), 1.9, 0.475) for h in H]
    assert energies(model, law, H, 1.9, 0.475) == pytest.approx(np.array(exact, dtype=float), rel=1e-12, abs=0.0)


@each_case
def test_energy_does_not_see_superposed_rotations(model, law):
    H = random_gradients(model.dim, 0.3)
    F = np.eye(model.dim) + H
    turned = rotations(model.dim, len(F)) @ F - np.eye(model.dim)
    expected = energies(model, law, H, 1.9, 0.475)
    assert energies(model, law, turned, 1.9, 0.475) == pytest.approx(expected, rel=1e-12)


@each_case
def test_energy_has_no_preferred_direction(model, law):
    H = random_gradients(model.dim, 0.3)
    Q = rotations(model.dim, len(H))
    expected = energies(model, law, H, 1.9, 0.475)
    assert energies(model, law, Q @ H @ Q.transpose(0, 2, 1), 1.9, 0.475) == pytest.approx(expected, rel=1e-12)


@each_case
def test_material_turned_inside_out_has_no_energy(model, law):
    F = np.stack([np.eye(model.dim)] * 4)
    F[:, 0, 0] = [-1e-9, -0.5, -1.0, -3.0]
    assert np.isnan(energies(model, law, F - np.eye(model.dim), 1.9, 0.475)).all()


@each_case
def test_material_squeezed_to_nothing_has_no_finite_energy(model, law):
    H = np.zeros((1, model.dim, model.dim))
    H[0, 0, 0] = -1.0
    assert not np.isfinite(energies(model, law, H, 1.9, 0.475)).any()


def test_plane_stress_leaves_nothing_across_the_plane():
    def build(E, nu, *entries):
        return cauchy_stress(PLANE_STRESS, of_constants(NeoHookean, E, nu), tensor(entries))[2, 2] / E

    for size in (1e-9, 1e-3, 0.5):
        stress = pointwise(build, arguments(random_gradients(2, size), 1.9, 0.475))
        assert np.abs(stress).max() < 1e-14 * max(1.0, 100 * size)
