"""A slender strip, clamped at one end and bent to the side at the other by a dead force (mm, N, MPa)."""

import numpy as np

from fenicsmech.elasticity import ElasticModel, Quadrature
from fenicsmech.laws import Law, NeoHookean

from ..plot.grids import box, rectangle
from .dirichlet_newton import solve
from .end_load import end_load
from .single_link import components, nodes, single_link

LENGTH, THICKNESS, DEPTH = 20.0, 1.0, 2.0
TRACTION = 0.5


def sideways_displacement(
    model: ElasticModel,
    *,
    along: int,
    across: int,
    order: int,
    quadrature: Quadrature | None = None,
    law: type[Law] | None = None,
) -> float:
    """u_y of the lower corner of the free end, with ``along`` × ``across`` squares cut in two, or cubes cut in six."""
    if model.dim == 2:
        points, cells = rectangle(along, across, LENGTH, THICKNESS)
    else:
        points, cells = box(along, across, 2 * across, (LENGTH, THICKNESS, DEPTH))
    body = single_link(
        points,
        cells,
        model=model,
        law=law or NeoHookean,
        order=order,
        young=1770.0,
        poisson=0.42,
        quadrature=quadrature,
    )
    clamped = components(body, lambda X: X[:, 0] < 1e-9)
    load = end_load(body, length=LENGTH, traction=(0.0, TRACTION))
    solve(body, clamped, np.zeros(len(clamped)), load, steps=6)
    corner = [LENGTH, 0.0, 0.0][: model.dim]
    node = np.argmin(np.linalg.norm(nodes(body.u) - corner, axis=1))
    return float(body.u.x.array.reshape(-1, model.dim)[node, 1])
