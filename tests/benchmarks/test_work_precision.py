import numpy as np
import pytest

from benchmarks.work_precision import ModellingError, WorkSeries, pareto_front, plot_work_precision
from fenicsmech.errors import DescriptionError

from ..plot.png import colour_fraction, png_size

GREY, BLUE = (238, 238, 238), (33, 102, 172)


def series():
    """Three families like those of a mechanism."""
    return [
        WorkSeries("rigid", "", [1e-4], [1.0], ["rigid"]),
        WorkSeries("plane stress", "P2", [3e-3, 1e-2, 4e-2], [0.05, 0.03, 0.025], ["coarse", "medium", "fine"]),
        WorkSeries("3D", "P2", [0.05, 0.3, 2.0], [0.06, 0.01, 0.0], ["3D coarse", "3D medium", "3D fine"]),
        WorkSeries("3D", "P2", [0.2], [0.0101], ["3D other"], joined=False),
    ]


def test_the_front_holds_what_nothing_faster_matches():
    seconds = [1.0, 2.0, 3.0, 0.5, 4.0]
    errors = [0.1, 0.2, 0.05, 1.0, 0.05]
    assert pareto_front(seconds, errors) == [3, 0, 2]


def test_no_point_is_better_than_one_on_the_front_and_every_other_is_beaten():
    seconds, errors = np.random.default_rng(0).uniform(size=(2, 60))
    front = pareto_front(seconds, errors, least_gain=0.0)
    for k in range(60):
        better = (seconds <= seconds[k]) & (errors <= errors[k]) & (np.arange(60) != k)
        assert better.any() == (k not in front)


def test_a_gain_that_is_noise_puts_no_point_on_the_front():
    seconds, errors = [1.0, 2.0, 3.0], [0.100, 0.099, 0.05]
    assert pareto_front(seconds, errors) == [0, 2]
    assert pareto_front(seconds, errors, least_gain=0.0) == [0, 1, 2]


def test_equal_points_are_on_the_front_once():
    assert pareto_front([1.0, 1.0], [0.5, 0.5]) == [0]
    assert pareto_front([], []) == []


@pytest.mark.thorough
def test_a_plot_has_a_fixed_size_and_the_same_bytes_every_time(tmp_path):
    for name in ("a.png", "b.png"):
        plot_work_precision(
            tmp_path / name, series(), uncertainty=0.004, modelling=[ModellingError("plane stress", 0.024)]
        )
    assert png_size(tmp_path / "a.png") == (1200, 780)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_the_uncertainty_of_the_reference_is_a_band(tmp_path):
    for name, uncertainty in (("without", 0.0), ("with", 0.004)):
        plot_work_precision(tmp_path / f"{name}.png", series()[:3], uncertainty=uncertainty)
    assert colour_fraction(tmp_path / "with.png", GREY) > colour_fraction(tmp_path / "without.png", GREY) + 0.02
    assert colour_fraction(tmp_path / "with.png", BLUE) > 0.0


@pytest.mark.parametrize(
    "change, message",
    [
        ({"seconds": [0.0]}, "no logarithm"),
        ({"errors": [-0.1]}, "no logarithm"),
        ({"errors": [np.nan]}, "nan"),
        ({"errors": [0.1, 0.2]}, "shape"),
        ({"names": []}, "0 names for 1 points"),
    ],
)
def test_points_that_cannot_be_drawn_are_refused(change, message):
    good = {"model": "3D", "variant": "P1", "seconds": [1.0], "errors": [0.1], "names": ["one"]}
    with pytest.raises(DescriptionError, match=message):
        WorkSeries(**{**good, **change})


def test_a_plot_of_nothing_and_other_formats_are_refused(tmp_path):
    with pytest.raises(DescriptionError, match="it has no points"):
        plot_work_precision(tmp_path / "a.png", [])
    with pytest.raises(DescriptionError, match="PNG"):
        plot_work_precision(tmp_path / "a.pdf", series())
    assert not list(tmp_path.iterdir())
