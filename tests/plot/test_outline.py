import numpy as np
import pytest

from fenicsmech.errors import DescriptionError
from fenicsmech.plot import rigid_outline


def area(polygon):
    x, y = polygon.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


@pytest.mark.parametrize(
    ("points", "length", "hull"),
    [
        ([(3.0, 4.0)], 0.0, 0.0),
        ([(0.0, 0.0), (6.0, 8.0)], 20.0, 0.0),
        ([(0.0, 0.0), (6.0, 8.0), (3.0, 4.0)], 20.0, 0.0),
        ([(0.0, 0.0), (0.1, 0.3), (0.2, 0.6), (0.3, 0.9)], 2 * np.hypot(0.3, 0.9), 0.0),
        ([(1.0, 1.0), (1.0, 1.0)], 0.0, 0.0),
        ([(0.0, 0.0), (3.0, 0.0), (0.0, 4.0)], 12.0, 6.0),
        ([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (1.0, 1.0), (1.0, 0.0)], 8.0, 4.0),
    ],
)
@pytest.mark.parametrize("width", [0.5, 3.0])
def test_area_is_that_of_the_hull_grown_by_a_disc(points, length, hull, width):
    # Steiner: A(K ⊕ r·disc) = A + r·perimeter + π r²
    radius = 0.5 * width
    disc = np.pi * radius**2
    assert area(rigid_outline(points, width)) == pytest.approx(hull + radius * length + disc, abs=1e-3 * disc)


def test_every_point_of_the_outline_is_half_a_width_from_the_bar():
    outline = rigid_outline([(0.0, 0.0), (10.0, 0.0)], 4.0)
    nearest = np.column_stack((np.clip(outline[:, 0], 0.0, 10.0), np.zeros(len(outline))))
    assert np.allclose(np.linalg.norm(outline - nearest, axis=1), 2.0, atol=1e-12)


def test_the_outline_scales_with_the_unit():
    points = np.array([(0.0, 0.0), (30.0, 1.0), (12.0, 20.0)])
    assert np.allclose(1e-3 * rigid_outline(points, 5.0), rigid_outline(1e-3 * points, 5e-3), atol=1e-15)


@pytest.mark.parametrize(
    ("points", "width", "message"),
    [
        (np.empty((0, 2)), 1.0, "no joint"),
        ([(0.0, np.nan)], 1.0, "entry"),
        ([(0.0, 0.0, 0.0)], 1.0, "shape"),
        ([(0.0, 0.0)], 0.0, "width.*: 0 is not positive"),
    ],
)
def test_invalid_input_is_refused(points, width, message):
    with pytest.raises(DescriptionError, match=message):
        rigid_outline(points, width)
