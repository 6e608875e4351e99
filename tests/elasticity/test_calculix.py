"""Displacements against CalculiX on the same quadratic mesh, under prescribed displacements and nodal forces."""

import numpy as np
import pytest

from fenicsmech.elasticity import SPATIAL, Quadrature
from fenicsmech.laws import IsochoricNeoHookean

from ..oracles import calculix
from ..plot.grids import box
from .dirichlet_newton import solve
from .end_load import end_load
from .single_link import nodes, single_link

pytestmark = [
    pytest.mark.calculix,
    pytest.mark.skipif(not calculix.available(), reason="ccx not found: apt install calculix-ccx"),
]

YOUNG, POISSON = 1770.0, 0.42
SIZE = (20.0, 2.0, 3.0)
CALCULIX = Quadrature(2)  # the four points of C3D10


def strip(quadrature):
    return single_link(
        *box(10, 2, 2, SIZE),
        model=SPATIAL,
        law=IsochoricNeoHookean,
        young=YOUNG,
        poisson=POISSON,
        quadrature=quadrature,
    )


def same_mesh(body):
    """The body's mesh with its nodes of u in CalculiX's order."""
    space = body.u.function_space
    count = body.mesh.topology.index_map(3).size_local
    cells = np.array([space.dofmap.cell_dofs(cell) for cell in range(count)])
    return calculix.Mesh(nodes(body.u), cells[:, list(calculix.VTK_FROM_BASIX)], np.ones(count, dtype=int))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("quadrature", "tolerance"), [(CALCULIX, 1e-6), (Quadrature.for_order(2, 3), 1e-3)], ids=["as CalculiX", "default"]
)
def test_bent_twisted_and_stretched_strip(quadrature, tolerance):
    body = strip(quadrature)
    X = nodes(body.u)
    clamped = np.flatnonzero(X[:, 0] < 1e-9)
    # the far end's upper edge is lifted and pushed aside, the rest of it pulled down and sideways
    edge = np.flatnonzero((X[:, 0] > SIZE[0] - 1e-9) & (X[:, 1] > SIZE[1] - 1e-9))
    moved = np.array([-1.0, 4.0, 2.0])
    force = end_load(body, length=SIZE[0], traction=(20.0, -10.0))

    fixed = np.concatenate([clamped, edge])
    values = np.zeros((len(fixed), 3))
    values[len(clamped) :] = moved
    solve(body, (3 * fixed[:, None] + np.arange(3)).ravel(), values.ravel(), force, steps=4)
    computed = body.u.x.array.reshape(-1, 3)

    loaded = {int(node): tuple(f) for node, f in enumerate(force.reshape(-1, 3)) if f.any()}
    reference = calculix.solve(
        same_mesh(body),
        {1: calculix.NeoHooke(YOUNG, POISSON)},
        [calculix.Fixed(clamped, np.zeros(3)), calculix.Fixed(edge, moved)],
        loaded,
        steps=4,
    )
    error = np.linalg.norm(computed - reference.displacement) / np.linalg.norm(reference.displacement)
    assert error < tolerance
