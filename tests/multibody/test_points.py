"""Material points move with their body, or with the displacement field of their link."""

import numpy as np
import pytest
from mpi4py import MPI

from fenicsmech.errors import DescriptionError
from fenicsmech.multibody import BodyPoint, link_point

from ..joints.poses import PLANAR, SPATIAL
from ..oracles.dense import jacobian
from .shared_mesh import shared_mesh

FIELDS = [(dim, order) for dim in (2, 3) for order in (1, 2, 3)]


def owned_cells(mesh):
    index = mesh.u.function_space.mesh.topology.index_map(mesh.dim)
    return np.arange(index.size_local)


def find(mesh, position, cells=None):
    cells = owned_cells(mesh) if cells is None else cells
    straight = np.zeros((len(cells), mesh.dim * (mesh.dim + 1) // 2, mesh.dim))
    return link_point("link 'strip'", np.asarray(position), mesh.u, cells, mesh.corners[mesh.here[cells]], straight)


def polynomial(order, dim):
    """A vector field of exactly the given degree."""
    coefficients = np.random.default_rng(8).uniform(-1.0, 1.0, (dim, order + 1, dim))
    return lambda x: np.stack(
        [sum((x @ coefficients[k, p]) ** p for p in range(order + 1)) for k in range(dim)], axis=-1
    )


def places(mesh):
    """Points inside cells, at vertices, and on every kind of edge and face of some cells."""
    random = np.random.default_rng(9)
    for corners in mesh.corners[:: len(mesh.corners) // 6]:
        yield random.dirichlet(np.ones(mesh.dim + 1)) @ corners
        for corner_count in range(1, mesh.dim + 1):
            yield random.dirichlet(np.ones(corner_count)) @ corners[random.permutation(mesh.dim + 1)[:corner_count]]


@pytest.fixture(scope="module", params=FIELDS, ids=lambda p: f"{p[0]}d-P{p[1]}")
def field(request):
    """A mesh whose displacement is a polynomial of the field's own order, and the polynomial."""
    dim, order = request.param
    mesh = shared_mesh(dim, order=order)
    exact = polynomial(order, dim)
    mesh.values[:] = exact(mesh.nodes)
    return mesh, exact


@pytest.mark.parallel
def test_displacements_inside_and_on_vertices_edges_and_faces_are_those_of_the_field(field):
    mesh, exact = field
    for place in places(mesh):
        displacement = find(mesh, place).displacement(mesh.u, None)
        assert displacement == pytest.approx(exact(place), abs=1e-12)
        assert all(np.array_equal(displacement, other) for other in MPI.COMM_WORLD.allgather(displacement))


@pytest.mark.parallel
def test_weights_belong_to_the_global_nodes_on_every_rank(field):
    # Σ N_i = 1 and Σ N_i X_i = P, with the X_i collected from the ranks that own them
    mesh, _ = field
    index = mesh.u.function_space.dofmap.index_map
    positions = np.concatenate(MPI.COMM_WORLD.allgather(mesh.nodes[: index.size_local]))
    for place in places(mesh):
        point = find(mesh, place)
        assert point.weights.sum() == pytest.approx(1.0, abs=1e-12)
        assert point.weights @ positions[point.global_nodes] == pytest.approx(place, abs=1e-12)


@pytest.mark.parallel
def test_a_point_just_outside_belongs_to_the_nearest_cell(field):
    mesh, exact = field
    place = np.array([0.0, 0.7, 0.4])[: mesh.dim] - 1e-3 * np.eye(mesh.dim)[0]
    assert find(mesh, place).displacement(mesh.u, None) == pytest.approx(exact(place), abs=1e-11)


@pytest.mark.parallel
def test_a_point_outside_is_refused_on_all_ranks(field):
    mesh, _ = field
    place = np.array([-0.1, 0.7, 0.4])[: mesh.dim]
    with pytest.raises(DescriptionError, match=r"link 'strip'.*\(-0\.1, 0\.7.*not on the link.*Move it"):
        find(mesh, place)


@pytest.mark.parallel
def test_a_point_on_another_link_is_refused(field):
    mesh, _ = field
    left = np.array([c for c in owned_cells(mesh) if mesh.corners[mesh.here[c]][:, 0].max() < 1.8], dtype=int)
    place = np.array([2.5, 0.7, 0.4])[: mesh.dim]
    with pytest.raises(DescriptionError, match="not on the link"):
        find(mesh, place, left)


@pytest.mark.parametrize("space", [PLANAR, SPATIAL])
def test_a_point_on_a_body_moves_rigidly_with_exact_derivatives(space):
    random = np.random.default_rng(10)
    centre, position, force = random.normal(size=(3, space.dim))
    poses = space.retract(random.normal(size=(3, space.pose_size)))
    point = BodyPoint(1, position - centre, space)

    def displacement(pose):
        return point.displacement(None, np.array([poses[0], pose, poses[2]]))

    def slope(pose):
        return force @ point.gradient(np.array([poses[0], pose, poses[2]]))

    turned = space.rotate(poses[1], position - centre)
    assert displacement(poses[1]) == pytest.approx(centre + turned + poses[1, : space.dim] - position, abs=1e-14)
    assert point.gradient(poses) == pytest.approx(jacobian(displacement, poses[1]), abs=1e-9)
    assert point.hessian(poses, force) == pytest.approx(jacobian(slope, poses[1]), abs=1e-9)
