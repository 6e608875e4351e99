"""Energy, forces, stiffness and stress do not depend on how many ranks share the mesh."""

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import original_cells, owned_values
from fenicsmech.elasticity import PLANE_STRESS, SPATIAL

from ..plot.grids import box, rectangle
from .cases import name
from .single_link import interpolate, single_link, wave

pytestmark = pytest.mark.parallel


@pytest.fixture(params=[SPATIAL, PLANE_STRESS], ids=name)
def bodies(request):
    """The same deformed body on one rank and on all of them."""
    model = request.param
    points, cells = rectangle(6, 3, 2.0, 1.0) if model.dim == 2 else box(4, 2, 2, (2.0, 1.0, 1.0))
    both = [single_link(points, cells, model=model, comm=comm) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)]
    for body in both:
        interpolate(body.shape, wave(model.dim, 0.1, seed=1))
        interpolate(body.u, wave(model.dim, 0.2, seed=2))
    return both


def test_energy(bodies):
    alone, shared = (body.energy() for body in bodies)
    assert shared == pytest.approx(alone, rel=1e-13)
    assert set(MPI.COMM_WORLD.allgather(shared)) == {shared}


def test_residual_and_tangent(bodies):
    seen = []
    for body in bodies:
        probe, other = (fem.Function(body.u.function_space) for _ in range(2))
        interpolate(probe, wave(body.model.dim, 1.0, seed=5))
        interpolate(other, wave(body.model.dim, 1.0, seed=6))
        force = body.residuals()
        matrix = fem.petsc.create_matrix(body.stiffness_forms[0][0])
        body.add_stiffness(matrix)
        matrix.assemble()
        right, image = matrix.createVecs()
        right.array_w[:] = owned_values(probe)
        matrix.mult(right, image)
        pairs = [
            (force, force),
            (force, right.array_r),
            (image.array_r, owned_values(other)),
            (image.array_r, image.array_r),
        ]
        seen.append([body.mesh.comm.allreduce(float(a @ b)) for a, b in pairs])
    assert seen[1] == pytest.approx(seen[0], rel=1e-11)


def test_ghosts_are_updated_from_their_owners(bodies):
    _, body = bodies
    expected = body.u.x.array.copy()
    owned = body.u.function_space.dofmap.index_map.size_local * body.model.dim
    body.u.x.array[owned:] = np.nan
    body.update()
    assert body.u.x.array == pytest.approx(expected, abs=1e-14)


def test_stress(bodies):
    alone, shared = bodies
    stress = alone.stress_samples()[0]
    expected = np.zeros_like(stress)
    expected[original_cells(alone.mesh)] = stress
    scale = np.abs(expected).max()
    found = shared.stress_samples()[0]
    assert found == pytest.approx(expected[original_cells(shared.mesh)], rel=1e-12, abs=1e-12 * scale)
