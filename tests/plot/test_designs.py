import numpy as np
import pytest
from matplotlib.colors import to_rgb

from fenicsmech.errors import DescriptionError
from fenicsmech.plot import FLEXIBLE, INK, DesignShape, OutlineShape, RigidShape, draw_designs

from .png import colour_fraction, png_size
from .strips import design, four_bar, strip

ORANGE, DARK = (tuple(round(255 * c) for c in to_rgb(name)) for name in (FLEXIBLE, INK))
GREY, PALE = (223, 226, 230), (244, 245, 246)
SQUARE = np.array([(0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0)])
HOLE = 10.0 + 0.5 * SQUARE


def bare(outline):
    return OutlineShape(outline.loops)


@pytest.mark.parametrize("links", [1, 3])
def test_both_shapes_are_drawn_and_the_same_bytes_every_time(tmp_path, links):
    for name in ("a.png", "b.png"):
        draw_designs(tmp_path / name, four_bar()[:links], title="four-bar linkage")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    for colour in (ORANGE, GREY):
        assert colour_fraction(tmp_path / "a.png", colour) > 0.005


def test_several_links_are_shown_once_more_beside_the_mechanism(tmp_path):
    draw_designs(tmp_path / "one.png", four_bar()[1:2])
    draw_designs(tmp_path / "all.png", four_bar())
    assert png_size(tmp_path / "all.png")[0] > png_size(tmp_path / "one.png")[0] + 400


def test_an_unchanged_link_hides_the_one_before(tmp_path):
    shape = strip([(0, 0), (20, 0), (40, 0)], 5.0)
    draw_designs(tmp_path / "same.png", [DesignShape("leaf", shape, shape)])
    moved = DesignShape("leaf", shape, strip([(0, 0), (20, 9), (40, 0)], 5.0))
    draw_designs(tmp_path / "moved.png", [moved])
    assert colour_fraction(tmp_path / "same.png", GREY) < 0.1 * colour_fraction(tmp_path / "moved.png", GREY)


@pytest.mark.parametrize("turned", [slice(None), slice(None, None, -1)])
def test_holes_stay_empty_in_whatever_direction_they_run(tmp_path, turned):
    for name, loops in (("full.png", [SQUARE]), ("hole.png", [SQUARE, HOLE[turned]])):
        shape = OutlineShape(loops)
        draw_designs(tmp_path / name, [DesignShape("plate", shape, shape)])
    full, hole = (colour_fraction(tmp_path / name, ORANGE) for name in ("full.png", "hole.png"))
    assert hole == pytest.approx(0.75 * full, rel=0.03)


def test_thicknesses_are_dimensioned_where_they_are_known(tmp_path):
    link = design("leaf", (0, 0), (60, 0), bulge=-1.5)
    ink = []
    for name, thickness in (("known.png", link.after.thickness), ("unknown.png", None)):
        after = OutlineShape(link.after.loops, link.after.centreline, thickness)
        draw_designs(tmp_path / name, [DesignShape(link.name, bare(link.before), after, link.joints)])
        ink.append(colour_fraction(tmp_path / name, DARK))
    assert ink[0] > 1.05 * ink[1]


def test_rigid_links_are_a_background_that_does_not_change_the_limits(tmp_path):
    plate = RigidShape([(-500.0, -500.0), (500.0, -500.0), (0.0, 500.0)], "base")
    draw_designs(tmp_path / "alone.png", four_bar())
    draw_designs(tmp_path / "base.png", four_bar(), rigid=[plate])
    assert png_size(tmp_path / "alone.png") == png_size(tmp_path / "base.png")
    orange = [colour_fraction(tmp_path / name, ORANGE) for name in ("alone.png", "base.png")]
    assert orange[0] == pytest.approx(orange[1], rel=1e-3)
    assert colour_fraction(tmp_path / "base.png", PALE, tolerance=1) > 0.1


def test_the_picture_of_a_design_does_not_depend_on_the_unit_of_length(tmp_path):
    shapes = []
    for scale in (1.0, 2.0**-10):  # a power of two: without rounding
        draw_designs(tmp_path / "design.png", [
            DesignShape(d.name, bare(d.before), bare(d.after), d.joints) for d in four_bar(scale)
        ])  # fmt: skip
        shapes.append((png_size(tmp_path / "design.png"), colour_fraction(tmp_path / "design.png", ORANGE)))
    assert shapes[0] == (shapes[1][0], pytest.approx(shapes[1][1], rel=1e-2))


def test_points_that_coincide_are_drawn(tmp_path):
    points = np.array([(0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (20.0, 0.0), (40.0, 0.0), (40.0, 0.0)])
    loop = np.repeat([(0.0, -2.0), (40.0, -2.0), (40.0, 2.0), (0.0, 2.0)], 3, axis=0)
    shape = OutlineShape([loop], points, [1.0, 1.0, 1.0, 4.0, 4.0, 4.0])
    for links in (1, 2):
        draw_designs(tmp_path / "link.png", [DesignShape("leaf", shape, shape)] * links)
        assert colour_fraction(tmp_path / "link.png", ORANGE) > 0.005


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: OutlineShape([]), "there are no loops"),
        (lambda: OutlineShape([SQUARE[:2]]), "2 point"),
        (lambda: OutlineShape([SQUARE * np.nan]), "Give finite numbers"),
        (lambda: OutlineShape([SQUARE], thickness=[1.0]), "thickness along a link's centreline"),
        (lambda: OutlineShape([SQUARE], SQUARE, thickness=[1.0, 2.0, 3.0]), r"shape \(4\)"),
        (lambda: OutlineShape([SQUARE], SQUARE, thickness=[1.0, 2.0, 0.0, 1.0]), "not positive"),
        (lambda: OutlineShape([SQUARE], SQUARE[:1], thickness=[1.0]), "two points or more"),
        (lambda: OutlineShape([SQUARE], controls=[1.0, 2.0]), "control points"),
        (
            lambda: DesignShape("rod", OutlineShape([SQUARE]), OutlineShape([SQUARE]), [(0, 0, 0)]),
            "joints of link 'rod'",
        ),
    ],
)
def test_invalid_outlines_are_refused(make, message):
    with pytest.raises(DescriptionError, match=message):
        make()


def test_a_picture_without_links_and_other_formats_are_refused(tmp_path):
    with pytest.raises(DescriptionError, match="nothing to draw"):
        draw_designs(tmp_path / "none.png", [])
    with pytest.raises(DescriptionError, match=r"\.png"):
        draw_designs(tmp_path / "design.pdf", four_bar())
    assert not list(tmp_path.iterdir())
