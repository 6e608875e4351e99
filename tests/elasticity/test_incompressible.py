"""Incompressible deformations known in closed form: blocks stretched evenly, and a piece of a tube blown up."""

import numpy as np
import pytest
import ufl
from dolfinx import fem

from fenicsmech.compat import compile_form
from fenicsmech.elasticity import PLANE_STRAIN, SPATIAL
from fenicsmech.laws import NeoHookean

from ..plot.grids import rectangle
from .even_stretch import free_stretch, stretch
from .mixed_newton import solve
from .single_link import components, distorted, interpolate, nodes, single_link

YOUNG, POISSON = 1.9, 0.49999
MU = YOUNG / (2.0 * (1.0 + POISSON))


@pytest.mark.parametrize("ratio", [0.5, 1.5, 2.0])
@pytest.mark.parametrize(("model", "pulled"), [(PLANE_STRAIN, 1), (SPATIAL, 1), (SPATIAL, 2)])
def test_evenly_stretched_block_is_exact_on_a_distorted_mesh(model, pulled, ratio):
    dim = model.dim
    body = single_link(*distorted(dim), model=model, law=NeoHookean, young=YOUNG, poisson=POISSON, mixed=True)
    stretch(body, ratio, pulled=pulled)
    free, pressure = free_stretch((ratio,) * pulled, dim - pulled, young=YOUNG, poisson=POISSON)
    exact = np.array([ratio - 1.0] * pulled + [free - 1.0] * (dim - pulled))
    assert body.u.x.array.reshape(-1, dim) == pytest.approx(nodes(body.u) * exact, abs=1e-9)
    # rounding of J counts 1/(1 − 2ν) times
    assert body.pressure.p.x.array == pytest.approx(pressure, abs=1e-7)


# A square cut out of the wall of a tube that is blown up: r² = R² + C, so that J = 1.
BLOWN = 1.5
EXACT = {"quadrature_degree": 10}


def tube(x) -> tuple:
    """Displacement and pressure at x in UFL.

    dσ_r/dr = (σ_θ − σ_r)/r with σ_r = μ (R²/r² − 1) − p, σ_θ = μ (r²/R² − 1) − p gives

        p = μ (R²/r² − 1) − μ/2 (ln(R²/r²) − C/r²)     up to a constant that is zero here.
    """
    square = x[0] ** 2 + x[1] ** 2
    ratio = square / (square + BLOWN)
    pressure = MU * (ratio - 1) - MU / 2 * (ufl.ln(ratio) - BLOWN / (square + BLOWN))
    return (ratio**-0.5 - 1) * x, pressure


def tube_errors(order: int, count: int) -> tuple[float, float]:
    """L² errors of displacement and pressure with ``count`` squares along each side, a traction on one side."""
    points, cells = rectangle(count, count, 1.0, 1.0)
    poisson = 0.5 - 1e-8
    body = single_link(
        points + (1.0, 0.3),
        cells,
        model=PLANE_STRAIN,
        law=NeoHookean,
        order=order,
        young=2.0 * (1.0 + poisson) * MU,
        poisson=poisson,
        mixed=True,
    )
    u, p = tube(ufl.SpatialCoordinate(body.mesh))
    F = ufl.Identity(2) + ufl.grad(u)
    piola = MU * F - (MU + p) * ufl.inv(F).T
    on_side = ufl.gt(ufl.SpatialCoordinate(body.mesh)[0], 2.0 - 1e-9)
    work = ufl.dot(piola * ufl.FacetNormal(body.mesh), ufl.TestFunction(body.u.function_space))
    ds, dx = (ufl.Measure(kind, domain=body.mesh, metadata=EXACT) for kind in ("ds", "dx"))
    force = fem.assemble_vector(compile_form(ufl.conditional(on_side, work, ufl.zero()) * ds)).array

    def blown(X):
        return (np.sqrt(1.0 + BLOWN / np.sum(X**2, axis=1, keepdims=True)) - 1.0) * X

    fixed = components(body, lambda X: (X[:, 0] < 1.0 + 1e-9) | (np.abs(X[:, 1] - 0.8) > 0.5 - 1e-9))
    interpolate(body.u, blown)
    solve(body, fixed, body.u.x.array[fixed], force)
    missed = (body.u - u, body.pressure.p - p)
    return tuple(float(np.sqrt(fem.assemble_scalar(compile_form(ufl.inner(e, e) * dx)))) for e in missed)


@pytest.mark.parametrize("order", [2, 3])
def test_displacement_and_pressure_of_a_tube_converge_with_the_orders_of_their_elements(order):
    coarse, fine = (np.array(tube_errors(order, count)) for count in (4, 8))
    rates = np.log2(coarse / fine)
    assert rates[0] > order + 1 - 0.2
    assert rates[1] > order - 0.2  # no oscillations
