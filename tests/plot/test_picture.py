import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fenicsmech.plot
from fenicsmech.errors import DescriptionError
from fenicsmech.plot import (
    Arrow,
    FlexibleShape,
    MechanismShape,
    Panel,
    Pin,
    RigidShape,
    Trace,
    draw_configurations,
    lay_out,
    plan_view,
    rigid_outline,
)

from .grids import box, rectangle
from .png import colour_fraction, png_size

ORANGE, GREY, DARK = (243, 156, 61), (201, 204, 209), (86, 91, 99)


def mechanism(bend=0.0, values=None, scale=1.0):
    points, triangles = rectangle(40, 3, 60.0, 4.0)
    points = points - (0.0, 2.0)
    points[:, 1] += bend * (points[:, 0] / 60.0) ** 2
    tip = np.array([60.0, bend])
    base, tool = rigid_outline([(0, 0), (0, -15)], 10.0), rigid_outline([tip, tip + (20, 5)], 8.0)
    return MechanismShape(
        flexible=(FlexibleShape(scale * points, triangles, values=values, name="strip"),),
        rigid=(RigidShape(scale * base, "base", fixed=True), RigidShape(scale * tool, "tool")),
        pins=(Pin((0.0, 0.0)), Pin(scale * tip)),
    )


def draw_mechanism(path, *, undeformed, deformed=(), arrows=(), traces=(), title="", **options):
    """The picture of one configuration."""
    draw_configurations(path, [Panel(undeformed, tuple(deformed), tuple(arrows), tuple(traces), title)], **options)


def test_a_mechanism_is_drawn_with_all_its_parts_and_the_same_bytes_every_time(tmp_path):
    for name in ("a.png", "b.png"):
        draw_mechanism(
            tmp_path / name,
            undeformed=mechanism(),
            deformed=[mechanism(5.0), mechanism(12.0)],
            arrows=[Arrow((80, 17), (0, 10), "10 N"), Arrow((60, 12), (0, 0), "nothing")],
            traces=[Trace([(60, 0), (60, 5), (60, 12)], "tip", marks=[(60, 5)])],
            title="strip",
        )
    width, height = png_size(tmp_path / "a.png")
    assert 800 < width < 1200 and 300 < height < 900
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    for colour in (ORANGE, GREY, DARK):
        assert colour_fraction(tmp_path / "a.png", colour) > 0.005


def test_values_colour_the_flexible_links(tmp_path):
    stress = np.linspace(0.0, 50.0, 3 * 240).reshape(-1, 3)
    draw_mechanism(tmp_path / "plain.png", undeformed=mechanism(), deformed=[mechanism(5.0)])
    draw_mechanism(
        tmp_path / "stress.png", undeformed=mechanism(), deformed=[mechanism(5.0, stress)], colour_label="stress [MPa]"
    )
    assert colour_fraction(tmp_path / "stress.png", ORANGE) < 0.2 * colour_fraction(tmp_path / "plain.png", ORANGE)
    assert png_size(tmp_path / "stress.png")[0] > png_size(tmp_path / "plain.png")[0]  # the colour bar


@pytest.mark.parametrize("values", [np.zeros((240, 3)), np.full((240, 3), -2.0), np.eye(240, 3)])
def test_values_without_spread_and_single_peaks_are_drawn(tmp_path, values):
    points, triangles = rectangle(40, 3, 60.0, 4.0)
    shape = MechanismShape((FlexibleShape(points, triangles, values),))
    draw_mechanism(tmp_path / "flat.png", undeformed=shape)
    assert png_size(tmp_path / "flat.png")[0] > 800


def test_a_solid_is_drawn_from_above_with_the_values_of_its_top_cells(tmp_path):
    points, tets = box(10, 2, 2, (30.0, 4.0, 6.0))
    triangles, cells = plan_view(points, tets)
    shape = FlexibleShape(points[:, :2], triangles, np.tile(np.arange(len(tets))[cells, None], 3))
    draw_mechanism(tmp_path / "solid.png", undeformed=MechanismShape((shape,)))
    assert png_size(tmp_path / "solid.png")[0] > 800


def test_panels_share_limits_and_scale_and_a_millimetre_is_as_long_in_x_as_in_y():
    panels = [Panel(mechanism(bend), title=f"bend {bend}") for bend in (0.0, 40.0, -10.0)]
    layout = lay_out(panels, colour_bar=True, heading="strip", legend=("foot path",))
    first = layout.axes[0]
    for axes in layout.axes:
        assert axes.get_xlim() == first.get_xlim() and axes.get_ylim() == first.get_ylim()
        (left, low), (right, high) = axes.transData.transform([(0.0, 0.0), (10.0, 10.0)])
        assert right - left == pytest.approx(high - low, rel=1e-9)


def test_everything_lies_inside_the_limits():
    panel = Panel(mechanism(), (mechanism(30.0),), (Arrow((80, 35), (0, -7), "7 N"),), (Trace([(-50, 0), (0, 90)]),))
    layout = lay_out([panel], colour_bar=False, heading="", legend=())
    (x0, x1), (y0, y1) = layout.axes[0].get_xlim(), layout.axes[0].get_ylim()
    assert x0 < -50 and x1 > 84 and y0 < -20 and y1 > 90


