"""Dead loads on the end of a body, as nodal forces."""

from collections.abc import Sequence

import numpy as np
import ufl
from dolfinx import fem

from fenicsmech.compat import compile_form
from fenicsmech.elasticity import ElasticBody


def end_load(body: ElasticBody, *, length: float, traction: Sequence[float]) -> np.ndarray:
    """Forces on all components of u, (n,), of an in-plane ``traction`` (2,) on the end of the body at x = ``length``.

    Per unit of depth in two dimensions.
    """
    on_end = ufl.gt(ufl.SpatialCoordinate(body.mesh)[0], length * (1.0 - 1e-9))
    virtual = ufl.TestFunction(body.u.function_space)
    work = traction[0] * virtual[0] + traction[1] * virtual[1]
    ds = ufl.Measure("ds", domain=body.mesh, metadata={"quadrature_degree": body.order})
    return fem.assemble_vector(compile_form(ufl.conditional(on_end, work, 0.0) * ds)).array
