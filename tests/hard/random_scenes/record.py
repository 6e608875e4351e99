"""Verdicts on disk, one per line, so that a run that was stopped goes on where it was."""

from __future__ import annotations

import json
from pathlib import Path

from .verdict import Verdict


def read(path: Path) -> dict[int, Verdict]:
    """Verdicts by seed; a line cut short by a stop is left out."""
    verdicts = {}
    if path.exists():
        for line in path.read_text().splitlines():
            try:
                verdict = Verdict(**json.loads(line))
            except ValueError:
                continue
            verdicts[verdict.seed] = verdict
    return verdicts


def append(path: Path, verdict: Verdict) -> None:
    """Adds one line."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as file:
        file.write(json.dumps(verdict.record()) + "\n")
