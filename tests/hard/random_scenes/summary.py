"""The table of outcomes."""

from __future__ import annotations

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
        f"largest relative residual {worst:.0e}; wrong: {sum(result.wrong for result in results)}",
    ]
    lines += [f"seed {v.seed} ({v.scene}): {v.outcome}: {v.detail}" for v in results if v.wrong]
    return "\n".join(lines)


def _order(outcome: str, count: int) -> tuple[int, int]:
    return ["equilibrium", "refused", "true", "wrong"].index(outcome.split(" ")[0].split(":")[0]), -count
