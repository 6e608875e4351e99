from dataclasses import replace

import pytest

import fenicsmech as fm
from benchmarks.work_precision import RIGID, TOLERANCE, FidelityLevel, Quantity, fidelity_levels
from fenicsmech.elasticity import MID_PLANE_SYMMETRIC, PLANE_STRAIN, PLANE_STRESS, SPATIAL
from fenicsmech.errors import DescriptionError

from .cantilever import cantilever


def test_every_level_has_its_own_name_and_families_run_from_coarse_to_fine():
    levels = fidelity_levels(cantilever().scene)
    assert len({level.name for level in levels}) == len(set(levels)) == len(levels)
    assert levels[0] == RIGID
    planar, spatial = (PLANE_STRAIN, PLANE_STRESS), (MID_PLANE_SYMMETRIC, SPATIAL)
    for model in (*planar, *spatial):
        for order in (1, 2) if model in planar else (1, 2, 3):
            factors = [r.factor for r in levels if r.model is model and r.order == order and not r.is_variant]
            assert factors == sorted(factors, reverse=True)
            assert set(factors) >= {4.0, 2.0, 1.0, 0.5}


def test_quadrature_and_tolerance_are_varied_one_at_a_time():
    variants = [level for level in fidelity_levels(cantilever().scene) if level.is_variant]
    assert all((level.quadrature is None) != (level.tolerance == TOLERANCE) for level in variants)
    assert {level.tolerance for level in variants} == {1e-4, 1e-6, 1e-8, TOLERANCE}
    assert {level.quadrature for level in variants if level.model is SPATIAL} == {None, 2, 4, 5, 6}


def test_names_say_what_sets_a_level_apart():
    assert FidelityLevel(PLANE_STRESS, 2, 0.5).name == "plane stress P2 h×0.5"
    assert FidelityLevel(MID_PLANE_SYMMETRIC, 2, 1.0).name == "3D symmetric P2 h×1"
    assert FidelityLevel(SPATIAL, 3, 4.0, quadrature=5, tolerance=1e-4).name == "3D P3 h×4, degree 5, tol 1e-4"


def test_a_model_without_a_form_for_an_effect_is_left_out():
    scene = cantilever().scene
    body = scene.mechanism.rigid_links[-1]
    weight = fm.Gravity((0.0, 0.0, -1.0), masses={body: fm.Mass(1e-9, (0.0, 0.0))})
    levels = fidelity_levels(replace(scene, effects=[weight]))
    assert {level.model for level in levels} == {None, SPATIAL}


def test_a_load_that_moves_nothing_is_refused():
    force = cantilever().tip.part
    with pytest.raises(DescriptionError, match="zero"):
        Quantity(force, 0.0)
    with pytest.raises(DescriptionError):
        Quantity(force, float("nan"))


@pytest.mark.parametrize("value", [0.0, float("nan"), float("inf")])
def test_sizes_and_tolerances_that_are_not_positive_numbers_are_refused(value):
    for entry in ("factor", "tolerance"):
        with pytest.raises(DescriptionError):
            FidelityLevel(SPATIAL, **{entry: value})
