"""Von Mises stress under uniaxial tension, from the closed form of each law."""

import numpy as np
import pytest
from scipy.optimize import brentq

from fenicsmech.elasticity import PLANE_STRAIN, PLANE_STRESS, SPATIAL
from fenicsmech.laws import IsochoricNeoHookean, IsochoricSimoNeoHookean, LogarithmicNeoHookean, NeoHookean
from fenicsmech.stress import von_mises

from .cases import each_case
from .single_link import distorted, interpolate, single_link

YOUNG, POISSON = 1.9, 0.4
MODULI = NeoHookean(YOUNG, POISSON)


def _isochoric(squares, J):
    return MODULI.mu * J ** (-2.0 / 3.0) * (squares - squares.sum() / 3.0)


# J σ_i from the squares of the principal stretches
KIRCHHOFF = {
    NeoHookean: lambda b, J: MODULI.mu * (b - 1.0) + 0.5 * MODULI.lam * (J**2 - 1.0),
    LogarithmicNeoHookean: lambda b, J: MODULI.mu * (b - 1.0) + MODULI.lam * np.log(J),
    IsochoricNeoHookean: lambda b, J: _isochoric(b, J) + MODULI.kappa * J * (J - 1.0),
    IsochoricSimoNeoHookean: lambda b, J: _isochoric(b, J) + 0.5 * MODULI.kappa * (J**2 - 1.0),
}


def cauchy(law, stretches):
    """Principal stresses (3,) of principal stretches (3,)."""
    stretches = np.asarray(stretches)
    J = np.prod(stretches)
    return KIRCHHOFF[law](stretches**2, J) / J


def uniaxial(model, law, stretch):
    """The stretches (3,) of a bar pulled along x: free to contract sideways as far as the model allows."""

    def stretches(sideways):
        return np.array([stretch, sideways, 1.0 if model is PLANE_STRAIN else sideways])

    return stretches(brentq(lambda s: cauchy(law, stretches(s))[1], 0.3, 3.0, xtol=1e-15, rtol=1e-14))


@pytest.mark.parametrize("stretch", [0.7, 1.0 + 1e-6, 1.5])
@each_case
def test_uniaxial_tension(model, law, stretch):
    dim = model.dim
    stretches = uniaxial(model, law, stretch)
    a, b, c = cauchy(law, stretches)
    expected = np.sqrt(0.5 * ((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2))
    if model is PLANE_STRAIN:
        assert abs(c) > 0.2 * abs(a)  # held by the walls
    else:
        assert expected == pytest.approx(abs(a))

    body = single_link(*distorted(dim), model=model, law=law, young=YOUNG, poisson=POISSON)
    interpolate(body.u, lambda X: X * (stretches[:dim] - 1.0))
    found = von_mises(body.stress_samples()[0])
    assert found == pytest.approx(np.full(found.shape, expected), rel=1e-8)


@each_case
def test_stress_turns_with_the_body(model, law):
    angle = 1.0
    turn = np.eye(model.dim)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    stretched = np.diag([1.3, 0.9, 1.1][: model.dim])
    seen = []
    for F in (stretched, turn @ stretched, stretched @ turn):
        body = single_link(*distorted(model.dim), model=model, law=law, young=YOUNG, poisson=POISSON)
        interpolate(body.u, lambda X, F=F: X @ (F - np.eye(model.dim)).T)
        seen.append(von_mises(body.stress_samples()[0]))
    assert seen[1] == pytest.approx(seen[0], rel=1e-12)
    assert seen[2] == pytest.approx(seen[0], rel=1e-12)


@pytest.mark.parametrize("model", [SPATIAL, PLANE_STRAIN, PLANE_STRESS])
def test_a_body_at_rest_has_no_stress(model):
    body = single_link(*distorted(model.dim), model=model)
    assert not von_mises(body.stress_samples()[0]).any()
