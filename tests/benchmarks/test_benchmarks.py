"""Every benchmark runs, prints its table with machine and commit, and its numbers are the physics'."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fenicsmech as fm
from benchmarks import laws
from benchmarks.stress import designs
from benchmarks.table import publish
from benchmarks.verification import CASES
from fenicsmech.report import format_table

ROOT = Path(__file__).parents[2]


def printed(name: str, *options: str) -> list[list[str]]:
    """The cells of the tables that a benchmark prints, run as a user does."""
    command = [sys.executable, "-m", f"benchmarks.{name}", *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert "Commit " in done.stdout
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in done.stdout.splitlines() if "|" in line]


def test_a_written_table_is_what_was_printed(tmp_path, capsys):
    publish("sizes", format_table(["h", "n"], [[1.0, 2]]), write=True, folder=tmp_path)
    assert (tmp_path / "sizes.md").read_text() == capsys.readouterr().out.rstrip("\n") + "\n"


@pytest.mark.parametrize(
    "case", [case for case in laws.CASES if case.published and len(case.kinds) == 1], ids=lambda case: case.name
)
def test_no_published_parameters_fit_treloars_tests_better_than_ours(case):
    fit = case.fit()

    def size(numbers):
        tests = [(laws.closed_form(case.law, numbers, t.kind, t.stretches) - t.stresses) / t.errors for t in fit.tests]
        return np.linalg.norm(np.concatenate(tests))

    *ours, _ = fit.law.parameters.values()
    assert size(tuple(ours)) <= size(case.published)


@pytest.mark.parametrize("kind", laws.KINDS)
@pytest.mark.parametrize(
    "law",
    [
        fm.Ogden((0.63, 0.0012, -0.01), (1.3, 5.0, -2.0), 0.4999999),
        fm.Yeoh(0.2, -2e-3, 5e-5, 0.4999999),
        fm.MooneyRivlin(0.17, 5e-3, 0.4999999),
    ],
    ids=lambda law: type(law).__name__,
)
def test_closed_forms_are_stresses_of_rubber_that_keeps_its_volume(law, kind):
    *numbers, _ = law.parameters.values()
    stretches = np.array([1.1, 2.0, 4.0])
    expected = laws.closed_form(law, tuple(numbers), kind, stretches)
    assert fm.specimen_stress(law, kind, stretches) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("test", [case.test for case in CASES])
def test_lines_of_the_verification_name_tests_that_exist(test):
    file, _, function = test.partition("::")
    text = (ROOT / "tests" / file).read_text()
    assert f"def {function}(" in text if function else "def test_" in text


@pytest.mark.thorough
def test_curves_of_the_drawn_mechanisms():
    *_, row = printed("frames", "truss", "--space", "plane-stress")
    assert row[0] == "truss" and float(row[2]) == pytest.approx(1.7555, rel=0.005)  # mm, with elements of 0.8 mm


@pytest.mark.thorough
def test_effects_move_the_finger_and_none_moves_nothing():
    rows = {row[0]: row for row in printed("effects", "--space", "plane-stress", "--size", "6")}
    moved = {name: float(row[-1]) for name, row in list(rows.items())[2:]}
    assert moved.pop("none") == moved.pop("none, again") == 0.0
    assert moved["joint spring"] < 0.0 < moved["joint compliance"]
    assert moved["contact"] < 0.0
    assert all(value != 0.0 for value in moved.values())


@pytest.mark.thorough
def test_a_limit_of_stress_on_the_claw_holds_beside_its_targets():
    free, limited = designs("plane-stress")
    assert limited[3] <= 2.0 * free[3]  # evaluations
    assert all(abs(error) < 1.0 for error in limited[5:])  # displacements, the limit, and in the exported parts


@pytest.mark.slow
def test_levenberg_marquardt_gains_more_in_ten_iterations_than_bfgs():
    *_, ours, other = printed("optimisers", "truss", "--size", "3", "--limit", "10")
    assert (ours[2], other[2]) == ("LevenbergMarquardt", "BFGS")
    assert float(ours[7]) < float(other[7])  # objectives


@pytest.mark.thorough
def test_sqp_solves_every_formula_and_every_design_under_inequalities():
    rows = printed("constrained", "--limit", "60", "--methods", "SQP")
    split = next(k for k, row in enumerate(rows) if row[0] == "design")
    formulas, designs = rows[2:split], rows[split + 2 :]
    assert rows[0][1] == rows[split][1] == "SQP" and len(formulas) == 9 and len(designs) == 3
    assert all(row[1].endswith(")") and "no" not in row[1] for row in formulas)
    assert all(row[1].endswith(")") and "violated" not in row[1] for row in designs)


@pytest.mark.slow
def test_accuracy_control_is_as_accurate_as_requested_on_the_truss():
    *_, row = printed("accuracy_control", "truss", "--accuracy", "0.05", "--repeats", "1", "--levels", "2")
    asked, bound, error = (float(row[column].rstrip("%")) for column in (1, 3, 4))
    assert error <= asked and bound <= asked


@pytest.mark.slow
def test_stopping_early_moves_less_than_the_elements_err():
    table = printed("stopping", "--mechanisms", "truss", "--size", "5", "--repeats", "1")
    moved = [float(row[-1]) for row in table if row[0] == "truss" and len(row) == 5]
    assert len(moved) == 5 and max(moved) < 0.1


@pytest.mark.slow
def test_predictors_and_quadratures_give_the_same_displacement():
    table = printed("performance", "--space", "plane-stress", "--size", "6")
    shifts = {row[0]: abs(float(row[-1])) for row in table if len(row) == 6 and row[-1][-4:-2] in ("e-", "e+")}
    assert max(shift for name, shift in shifts.items() if name.startswith("predictor")) < 1e-7
    assert max(shift for name, shift in shifts.items() if name.startswith("quadrature")) < 1e-2


@pytest.mark.thorough
def test_a_run_that_takes_too_long_is_stopped_and_marked():
    *_, row = printed("solvers", "elastica, a tenth of it at once", "--limit", "0")
    assert row[1:] and set(row[1:]) == {"stopped after 0 s"}


@pytest.mark.slow
def test_two_levels_the_factor_and_algebraic_multigrid_agree():
    table = printed("large", "--sizes", "6", "--compare")
    curves = next(row for row in table if len(row) == 8 and row[0].isdigit())
    assert float(curves[-1]) <= 1e-8
    systems = {row[1]: row for row in table if row[1:] and not row[1][:1].isdigit()}
    for multigrid in ("GAMG", "BoomerAMG"):
        # the Schur complement is a difference of much larger terms
        assert float(systems[multigrid][-1]) <= 1e-5


@pytest.mark.thorough
def test_optimal_handles_stretch_cells_less_than_naive_ones():
    naive, optimal = ([float(cell) for cell in row[1:]] for row in printed("handles", "--size", "3")[2:])
    cells, mean, most, inverted, sizes = zip(naive, optimal, strict=True)
    assert cells[0] == cells[1] and inverted[1] == 0
    assert mean[1] - 1.0 < 0.75 * (mean[0] - 1.0)  # half of ρ is 1 in an equilateral triangle
    assert most[1] < most[0] and sizes[1] < sizes[0]


@pytest.mark.thorough
def test_parts_of_the_switch_meet_their_targets_and_are_kept(tmp_path):
    options = ("switch", "--size", "3", "--results", str(tmp_path))
    first = printed("parts", *options)[2:]
    assert [path.name for path in tmp_path.iterdir()] == ["switch-3.json"]
    assert len(first) == 2 and all(row[0] == "switch" and abs(float(row[-1])) < 1.0 for row in first)
    assert printed("parts", *options)[2:] == first
