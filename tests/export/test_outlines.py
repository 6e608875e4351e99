"""Smooth outlines: through every vertex, with corners where the shape has them, close to the shape in between."""

import math

import numpy as np
import pytest

from fenicsmech.export import corners_of, smooth_outline
from fenicsmech.meshing import CircleArc, boundary_loops, sampled, start_of
from fenicsmech.polygons import distance_to

from ..meshing.bent_links import CURVED, STRAIGHT, THICKNESS, bent, link


def outline(mesh):
    return mesh.points[boundary_loops("strip", mesh)[0]]


def hausdorff(one, other):
    """The largest distance of a vertex of one closed polygon from the other polygon, either way."""
    return max(max(distance_to(b, p) for p in a) for a, b in ((one, other), (other, one)))


def along(start, end, count):
    return np.linspace(start, end, count, endpoint=False)


def rounded(angles, radius=1.0, centre=(0.0, 0.0)):
    return centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])


SHAPES = {
    "curved": lambda size: link(size),
    "curved, an eye in the middle": lambda size: link(size, pins=(0, 1, 2)),
    "curved, round ends": lambda size: link(size, radius=0.5 * THICKNESS),
    "straight, wide eyes": lambda size: link(size, points=STRAIGHT, radius=THICKNESS, pins=(0, 1, 2)),
    "curved, eyes much wider than the strip": lambda size: link(size, radius=2.5 * THICKNESS, pins=(0, 1, 2)),
    "bent": lambda size: bent(link(size, points=STRAIGHT)),
    "bent, round ends": lambda size: bent(link(size, points=STRAIGHT, radius=0.5 * THICKNESS)),
}
CORNERS = {
    "curved, an eye in the middle": 8,
    "curved, round ends": 0,
    "straight, wide eyes": 8,
    "curved, eyes much wider than the strip": 8,
    "bent, round ends": 0,
}


@pytest.mark.thorough
@pytest.mark.parametrize("shape", SHAPES)
def test_the_outline_of_a_mesh_is_that_of_a_much_finer_mesh(shape):
    fine = outline(SHAPES[shape](0.2))
    for size in (1.73, 3.0):
        polygon = outline(SHAPES[shape](size))
        curves = smooth_outline(polygon)
        # the fine polygon's own chords: 0.2² / (8 · 1.5)
        assert hausdorff(sampled(curves, 1e-4), fine) < (0.004 if size < 2.0 else 0.01), size
        assert np.count_nonzero(corners_of(polygon)) == CORNERS.get(shape, 4), size


@pytest.mark.parametrize("shape", SHAPES)
def test_the_outline_runs_through_every_vertex(shape):
    polygon = outline(SHAPES[shape](1.73))
    fine = sampled(smooth_outline(polygon), 1e-7)
    assert max(distance_to(fine, vertex) for vertex in polygon) < 1e-6


@pytest.mark.parametrize("shape", SHAPES)
def test_nothing_overshoots_at_corners(shape):
    polygon = outline(SHAPES[shape](1.73))
    corners = polygon[corners_of(polygon)]
    edge = np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1).max()
    for point in sampled(smooth_outline(polygon), 1e-4):
        if len(corners) and np.linalg.norm(corners - point, axis=1).min() < edge:
            # the sagitta of an arc of the smallest radius over the longest edge
            assert distance_to(polygon, point) < 1.1 * edge**2 / (8.0 * 2.5)


def test_curves_follow_each_other_and_none_is_closed():
    for shape in SHAPES.values():
        curves = smooth_outline(outline(shape(2.0)))
        ends = [c.at([1.0])[0] if isinstance(c, CircleArc) else c.c[-1] for c in curves]
        starts = [start_of(c) for c in curves]
        assert np.roll(ends, 1, axis=0) == pytest.approx(np.array(starts), abs=1e-9)
        assert all(math.dist(*pair) > 1e-3 for pair in zip(starts, ends, strict=True))


def test_eyes_are_exact_circles_and_straight_sides_exact_lines():
    curves = smooth_outline(outline(link(1.73, points=STRAIGHT)))
    eyes = [curve for curve in curves if isinstance(curve, CircleArc)]
    assert len(curves) == 4 and len(eyes) == 2
    assert sorted(round(eye.centre[0], 6) for eye in eyes) == [0.0, 40.0]
    assert [eye.radius for eye in eyes] == pytest.approx([2.5] * 2, rel=1e-10)
    assert [len(curve.c) for curve in curves if not isinstance(curve, CircleArc)] == [2, 2]


