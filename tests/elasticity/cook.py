"""Cook's membrane: a tapered panel, 1 mm thick, clamped on the left, sheared by 1 N on the right (mm, N, MPa).

References: "Quasi-Static Finite-Strain Compressible Elasticity" of the deal.II code gallery, Q2 on up to 64 × 64 × 1
hexahedra. Its table of 2021, for which the panel was held between two walls (plane strain), converges to 14.74 mm of
upward displacement in the middle of the loaded edge. The table before that converges to 14.33 mm at the upper corner:
a slip in the selection of faces had left both faces of the panel free. In space, half of that panel is computed, from
its middle plane to one of its faces: the whole one could buckle.
"""

import numpy as np

from fenicsmech.elasticity import ElasticModel, Quadrature
from fenicsmech.laws import IsochoricSimoNeoHookean

from ..plot.grids import box, rectangle
from .dirichlet_newton import solve
from .end_load import end_load
from .single_link import components, nodes, single_link

BETWEEN_WALLS, FREE_FACES = 14.74, 14.33
MIDDLE, CORNER = (48.0, 52.0), (48.0, 60.0)

SHEAR_MODULUS, POISSON = 0.4225, 0.3
LENGTH, EDGE = 48.0, 16.0


def panel(count: int, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and cells: ``count`` squares, each cut in two, or cubes, in six, along each side."""
    square, cells = rectangle(count, count, 1.0, 1.0) if dim == 2 else box(count, count, 1, (1.0, 1.0, 0.5))
    x, y, *z = square.T
    return np.column_stack([LENGTH * x, 44.0 * x + y * (44.0 - 28.0 * x), *z]), cells


def upward_displacement(
    model: ElasticModel, at: tuple[float, float], *, count: int, order: int, quadrature: Quadrature | None = None
) -> float:
    """u_y at a vertex of the panel."""
    body = single_link(
        *panel(count, model.dim),
        model=model,
        law=IsochoricSimoNeoHookean,
        order=order,
        young=2.0 * SHEAR_MODULUS * (1.0 + POISSON),
        poisson=POISSON,
        quadrature=quadrature,
    )
    fixed = components(body, lambda X: X[:, 0] < 1e-9)
    if model.dim == 3:
        middle_plane = components(body, lambda X: X[:, 2] < 1e-9)
        fixed = np.union1d(fixed, middle_plane[2::3])
    solve(body, fixed, np.zeros(len(fixed)), end_load(body, length=LENGTH, traction=(0.0, 1.0 / EDGE)), steps=3)
    node = np.argmin(np.linalg.norm(nodes(body.u)[:, :2] - at, axis=1))
    return float(body.u.x.array.reshape(-1, model.dim)[node, 1])
