import csv
from dataclasses import replace

import pytest
from mpi4py import MPI

import fenicsmech as fm
from benchmarks.work_precision import (
    RIGID,
    FidelityLevel,
    Study,
    fidelity_levels,
    front_of,
    run_study,
    save_study,
    study_text,
)
from fenicsmech.elasticity import MID_PLANE_SYMMETRIC, PLANE_STRAIN, PLANE_STRESS, SPATIAL
from fenicsmech.errors import DescriptionError

from .cantilever import THICKNESS, cantilever

pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def study() -> Study:
    case = cantilever()
    levels = fidelity_levels(
        case.scene,
        planar={1: (2.0, 1.0), 2: (2.0, 1.0, 0.5)},
        spatial={1: (1.0,), 2: (2.0, 1.0, 0.5)},
        quadratures=(2,),
        tolerances=(1e-4,),
    )
    return run_study(case.scene, case.tip, levels, size=0.5 * THICKNESS, repeats=1, comm=MPI.COMM_SELF)


def test_limits_are_those_of_beam_theory(study):
    expected = cantilever().expected
    assert study.reference.value == pytest.approx(expected, rel=5e-3)
    for limit in study.limits.values():
        assert limit.value == pytest.approx(expected, rel=5e-3)
        assert limit.uncertainty < 0.02 * expected


def test_without_contraction_across_the_depth_models_agree_within_their_uncertainty(study):
    assert len(study.limits) == 4
    for limit in study.limits.values():
        assert abs(limit.value - study.reference.value) <= limit.uncertainty + study.reference.uncertainty


def test_finer_meshes_and_higher_orders_err_less(study):
    error = {m.level: abs(study.split(m).discretisation) for m in study.measurements}
    for model in (PLANE_STRESS, SPATIAL):
        assert (
            error[FidelityLevel(model, 2, 0.5)]
            < error[FidelityLevel(model, 2, 1.0)]
            < error[FidelityLevel(model, 2, 2.0)]
        )
        assert error[FidelityLevel(model, 2, 1.0)] < error[FidelityLevel(model, 1, 1.0)]
    assert study.relative(error[FidelityLevel(SPATIAL, 2, 0.5)]) < 0.01


def test_half_the_depth_has_the_limit_of_all_of_it(study):
    halves = [m for m in study.measurements if m.level.model is MID_PLANE_SYMMETRIC]
    assert len(halves) == 4
    assert all(study.split(m).modelling == 0.0 for m in halves)
    assert abs(study.limits[MID_PLANE_SYMMETRIC].value - study.reference.value) < 0.005 * study.reference.value
    fine, coarse = (next(m for m in halves if m.level.factor == f and m.level.order == 2) for f in (0.5, 2.0))
    assert abs(study.split(fine).discretisation) < abs(study.split(coarse).discretisation)


def test_errors_add_up_and_rigid_links_miss_everything(study):
    for m in study.measurements:
        split = study.split(m)
        assert split.total == pytest.approx(m.value - study.reference.value, abs=1e-12 * study.reference.value)
    rigid = study.measurements[0]
    assert (rigid.level, rigid.value) == (RIGID, 0.0)
    assert study.relative(study.split(rigid).modelling) == pytest.approx(-1.0)


def test_every_level_has_its_price(study):
    for m in study.measurements:
        assert not m.failure
        assert m.unknowns > 0 and m.frame_seconds > 0.0 and m.curve_seconds >= m.frame_seconds
    fine, coarse = (next(m for m in study.measurements if m.level == FidelityLevel(SPATIAL, 2, f)) for f in (0.5, 2.0))
    assert fine.unknowns > 4 * coarse.unknowns


def test_the_front_gets_more_accurate_as_it_gets_slower(study):
    front = front_of(study)
    seconds = [m.frame_seconds for m in front]
    errors = [max(study.relative(study.split(m).magnitude), study.uncertainty) for m in front]
    assert front[0].level == RIGID
    assert seconds == sorted(seconds)
    assert errors == sorted(errors, reverse=True)


def test_files_hold_every_level(study, tmp_path):
    save_study(study, tmp_path / "new")
    assert {path.name for path in (tmp_path / "new").iterdir()} == {"table.csv", "table.md", "work-precision.png"}
    with open(tmp_path / "new" / "table.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["level"] for row in rows] == [m.level.name for m in study.measurements]
    assert [float(row["value [mm]"]) for row in rows] == [m.value for m in study.measurements]
    text = (tmp_path / "new" / "table.md").read_text(encoding="utf-8")
    assert all(f"| {m.level.name} " in text for m in study.measurements)
    assert "observed order" in text


def test_failures_and_levels_that_take_too_long_are_recorded(tmp_path):
    case = cantilever()
    (beam,) = case.scene.mechanism.flexible_links
    scene = replace(case.scene, effects=[fm.Prestrain(beam, 1.0, along=(0, 0, 1))])
    levels = [RIGID, FidelityLevel(PLANE_STRAIN), FidelityLevel(SPATIAL, 1, 4.0), FidelityLevel(SPATIAL, 1, 0.01)]
    study = run_study(scene, case.tip, levels, size=THICKNESS, repeats=1, comm=MPI.COMM_SELF)
    rigid, unknown, coarse, fine = study.measurements
    assert rigid.value == 0.0 and coarse.value > 0.0
    assert unknown.value is None and "leaves the plane" in unknown.failure
    assert fine.value is None and "left out" in fine.failure
    # one mesh in space: no reference, so no errors and no plot, but a table
    assert study.reference is None and study.split(coarse) is None and front_of(study) == []
    save_study(study, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"table.csv", "table.md"}
    assert "left out" in study_text(study)


@pytest.mark.parametrize("levels, repeats", [([], 1), ([RIGID], 0)])
def test_a_study_of_nothing_is_refused(levels, repeats):
    case = cantilever()
    with pytest.raises(DescriptionError, match="at least one"):
        run_study(case.scene, case.tip, levels, size=THICKNESS, repeats=repeats)
