"""Every demo runs as documented, leaves its files, and its numbers are the physics'."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from .summary import check_summary

ROOT = Path(__file__).parents[2]

# last displacement [mm] of each demo in plane stress at element size 0.8 mm, and its rigid coordinates
DEMOS = {"truss": (1.7555, 18), "claw": (11.907, 33), "klann": (11.562, 33)}


def run(name: str, folder: Path, *options: str) -> tuple[dict, str]:
    """Runs a demo as a user does; returns its summary and what it printed."""
    command = [sys.executable, str(ROOT / "demos" / f"{name}.py"), *options, "--out", str(folder)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "summary.json").read_text()), done.stdout


@pytest.mark.parametrize("name", DEMOS)
def test_demo_leaves_a_valid_summary_pictures_and_a_stable_curve(name, tmp_path):
    summary, printed = run(name, tmp_path, "--space", "plane-stress", "--simulate-only")
    displacement, rigid = DEMOS[name]
    check_summary(summary)
    assert summary["dofs"]["rigid"] == rigid
    assert all(frame["stable"] for frame in summary["frames"])
    assert summary["frames"][-1]["displacement"] == pytest.approx(displacement, rel=0.005)
    assert "frame_median" in printed
    files = {path.name for path in tmp_path.iterdir()}
    assert {"mechanism.png", "curve.png"} <= files
    configurations = {frame["configuration"] for frame in summary["frames"]}
    assert len([file for file in files if file.endswith(".xdmf")]) == len(configurations)
    assert summary["peak_memory_mb"] < 1500.0
    assert summary["seconds"]["frame_median"] < 0.1


def test_truss_is_soft_first_and_stiff_once_its_diagonal_is_straight(tmp_path):
    summary, _ = run("truss", tmp_path, "--quick", "--space", "plane-stress", "--simulate-only")
    u = np.array([frame["displacement"] for frame in summary["frames"]])
    f = np.array([frame["force"] for frame in summary["frames"]])
    stiffness = np.diff(f) / np.diff(u)
    assert stiffness[-1] > 5.0 * stiffness[0]


def check_design(summary: dict, folder: Path, thickness: tuple[float, float]) -> None:
    """Every target within 1 %, inside the bounds of fabrication, every equilibrium stable, all files there."""
    check_summary(summary)
    for target in summary["targets"]:
        assert target["reached"] == pytest.approx(target["wanted"], rel=0.01)
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
    assert solids == {".step", ".stl"}


THICKNESS = {"truss": (1.5, 6.0), "claw": (1.0, 9.0), "klann": (1.0, 9.0)}
PARAMETERS = {"truss": 18, "claw": 69, "klann": 57}


QUICK = ("--quick", "--space", "plane-stress")


@pytest.fixture(scope="module")
def truss_alone(tmp_path_factory) -> tuple[dict, str, Path]:
    """The quick design of the truss on one rank: its summary, what it printed, its folder."""
    folder = tmp_path_factory.mktemp("truss")
    return *run("truss", folder, *QUICK), folder


def check_quick(name: str, summary: dict, printed: str, folder: Path) -> None:
    check_design(summary, folder, THICKNESS[name])
    assert summary["parameters"] == PARAMETERS[name]
    assert "optimize:" in printed


def test_quick_truss_reaches_its_targets_in_plane_stress(truss_alone):
    check_quick("truss", *truss_alone)


@pytest.mark.parametrize("name", ["claw", pytest.param("klann", marks=pytest.mark.slow)])
def test_quick_demo_reaches_its_targets_in_plane_stress(name, tmp_path):
    check_quick(name, *run(name, tmp_path, *QUICK), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", DEMOS)
def test_quick_demo_reaches_its_targets_in_space(name, tmp_path):
    summary, _ = run(name, tmp_path, "--quick")
    check_design(summary, tmp_path, THICKNESS[name])
    assert len(summary["plane_stress"]["reached_in_3d"]) == len(summary["targets"])


def test_two_ranks_give_the_same_curve_and_the_same_optimum(truss_alone, tmp_path, mpirun):
    alone, _, folder = truss_alone
    done = mpirun(2, ROOT / "demos" / "truss.py", *QUICK, "--out", str(tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr
    shared = json.loads((tmp_path / "summary.json").read_text())
    assert shared["ranks"] == 2
    for one, two in zip(alone["initial_frames"], shared["initial_frames"], strict=True):
        assert two["displacement"] == pytest.approx(one["displacement"], rel=1e-9, abs=1e-12)
    designs = [json.loads((folder / "design.json").read_text())["links"] for folder in (folder, tmp_path)]
    for one, two in zip(*designs, strict=True):
        assert two["parameters"] == pytest.approx(one["parameters"], rel=1e-6, abs=1e-6)


@pytest.mark.slow
def test_characterisation_finds_the_modulus_of_the_synthetic_data(tmp_path):
    summary, printed = run("characterize", tmp_path, "--quick")
    check_summary(summary)
    modulus = summary["youngs_modulus"]
    assert modulus["fitted"] == pytest.approx(modulus["true"], rel=0.01)
    assert modulus["interval"][0] < modulus["true"] < modulus["interval"][1]
    assert "95 % interval" in printed
    assert (tmp_path / "curve.png").exists()
