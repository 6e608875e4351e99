"""The work–precision benchmark runs as documented and its figures agree with each other."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_quick_study_of_the_truss_leaves_table_plot_and_summary(tmp_path):
    command = [sys.executable, "-m", "benchmarks.work_precision", "truss", "--quick", "--out", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"table.csv", "table.md", "summary.json", "work-precision.png"}
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["failures"] == {}
    assert summary["reference"] == pytest.approx(1.737, rel=0.01)
    assert summary["reference_uncertainty_percent"] < 1.0
    assert summary["limits"]["plane-stress"]["value"] == pytest.approx(1.7555, rel=0.005)
    assert summary["front"][0]["level"] == "rigid"
    with open(tmp_path / "table.csv", encoding="utf-8", newline="") as file:
        rows = {row["level"]: row for row in csv.DictReader(file)}
    assert {point["level"] for point in summary["front"]} == {
        name for name, row in rows.items() if row["on the front"] == "yes"
    }
    for row in rows.values():
        parts = sum(float(row[f"{part} error [%]"]) for part in ("modelling", "discretisation", "algebraic"))
        assert float(row["error [%]"]) == pytest.approx(parts, abs=1e-9)
    assert "| 3D P2 h×1 " in done.stdout
