"""Barriers and regularisers: the paper's constants, exact gradients, how they combine, and freedom from units."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fenicsmech.design import (
    Barrier,
    Bounds,
    DesignedLink,
    LinkSpline,
    MeshQuality,
    Model,
    Regulariser,
    ShapeBounds,
    ShapeError,
    SplineSamples,
    StayClose,
)

from ..oracles.dense import hessian, taylor_rates
from ..ranks import EACH_COMM
from .mechanisms import bench, pinned_links
from .shapes import own_parameters

THICKNESS = 3.0
STEPS = [0.02, 0.01, 0.005, 0.0025]


def spline() -> LinkSpline:
    """An arch with one interior control point."""
    controls = np.zeros((3, 2, 3))
    controls[:, 0] = [(0, 0, 1), (30, 12, 1), (60, 0, 1)]
    controls[:, 1] = [(30, 20, 0), (30, 0, 0), (30, -20, 0)]
    return LinkSpline(controls, np.array([True, False, True]))


def rest_of(link: LinkSpline, bounds: Bounds, *, count: int = 500, thickness: float = THICKNESS) -> SimpleNamespace:
    """The part of a rest shape that regularisers of the spline alone read."""
    lengths = np.where(link.is_thickness, 1.0, thickness)
    samples = SplineSamples(link, count=count)
    (own,), controls = own_parameters([link]), link.controls[:, 0, :2]
    arch = DesignedLink("arch", own, link, samples, thickness, bounds, controls)
    none = slice(len(lengths), len(lengths))
    return SimpleNamespace(links=(arch,), initial=link.initial, lengths=lengths, of_numbers=none)


def model_of(regulariser: Regulariser, rest: SimpleNamespace) -> Model:
    return regulariser.around(rest, SimpleNamespace(p=rest.initial))


def away(link: LinkSpline) -> tuple[np.ndarray, np.ndarray]:
    """A wavy design beyond all bounds of ``TIGHT``, and a direction from there."""
    random = np.random.default_rng(0)
    scale = np.where(link.is_thickness, 0.3, 9.0)
    p = link.initial + scale * random.uniform(-1.0, 1.0, link.size)
    p[link.is_thickness] = [1.0, 0.8, 0.1, -1.2]  # thick, thin in the middle, and thick again
    return p, scale * random.standard_normal(link.size)


TIGHT = Bounds((2.8, 3.2), bend=0.002)
WIDE = Bounds((1.0, 9.0), bend=0.08)


def test_barrier_is_zero_inside_and_twice_continuously_differentiable_at_its_limit():
    barrier = Barrier(30.0, 30.0, 5.0)
    assert barrier.value(np.array([0.0, 30.0, 60.0])) == pytest.approx([0.0, 0.0, 5.0])
    just = np.array([30.0 - 1e-9, 30.0 + 1e-9])
    for derivative in (barrier.value, barrier.slope, barrier.curvature):
        assert derivative(just) == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize(
    ("bounds", "active"),
    [
        (Bounds(TIGHT.thickness, WIDE.bend), {"least thickness 2.8 of 'arch'", "largest thickness 3.2 of 'arch'"}),
        (Bounds(WIDE.thickness, TIGHT.bend), {"curvature 0.002 of 'arch'"}),
    ],
    ids=["thickness", "bend"],
)
def test_shape_bounds_pass_the_taylor_test_where_they_are_active_on_both_sides(bounds, active):
    link = spline()
    rest = rest_of(link, bounds)
    p, direction = away(link)
    bends = rest.links[0].samples.curvature(p)
    assert bends.min() < -TIGHT.bend and bends.max() > TIGHT.bend
    assert set(ShapeBounds().active(rest, SimpleNamespace(p=p))) == active
    model = model_of(ShapeBounds(), rest)
    rates = taylor_rates(lambda q: model(q).value, p, direction, model(p).gradient, STEPS)
    assert np.all(rates.with_gradient >= 1.95)
    assert np.all(rates.without >= 0.95)


def test_nothing_is_penalised_inside_the_bounds():
    link = spline()
    rest = rest_of(link, WIDE)
    here = model_of(ShapeBounds(), rest)(link.initial)
    assert here.value == 0.0
    assert not here.gradient.any()
    assert not here.curvature.any()
    assert ShapeBounds().active(rest, SimpleNamespace(p=link.initial)) == ()


def test_thickness_barriers_have_their_exact_curvature():
    link = spline()
    model = model_of(ShapeBounds(), rest_of(link, Bounds((2.0, 4.0), bend=9.0), count=30))
    p = link.initial + np.where(link.is_thickness, 0.8, 0.0)
    assert model(p).value > 0.0
    exact = hessian(lambda q: model(q).value, p, step=1e-3)
    assert model(p).curvature == pytest.approx(exact, abs=1e-5 * np.abs(exact).max())


def test_curvature_of_the_bend_barriers_is_positive_semidefinite():
    link = spline()
    p, _ = away(link)
    values = np.linalg.eigvalsh(model_of(ShapeBounds(), rest_of(link, TIGHT))(p).curvature)
    assert values.min() > -1e-10 * values.max()


def test_staying_close_counts_lengths_in_thicknesses_of_the_link():
    rest = SimpleNamespace(
        initial=np.array([10.0, -4.0, 1.0]), lengths=np.array([2.0, 2.0, 1.0]), of_numbers=slice(3, 3)
    )
    model = model_of(StayClose(), rest)
    assert model(rest.initial).value == 0.0
    here = model(rest.initial + [4.0, -2.0, 0.5])
    assert here.value == pytest.approx(0.5 * (2.0**2 + 1.0**2 + 0.5**2))
    assert here.gradient == pytest.approx([1.0, -0.5, 0.5])
    assert here.curvature == pytest.approx(np.diag([0.25, 0.25, 1.0]))


def test_regularisers_add_and_scale():
    link = spline()
    rest, (p, _) = rest_of(link, TIGHT), away(link)
    close, bounds, both = (
        model_of(r, rest)(p) for r in (StayClose(), ShapeBounds(), 3.0 * StayClose() + ShapeBounds() * 0.5)
    )
    for attribute in ("value", "gradient", "curvature"):
        expected = 3.0 * getattr(close, attribute) + 0.5 * getattr(bounds, attribute)
        assert getattr(both, attribute) == pytest.approx(expected, rel=1e-12)
    active = (3.0 * StayClose() + ShapeBounds() * 0.5).active(rest, SimpleNamespace(p=p))
    assert active == ShapeBounds().active(rest, SimpleNamespace(p=p))


# -- mesh quality --------------------------------------------------------------------------------------------

LOW = {"plane-stress": MeshQuality(limit=2.2, width=2.2), "3d": MeshQuality(limit=3.5, width=3.5)}


@pytest.mark.parametrize("comm", EACH_COMM)
@pytest.mark.parametrize(("space", "size"), [("plane-stress", 2.0), ("3d", 3.0)])
def test_mesh_quality_passes_the_taylor_test_with_handles_at_their_best(space, size, comm):
    case = pinned_links()
    both = bench(case, case.simulate(space, size=size, comm=comm))
    p, direction = both.design(0.3), both.direction(8)
    placed, low = both.rest.place(p, None), LOW[space]
    model = low.around(both.rest, placed)
    assert low.active(both.rest, placed) == (f"aspect ratio {low.limit:g} of the mesh",)
    assert model(p).value > 0.1

    def value(q: np.ndarray) -> float:
        near = both.rest.place(q, placed)
        return low.around(both.rest, near)(q).value

    rates = taylor_rates(value, p, direction, model(p).gradient, [0.02, 0.01, 0.005])
    assert np.all(rates.with_gradient >= 1.95)
    assert np.all(rates.without >= 0.95)


def test_model_of_the_mesh_quality_is_a_parabola_that_opens_upwards():
    case = pinned_links()
    both = bench(case, case.simulate(size=2.0))
    p, direction = both.design(0.3), both.direction(8)
    model = LOW["plane-stress"].around(both.rest, both.rest.place(p, None))
    curvature = model(p).curvature
    assert np.linalg.eigvalsh(curvature).min() >= -1e-12 * np.abs(curvature).max()
    ahead, back = model(p + direction), model(p - direction)
    assert ahead.value + back.value - 2.0 * model(p).value == pytest.approx(direction @ curvature @ direction)
    assert ahead.gradient - back.gradient == pytest.approx(2.0 * curvature @ direction)


def test_good_meshes_are_not_penalised():
    case = pinned_links()
    both = bench(case, case.simulate(size=2.0))
    placed = both.rest.place(both.design(0.3), None)
    assert both.rest.worst_ratio() < MeshQuality().limit
    here = MeshQuality().around(both.rest, placed)(placed.p)
    assert here.value == 0.0
    assert not here.gradient.any()
    assert MeshQuality().active(both.rest, placed) == ()


def test_designs_that_turn_cells_inside_out_have_no_placement():
    case = pinned_links()
    both = bench(case, case.simulate(size=2.0))
    p = np.where(np.isin(both.rest.lengths, 1.0), -3.0, both.rest.initial)
    with pytest.raises(ShapeError, match="inverted"):
        both.rest.place(p, None)


def test_regularisers_do_not_depend_on_the_unit_of_length():
    regularisers = {"close": StayClose(), "bounds": ShapeBounds(), "mesh": LOW["plane-stress"]}
    seen = []
    for unit in (1.0, 1000.0):
        case = pinned_links(unit)
        both = bench(case, case.simulate(size=2.0 / unit))
        direction = both.direction(8)
        p = both.design(0.6)
        placed = both.rest.place(p, None)
        here = {name: regulariser.around(both.rest, placed)(p) for name, regulariser in regularisers.items()}
        seen.append({name: [r.value, r.gradient @ direction] for name, r in here.items()})
    millimetres, metres = seen
    for name in regularisers:
        assert millimetres[name][0] > 1e-3, name
        assert metres[name] == pytest.approx(millimetres[name], rel=1e-8), name
