"""The README's example runs as printed, from description to shapes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

README = Path(__file__).parents[1] / "README.md"


def test_example_gives_a_stiffening_stable_curve_a_design_and_their_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", README.read_text(), flags=re.S)
    names: dict = {}
    exec(compile(code, str(README), "exec"), names)  # the project's own file
    curve = names["curve"]
    assert np.all(curve.stable)
    assert np.all(np.diff(curve.displacements) > 0)
    stiffness = np.diff(curve.forces) / np.diff(curve.displacements)
    assert np.all(np.diff(stiffness) > 0)
    result = names["result"]
    assert result.worst_error < 0.01
    assert 1.5 <= result.thickness[0] <= result.thickness[1] <= 6.0
    files = {path.name for path in (*tmp_path.iterdir(), *(tmp_path / "links").iterdir())}
    assert {"curve.png", "finger.png", "finger.xdmf", "finger.h5"} <= files
    assert {"links.png", "optimised.png", "design.json", "diagonal.step", "diagonal.stl"} <= files
