import numpy as np
import pytest

from fenicsmech.plot import Labels, Spot, new_figure, text_size

SQUARE = np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)])
UP, DOWN, RIGHT = np.array([0.0, 1.0]), np.array([0.0, -1.0]), np.array([1.0, 0.0])


@pytest.fixture
def axes():
    axes = new_figure(6.0, 6.0).add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-30.0, 30.0), ylim=(-30.0, 30.0))
    return axes


def extent(label):
    """(2, 2) corners of a label in data coordinates."""
    box = label.get_window_extent(label.figure.canvas.get_renderer())
    return label.axes.transData.inverted().transform(box)


def test_a_label_stands_beside_its_anchor_in_the_first_of_equal_places(axes):
    labels = Labels(axes, [SQUARE])
    (x0, y0), (x1, y1) = extent(labels.add("leaf", [Spot(np.array([5.0, 10.0]), UP), Spot(np.array([5.0, 0.0]), DOWN)]))
    assert 10.0 < y0 < 12.0 and 0.5 * (x0 + x1) == pytest.approx(5.0, abs=0.1)


def test_a_label_moves_to_where_it_hides_nothing(axes):
    above = SQUARE + (0.0, 11.0)
    labels = Labels(axes, [SQUARE, above])
    (_, _), (_, y1) = extent(labels.add("leaf", [Spot(np.array([5.0, 10.0]), UP), Spot(np.array([5.0, 0.0]), DOWN)]))
    assert y1 < 0.0


def test_a_label_does_not_stand_in_a_filled_shape_even_far_from_its_rim(axes):
    large = np.array([(-25.0, -25.0), (25.0, -25.0), (25.0, 0.0), (-25.0, 0.0)])
    inside, outside = Spot(np.array([0.0, -8.0]), DOWN), Spot(np.array([0.0, 0.0]), UP)
    (_, y0), (_, _) = extent(Labels(axes, [large]).add("leaf", [inside, outside]))
    assert y0 > 0.0


def test_labels_at_the_same_anchor_do_not_overlap(axes):
    labels = Labels(axes, [SQUARE])
    spots = [Spot(np.array([5.0, 10.0]), UP)]
    first, second = (extent(labels.add("a long label", spots)) for _ in range(2))
    assert second[0, 1] >= first[1, 1]


def test_a_label_stays_inside_the_picture(axes):
    labels = Labels(axes, [])
    spots = [Spot(np.array([29.0, 0.0]), RIGHT), Spot(np.array([29.0, 0.0]), -RIGHT)]
    (_, _), (x1, _) = extent(labels.add("a long label", spots))
    assert x1 < 30.0


def test_a_line_leads_to_a_label_that_had_to_move_away(axes):
    spots = [Spot(np.array([5.0, 10.0]), UP)]
    Labels(axes, [SQUARE]).add("3.1", spots, leader=True)
    close = len(axes.lines)
    bar = SQUARE * (1.0, 0.05) + (0.0, 11.0)
    (_, y0), (_, _) = extent(Labels(axes, [SQUARE, bar]).add("3.1", spots, leader=True))
    (line,) = axes.lines[close:]
    assert line.get_ydata()[0] == 10.0 and 11.5 < line.get_ydata()[1] < y0


def test_a_spot_without_direction_is_the_middle_of_the_label(axes):
    at = np.array([3.0, 4.0])
    corners = extent(Labels(axes, []).add("here", [Spot(at, np.zeros(2))]))
    assert corners.mean(axis=0) == pytest.approx(at, abs=0.1)


def test_sizes_of_text_grow_with_text_and_font():
    assert text_size("")[0] == 0.0
    (short, low), (long, _), (_, high) = text_size("ab"), text_size("ab" * 4), text_size("ab", fontsize=20.0)
    assert long == pytest.approx(4.0 * short, rel=0.1) and high > 1.5 * low
