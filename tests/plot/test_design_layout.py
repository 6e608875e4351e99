import numpy as np
import pytest

from fenicsmech.plot import IN_PLACE, lay_out_designs

from .strips import design, four_bar


def lay_out(designs, *, caption=1.5, heading=0.0, legend=3.0, subtitle=0.0):
    return lay_out_designs(
        designs, captions=[caption] * len(designs), heading=heading, legend=legend, subtitle=subtitle
    )


def corners(link, view=IN_PLACE):
    """Least and largest coordinates of a link, before and after."""
    points = np.concatenate([view(loop) for loop in (*link.before.loops, *link.after.loops)])
    return points.min(axis=0), points.max(axis=0)


def many(rows=4, columns=3):
    return [
        design(f"leaf {i}.{k}", (45 * k, 30 * i), (45 * k + 36, 30 * i)) for i in range(rows) for k in range(columns)
    ]


def test_a_millimetre_is_as_long_in_x_as_in_y_and_as_the_frame_says():
    layout = lay_out(four_bar())
    for stage in (layout.place, layout.details):
        (left, low), (right, high) = stage.axes.transData.transform([(0.0, 0.0), (10.0, 10.0)])
        assert right - left == pytest.approx(high - low, rel=1e-9)
        assert right - left == pytest.approx(10.0 * stage.scale * layout.page.figure.dpi, rel=1e-9)


def test_a_single_link_is_shown_in_place_only():
    layout = lay_out(four_bar()[:1])
    assert layout.details is None


@pytest.mark.parametrize("links", [four_bar(), many()])
def test_links_are_laid_down_without_touching_each_other_or_leaving_the_picture(links):
    layout = lay_out(links)
    x, y = layout.details.axes.get_xlim(), layout.details.axes.get_ylim()
    boxes = [corners(link, view) for link, view in zip(links, layout.details.views, strict=True)]
    for low, high in boxes:
        assert x[0] <= low[0] and high[0] <= x[1] and y[0] <= low[1] and high[1] <= y[1]
    for k, (low, high) in enumerate(boxes):
        for other_low, other_high in boxes[:k]:
            assert (low > other_high).any() or (other_low > high).any()


def test_links_laid_down_are_rigidly_moved_lie_along_x_and_are_not_smaller_than_in_place():
    links = [*four_bar(), design("hanger", (0, 0), (-4, 60)), design("mast", (40, 60), (41, -20))]
    layout = lay_out(links)
    assert layout.details.scale >= layout.place.scale
    for link, view in zip(links, layout.details.views, strict=True):
        assert view.turn.T @ view.turn == pytest.approx(np.eye(2), abs=1e-12)
        assert np.linalg.det(view.turn) == pytest.approx(1.0)
        (x0, y0), (x1, y1) = view(link.joints)
        assert abs(y1 - y0) < 0.05 * abs(x1 - x0)


def test_captions_stand_above_their_links():
    links = four_bar()
    layout = lay_out(links)
    for link, view, at in zip(links, layout.details.views, layout.captions, strict=True):
        low, high = corners(link, view)
        assert at[0] < low[0] and at[1] > high[1] + 0.3 / layout.details.scale


def test_the_mechanism_lies_inside_its_limits_with_room_around_it():
    links = four_bar()
    layout = lay_out(links)
    (x0, x1), (y0, y1) = layout.place.axes.get_xlim(), layout.place.axes.get_ylim()
    for low, high in map(corners, links):
        assert x0 < low[0] and high[0] < x1 and y0 < low[1] and high[1] < y1


@pytest.mark.parametrize("line", ["heading", "legend", "subtitle"])
@pytest.mark.parametrize("links", [1, 3])
def test_long_lines_widen_the_picture(line, links):
    layout = lay_out(four_bar()[:links], **{line: 12.0})
    assert layout.page.figure.get_figwidth() > 12.0
