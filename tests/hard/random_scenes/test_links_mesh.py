"""Shape functions and quadrature of the residual check, which share no code with the solver."""

import math

import numpy as np
import pytest

from .links_mesh import Elements, quadrature

CASES = pytest.mark.parametrize("dim, order", [(2, 1), (2, 2), (2, 3), (3, 1), (3, 2), (3, 3)])


@CASES
def test_shape_functions_are_one_at_their_node_and_zero_at_others(dim, order):
    elements = Elements.regular(dim, order)
    assert len(elements.places) == math.comb(order + dim, dim)
    assert elements.values(elements.places) == pytest.approx(np.eye(len(elements.places)), abs=1e-14)


@CASES
def test_slopes_are_those_of_the_shape_functions(dim, order):
    elements = Elements.regular(dim, order)
    at = np.random.default_rng(0).dirichlet(np.ones(dim + 1), size=3)
    for b in range(dim + 1):
        step = np.zeros(dim + 1)
        step[b] = 1e-6
        difference = (elements.values(at + step) - elements.values(at - step)) / 2e-6
        assert elements.slopes(at)[..., b].astype(float) == pytest.approx(difference, abs=1e-7)


@pytest.mark.parametrize("dim, degree", [(1, 4), (2, 1), (2, 4), (3, 1), (3, 3)])
def test_quadrature_integrates_monomials(dim, degree):
    points, weights = quadrature(dim, degree)
    # ∫ L₀^a L₁^b / volume = a! b! dim! / (a + b + dim)!
    for a in range(degree + 1):
        for b in range(degree + 1 - a):
            exact = math.factorial(a) * math.factorial(b) * math.factorial(dim) / math.factorial(a + b + dim)
            assert weights @ (points[:, 0] ** a * points[:, 1] ** b) == pytest.approx(exact, rel=1e-12)
