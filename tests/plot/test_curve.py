import numpy as np
import pytest
from matplotlib.colors import to_rgb

from fenicsmech.errors import DescriptionError
from fenicsmech.files import read_csv, write_csv
from fenicsmech.plot import PALETTE, CurveSeries, CurveTarget, plot_curve

from .png import colour_fraction, png_size

X = np.linspace(0.0, 20.0, 9)


@pytest.fixture
def drawn(monkeypatch):
    """The figures that are drawn from now on."""
    figures = []
    monkeypatch.setattr("fenicsmech.plot.curve.save_png", lambda figure, path: figures.append(figure))
    return figures


def legend(figure):
    """Colour of each entry by its label."""
    shown = figure.axes[0].get_legend()
    labels = [text.get_text() for text in shown.get_texts()]
    assert len(set(labels)) == len(labels)
    return {label: line.get_markeredgecolor() for label, line in zip(labels, shown.get_lines(), strict=True)}


def test_columns_survive_the_round_trip_to_the_last_digit(tmp_path):
    columns = {
        "displacement [mm]": np.array([0.0, 1.0 / 3.0, -1e-300, 1.7976931348623157e308]),
        "force, measured [N]": [0, 0.1, np.pi, 2.5],
        "stable": np.array([True, True, False, True]),
        "iterations": [0, 3, 4, 17],
    }
    write_csv(tmp_path / "curve.csv", columns)
    read = read_csv(tmp_path / "curve.csv")
    assert list(read) == list(columns)
    for header, values in columns.items():
        assert np.array_equal(read[header], np.asarray(values, dtype=float))
    assert (tmp_path / "curve.csv").read_text().splitlines()[3] == "-1e-300,3.141592653589793,0,4"


def test_a_table_without_rows_is_a_table(tmp_path):
    write_csv(tmp_path / "curve.csv", {"force [N]": []})
    assert read_csv(tmp_path / "curve.csv")["force [N]"].shape == (0,)


def test_comments_blank_lines_and_a_byte_order_mark_are_understood(tmp_path):
    path = tmp_path / "measured.csv"
    path.write_bytes(
        "\ufeff# sample 1 mm, µ-test\r\n displacement [mm], force [N]\r\n\r\n0, 0\r\n1.5,2e-1\r\n".encode()
    )
    read = read_csv(path)
    assert read["displacement [mm]"].tolist() == [0.0, 1.5]
    assert read["force [N]"].tolist() == [0.0, 0.2]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "it is empty"),
        ("x,x\n1,2\n", "own name"),
        ("x,\n1,2\n", "own name"),
        ("x,y\n1,2\n\n3\n", "line 4: 1 field for 2 columns"),
        ("x,y\n1,2\n3,four\n", "line 3: 'four' is not a number"),
        ("x,y\n1,nan\n", "line 2: the value is nan"),
    ],
)
def test_a_bad_table_is_refused_with_its_line(tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(DescriptionError, match=message):
        read_csv(path)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({}, "there are no columns"),
        ({"a": [1.0, 2.0], "b": [1.0]}, r"column 'b'.*shape \(1,\)"),
        ({"a": [1.0, np.nan]}, r"column 'a'.*entry \[1\] is nan"),
        ({"a": ["one"]}, "not an array of numbers"),
    ],
)
def test_bad_columns_are_refused_and_nothing_is_written(tmp_path, columns, message):
    with pytest.raises(DescriptionError, match=message):
        write_csv(tmp_path / "curve.csv", columns)
    assert not list(tmp_path.iterdir())


def test_a_plot_has_a_fixed_size_and_the_same_bytes_every_time(tmp_path):
    series = [
        CurveSeries(X, np.sin(X / 8), "initial design", stable=np.gradient(np.sin(X / 8)) > 0),
        CurveSeries(X, X / 10, "optimised design"),
        CurveSeries(X, X / 11, "measured", joined=False),
    ]
    for name in ("a.png", "b.png"):
        plot_curve(tmp_path / name, series, targets=[CurveTarget(5.0, 0.5)], title="claw")
    assert png_size(tmp_path / "a.png") == (960, 660)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_the_unstable_part_is_dashed(tmp_path):
    blue = (33, 102, 172)
    for name, stable in (("solid.png", X >= 0), ("dashed.png", X < 5)):
        plot_curve(tmp_path / name, [CurveSeries(X, X, stable=stable)])
    assert 0.0 < colour_fraction(tmp_path / "dashed.png", blue) < 0.9 * colour_fraction(tmp_path / "solid.png", blue)


def test_a_snap_through_is_a_dotted_arrow_with_an_entry_of_its_own(tmp_path, drawn):
    snapped_through = np.arange(len(X)) == 4
    for flags in (np.zeros(len(X), bool), snapped_through):
        plot_curve(tmp_path / "a.png", [CurveSeries(X, X, "pushed", snapped_through=flags)])
    whole, broken = (figure.axes[0] for figure in drawn)
    assert [text.get_text() for text in broken.get_legend().get_texts()] == ["pushed", "snap-through"]
    assert [text.get_text() for text in whole.get_legend().get_texts()] == ["pushed"]
    (arrow,) = broken.texts
    assert arrow.xy == pytest.approx([X[4], X[4]]) and not whole.texts
    solid = [axes.get_lines()[0].get_xdata() for axes in (whole, broken)]
    assert [np.isnan(x).sum() for x in solid] == [0, 1]  # one piece, or two


