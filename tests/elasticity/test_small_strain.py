"""At small strain every law is linear elasticity with the given Young's modulus and Poisson's ratio."""

import numpy as np
import pytest
import ufl
from dolfinx import fem

from fenicsmech.compat import compile_form
from fenicsmech.elasticity import PLANE_STRESS
from fenicsmech.laws import NeoHookean

from .cases import each_case
from .single_link import distorted, single_link, stiffness_matrix

YOUNG, POISSON, DEPTH = 1770.0, 0.42, 2.5


def linear_stiffness(body) -> np.ndarray:
    """∫ (2 μ ε(u) : ε(v) + λ tr ε(u) tr ε(v)) b dX, in plane stress with λ* = 2 λ μ / (λ + 2 μ)."""
    space = body.u.function_space
    moduli = NeoHookean(YOUNG, POISSON)
    lam = 2 * moduli.lam * moduli.mu / (moduli.lam + 2 * moduli.mu) if body.model is PLANE_STRESS else moduli.lam
    strain, virtual = (ufl.sym(ufl.grad(f(space))) for f in (ufl.TrialFunction, ufl.TestFunction))
    power = 2 * moduli.mu * ufl.inner(strain, virtual) + lam * ufl.tr(strain) * ufl.tr(virtual)
    depth = DEPTH if body.model.dim == 2 else 1.0
    matrix = fem.petsc.assemble_matrix(compile_form(power * depth * ufl.dx))
    matrix.assemble()
    return matrix[:, :]


@pytest.mark.parametrize("order", [1, 2])
@each_case
def test_stiffness_of_the_undeformed_body_is_that_of_linear_elasticity(model, law, order):
    body = single_link(
        *distorted(model.dim), model=model, law=law, order=order, young=YOUNG, poisson=POISSON, depth=DEPTH
    )
    expected = linear_stiffness(body)
    assert stiffness_matrix(body) == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())
