from dataclasses import replace

import pytest

import fenicsmech as fm
from fenicsmech.accuracy import RIGID, TOLERANCE, Displacement, Rung, ladder
from fenicsmech.elasticity import MID_PLANE_SYMMETRIC, PLANE_STRAIN, PLANE_STRESS, SPATIAL
from fenicsmech.errors import DescriptionError

from .cantilever import cantilever


def test_every_rung_has_its_own_name_and_families_run_from_coarse_to_fine():
    rungs = ladder(cantilever().scene)
    assert len({rung.name for rung in rungs}) == len(set(rungs)) == len(rungs)
    assert rungs[0] == RIGID
    planar, spatial = (PLANE_STRAIN, PLANE_STRESS), (MID_PLANE_SYMMETRIC, SPATIAL)
    for model in (*planar, *spatial):
        for order in (1, 2) if model in planar else (1, 2, 3):
            factors = [r.factor for r in rungs if r.model is model and r.order == order and not r.is_variant]
            assert factors == sorted(factors, reverse=True)
            assert set(factors) >= {4.0, 2.0, 1.0, 0.5}


def test_quadrature_and_tolerance_are_varied_one_at_a_time():
    variants = [rung for rung in ladder(cantilever().scene) if rung.is_variant]
    assert all((rung.quadrature is None) != (rung.tolerance == TOLERANCE) for rung in variants)
    assert {rung.tolerance for rung in variants} == {1e-4, 1e-6, 1e-8, TOLERANCE}
    assert {rung.quadrature for rung in variants if rung.model is SPATIAL} == {None, 2, 4, 5, 6}


def test_names_say_what_sets_a_rung_apart():
    assert Rung(PLANE_STRESS, 2, 0.5).name == "plane stress P2 h×0.5"
    assert Rung(MID_PLANE_SYMMETRIC, 2, 1.0).name == "3D symmetric P2 h×1"
    assert Rung(SPATIAL, 3, 4.0, quadrature=5, tolerance=1e-4).name == "3D P3 h×4, degree 5, tol 1e-4"


def test_a_model_without_a_form_for_an_effect_is_left_out():
    scene = cantilever().scene
    (beam,) = scene.mechanism.flexible_links
    weight = fm.Gravity((0.0, 0.0, -1.0), {beam.material: 1e-9})
    assert {rung.model for rung in ladder(replace(scene, effects=[weight]))} == {None, SPATIAL}


def test_a_load_that_moves_nothing_is_refused():
    force = cantilever().tip.force_part
    with pytest.raises(DescriptionError, match="zero"):
        Displacement(force, 0.0)
    with pytest.raises(DescriptionError):
        Displacement(force, float("nan"))
