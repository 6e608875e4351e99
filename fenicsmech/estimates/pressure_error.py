"""How far pressures of their own are from those of infinitely fine elements.

The gradient of p, recovered by averaging as a continuous linear field G (``recovery``) and integrated along the edges
of each cell from its vertices, where p is best, gives a quadratic p*. With w = p − ½ G · X and I w its interpolation at
the vertices,

    e_p ≈ p* − p = I w − w,

where p is linear ½ Σ λ_i λ_j (G_i − G_j) · (X_j − X_i) over the edges of a cell.
"""

from __future__ import annotations

import ufl
from dolfinx import fem

from fenicsmech.compat import compile_expression, compile_form, interpolation_points, scalar_space, vector_space
from fenicsmech.elasticity import ElasticBody
from fenicsmech.estimates.recovery import Recovery


class PressureError:
    """e_p of one field of pressures.

    Args:
        elastic: the links.
        field: their pressure, or its adjoint.
        recovery: of degree 1.

    Attributes:
        error: e_p, symbolic, of the values of the field at the last ``update``.
    """

    def __init__(self, elastic: ElasticBody, field: fem.Function, recovery: Recovery) -> None:
        self._recovery, self._dim = recovery, elastic.model.dim
        self._gradient = fem.Function(vector_space(elastic.mesh, 1), name=f"recovered_gradient_of_{field.name}")
        self._sums = fem.Function(self._gradient.function_space)
        test = ufl.TestFunction(self._gradient.function_space)
        self._right = compile_form(ufl.inner(ufl.grad(field), test) * elastic.free(2))
        w = field - 0.5 * ufl.dot(self._gradient, ufl.SpatialCoordinate(elastic.mesh))
        V = scalar_space(elastic.mesh, 1)
        self._interpolated = fem.Function(V, name=f"interpolated_{field.name}")
        self._expression = compile_expression(w, interpolation_points(V), elastic.mesh.comm)
        self.error = self._interpolated - w

    def update(self) -> None:
        """Follows the field (collective)."""
        self._recovery.project(self._right, self._gradient, self._sums, [k == 2 for k in range(self._dim)])
        self._interpolated.interpolate(self._expression)
        self._interpolated.x.scatter_forward()
