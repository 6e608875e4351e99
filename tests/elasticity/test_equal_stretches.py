"""Ogden's law where principal stretches are equal, or nearly so: energies and their first two derivatives."""

import numpy as np
import pytest
import ufl

import fenicsmech as fm
from fenicsmech.elasticity import PLANE_STRAIN, SPATIAL

from .pointwise import pointwise, tensor

LAW = fm.Ogden((0.63, 0.4, -0.3), (1.3, 5.0, -2.0), 0.4)
TURN = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
EQUAL = {
    "undeformed": np.eye(3),
    "turned": TURN @ np.diag([1.0, 1.0, np.linalg.det(TURN)]),
    "swollen": 1.3 * np.eye(3),
    "uniaxial": TURN @ np.diag([2.0, 0.7, 0.7]) @ TURN.T,
    "equibiaxial": TURN @ np.diag([1.6, 1.6, 0.4]) @ TURN.T,
    "nearly uniaxial": np.diag([2.0, 0.7, 0.7 + 1e-9]),
    "nearly undeformed": np.diag([1.0, 1.0 + 1e-7, 1.0 - 2e-7]),
    "all apart": np.diag([2.0, 1.1, 0.5]),
    "middle in the middle": np.diag([1.3, 1.0, np.sqrt(2.0 - 1.69)]),  # J₃ = 0
    "middle exactly in the middle": np.diag([1.75, 1.25, 0.25]),  # without rounding
}


def energy(F: np.ndarray) -> float:
    """By singular values."""
    stretches = np.linalg.svd(F)[1]
    J = np.prod(stretches)
    kept = stretches * J ** (-1.0 / 3.0)
    kappa = LAW.E / (3.0 * (1.0 - 2.0 * LAW.nu))
    powers = sum(m / a * (np.sum(kept**a) - 3.0) for m, a in zip(LAW.mu, LAW.alpha, strict=True))
    return float(powers + kappa / 2.0 * (J - 1.0) ** 2)


@pytest.mark.parametrize("model", [SPATIAL, PLANE_STRAIN], ids=lambda model: model.name)
def test_energies_have_the_right_values_slopes_and_curvatures(model):
    dim, step = model.dim, 1e-3
    places = {name: F[:dim, :dim] for name, F in EQUAL.items() if dim == 3 or abs(F[:2, 2]).max() == 0.0}
    towards = np.random.default_rng(5).uniform(-1.0, 1.0, (dim, dim))
    shifts = step * np.array([0.0, -2.0, -1.0, 1.0, 2.0])
    rows = [[t, *(F - np.eye(dim)).ravel(), *towards.ravel()] for F in places.values() for t in shifts]

    def build(t, *entries):
        t, count = ufl.variable(t), dim * dim
        W = LAW.energy(model.strain(LAW, tensor(entries[:count]) + t * tensor(entries[count:])))
        slope = ufl.diff(W, t)
        return ufl.as_vector([W, slope, ufl.diff(slope, t)])

    found = pointwise(build, np.array(rows)).reshape(len(places), len(shifts), 3)
    for (name, F), values in zip(places.items(), found, strict=True):
        W, slope, curvature = values.T
        for t, each in zip(shifts, W, strict=True):
            full = np.eye(3)
            full[:dim, :dim] = F + t * towards
            assert each == pytest.approx(energy(full), rel=1e-11, abs=1e-14), name
        # differences of fourth order
        weights = np.array([0.0, 1.0, -8.0, 8.0, -1.0]) / (12.0 * step)
        assert slope[0] == pytest.approx(weights @ W, rel=1e-7, abs=1e-8), name
        assert curvature[0] == pytest.approx(weights @ slope, rel=1e-7), name
