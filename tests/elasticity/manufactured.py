"""Equilibria with a known displacement: the forces that hold a large, smooth deformation are computed from it.

∫ P(∇u) : ∇v dX = ∫ P(∇u*) : ∇v dX    for all v that vanish on the boundary, where u = u*
"""

from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem

from fenicsmech.compat import compile_form
from fenicsmech.elasticity import ElasticModel, Quadrature
from fenicsmech.laws import NeoHookean

from ..plot.grids import box, rectangle
from .dirichlet_newton import solve
from .single_link import components, interpolate, single_link

EXACT = Quadrature(8)


def exact(x, sin):
    """u* at x, of strains up to about 0.3; with the sine of UFL or of NumPy."""
    return [0.1 * sin((k + 1.5) * x[(k + 1) % len(x)] + x[k] + 0.5 * k) for k in range(len(x))]


@dataclass(frozen=True)
class Errors:
    """‖u − u*‖ in L² and ‖∇(u − u*)‖ in L²."""

    L2: float
    H1: float


def errors(model: ElasticModel, *, order: int, count: int) -> Errors:
    """Errors on the unit square or cube, ``count`` squares cut in two or cubes cut in six along each side."""
    points, cells = rectangle(count, count, 1.0, 1.0) if model.dim == 2 else box(*[count] * 3, (1.0, 1.0, 1.0))
    body, accurate = (
        single_link(points, cells, model=model, law=NeoHookean, order=order, quadrature=quadrature)
        for quadrature in (None, EXACT)
    )
    x = ufl.SpatialCoordinate(accurate.mesh)
    solution = ufl.as_vector(exact([x[i] for i in range(model.dim)], ufl.sin))
    residual = ufl.derivative(accurate.energy_ufl, accurate.u)
    force = fem.assemble_vector(compile_form(ufl.replace(residual, {accurate.u: solution}))).array

    interpolate(body.u, lambda X: np.column_stack(exact(X.T, np.sin)))
    fixed = components(body, lambda X: np.any((X < 1e-9) | (X > 1.0 - 1e-9), axis=1))
    solve(body, fixed, body.u.x.array[fixed], force)

    accurate.u.x.array[:] = body.u.x.array
    difference = accurate.u - solution
    dx = ufl.Measure("dx", domain=accurate.mesh, metadata={"quadrature_degree": EXACT.degree})
    return Errors(*(_norm(field, dx) for field in (difference, ufl.grad(difference))))


def _norm(field, dx) -> float:
    return float(np.sqrt(fem.assemble_scalar(compile_form(ufl.inner(field, field) * dx))))
