import numpy as np
import pytest

from fenicsmech.errors import DescriptionError
from fenicsmech.plot import plan_view
from fenicsmech.polygons import edge_loops

from .grids import box, rectangle


def signed_areas(points, triangles):
    a, b, c = (points[triangles[:, k], :2] for k in range(3))
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def test_the_top_of_a_box_is_seen_once_and_turned_to_the_viewer():
    points, tets = box(3, 2, 2, (6.0, 4.0, 5.0))
    triangles, _ = plan_view(points, tets)
    assert triangles.shape == (12, 3)
    assert np.all(points[triangles][..., 2] == 5.0)
    areas = signed_areas(points, triangles)
    assert np.all(areas > 0.0)
    assert areas.sum() == pytest.approx(24.0, rel=1e-14)


def test_each_triangle_knows_the_cell_below_it():
    points, tets = box(2, 2, 2, (2.0, 2.0, 1.0))
    for triangle, cell in zip(*plan_view(points, tets), strict=True):
        assert set(triangle) < set(tets[cell])


def test_the_orientation_of_the_cells_does_not_matter():
    points, tets = box(2, 1, 1, (2.0, 1.0, 1.0))
    mirrored = tets[:, [1, 0, 2, 3]]
    assert np.array_equal(np.sort(plan_view(points, tets)[0]), np.sort(plan_view(points, mirrored)[0]))


def test_walls_and_steep_slopes_are_not_seen():
    points, tets = box(1, 1, 1, (1.0, 1.0, 1.0))
    for slope, seen in ((1.0, 2), (3.0, 0)):
        sheared = points + np.outer(points[:, 0], (0.0, 0.0, slope))
        # the top's normal is (−slope, 0, 1)/√(1 + slope²)
        if seen:
            assert len(plan_view(sheared, tets)[0]) == seen
        else:
            with pytest.raises(DescriptionError, match=r"towards \+z"):
                plan_view(sheared, tets)


@pytest.mark.parametrize(
    ("points", "tets", "message"),
    [
        (np.zeros((4, 2)), [[0, 1, 2, 3]], "shape"),
        (np.zeros((4, 3)), [[0, 1, 2, 4]], "Only 0 to 3 exist"),
        (np.zeros((4, 3)), [[0.0, 1.0, 2.0, 3.0]], "Give integers"),
        (np.full((4, 3), np.nan), [[0, 1, 2, 3]], "finite"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(points, tets, message):
    with pytest.raises(DescriptionError, match=message):
        plan_view(points, tets)


def test_the_rim_of_a_plate_with_a_hole_is_two_loops():
    points, triangles = rectangle(6, 6, 6.0, 6.0)
    centres = points[triangles].mean(axis=1)
    plate = triangles[(np.abs(centres - 3.0) > 1.0).any(axis=1)]
    loops = sorted(edge_loops(plate), key=len)
    assert [len(loop) for loop in loops] == [8, 24]
    areas = [signed_areas(points, np.array([(loop[0], a, b) for a, b in zip(loop[1:], loop[2:], strict=False)])).sum()
             for loop in loops]  # fmt: skip
    assert areas == pytest.approx([-4.0, 36.0], rel=1e-14)


def test_the_rim_of_parts_that_touch_in_a_point_uses_every_edge_once():
    triangles = np.array([(0, 1, 2), (2, 3, 4)])
    loops = edge_loops(triangles)
    edges = sorted(tuple(sorted(e)) for loop in loops for e in zip(loop, np.roll(loop, -1), strict=True))
    assert edges == [(0, 1), (0, 2), (1, 2), (2, 3), (2, 4), (3, 4)]
