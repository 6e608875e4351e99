"""The table of outcomes, and the raw one with a line for each scene."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterable

from .designs import UNMET
from .reasons import HELD
from .scene_result import DESIGNS, INVALID_SHARE, ROUNDED, SceneResult
from .thresholds import THRESHOLDS

_EXCUSED = ("true", "designed: not verified")


def table(results: Iterable[SceneResult]) -> str:
    """Outcomes and how often they came, the numbers that prove errors, what the scenes have, and all that is wrong."""
    results = list(results)
    outcomes = sorted(Counter(result.outcome for result in results).items(), key=lambda item: _order(*item))
    lines = ["| outcome | scenes | proof |", "| --- | ---: | --- |"]
    for outcome, count in outcomes:
        proofs = [result.proof for result in results if result.outcome == outcome and result.proof]
        lines.append(f"| {outcome} | {count} | {_range(proofs)} |")
    frames = sum(result.frames for result in results)
    cpu = sum(result.cpu for result in results)
    worst = max((v.residual for v in results if v.outcome == "equilibrium"), default=0.0)
    lines += [
        "",
        f"{len(results)} scenes, {frames} equilibria checked; largest relative residual {worst:.0e}; "
        f"{cpu / max(len(results), 1):.2f} s of a processor per scene, slowest scene "
        f"{max((v.cpu for v in results), default=0.0):.0f} s of it; wrong: {sum(result.wrong for result in results)}",
        "A seed gives this scene at this commit: wider generators draw others.",
        "",
        *_coverage(results),
    ]
    lines += [f"{text}." for text in excessive(results)]
    lines += [f"seed {v.seed} ({v.scene}): {v.outcome}: {v.detail}" for v in results if v.wrong]
    return "\n".join(lines)


def excessive(results: Iterable[SceneResult]) -> list[str]:
    """Excuses, and checks left out, that let off more scenes than they may: alone, and excuses all together.

    Shares are those of scenes that make sense; of designs, of these.
    """
    results, found = list(results), []
    sound = [result for result in results if _sound(result)]
    designs = [result for result in sound if _design(result)]
    excused = Counter(result.outcome for result in sound if result.outcome.startswith(_EXCUSED))
    held = sum(count for outcome, count in excused.items() if outcome.endswith(HELD))
    lets_off = [(repr(outcome), count, THRESHOLDS.excused) for outcome, count in excused.items() if HELD not in outcome]
    lets_off += [
        (f"{HELD!r}", held, THRESHOLDS.held),
        ("the sum of all other excuses", excused.total() - held, THRESHOLDS.excused_together),
        (f"{ROUNDED!r}", sum(result.outcome == ROUNDED for result in sound), THRESHOLDS.rounded_share),
    ]
    unchecked = Counter(word for result in sound for word in result.unchecked.split(" and ") if word)
    lets_off += [(f"no check of the {word}", count, THRESHOLDS.unchecked[word]) for word, count in unchecked.items()]
    for what, count, share in lets_off:
        if count > (most := THRESHOLDS.spare + share * len(sound)):
            found.append(f"{what} lets off {count} scenes of {len(sound)}, more than {most:.0f}")
    unmet = sum(result.outcome == UNMET for result in designs)
    if unmet > (most := THRESHOLDS.spare + THRESHOLDS.unmet * len(designs)):
        found.append(f"{UNMET!r} lets off {unmet} designs of {len(designs)}, more than {most:.0f}")
    return found


def _sound(result: SceneResult) -> bool:
    """Whether a scene makes sense."""
    return _design(result) or result.seed % 10 >= INVALID_SHARE


def _design(result: SceneResult) -> bool:
    return result.seed % DESIGNS == DESIGNS - 1


def _range(proofs: list[str]) -> str:
    """The numbers of proofs that differ in them alone: their name, the least and the largest."""
    if not proofs:
        return ""
    numbers = sorted(float(proof.rsplit(" ", 1)[1]) for proof in proofs)
    return f"{proofs[0].rsplit(' ', 1)[0]} {numbers[0]:.1e}" + (f" to {numbers[-1]:.1e}" if len(numbers) > 1 else "")


def _coverage(results: list[SceneResult]) -> list[str]:
    """How many of the scenes that make sense have each space, order, control, effect and so on."""
    sound = [result for result in results if _sound(result) and not _design(result)]
    counts = Counter(word for result in sound for word in set(result.scene.split(", ")) if word)
    kinds = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    designs = sum(map(_design, results))
    return [
        f"Of {len(sound)} scenes that make sense, besides {designs} designs, so many have",
        "",
        "| property | scenes |",
        "| --- | ---: |",
        *(f"| {kind} | {count} |" for kind, count in kinds),
        "",
    ]


def raw_table(results: Iterable[SceneResult]) -> str:
    """A line for each scene, in CSV."""
    columns = ("seed", "scene", "outcome", "proof", "seconds", "cpu", "frames", "iterations", "residual", "unchecked")
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for result in results:
        row = result.record() | {
            "seconds": f"{result.seconds:.2f}",
            "cpu": f"{result.cpu:.2f}",
            "residual": f"{result.residual:.1e}",
        }
        writer.writerow([row[column] for column in columns])
    return text.getvalue()


def _order(outcome: str, count: int) -> tuple[int, int]:
    return ["equilibrium", "designed", "refused", "true", "wrong"].index(outcome.split(" ")[0].split(":")[0]), -count
