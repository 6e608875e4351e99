"""Every demo runs as documented, leaves its files, and its numbers are the physics'."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fenicsmech as fm

from .summary import check_summary

ROOT = Path(__file__).parents[2]

# last displacement [mm] of each demo as drawn, in plane stress at element size 0.8 mm, and its rigid coordinates
DRAWN = {"truss": (1.7555, 18), "claw": (11.907, 33), "klann": (11.562, 33)}
QUICK = ("--quick", "--space", "plane-stress")


def run(name: str, folder: Path, *options: str) -> str:
    """Runs a demo as a user does; returns what it printed."""
    command = [sys.executable, str(ROOT / "demos" / f"{name}.py"), *options, "--out", str(folder)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def report(name: str, folder: Path, *options: str) -> tuple[dict, str]:
    """Runs a demo that writes a report; returns its summary and what it printed."""
    printed = run(name, folder, *options)
    summary = json.loads((folder / "summary.json").read_text())
    check_summary(summary)
    return summary, printed


def test_demos_use_nothing_below_the_package():
    for path in (ROOT / "demos").glob("*.py"):
        assert "from fenicsmech" not in path.read_text() and "import fenicsmech." not in path.read_text()


def check_drawn(name: str, summary: dict, frames: list[dict], folder: Path) -> None:
    """The curve of the drawn mechanism is stable and has the known end; pictures, and files per configuration."""
    displacement, rigid = DRAWN[name]
    assert summary["dofs"]["rigid"] == rigid
    assert all(frame["stable"] for frame in frames)
    assert frames[-1]["displacement"] == pytest.approx(displacement, rel=0.005)
    files = {path.name for path in folder.iterdir()}
    assert {"mechanism.png", "curve.png"} <= files
    configurations = {frame["configuration"] for frame in frames}
    for kind in (".xdmf", ".csv"):
        assert len([file for file in files if file.endswith(kind)]) == len(configurations)
    assert summary["peak_memory_mb"] < 1500.0
    assert np.median([frame["iterations"] for frame in frames]) <= 4


@pytest.mark.thorough
def test_drawn_claw_yields_as_known(tmp_path):
    summary, _ = report("claw", tmp_path, "--space", "plane-stress", "--simulate-only")
    check_drawn("claw", summary, summary["frames"], tmp_path)


def test_truss_is_soft_first_and_stiff_once_its_diagonal_is_straight(tmp_path):
    summary, printed = report("truss", tmp_path, *QUICK, "--simulate-only")
    check_drawn("truss", summary, summary["frames"], tmp_path)
    assert "seconds per loaded equilibrium" in printed
    u = np.array([frame["displacement"] for frame in summary["frames"]])
    f = np.array([frame["force"] for frame in summary["frames"]])
    stiffness = np.diff(f) / np.diff(u)
    assert stiffness[-1] > 5.0 * stiffness[0]


def check_design(summary: dict, folder: Path, thickness: tuple[float, float]) -> None:
    """Every target within 1 %, inside the bounds of fabrication, every equilibrium stable, all files there."""
    for target in summary["targets"]:
        assert target["corrected"] == pytest.approx(target["wanted"], rel=0.01)
    least, most = summary["thickness"]
    assert thickness[0] <= least <= most <= thickness[1]
    assert summary["curvature_ratio_max"] <= 0.08
    assert summary["mesh_ratio_max"] <= 30.0
    assert summary["verified"]
    assert all(frame["stable"] for frame in summary["frames"])
    assert summary["objective"]["final"] < 0.05 * summary["objective"]["initial"]
    # the curve of the optimised mechanism runs through the targets
    frames = {(frame["configuration"], frame["force"]): frame["displacement"] for frame in summary["frames"]}
    for target in summary["targets"]:
        there = frames[target["configuration"], target["force"]]
        assert there == pytest.approx(target["reached"], rel=1e-6)
    assert {"links.png", "design.json", "curve.png", "mechanism.png"} <= {path.name for path in folder.iterdir()}
    solids = {path.suffix for path in (folder / "links").iterdir()}
    assert solids == {".step", ".stl", ".json"}
    assert fm.DesignResult.load(folder / "design.json").parameters == summary["parameters"]


THICKNESS = {"truss": (1.5, 6.0), "klann": (1.0, 9.0)}
PARAMETERS = {"truss": 18, "klann": 57}


@pytest.fixture(scope="module")
def truss_alone(tmp_path_factory) -> tuple[dict, str, Path]:
    """The quick design of the truss on one rank: its summary, what it printed, its folder."""
    folder = tmp_path_factory.mktemp("truss")
    return *report("truss", folder, *QUICK), folder


@pytest.mark.thorough
def test_truss_reaches_its_targets_with_a_tapered_diagonal_from_a_step_file(tmp_path):
    part = str(ROOT / "meshes" / "diagonal.step")
    summary, _ = report("truss", tmp_path, *QUICK, "--part", part)
    check_design(summary, tmp_path, THICKNESS["truss"])
    assert summary["parameters"] == PARAMETERS["truss"]
    for target in summary["targets"]:
        assert target["part"]["value"] == pytest.approx(target["wanted"], rel=0.01)


def check_quick(name: str, summary: dict, printed: str, folder: Path) -> None:
    check_drawn(name, summary, summary["initial_frames"], folder)
    check_design(summary, folder, THICKNESS[name])
    assert summary["parameters"] == PARAMETERS[name]
    assert "optimisation:" in printed


def test_quick_truss_reaches_its_targets_in_plane_stress(truss_alone):
    check_quick("truss", *truss_alone)


@pytest.mark.slow
def test_quick_klann_leg_reaches_its_targets_in_plane_stress(tmp_path):
    check_quick("klann", *report("klann", tmp_path, *QUICK), tmp_path)
    assert (tmp_path / "foot-path.png").exists()


@pytest.mark.slow
def test_quick_truss_reaches_its_targets_in_space(tmp_path):
    summary, _ = report("truss", tmp_path, "--quick")
    assert summary["space"] == "3d"
    check_design(summary, tmp_path, THICKNESS["truss"])


@pytest.mark.thorough
def test_lightest_claw_keeps_its_bounds(tmp_path):
    summary, _ = report("claw", tmp_path, *QUICK, "--least-mass")
    assert summary["parameters"] == 69
    *bounded, mass = summary["targets"]
    assert mass["relation"] == "least" and mass["configuration"] is None
    assert summary["objective"]["final"] < summary["objective"]["initial"] == 1.0
    for target in bounded:
        assert target["relation"] == "at most"
        assert target["corrected"] <= 1.002 * target["wanted"]  # a violation of 0.1 % and a correction as exact
        assert target["part"]["value"] <= 1.01 * target["wanted"]
    least, most = summary["thickness"]
    assert 2.0 <= least <= most <= 9.0
    assert all(frame["stable"] for frame in summary["frames"])


@pytest.mark.thorough
def test_two_ranks_give_the_same_curve_and_continue_to_the_same_optimum(truss_alone, tmp_path, mpirun):
    alone, _, folder = truss_alone
    shutil.copy(folder / "checkpoint.json", tmp_path)
    done = mpirun(2, ROOT / "demos" / "truss.py", *QUICK, "--resume", "--out", str(tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr
    shared = json.loads((tmp_path / "summary.json").read_text())
    assert shared["ranks"] == 2
    for one, two in zip(alone["initial_frames"], shared["initial_frames"], strict=True):
        assert two["displacement"] == pytest.approx(one["displacement"], rel=1e-9, abs=1e-12)
    designs = [json.loads((folder / "design.json").read_text())["links"] for folder in (folder, tmp_path)]
    for one, two in zip(*designs, strict=True):
        assert two["parameters"] == pytest.approx(one["parameters"], rel=1e-6, abs=1e-6)
    assert shared["iterations"] >= alone["iterations"]
    assert shared["objective"]["final"] <= (1.0 + 1e-6) * alone["objective"]["final"]


def test_characterisation_finds_the_modulus_of_the_synthetic_data(tmp_path):
    printed = run("characterise", tmp_path, "--space", "plane-stress", "--size", "2")
    figures = json.loads((tmp_path / "summary.json").read_text())
    assert figures["youngs_modulus"] == pytest.approx(figures["true"], rel=0.02)
    assert "95 % interval" in printed
    assert (tmp_path / "curve.png").exists()


@pytest.mark.slow
def test_characterisation_in_space_holds_the_true_modulus_in_its_interval(tmp_path):
    run("characterise", tmp_path, "--quick", "--space", "3d-symmetric")
    figures = json.loads((tmp_path / "summary.json").read_text())
    assert figures["youngs_modulus"] == pytest.approx(figures["true"], rel=0.01)
    assert figures["interval"][0] < figures["true"] < figures["interval"][1]


@pytest.mark.thorough
def test_force_of_the_designed_spring_is_constant_in_the_exported_strut(tmp_path):
    summary, printed = report("constant_force", tmp_path, "--quick")
    assert "from 2 to 8 mm" in printed
    there = [frame["force"] for frame in summary["frames"] if 1.99 <= frame["displacement"] <= 8.01]
    before = [frame["force"] for frame in summary["initial_frames"] if 1.99 <= frame["displacement"] <= 8.01]
    assert len(there) == len(before) == 13
    assert max(map(abs, np.array(there) / 8.0 - 1.0)) < 0.01
    assert max(before) / min(before) > 1.07
    for target in summary["targets"]:
        assert target["part"]["value"] == pytest.approx(8.0, rel=0.01)
    assert {path.name for path in (tmp_path / "parts").iterdir()} == {"strut.step"}


@pytest.mark.thorough
def test_designed_switch_snaps_at_1_newton_and_rests_15_mm_away(tmp_path):
    run("switch", tmp_path, "--quick")
    figures = json.loads((tmp_path / "summary.json").read_text())
    assert figures["snap_force"] == pytest.approx(1.0, abs=0.01)
    assert figures["force_at_rest"] == pytest.approx(0.0, abs=0.01)
    assert figures["stable"]
    assert figures["part_error"] < 0.01
    assert {"curve.png", "links.png", "design.json"} <= {path.name for path in tmp_path.iterdir()}


@pytest.mark.thorough
def test_contact_points_of_the_designed_gripper_move_by_the_wanted_vectors(tmp_path):
    summary, _ = report("gripper", tmp_path, "--quick")
    wanted = [target["wanted"] for target in summary["targets"]]
    assert wanted == [[2.0, 0.0], [7.0, 0.9]]
    for target in summary["targets"]:
        size = np.linalg.norm(target["wanted"])
        assert np.linalg.norm(np.subtract(target["corrected"], target["wanted"])) < 0.01 * size
        assert np.linalg.norm(np.subtract(target["part"]["value"], target["wanted"])) < 0.02 * size


@pytest.mark.thorough
def test_wheel_of_the_designed_suspension_leans_and_resists_as_wanted(tmp_path):
    summary, _ = report("suspension", tmp_path, "--quick")
    force, bump, rebound = (target["part"]["value"] for target in summary["targets"])
    assert force == pytest.approx(900.0, rel=1e-3)
    assert np.degrees([bump, rebound]) == pytest.approx([0.4, -0.1], abs=1e-3)
    drawn = [frame["force"] for frame in summary["initial_frames"]]
    assert drawn[-1] != pytest.approx(900.0, rel=5e-3)
    assert {path.name for path in (tmp_path / "parts").iterdir()} == {"upper-arm.step"}


@pytest.mark.thorough
def test_switch_snaps_behind_its_spring_only(tmp_path):
    printed = run("snap", tmp_path, "--size", "3")
    direct, sprung = ([line for line in printed.splitlines() if line.startswith(f"{how}: limit point")]
                      for how in ("pushed directly", "through a spring"))  # fmt: skip
    forces = [float(line.split(", ")[-1].removesuffix(" N")) for line in direct]
    assert len(direct) == len(sprung) == 2
    assert forces[0] > 0.0 > forces[1]  # the crank has a second rest
    assert "turning point" in printed and "snaps after" in printed
    files = {path.name for path in tmp_path.iterdir()}
    assert files == {"curve.png", "crank.png", "switch.png", "switch-behind-a-spring.png"}
