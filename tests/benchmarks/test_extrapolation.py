import pytest

from benchmarks.work_precision import extrapolate
from fenicsmech.errors import DescriptionError


@pytest.mark.parametrize("order", [0.7, 1.0, 1.5, 2.0])
@pytest.mark.parametrize("sizes", [(1.0, 2.0, 4.0), (0.3, 0.4, 0.9), (5.0, 1.0, 2.5)])
def test_limit_and_order_of_an_even_sequence_are_exact(order, sizes):
    limit = extrapolate(sizes, [3.0 - 0.2 * h**order for h in sizes])
    assert limit.value == pytest.approx(3.0, rel=1e-10)
    assert limit.order == pytest.approx(order, rel=1e-8)
    assert limit.levels == 3
    finest = 0.2 * min(sizes) ** order
    assert limit.uncertainty == pytest.approx(1.25 * finest, rel=1e-8)


def test_an_order_above_the_formal_one_is_reported_but_not_trusted():
    limit = extrapolate([1.0, 2.0, 4.0], [1.0 + h**4 for h in (1.0, 2.0, 4.0)])
    assert limit.order == pytest.approx(4.0)
    assert limit.value == pytest.approx(2.0 - 15.0 / 3.0)  # as if the order were 2
    assert abs(limit.value - 1.0) < limit.uncertainty


def test_the_three_finest_meshes_that_differ_count():
    sizes = [1.0, 1.05, 2.0, 4.0, 8.0]
    values = [2.0 + h**2 for h in sizes]
    values[1], values[4] = 100.0, -100.0
    assert extrapolate(sizes, values).value == pytest.approx(2.0)


@pytest.mark.parametrize("values", [(1.0, 1.2, 1.1), (1.0, 1.0, 1.2), (1.0, 1.3, 1.35)])
def test_a_sequence_that_does_not_settle_is_not_extrapolated(values):
    limit = extrapolate([1.0, 2.0, 4.0], values)
    assert limit.value == values[0]
    assert limit.order is None or limit.order < 0.5
    assert limit.uncertainty >= 3.0 * 0.2 - 1e-12


def test_values_that_settle_faster_than_any_element_does_are_taken_as_they_are():
    limit = extrapolate([1.0, 2.0, 4.0], [11.91, 11.905, 11.794 - 1.0])
    assert limit.value == 11.91
    assert limit.order > 6.0
    assert limit.uncertainty == pytest.approx(3.0 * 0.005)


def test_two_meshes_give_a_doubtful_limit_and_one_gives_none():
    limit = extrapolate([1.0, 2.0], [2.0 + 0.1, 2.0 + 0.4])
    assert limit.value == pytest.approx(2.0)
    assert limit.order is None
    assert limit.uncertainty == pytest.approx(0.3)
    assert extrapolate([1.0], [2.0]) is None
    assert extrapolate([1.0, 1.1], [2.0, 2.1]) is None


@pytest.mark.parametrize("sizes", [(1.0,), (1.0, 0.0)])
def test_invalid_sizes_are_refused(sizes):
    with pytest.raises(DescriptionError, match="positive size"):
        extrapolate(sizes, [1.0, 2.0])
