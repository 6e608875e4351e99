"""The table of outcomes, and the raw one with a line for each scene."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterable

from .scene_result import SceneResult


def table(results: Iterable[SceneResult]) -> str:
    """Outcomes and how often they came, in Markdown, and every scene that is wrong."""
    results = list(results)
    counts = Counter(result.outcome for result in results)
    lines = ["| outcome | scenes |", "| --- | ---: |"]
    lines += [f"| {outcome} | {count} |" for outcome, count in sorted(counts.items(), key=lambda item: _order(*item))]
    frames = sum(result.frames for result in results)
    seconds = sum(result.seconds for result in results)
    worst = max((v.residual for v in results if v.outcome == "equilibrium"), default=0.0)
    lines += [
        "",
        f"{len(results)} scenes, {frames} equilibria checked, {seconds / max(len(results), 1):.2f} s per scene; "
        f"largest relative residual {worst:.0e}; slowest scene {max((v.seconds for v in results), default=0.0):.0f} s; "
        f"wrong: {sum(result.wrong for result in results)}",
        "A seed gives this scene at this commit: wider generators draw others.",
    ]
    lines += [f"seed {v.seed} ({v.scene}): {v.outcome}: {v.detail}" for v in results if v.wrong]
    return "\n".join(lines)


def raw_table(results: Iterable[SceneResult]) -> str:
    """A line for each scene, in CSV."""
    columns = ("seed", "scene", "outcome", "seconds", "frames", "iterations", "residual", "unchecked")
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for result in results:
        row = result.record() | {"seconds": f"{result.seconds:.2f}", "residual": f"{result.residual:.1e}"}
        writer.writerow([row[column] for column in columns])
    return text.getvalue()


def _order(outcome: str, count: int) -> tuple[int, int]:
    return ["equilibrium", "designed", "refused", "true", "wrong"].index(outcome.split(" ")[0].split(":")[0]), -count
