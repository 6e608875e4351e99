"""Paths that turn back, and that pass others closely: where curves end, and which path they follow."""

import re

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.mechanism import Force

from ..equilibrium import toggle
from ..equilibrium.curved_beam import RISE, beam_forces, curved_beam


def test_curve_that_ends_where_the_displacement_turns_back_says_where_and_names_the_remedy():
    simulation, push = curved_beam(4.0, cells=1.0)
    turned = simulation.follow(push, until=fm.Until(displacement=2.0 * RISE)).turning_points[0]
    fold = turned.frame.displacement
    values = [*np.linspace(0.0, fold, 30)[1:-1], 1.05 * fold]
    # iterations that suffice along the path, but not for the snap beyond its fold, which may end on another one
    options = {"space": "plane-stress", "size": RISE / 4.0, "solver": fm.PrimalDualNewton(iterations=3)}
    ending = fm.Simulation(simulation.scene, **options)
    with pytest.raises(fm.EquilibriumError, match=r"Use follow\(\), which goes round the turn") as caught:
        ending.load_displacement(push, displacements=values)
    (found,) = re.findall("the path turns back near ([0-9.]+);", str(caught.value))
    assert float(found) == pytest.approx(fold, rel=1e-3)


def driven_toggle(iterations: int) -> tuple[fm.Simulation, fm.Configuration, Force]:
    """A toggle whose head a motor moves beyond the fold of its path, a solver with few iterations, and a force."""
    case = toggle.toggle(stilt_modulus=0.075)
    mechanism = case.simulation.scene.mechanism
    (guide,) = (joint for joint in mechanism.joints if joint.b.name == "head" and joint.kind.sliding)
    motor = mechanism.motor(guide)
    options = {"space": "plane-stress", "order": 1, "size": 6.0, "solver": fm.PrimalDualNewton(iterations=iterations)}
    simulation = fm.Simulation(case.simulation.scene, **options)
    return simulation, simulation.scene.configuration("driven", {motor: -5.8}), case.push


def test_motors_that_end_where_their_path_turns_back_are_said_to_with_their_position_there():
    simulation, driven, push = driven_toggle(25)
    ((motor, _),) = driven.positions
    fold = simulation.follow(motor, until=fm.Until(position=-6.0, frames=30)).turning_points[0].frame.displacement
    # iterations that suffice along the path, but not for the snap beyond its fold
    simulation, driven, push = driven_toggle(1)
    with pytest.raises(fm.EquilibriumError, match=r"before the turn, which follow\(\) goes round") as caught:
        simulation.load_displacement(push, forces=[0.0], configuration=driven)
    (found,) = re.findall("the path turns back near '.*' at (-[0-9.]+);", str(caught.value))
    assert float(found) == pytest.approx(fold, rel=1e-3)


def test_motors_snap_to_the_same_equilibrium_by_few_iterations_at_a_time():
    frames = []
    for iterations in (3, 25):  # three end load steps where the path turns back
        simulation, driven, push = driven_toggle(iterations)
        frames += simulation.load_displacement(push, forces=[0.0], configuration=driven).frames
    assert [(frame.snapped_through, frame.unstable_modes) for frame in frames] == [(True, 0)] * 2
    assert frames[0].strain_energy == pytest.approx(frames[1].strain_energy, rel=1e-8)


def test_path_beside_an_imperfect_bifurcation_turns_into_the_next_mode_as_a_beam_does():
    # with steps of this length it would jump to the path that a perfect beam follows, whose forces differ by a fifth
    simulation, push = curved_beam(3.0, 1e-3, cells=1.0)
    curve = simulation.follow(push, until=fm.Until(displacement=2.0 * RISE))
    assert [event.kind for event in curve.events] == [fm.Critical.LIMIT, fm.Critical.LIMIT]
    assert (np.diff(curve.displacements) > 0.0).all()
    some = slice(None, None, 4)
    exact = beam_forces(3.0, 1e-3, curve.displacements[some])
    assert np.abs(curve.forces[some] - exact).max() < 1e-2 * np.abs(exact).max()
