"""Paths that turn back, and that pass others closely: where curves end, and which path they follow."""

import re

import numpy as np
import pytest

import fenicsmech as fm

from ..equilibrium.curved_beam import RISE, beam_forces, curved_beam


def test_curve_that_ends_where_the_displacement_turns_back_says_where_and_names_the_remedy():
    simulation, push = curved_beam(4.0, cells=1.0)
    turned = simulation.follow(push, until=fm.Until(displacement=2.0 * RISE)).turning_points[0]
    fold = turned.frame.displacement
    values = [*np.linspace(0.0, fold, 30)[1:-1], 1.05 * fold]
    with pytest.raises(fm.EquilibriumError, match=r"Use follow\(\), which goes round the turn") as caught:
        simulation.load_displacement(push, displacements=values)
    (told,) = re.findall("the path turns back near ([0-9.]+);", str(caught.value))
    assert float(told) == pytest.approx(fold, rel=1e-3)


def test_path_beside_an_imperfect_bifurcation_turns_into_the_next_mode_as_a_beam_does():
    # with steps of this length it would jump to the path that a perfect beam follows, whose forces differ by a fifth
    simulation, push = curved_beam(3.0, 1e-3, cells=1.0)
    curve = simulation.follow(push, until=fm.Until(displacement=2.0 * RISE))
    assert [event.kind for event in curve.events] == [fm.Critical.LIMIT, fm.Critical.LIMIT]
    assert (np.diff(curve.displacements) > 0.0).all()
    some = slice(None, None, 4)
    exact = beam_forces(3.0, 1e-3, curve.displacements[some])
    assert np.abs(curve.forces[some] - exact).max() < 1e-2 * np.abs(exact).max()
