"""From parameters to the design field and back: identity, rigid interfaces, derivatives, transposes, ranks."""

from dataclasses import replace

import numpy as np
import pytest

from fenicsmech.design import BETWEEN, shape_links
from fenicsmech.meshing import FREE

from ..oracles.dense import taylor_rates
from .refusal import refused
from .shapes import bench, request

each_dim = pytest.mark.parametrize("dim", [2, 3])


def field_like(both, seed: int, rows: tuple[int, ...] = ()) -> np.ndarray:
    """A random field that does not depend on the number of ranks, (*rows, nodes, dim)."""
    whole = np.random.default_rng(seed).standard_normal((*rows, *both.mesh.vertices.shape))
    return whole[..., both.shape.original, :]


@each_dim
def test_initial_parameters_leave_the_mesh_alone(dim):
    shape = bench(dim).shape
    assert shape.field(shape.initial, shape.initial_theta) == pytest.approx(0.0, abs=1e-12)


@each_dim
@pytest.mark.parametrize("seed", range(3))
def test_interfaces_move_rigidly(dim, seed):
    both = bench(dim)
    theta = both.positions() + np.random.default_rng(seed).uniform(-0.3, 0.3, len(both.shape.initial_theta))
    d = both.shape.field(both.design(0.3, seed), theta)
    moved = np.empty_like(both.mesh.vertices)
    moved[both.shape.original] = both.mesh.vertices[both.shape.original] + d
    for shape in both.shape.shapes:
        for site in shape.handles.site[shape.handles.site != BETWEEN]:
            held = held_vertices(both, shape.own.link, site)
            before, after = both.mesh.vertices[held], moved[held]
            distances = [np.linalg.norm(x[:, None] - x[None], axis=2) for x in (before, after)]
            assert np.abs(before - after).max() > 1e-3
            assert distances[1] == pytest.approx(distances[0], abs=1e-10)


def held_vertices(both, link: int, site: int) -> np.ndarray:
    """Vertices of one interface; on one rank."""
    first = both.mesh.interface[(both.mesh.link == link) & (both.mesh.interface != FREE)].min()
    cells = np.asarray(both.mesh.mesh.topology.original_cell_index)[both.mesh.interface == first + site]
    return np.unique(both.mesh.cells[cells])


def test_nothing_moves_out_of_the_plane():
    both = bench(3)
    assert not np.any(both.shape.field(both.design(), both.positions())[:, 2])


def test_plane_and_space_have_the_same_shape():
    flat, deep = (bench(dim) for dim in (2, 3))
    fields = []
    for both in (flat, deep):
        whole = np.empty((len(both.mesh.vertices), 2))
        whole[both.shape.original] = both.shape.field(flat.design(), flat.positions())[:, :2]
        fields.append(whole)
    for point, change in zip(deep.mesh.vertices, fields[1], strict=True):
        below = np.argmin(np.linalg.norm(flat.mesh.vertices - point[:2], axis=1))
        assert change == pytest.approx(fields[0][below], abs=1e-9)


@pytest.mark.parallel
def derivative(shape, p, theta, dp, dtheta) -> np.ndarray:
    """∂d/∂p dp + ∂d/∂θ dθ, (nodes, dim)."""
    changes = []
    for link, *point, dp_link, dtheta_link in zip(
        shape.shapes,
        shape.parameters(p),
        shape.positions(theta),
        shape.parameters(dp),
        shape.positions(dtheta),
        strict=True,
    ):
        by_p, by_theta = link.handles.gradients(*point)
        changes.append(by_p @ dp_link + by_theta * dtheta_link[:, None, None])
    return shape.spread(changes)


@each_dim
@pytest.mark.parametrize("shared", [False, True], ids=["alone", "together"])
def test_tangent_and_its_transpose_pass_the_taylor_test_away_from_the_initial_design(dim, shared):
    both = bench(dim, shared=shared)
    shape, comm = both.shape, both.mesh.mesh.comm
    p, theta = both.design(0.2), both.positions()
    dp, dtheta = both.direction(7), np.random.default_rng(8).uniform(-0.2, 0.2, len(both.positions()))
    g, steps = field_like(both, 3)[: shape.owned], [0.02, 0.01, 0.005, 0.0025]

    def moved(h):
        return shape.field(p + h[0] * dp, theta + h[0] * dtheta)

    pushed = derivative(shape, p, theta, dp, dtheta).ravel()
    rates = taylor_rates(lambda h: moved(h).ravel(), [0.0], [1.0], pushed[:, None], steps)
    by_p, by_theta = shape.apply_transpose(p, theta, g)
    pulled = taylor_rates(
        lambda h: comm.allreduce(np.sum(moved(h)[: shape.owned] * g)),
        [0.0],
        [1.0],
        [by_p @ dp + by_theta @ dtheta],
        steps,
    )
    for each in (rates, pulled):
        assert each.with_gradient.min() >= 1.95
        assert each.without.min() >= 0.95


@each_dim
@pytest.mark.parametrize("shared", [False, pytest.param(True, marks=pytest.mark.parallel)])
def test_the_transpose_is_that_of_the_derivative(dim, shared):
    both = bench(dim, shared=shared)
    p, theta, shape = both.design(), both.positions(), both.shape
    g = field_like(both, 3)[: shape.owned]
    dp, dtheta = both.direction(4), np.random.default_rng(5).standard_normal(len(theta))
    pushed = derivative(shape, p, theta, dp, dtheta)[: shape.owned]
    by_p, by_theta = shape.apply_transpose(p, theta, g)
    assert by_p @ dp + by_theta @ dtheta == pytest.approx(both.mesh.mesh.comm.allreduce(np.sum(pushed * g)), rel=1e-12)


def test_the_transpose_takes_several_fields_at_once():
    both = bench(2)
    p, theta, g = both.design(), both.positions(), field_like(both, 3, (2, 3))
    by_p, by_theta = both.shape.apply_transpose(p, theta, g)
    for index in np.ndindex(2, 3):
        one_p, one_theta = both.shape.apply_transpose(p, theta, g[index])
        assert by_p[index] == pytest.approx(one_p, abs=1e-11)
        assert by_theta[index] == pytest.approx(one_theta, abs=1e-11)


@pytest.mark.parallel
@each_dim
def test_field_does_not_depend_on_the_number_of_ranks(dim):
    alone, shared = (bench(dim, shared=several) for several in (False, True))
    whole = np.empty_like(alone.mesh.vertices)
    whole[alone.shape.original] = alone.shape.field(alone.design(), alone.positions())
    shared.shape.apply(shared.design(), shared.positions())
    values = shared.shape.design.x.array.reshape(-1, dim)
    assert values == pytest.approx(whole[shared.shape.original], abs=1e-12)
    pulled = [
        both.shape.apply_transpose(both.design(), both.positions(), field_like(both, 1)[: both.shape.owned])
        for both in (alone, shared)
    ]
    for one, other in zip(*pulled, strict=True):
        assert other == pytest.approx(one, rel=1e-10, abs=1e-10)


@pytest.mark.parallel
@pytest.mark.parametrize("link", [0, 1])
def test_a_link_without_a_shape_is_refused_on_all_ranks(link):
    requests = [request(k) for k in range(2)]
    requests[link] = replace(requests[link], segments=0)
    mesh = bench(2, shared=True).mesh
    refused(lambda: shape_links(mesh, requests), part=repr(str(link)), problem="0 segments", remedy="Give at least")
