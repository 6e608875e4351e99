"""Extremes of outlines and gaps between them are those of exact shapes, and smooth values bound them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import fenicsmech as fm

INNER, OUTER = 8.0, 12.0  # mm
SIZE = 2.0


@cache
def bow(space: str) -> tuple[fm.Simulation, fm.FlexibleLink]:
    """Half a ring on two straight feet, held at their ends."""
    shape = fm.outline(
        (-OUTER, -6),
        [
            fm.Line((-INNER, -6)),
            fm.Line((-INNER, 0)),
            fm.Arc((0, INNER), (INNER, 0)),
            fm.Line((INNER, -6)),
            fm.Line((OUTER, -6)),
            fm.Line((OUTER, 0)),
            fm.Arc((0, OUTER), (-OUTER, 0)),
        ],
        depth=4.0,
    )
    mechanism = fm.Mechanism("bow")
    ground = mechanism.rigid("ground", fixed=True)
    link = mechanism.flexible("bow", shape, fm.ONYX)
    for x in (-10.0, 10.0):
        mechanism.revolute(ground, link, at=(x, -4.5), interface_radius=1.0)
    return fm.Simulation(fm.Scene(mechanism), space=space, size=SIZE), link


SPACES = ["plane-stress", pytest.param("3d-symmetric", marks=pytest.mark.thorough)]


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize(("side", "radius"), [("convex", OUTER), ("concave", INNER), ("both", INNER)])
def test_curvature_of_a_ring_is_the_inverse_of_its_radius(space, side, radius):
    sim, link = bow(space)
    own = fm.LargestCurvature(link, side).on(sim.model)
    smooth, missing = own.value(), float(own.smoothing_errors(None)[0])
    assert smooth + missing == pytest.approx(1.0 / radius, rel=1e-6)
    assert missing < 0.0  # the smooth radius is the smaller one


@pytest.mark.parametrize("space", SPACES)
def test_thickness_of_a_ring_is_the_difference_of_its_radii(space):
    sim, link = bow(space)
    own = fm.LeastThickness(link).on(sim.model)
    smooth, missing = own.value(), float(own.smoothing_errors(None)[0])
    chord = SIZE / 2  # between nodes
    assert smooth + missing == pytest.approx(OUTER - INNER, abs=1.2 * chord**2 / (8.0 * OUTER))
    assert missing > 0.0


def test_sharper_extremes_are_closer_to_the_true_ones():
    sim, link = bow("plane-stress")
    missing = [
        float(fm.LeastThickness(link, sharpness).on(sim.model).smoothing_errors(None)[0])
        for sharpness in (25.0, 50.0, 100.0)
    ]
    assert np.all(np.diff(missing) < 0.0)


def exact(sim: fm.Simulation, gap: fm.LeastGap) -> float:
    """The least gap of the drawn links without load."""
    gap.check(sim.scene, 2)
    own, state = gap.on(sim.model), sim.model.assembled_state(sim.linkage.joints.drawn, np.zeros(0))
    sim.model.load(state)
    smooth, missing = own.values(state), own.smoothing_errors(state)
    assert missing >= 0.0  # the smooth gap is the smaller one
    return float((smooth + missing)[0])


@pytest.mark.parametrize("apart", [10.0, 2.0])
def test_gap_of_strips_is_their_distance_less_their_thickness_and_negative_where_they_overlap(apart):
    mechanism = fm.Mechanism("strips")
    ground, links = mechanism.rigid("ground", fixed=True), []
    for name, x, y in (("low", 0.0, 0.0), ("high", apart, 5.0)):
        shape = fm.strip([(x, y), (x, y + 20)], thickness=3.0, depth=5.0)
        links.append(mechanism.flexible(name, shape, fm.ONYX))
        for at in shape.centreline:
            mechanism.revolute(ground, links[-1], at=at, interface_radius=1.5)
    sim = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=SIZE)
    low, high = links
    assert exact(sim, fm.LeastGap(low, high)) == pytest.approx(apart - 3.0, abs=1e-6)
    assert exact(sim, fm.LeastGap(high, low)) == pytest.approx(apart - 3.0, abs=1e-6)
    wall = fm.HalfPlane((-4.0, 0.0), (1.0, 0.0))
    assert exact(sim, fm.LeastGap(low, wall)) == pytest.approx(2.5, abs=1e-6)


def crossed(at: float) -> tuple[fm.Simulation, fm.LeastGap]:
    """Two strips 1 mm thick that cross at a right angle, ``at`` from the start of one, in elements of 8 mm."""
    mechanism = fm.Mechanism("cross")
    ground, links = mechanism.rigid("ground", fixed=True), []
    for name, start, end in (("along", (0.0, 0.0), (40.0, 0.0)), ("across", (at, -18.0), (at, 22.0))):
        links.append(mechanism.flexible(name, fm.strip([start, end], thickness=1.0, depth=5.0), fm.ONYX))
        mechanism.clamp(ground, links[-1], end="start", length=1.0)
    return fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=8.0), fm.LeastGap(*links)


def test_strips_that_cross_have_a_negative_gap_wherever_their_nodes_are():
    for at in (18.0, 19.0, 20.5):
        # at most half the thickness inside, and a quarter of it at least: points are half a thickness apart
        assert -0.5 - 1e-9 <= exact(*crossed(at)) <= -0.25 + 1e-9


def test_joined_links_have_no_gap():
    mechanism = fm.Mechanism("pair")
    one, other = (
        mechanism.flexible(name, fm.strip([(0, 0), (x, 20)], thickness=3.0, depth=5.0), fm.ONYX)
        for name, x in (("one", 0.0), ("other", 10.0))
    )
    mechanism.revolute(one, other, at=(0, 0), interface_radius=2.0, name="pin")
    with pytest.raises(fm.DescriptionError, match="'pin' joins them"):
        fm.LeastGap(one, other).check(fm.Scene(mechanism), 2)


def test_an_unknown_side_is_refused():
    _, link = bow("plane-stress")
    with pytest.raises(fm.DescriptionError, match="its side is 'inner'"):
        fm.LargestCurvature(link, "inner")
