"""Reports lose nothing that was computed: designs, curves of groups and motors, curves without estimated errors."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import NewtonSolver, NotConverged

from .continuation.test_motor_paths import driven_toggle
from .design.mechanisms import truss
from .equilibrium.column import EULER, column

WANTED = 2.0  # mm at 0.1 N


def figures(folder: Path) -> dict:
    return json.loads((folder / "summary.json").read_text())


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> tuple[Path, str]:
    """The folder of a design study whose links cannot hold their pins, and its error; its curve is of a group."""
    folder, problem = tmp_path_factory.mktemp("study"), truss((0.1, WANTED)).problem()
    (push,) = problem.simulation.scene.mechanism.forces
    twice = fm.ForceGroup("twice", {push: 2.0})
    curve = problem.simulation.load_displacement(twice, forces=[0.02, 0.05])
    with pytest.raises(fm.MeshingError) as caught:
        fm.design_study(folder, problem, [curve], pin_diameter=50.0)
    return folder, str(caught.value)


def test_design_whose_pins_do_not_fit_is_kept_with_all_else(study):
    folder, error = study
    assert "pin" in error
    result = fm.DesignResult.load(folder / "design.json")
    assert result.verified and result.targets[0].corrected == pytest.approx(WANTED, rel=0.01)
    assert {path.name for path in folder.iterdir()} >= {
        *("summary.json", "mechanism.png", "curve.png", "curve.csv", "links.png", "deformed.xdmf", "checkpoint.json")
    }


def test_curve_of_a_group_is_computed_again_at_the_optimum(study):
    folder, _ = study
    result, last = fm.DesignResult.load(folder / "design.json"), figures(folder)["frames"][-1]
    assert last["force"] == 0.05
    # twice the force acts, and the group's displacement is its work over its magnitude
    assert last["displacement"] == pytest.approx(2.0 * result.targets[0].reached, rel=1e-6)


def test_design_studies_check_their_curves_before_they_optimise(tmp_path, monkeypatch):
    problem = truss((0.1, WANTED)).problem()
    (push,) = problem.simulation.scene.mechanism.forces
    curve = problem.simulation.load_displacement(push, forces=[0.05])
    driven, motor, _ = driven_toggle()
    moved = driven.follow(motor, until=fm.Until(position=-0.5))
    other = truss().simulate()
    stranger = other.scene.mechanism.force(on=push.on, at=(0, 70), direction=(0, 1), name="stranger")
    foreign = other.load_displacement(stranger, forces=[0.01])
    monkeypatch.setattr(fm.DesignProblem, "optimise", lambda *_, **__: pytest.fail("optimised first"))
    for curves, message in (
        ([], "there are no curves"),
        ([curve, curve], "two curves are of configuration"),
        ([moved], "has no prescribed forces or displacements"),
        ([foreign], "not a force of"),
    ):
        with pytest.raises(fm.DescriptionError, match=message):
            fm.design_study(tmp_path, problem, curves)
    assert not list(tmp_path.iterdir())


def test_curves_of_one_configuration_or_of_no_common_axes_make_no_report_and_names_no_other_folder(tmp_path):
    simulation, motor, _ = driven_toggle()
    scene = simulation.scene
    push = scene.mechanism.forces[0]
    up, also_up = (scene.configuration(name, {motor: 0.5}) for name in ("half up", "../half-up"))
    curves = [simulation.load_displacement(push, forces=[0.0], configuration=place) for place in (up, also_up)]
    moved = simulation.follow(motor, until=fm.Until(position=-0.5))
    with pytest.raises(fm.DescriptionError, match="'half up', by which their files are named"):
        fm.write_report(tmp_path, simulation, [curves[0], curves[0]])
    with pytest.raises(fm.DescriptionError, match="no axes in common"):
        fm.write_report(tmp_path, simulation, [curves[0], moved])
    assert not list(tmp_path.iterdir())
    fm.write_report(tmp_path / "report", simulation, curves)
    assert {path.name for path in tmp_path.rglob("*.csv")} == {"curve-half-up.csv", "curve-half-up-2.csv"}
    assert [path.name for path in tmp_path.iterdir()] == ["report"]


def test_curve_of_a_motor_is_reported_without_estimates(tmp_path):
    simulation, motor, output = driven_toggle()
    curve = simulation.follow(motor, until=fm.Until(position=-2.0))
    report = fm.write_report(tmp_path, simulation, [curve])
    frames = figures(tmp_path)["frames"]
    assert [frame["displacement"] for frame in frames] == pytest.approx(curve.displacements.tolist())
    assert all(frame["force_error"] is None for frame in frames)
    table = fm.read_csv(tmp_path / "curve.csv")
    assert table["position [mm]"] == pytest.approx(curve.displacements, abs=0.0)
    assert not any("finer elements" in header for header in table)
    assert "position [mm]" in str(report)


def test_curve_with_a_singular_frame_is_reported_without_estimates(tmp_path, monkeypatch, caplog):
    case = column()
    curve = case.simulation.load_displacement(case.push, forces=[0.1 * EULER])

    def singular(*arguments, **options):
        raise NotConverged("the KKT matrix cannot be factored", 0)

    monkeypatch.setattr(NewtonSolver, "linearise", singular)
    fm.write_report(tmp_path, case.simulation, [curve])
    (frame,) = figures(tmp_path)["frames"]
    assert frame["displacement"] == curve.displacements[0] and frame["displacement_error"] is None
    assert "cannot be factored" in caplog.text
    assert "displacement [mm]" in fm.read_csv(tmp_path / "curve.csv")


def test_targets_are_marked_on_curves_of_their_own_force(tmp_path, monkeypatch):
    case, marked = truss((0.1, WANTED)), []
    (push,) = case.scene.mechanism.forces
    drag = case.scene.mechanism.force(on=push.on, at=(20, 70), direction=(-1, 0), name="drag")
    targets = [*case.targets, fm.Target(drag, force=0.05, displacement=1.0)]
    problem = fm.DesignProblem(case.simulate(size=6.0, order=1), case.designs, targets=targets)
    result = problem.optimise(optimiser=fm.LevenbergMarquardt(iterations=1))
    monkeypatch.setattr("fenicsmech.report.plot_curve", lambda *_, targets, **__: marked.extend(targets))
    for part, expected in ((push, (WANTED, 0.1)), (drag, (1.0, 0.05))):
        marked.clear()
        curve = problem.simulation.load_displacement(part, forces=[0.02])
        fm.write_report(tmp_path, problem.simulation, [curve], optimisation=fm.Optimisation(problem, result))
        assert [(own.displacement, own.force) for own in marked] == [expected]


def test_points_are_shown_where_finer_elements_put_the_unknown_of_the_curve(tmp_path, monkeypatch):
    case, shown = truss((0.1, WANTED)), []
    simulation, (push,) = case.simulate(size=6.0), case.scene.mechanism.forces
    monkeypatch.setattr("fenicsmech.report.plot_curve", lambda _, series, **__: shown.extend(series))
    for given, known in (({"forces": [0.05, 0.1]}, 1), ({"displacements": [1.0, 2.0]}, 0)):
        shown.clear()
        curve = simulation.load_displacement(push, **given)
        fm.write_report(tmp_path, simulation, [curve])
        (series,) = shown
        points, moved = (series.displacement, series.force), series.corrected.T
        assert moved[known] == pytest.approx(points[known], abs=0.0)
        expected = curve.values + curve.error_estimates()
        assert moved[1 - known] == pytest.approx(expected, rel=1e-12) and (moved[1 - known] != curve.values).all()


@pytest.mark.parallel
def test_reports_of_several_processes_are_those_of_one(shared_tmp_path):
    simulation = truss().simulate(comm=MPI.COMM_WORLD)
    push = simulation.scene.mechanism.forces[0]
    curve = simulation.load_displacement(push, forces=[0.02, 0.05])
    report = fm.write_report(shared_tmp_path, simulation, [curve])
    assert report.summary["ranks"] == MPI.COMM_WORLD.size
    alone = truss().simulate().load_displacement(push, forces=[0.02, 0.05])
    frames = report.summary["frames"]
    assert [frame["displacement"] for frame in frames] == pytest.approx(alone.displacements.tolist(), rel=1e-8)
    assert [frame["displacement_error"] for frame in frames] == pytest.approx(alone.error_estimates(), rel=1e-6)