def test_the_label_at_the_tail_of_an_arrow_has_room():
    widths = []
    for label in ("", "a force of 10 N"):
        arrow = Arrow((60, 0), (-10, 0), label)
        layout = lay_out([Panel(mechanism(), arrows=(arrow,))], colour_bar=False, heading="", legend=())
        widths.append(np.array(layout.axes[0].get_xlim()))
    (_, short), (_, long) = widths
    assert long > short + 5.0


def test_the_picture_does_not_depend_on_the_unit_of_length(tmp_path):
    sizes = set()
    for scale, unit in ((1.0, "mm"), (1e-3, "m")):
        path = tmp_path / f"{unit}.png"
        draw_mechanism(
            path, undeformed=mechanism(scale=scale), arrows=[Arrow((0.08 * scale, 0), (3, 0), "3 N")], unit=unit
        )
        sizes.add(png_size(path))
    assert len(sizes) == 1


def test_a_single_pin_makes_a_picture(tmp_path):
    draw_mechanism(tmp_path / "pin.png", undeformed=MechanismShape(pins=(Pin((3.0, 4.0)),)))
    assert png_size(tmp_path / "pin.png")[0] > 300


def test_a_long_title_fits_above_a_slender_link():
    points, triangles = rectangle(2, 20, 2.0, 60.0)
    title = "a slender link under its own weight, initial design"
    panel = Panel(MechanismShape((FlexibleShape(points, triangles),)), title=title)
    layout = lay_out([panel], colour_bar=False, heading="", legend=())
    text = layout.axes[0].set_title(title, loc="left", fontsize=10.5, fontweight="bold")
    assert text.get_window_extent(layout.page.figure.canvas.get_renderer()).x1 < layout.page.figure.bbox.x1


def test_neither_a_display_nor_pyplot_is_needed(tmp_path):
    code = (
        "import sys\n"
        "from fenicsmech.plot import CurveSeries, MechanismShape, Panel, Pin, draw_configurations, plot_curve\n"
        "draw_configurations('picture.png', [Panel(MechanismShape(pins=(Pin((0, 0)),)))])\n"
        "plot_curve('curve.png', [CurveSeries([0, 1], [0, 1])])\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    environment = {key: value for key, value in os.environ.items() if "DISPLAY" not in key}
    environment["PYTHONPATH"] = str(Path(fenicsmech.plot.__file__).parents[2])
    environment["MPLBACKEND"] = "TkAgg"  # the user's choice for windows must not matter
    # dolfinx 0.9 warns on import where numba is missing
    strict = ["-W", "error", "-W", "ignore::ImportWarning"]
    subprocess.run([sys.executable, *strict, "-c", code], cwd=tmp_path, env=environment, check=True)
    assert sorted(os.listdir(tmp_path)) == ["curve.png", "picture.png"]


TRIANGLE = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: FlexibleShape(TRIANGLE, [(0, 1, 3)], name="rod"), "triangles of flexible shape 'rod'"),
        (lambda: FlexibleShape(TRIANGLE, np.empty((0, 3), int)), "no triangle"),
        (lambda: FlexibleShape(TRIANGLE * np.nan, [(0, 1, 2)]), "Give finite numbers"),
        (lambda: FlexibleShape(TRIANGLE, [(0, 1, 2)], values=[1.0, 2.0, 3.0]), "corners of triangles"),
        (lambda: RigidShape([(0, 0), (1, 1)], "bar"), "rigid shape 'bar'.*at least 3"),
        (lambda: Pin((0, 0, 0)), "position of a pin"),
        (lambda: Arrow((0, 0), (np.inf, 0), "load"), "vector of arrow 'load'"),
        (lambda: Trace([0, 1, 2], "foot"), "points of trace 'foot'"),
    ],
)
def test_values_that_cannot_be_drawn_are_refused(make, message):
    with pytest.raises(DescriptionError, match=message):
        make()


def test_an_empty_picture_is_refused(tmp_path):
    with pytest.raises(DescriptionError, match="nothing to draw"):
        draw_configurations(tmp_path / "none.png", [])
    with pytest.raises(DescriptionError, match="nothing to draw"):
        draw_mechanism(tmp_path / "none.png", undeformed=MechanismShape())
    assert not list(tmp_path.iterdir())


def test_a_weld_is_drawn_as_a_square_without_a_ring(tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr("fenicsmech.plot.mechanism.save_png", lambda figure, path: figures.append(figure))
    for welded in (False, True):
        draw_mechanism(tmp_path / "joint.png", undeformed=MechanismShape(pins=(Pin((3.0, 4.0), welded),)))
    ring, square = ({type(patch).__name__ for patch in figure.axes[0].patches} for figure in figures)
    assert ring == {"Circle"} and square == {"Rectangle"}
