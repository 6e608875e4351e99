"""The table of outcomes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from .verdict import Verdict


def table(verdicts: Iterable[Verdict]) -> str:
    """Outcomes and how often they came, in Markdown, and every scene that is wrong."""
    verdicts = list(verdicts)
    counts = Counter(verdict.outcome for verdict in verdicts)
    lines = ["| outcome | scenes |", "| --- | ---: |"]
    lines += [f"| {outcome} | {count} |" for outcome, count in sorted(counts.items(), key=lambda item: _order(*item))]
    frames = sum(verdict.frames for verdict in verdicts)
    seconds = sum(verdict.seconds for verdict in verdicts)
    worst = max((v.residual for v in verdicts if v.outcome == "equilibrium"), default=0.0)
    lines += [
        "",
        f"{len(verdicts)} scenes, {frames} equilibria checked, {seconds / max(len(verdicts), 1):.2f} s per scene; "
        f"largest relative residual {worst:.0e}; wrong: {sum(verdict.wrong for verdict in verdicts)}",
    ]
    lines += [f"seed {v.seed} ({v.scene}): {v.outcome}: {v.detail}" for v in verdicts if v.wrong]
    return "\n".join(lines)


def _order(outcome: str, count: int) -> tuple[int, int]:
    return ["equilibrium", "refused", "true", "wrong"].index(outcome.split(" ")[0].split(":")[0]), -count
