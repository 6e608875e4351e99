"""Bounded biharmonic weights: bounds, partition of unity, interfaces, optimality, depth and units."""

from functools import cache, partial

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags

from fenicsmech.design import BETWEEN, lumped_mass, shape_link, solve_partition, stiffness

from .shapes import request, strip_mesh

KINDS = {"plane": (2, (0, 0, 1)), "extruded": (3, (0, 0, 1)), "solid": (3, (0.0, 0.02, 1.0))}
each_link = pytest.mark.parametrize(("kind", "link"), [(kind, link) for kind in KINDS for link in (0, 1)])


@cache
def shaped(kind: str, link: int):
    """A link's mesh, handles and weights."""
    dim, axis = KINDS[kind]
    mesh = strip_mesh(link, dim, axis=axis)
    shape = shape_link(mesh, request(link))
    return mesh, shape.handles, shape.own.weights


@each_link
def test_weights_lie_between_zero_and_one_and_add_up_to_one(kind, link):
    mesh, handles, weights = shaped(kind, link)
    assert weights.shape == (len(mesh.points), len(handles))
    assert weights.min() >= 0.0
    assert weights.max() <= 1.0 + 1e-12
    assert weights.sum(axis=1) == pytest.approx(1.0, abs=1e-12)


@each_link
def test_an_interface_belongs_to_its_joint_alone(kind, link):
    mesh, handles, weights = shaped(kind, link)
    for handle, site in enumerate(handles.site):
        if site != BETWEEN:
            held = weights[np.unique(mesh.cells_of(site))]
            assert np.array_equal(held, np.tile(np.arange(len(handles)) == handle, (len(held), 1)))


@each_link
def test_every_handle_has_its_largest_weight_close_to_it(kind, link):
    mesh, handles, weights = shaped(kind, link)
    spacing = np.linalg.norm(np.diff(handles.centre, axis=0), axis=1).min()
    for handle in np.flatnonzero(handles.slides):
        most = mesh.points[np.argmax(weights[:, handle]), :2]
        assert np.linalg.norm(most - handles.centre[handle]) < spacing


def test_weights_of_an_extruded_link_do_not_change_through_its_depth_and_are_those_of_the_planar_link():
    mesh, _, weights = shaped("extruded", 1)
    assert np.abs(weights.T @ stiffness(mesh, axis=2) @ weights).max() < 1e-13
    flat_mesh, _, flat = shaped("plane", 1)
    for point, weight in zip(mesh.points, weights, strict=True):
        below = np.argmin(np.linalg.norm(flat_mesh.points - point[:2], axis=1))
        assert weight == pytest.approx(flat[below], abs=1e-9)


def test_weights_of_a_solid_change_little_through_its_depth():
    mesh, _, weights = shaped("solid", 0)
    through, all_ways = (np.trace(weights.T @ stiffness(mesh, axis=axis) @ weights) for axis in (2, None))
    assert through < 0.1 * all_ways


def test_weights_do_not_depend_on_the_unit_of_length():
    _, _, weights = shaped("plane", 1)
    metres = shape_link(strip_mesh(1, 2, unit=1000.0), request(1, unit=1000.0)).own.weights
    assert metres == pytest.approx(weights, abs=1e-8)


def program(n: int = 30, k: int = 4):
    """A biharmonic energy on a strip's free vertices and random linear terms, (n, n) and (n, k)."""
    mesh = strip_mesh(0, 2)
    L = stiffness(mesh)
    Q = csr_matrix(L @ diags(1.0 / lumped_mass(mesh)) @ L)[:n, :n]
    return Q, np.abs(Q).max() * 0.1 * np.random.default_rng(4).standard_normal((n, k))


def dense_program(seed: int, n: int = 15, k: int = 3):
    """A random energy; from seeds 23 and 55, one on which exchanges of all violations at once go round in circles."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((n, n))
    return csr_matrix(root @ root.T + 1e-6 * np.eye(n)), 0.03 * n * rng.standard_normal((n, k))


@pytest.mark.parametrize("problem", [program, *(partial(dense_program, seed) for seed in (0, 23, 55))])
def test_partition_satisfies_the_optimality_conditions(problem):
    Q, c = problem()
    w = solve_partition(Q, c, part="test")
    assert w.min() >= 0.0
    assert w.sum(axis=1) == pytest.approx(1.0, abs=1e-8)
    slope = Q @ w + c
    # at each vertex the slopes of positive weights agree, and those of zero weights are not lower
    lowest = slope.min(axis=1, keepdims=True)
    assert np.abs((slope - lowest)[w > 1e-7]).max() < 1e-9 * np.abs(Q).max()
    assert np.any(w == 0.0)


def test_partition_does_not_depend_on_the_scale_of_the_energy():
    Q, c = program()
    assert solve_partition(1e6 * Q, 1e6 * c, part="test") == pytest.approx(solve_partition(Q, c, part="test"), abs=1e-9)