def test_bars_lead_from_points_to_where_finer_elements_put_them(tmp_path, drawn):
    added = 0.05 * X
    for corrected, end in (((X + added, X), "|"), ((X, X + added), "_")):
        plot_curve(tmp_path / "a.png", [CurveSeries(X, X, "pushed", corrected=np.column_stack(corrected))])
        axes = drawn[-1].axes[0]
        (bars,) = axes.collections
        moved = added != 0.0
        expected = np.stack([np.column_stack([X, X]), np.column_stack(corrected)], axis=1)[moved]
        assert np.array_equal(bars.get_segments(), expected)
        assert end in [line.get_marker() for line in axes.get_lines()]
        assert list(legend(drawn[-1])) == ["pushed", "in finer elements"]


def test_a_faint_curve_is_thinner_lighter_and_behind_the_others(tmp_path):
    blue, faint = (33, 102, 172), (155, 186, 218)
    orders = {"strong": ["strong"], "faint": ["faint"], "both": ["faint", "strong"], "turned": ["strong", "faint"]}
    for name, order in orders.items():
        series = [CurveSeries(X, X, colour="#2166ac", faint=kind == "faint") for kind in order]
        plot_curve(tmp_path / f"{name}.png", series)
    fraction = {name: colour_fraction(tmp_path / f"{name}.png", blue) for name in orders}
    assert fraction["faint"] == 0.0
    assert fraction["both"] == fraction["turned"] == pytest.approx(fraction["strong"], rel=0.02)
    assert 0.0 < colour_fraction(tmp_path / "faint.png", faint) < 0.9 * fraction["strong"]


def test_a_label_of_several_curves_appears_once_and_in_grey(tmp_path, drawn):
    blue, orange, grey = PALETTE[0], PALETTE[1], "#777777"
    series = [
        CurveSeries(X, X, "initial design", colour=blue, faint=True),
        CurveSeries(X, 2 * X, "initial design", colour=orange, faint=True),
        CurveSeries(X, X / 2, "crank 45 deg", colour=blue),
        CurveSeries(X, X / 3, "crank 95 deg", colour=orange),
    ]
    plot_curve(tmp_path / "a.png", series, targets=[CurveTarget(5, 2, blue), CurveTarget(5, 3, orange)])
    plot_curve(tmp_path / "b.png", series[::2], targets=[CurveTarget(5, 2, blue), CurveTarget(9, 3, blue)])
    several, one = (legend(figure) for figure in drawn)
    assert list(several) == ["initial design", "crank 45 deg", "crank 95 deg", "target"]
    assert several["crank 45 deg"] == blue and several["crank 95 deg"] == orange and several["target"] == grey
    red, green, light = to_rgb(several["initial design"])
    assert red == green == light > to_rgb(grey)[0]
    assert one["target"] == blue and list(one) == ["initial design", "crank 45 deg", "target"]


def test_targets_at_the_same_place_are_all_visible(tmp_path):
    colours = PALETTE[:3]
    plot_curve(tmp_path / "targets.png", [CurveSeries(X, X)], targets=[CurveTarget(5, 2, c) for c in colours[::-1]])
    for colour in colours[1:]:
        wanted = tuple(round(255 * c) for c in to_rgb(colour))
        assert colour_fraction(tmp_path / "targets.png", wanted) > 1e-4


@pytest.mark.parametrize("count", [0, 1, 2, 500])
def test_any_number_of_samples_is_drawn(tmp_path, count):
    x = np.linspace(0.0, 1.0, count)
    plot_curve(tmp_path / "curve.png", [CurveSeries(x, x, "curve", stable=x > 0.5)])
    assert png_size(tmp_path / "curve.png") == (960, 660)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"displacement": X, "force": X[1:]}, "forces of curve 'c'.*shape"),
        ({"displacement": X, "force": np.full(9, np.inf)}, "forces of curve 'c'.*entry"),
        ({"displacement": X, "force": X, "stable": [True]}, "stability of curve 'c': 1 flag for 9 points"),
        ({"displacement": X, "force": X, "snapped_through": [True]}, "snaps of curve 'c': 1 flag for 9 points"),
    ],
)
def test_a_contradictory_series_is_refused(arguments, message):
    with pytest.raises(DescriptionError, match=message):
        CurveSeries(label="c", **arguments)


def test_a_target_that_is_not_a_number_is_refused():
    with pytest.raises(DescriptionError, match="target"):
        CurveTarget(np.nan, 4.0)


def test_only_png_is_drawn(tmp_path):
    with pytest.raises(DescriptionError, match=r"\.png"):
        plot_curve(tmp_path / "curve.pdf", [CurveSeries(X, X)])
