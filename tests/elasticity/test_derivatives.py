"""Derivatives of the energy by state, design and material, at a deformed and redesigned point, by Taylor tests."""

import numpy as np
import pytest
import ufl
from dolfinx import fem

from fenicsmech.compat import compile_form

from ..oracles.dense import taylor_rates
from .cases import CASES, name
from .single_link import distorted, forces, interpolate, single_link, stiffness_matrix, wave

STEPS = 10.0 ** -np.arange(2.0, 4.5, 0.5)
PARAMETERS = ("u", "shape", "E", "nu")


@pytest.fixture(scope="module", params=CASES, ids=lambda case: "-".join(map(name, case)))
def body(request):
    model, law = request.param
    body = single_link(*distorted(model.dim), model=model, law=law, depth=2.5)
    interpolate(body.shape, wave(model.dim, 0.2, seed=1))
    interpolate(body.u, wave(model.dim, 0.2, seed=2))
    return body


def seen_from(function, compute):
    """``compute()`` as a function of the values of ``function``, which it leaves as they were."""

    def at(values):
        before = function.x.array.copy()
        function.x.array[:] = values
        result = compute()
        function.x.array[:] = before
        return result

    return at


def direction(function):
    """Of a size that keeps the deformed body, and its Poisson's ratio, well within bounds."""
    size = 0.2 * np.abs(function.x.array).max()
    return np.random.default_rng(4).uniform(-size, size, len(function.x.array))


def rates(function, compute, derivative):
    found = taylor_rates(seen_from(function, compute), function.x.array, direction(function), derivative, STEPS)
    assert found.without[-1] > 0.95
    return found.with_gradient


@pytest.mark.thorough
@pytest.mark.parametrize("parameter", PARAMETERS)
def test_first_derivatives_of_the_energy(body, parameter):
    function = body.parameters[parameter] if parameter in body.parameters else getattr(body, parameter)
    gradient = fem.assemble_vector(compile_form(ufl.derivative(body.energy_ufl, function))).array
    if parameter == "E":  # the energy is linear in it
        assert gradient @ function.x.array == pytest.approx(body.energy(), rel=1e-13)
    else:
        assert rates(function, body.energy, gradient).min() > 1.95


def test_residual_is_the_first_derivative_by_the_state(body):
    gradient = fem.assemble_vector(compile_form(ufl.derivative(body.energy_ufl, body.u))).array
    assert forces(body) == pytest.approx(gradient, rel=1e-14)


def test_tangent_is_the_derivative_of_the_residual(body):
    assert rates(body.u, lambda: forces(body), stiffness_matrix(body)).min() > 1.95


def test_tangent_is_symmetric(body):
    K = stiffness_matrix(body)
    assert np.abs(K - K.T).max() < 1e-14 * np.abs(K).max()


def test_work_of_the_residual_is_differentiated_by_the_design(body):
    # what an adjoint needs: ∂(zᵀ ∂E/∂u)/∂d for a given z
    z = fem.Function(body.u.function_space)
    interpolate(z, wave(body.model.dim, 1.0, seed=5))
    gradient = fem.assemble_vector(
        compile_form(ufl.derivative(ufl.derivative(body.energy_ufl, body.u, z), body.shape))
    ).array
    assert rates(body.shape, lambda: forces(body) @ z.x.array, gradient).min() > 1.95
