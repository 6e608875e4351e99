"""Residual and stiffness of displacement and pressure are the derivatives of the energy."""

import numpy as np
import pytest

from fenicsmech.elasticity import PLANE_STRAIN, SPATIAL

from ..oracles.dense import taylor_rates
from .cases import LAWS, each_law, name
from .mixed_newton import stiffness_matrix
from .single_link import distorted, interpolate, single_link, wave

STEPS = 10.0 ** -np.arange(1.5, 3.6, 0.5)


def loaded(model, law, *, order: int = 2):
    """A body somewhere, with no symmetry, and its values."""
    body = single_link(*distorted(model.dim), model=model, law=law, order=order, poisson=0.4999, mixed=True)
    interpolate(body.u, wave(model.dim, 0.05, seed=1))
    interpolate(body.shape, wave(model.dim, 0.02, seed=2))
    random = np.random.default_rng(3)
    body.pressure.p.x.array[:] = random.uniform(-1.0, 1.0, len(body.pressure.p.x.array))
    return body, body.values(), random.uniform(-0.03, 0.03, len(body.values()))


@pytest.mark.thorough
@each_law
@pytest.mark.parametrize("model", [PLANE_STRAIN, SPATIAL], ids=name)
def test_residual_is_the_derivative_of_the_energy(model, law):
    body, start, direction = loaded(model, law)
    rates = taylor_rates(lambda x: (body.take(x), body.energy())[1], start, direction, body.residuals(), STEPS)
    assert rates.without[-1] > 0.95
    assert rates.with_gradient.min() > 1.9


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("model", "order", "law"),
    [*((model, 2, law) for model in (PLANE_STRAIN, SPATIAL) for law in LAWS), (PLANE_STRAIN, 3, LAWS[0])],
    ids=lambda own: str(own) if isinstance(own, int) else name(own),
)
def test_tangent_is_the_derivative_of_the_residual_and_symmetric(model, order, law):
    body, start, direction = loaded(model, law, order=order)
    K = stiffness_matrix(body)
    weights = np.random.default_rng(4).uniform(-1.0, 1.0, len(start))

    def weighted(x):
        body.take(x)
        return weights @ body.residuals()

    rates = taylor_rates(weighted, start, direction, K @ weights, STEPS)
    assert rates.without[-1] > 0.95
    assert rates.with_gradient[-1] > 1.95
    assert abs(K - K.T).max() < 1e-12 * abs(K).max()


@pytest.mark.parametrize("model", [PLANE_STRAIN, SPATIAL], ids=name)
def test_inverted_cells_have_no_energy(model):
    body, start, _ = loaded(model, None)
    body.take(start)
    body.u.x.array[:] *= -100.0
    assert not np.isfinite(body.energy())
