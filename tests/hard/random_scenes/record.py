"""Verdicts on disk, one per line, so that a run that was stopped goes on where it was."""

from __future__ import annotations

import json
from pathlib import Path

from .scene_result import SceneResult


def read(path: Path) -> dict[int, SceneResult]:
    """Verdicts by seed; a line cut short by a stop is left out."""
    results = {}
    if path.exists():
        for line in path.read_text().splitlines():
            try:
                result = SceneResult(**json.loads(line))
            except ValueError:
                continue
            results[result.seed] = result
    return results


def append(path: Path, result: SceneResult) -> None:
    """Adds one line."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as file:
        file.write(json.dumps(result.record()) + "\n")
