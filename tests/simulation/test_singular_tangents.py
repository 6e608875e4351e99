"""Singular tangents raise errors that name the equilibrium and keep the frames before it."""

from __future__ import annotations

import pytest
from slepc4py import SLEPc

import fenicsmech as fm
from fenicsmech.continuation import ArcLengthStepper
from fenicsmech.equilibrium import NewtonSolver, NotConverged

from ..equilibrium.column import EULER, column

ASKED = {
    "buckling loads": lambda curve: curve.buckling_points(),
    "soft modes": lambda curve: curve.soft_modes(),
    "error estimates": lambda curve: curve.error_estimates(),
    "explanation": lambda curve: curve.explain(),
}


def failing(*arguments, **options):
    """Singular KKT matrices: every computation that needs one says so."""
    raise NotConverged("the KKT matrix cannot be factored", 0)


@pytest.mark.parametrize("ask", ASKED.values(), ids=ASKED)
def test_evaluations_at_a_singular_equilibrium_raise_errors(ask, monkeypatch):
    case = column()
    curve = case.simulation.load_displacement(case.push, forces=[0.1 * EULER])
    design = case.simulation.model.elastic.design
    monkeypatch.setattr(NewtonSolver, "linearise", failing)
    with pytest.raises(fm.EquilibriumError, match="cannot be factored"):
        ask(curve)
    assert (case.simulation.model.elastic.design == design).all()


def test_curve_ends_with_its_frames_where_the_modes_of_a_bifurcation_are_not_found(monkeypatch):
    case = column()
    monkeypatch.setattr(SLEPc, "EPS", failing)
    with pytest.raises(fm.EquilibriumError, match="cannot be followed beyond") as caught:
        case.simulation.follow(case.push, until=fm.Until(force=1.1 * EULER))
    assert 0.5 * EULER < caught.value.last.force < 1.1 * EULER
    assert caught.value.last is caught.value.frames[-1]


def test_force_that_joints_hold_has_no_buckling_load_and_no_path():
    case = column()
    mechanism = case.simulation.scene.mechanism
    across = mechanism.force(on=case.push.on, at=case.push.at, direction=(0, 1), name="across")
    curve = case.simulation.load_displacement(across, forces=[EULER])
    with pytest.raises(fm.EquilibriumError, match="moves nothing"):
        curve.buckling_points()
    with pytest.raises(fm.EquilibriumError, match="moves nothing"):
        case.simulation.follow(across, until=fm.Until(force=EULER))


def test_path_of_a_mechanism_that_its_force_drives_on_without_end_names_the_links():
    sledge = fm.Mechanism("sledge")
    base, slide = sledge.rigid("base", fixed=True), sledge.rigid("slide")
    blade = sledge.flexible("blade", fm.strip([(0, 0), (20, 0)], thickness=1.0, depth=5.0), fm.SMOOTH_SIL_950)
    sledge.prismatic(base, slide, at=(0, 0), axis=(1, 0))
    sledge.weld(slide, blade, at=(0, 0), interface_radius=0.8)
    push = sledge.force(on=blade, at=(20, 0), direction=(0.3, 1.0))
    simulation = fm.Simulation(fm.Scene(sledge), space="plane-stress", size=2.0)
    with pytest.raises(fm.EquilibriumError, match="Nothing but the force holds 'slide', 'blade'"):
        simulation.follow(push, until=fm.Until(force=5.0))


@pytest.mark.parametrize("found", [True, False])
def test_curve_that_ends_off_its_target_warns(found, monkeypatch, caplog):
    case = column()
    if not found:
        monkeypatch.setattr(ArcLengthStepper, "between", failing)
    curve = case.simulation.follow(case.push, until=fm.Until(force=0.333 * EULER))
    assert (abs(curve.forces[-1] / (0.333 * EULER) - 1.0) < 1e-9) == found
    assert ("the path ends at" in caplog.text) != found