@pytest.mark.parametrize("count", [8, 9, 40])
@pytest.mark.parametrize("direction", [1, -1])
def test_a_regular_polygon_is_a_circle(count, direction):
    polygon = rounded(direction * along(0.0, 2.0 * math.pi, count), 1.5, (3.0, 4.0))
    curves = smooth_outline(polygon)
    assert np.linalg.norm(sampled(curves, 1e-3) - (3.0, 4.0), axis=1) == pytest.approx(1.5, rel=1e-12)
    assert sum(curve.sweep for curve in curves) == pytest.approx(direction * 2.0 * math.pi)


def test_a_smooth_closed_curve_has_no_corner_nor_kink():
    angles = along(0.0, 2.0 * math.pi, 32)
    curves = smooth_outline(rounded(angles) * (3.0, 2.0))
    fine = sampled(curves, 1e-5)
    assert np.hypot(*(fine / (3.0, 2.0)).T) == pytest.approx(1.0, abs=1e-3)
    for one, other in zip(curves, [curves[1], curves[0]], strict=True):
        for order in (1, 2):
            assert one(one.t[-1], order) == pytest.approx(other(other.t[0], order), abs=1e-9)


def test_a_drop_keeps_its_only_corner():
    t = along(0.0, 2.0 * math.pi, 40)
    drop = np.column_stack([np.cos(t), np.sin(t) * np.sin(0.5 * t) ** 1.5]) * (3.0, 2.0)
    tip = int(np.argmax(drop[:, 0]))
    assert np.flatnonzero(corners_of(drop)).tolist() == [tip]
    assert max(distance_to(sampled(smooth_outline(drop), 1e-7), vertex) for vertex in drop) < 1e-6


@pytest.mark.parametrize("edge", [0.4, 1.0, 2.0])
def test_straight_shapes_stay_straight(edge):
    corners = np.array([(0, 0), (12, 0), (16, 3), (16, 6), (8, 6), (8, 10), (0, 10)], dtype=float)
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    polygon = np.concatenate([along(a, b, round(math.dist(a, b) / edge)) for a, b in sides])
    curves = smooth_outline(polygon)
    assert [start_of(curve).tolist() for curve in curves] == corners.tolist()
    assert all(len(curve.c) == 2 for curve in curves)


def test_the_ends_of_a_strip_without_eyes_are_four_corners():
    polygon = outline(link(1.73, points=CURVED, pins=()))
    assert np.count_nonzero(corners_of(polygon)) == 4
    assert len(smooth_outline(polygon)) == 4


def test_a_curve_may_set_in_where_edges_grow():
    arc = rounded(along(-0.5 * math.pi, 0.5 * math.pi, 6), 1.0, (10.0, 0.0))
    lower = np.column_stack([np.array([0.0, 2.5, 5.0, 7.0, 8.5, 9.3]), np.full(6, -1.0)])
    polygon = np.concatenate([lower, arc, (lower * (1.0, -1.0))[::-1] + (0.7, 0.0), [(0.0, 1.0)]])
    assert np.flatnonzero(corners_of(polygon)).tolist() == [0, len(polygon) - 1]


def test_a_triangle_and_a_rectangle_of_single_edges_keep_their_corners():
    for polygon in ([(0, 0), (4, 0), (0, 3)], [(0, 0), (4, 0), (4, 3), (0, 3)]):
        polygon = np.array(polygon, dtype=float)
        assert sampled(smooth_outline(polygon), 1e-3).tolist() == polygon.tolist()


@pytest.mark.parametrize("seed", range(5))
def test_uneven_edges_on_a_smooth_shape_give_no_corners(seed):
    random = np.random.default_rng(seed)
    steps = random.uniform(1.0, 1.5, 36)
    angles = 2.0 * math.pi * np.cumsum(steps) / steps.sum()
    polygon = rounded(angles) * (5.0 + np.cos(2.0 * angles) + 0.15 * np.sin(5.0 * angles))[:, None]
    assert not np.any(corners_of(polygon))
