"""Patch test: homogeneous strain is in equilibrium on any mesh; Newton's method finds equilibria quadratically."""

import numpy as np
import pytest

from .cases import each_case
from .dirichlet_newton import solve
from .single_link import components, distorted, forces, interpolate, single_link, wave

GRADIENT = np.array([[0.2, 0.3, -0.1], [-0.2, -0.1, 0.2], [0.1, 0.2, 0.15]])


def stretched(X):
    dim = X.shape[1]
    return X @ GRADIENT[:dim, :dim].T + 0.1


def on_side(X):
    return np.any((X < 1e-9) | (X > 1.0 - 1e-9), axis=1)


@pytest.mark.parametrize("order", [1, 2])
@each_case
def test_homogeneous_strain_takes_no_force_inside(model, law, order):
    body = single_link(*distorted(model.dim), model=model, law=law, order=order)
    interpolate(body.u, stretched)
    inside = components(body, lambda X: ~on_side(X))
    force = forces(body)
    assert len(inside) > 0
    assert np.abs(force[inside]).max() < 1e-12 * np.abs(force).max()


@pytest.mark.thorough
@pytest.mark.parametrize("order", [1, 2])
@each_case
def test_homogeneous_strain_is_found_from_its_boundary_values(model, law, order):
    body = single_link(*distorted(model.dim), model=model, law=law, order=order)
    interpolate(body.u, stretched)
    expected = body.u.x.array.copy()
    body.u.x.array[:] = 0.0
    fixed = components(body, on_side)
    solve(body, fixed, expected[fixed], steps=2)
    assert body.u.x.array == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())


@each_case
def test_newtons_method_converges_quadratically(model, law):
    body = single_link(*distorted(model.dim), model=model, law=law)
    interpolate(body.u, wave(model.dim, 0.2, seed=2))
    fixed = components(body, on_side)
    norms = np.array(solve(body, fixed, body.u.x.array[fixed]))
    before, after = norms[1:-1], norms[2:]
    assert len(norms) <= 6
    assert np.all(after <= np.maximum(before**2, 1e-13))
