"""Judges error estimates on random scenes: `python -m tests.hard.random_scenes.effectivity`.

The effectivity of an estimate is the estimate over the true difference. That of the elements is the difference from
elements a quarter as wide of the same outline, in space half as wide in all directions, and of order 2 at least; that
of plane stress the difference between both models in such elements, each with its own estimate added.
Where it is not within a factor of two, the scene must say so: by a doubt of the estimate (``Curve.doubts``), or because
the difference is below resolution. Judged are estimates alone, and those from finer elements
(``Curve.checked_errors``). Elements are 0.9 to 1.5 times as wide as their link is thick; designs are those of
exported parts.

Estimators that fail are wrong, as checked errors are that are off without a doubt. The exit code is 1 then, and where
more of them are in doubt, rightly or needlessly, or more scenes left out, than ``THRESHOLDS`` allow. Results are kept
in DIR/seed-SEED.jsonl; the same command goes on after an interruption.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import fenicsmech as fm
from benchmarks.table import command, publish, revision

from .blueprint import Blueprint, ContactPlan
from .designs import DesignScene, design_problem, design_scene
from .finer import Finer, Shapes, Unsolved, coarse_curve, finer, most_unknowns
from .generator import random_scene
from .record import CODE, OtherCode, append, read
from .scene_result import DESIGNS, INVALID_SHARE
from .thresholds import THRESHOLDS
from .worker import Crashed, side_by_side

FIRST, COUNT = 20_000, 300
"""The block of scenes that is judged, which nothing was built on."""

_UNKNOWNS = 200_000  # of finer meshes; scenes with more are left out
_FRAMES = 60  # of a path
_CHECKED = ", checked"
_ENDS = ("within", "said", "below resolution", "outside")


@dataclass(frozen=True)
class Estimate:
    """One kind of error of one scene.

    Attributes:
        estimate: of the error.
        difference: the true one.
        resolution: smallest difference that stands out of rounding and the errors of what it is compared with.
        doubts: what the scene says against the estimate.
        failure: the error of the estimator, if it has one in place of an estimate.
    """

    estimate: float = math.nan
    difference: float = math.nan
    resolution: float = 0.0
    doubts: tuple[str, ...] = ()
    failure: str = ""

    @property
    def effectivity(self) -> float:
        """Estimate over difference."""
        return self.estimate / self.difference if self.difference else math.inf

    @property
    def outcome(self) -> str:
        """ "within", "below resolution", "said" or "outside"."""
        if 1.0 / THRESHOLDS.effectivity <= self.effectivity <= THRESHOLDS.effectivity:
            return "within"
        if max(abs(self.difference), abs(self.estimate)) <= self.resolution:
            return "below resolution"
        return "said" if self.doubts else "outside"


@dataclass(frozen=True)
class Judged:
    """The estimates of one scene.

    Attributes:
        seed: of the scene.
        scene: in a few words.
        value: the displacement or force.
        elements: the error of its elements.
        plane_stress: of plane stress; None in other models.
        checked_elements: the first one from finer elements.
        checked_plane_stress: the second one from these.
        left_out: why nothing is compared, empty if something is.
        seconds: wall-clock time.
    """

    seed: int
    scene: str
    value: float = 0.0
    elements: Estimate | None = None
    plane_stress: Estimate | None = None
    checked_elements: Estimate | None = None
    checked_plane_stress: Estimate | None = None
    left_out: str = ""
    seconds: float = 0.0

    @property
    def kinds(self) -> dict[str, Estimate]:
        """The estimates by what they are of."""
        designed = self.seed % DESIGNS == DESIGNS - 1
        where = "designs" if designed else "in space" if ", 3d" in self.scene else "in the plane"
        elements, plane_stress = f"elements, {where}", f"plane stress{', designs' * designed}"
        found = {
            elements: self.elements,
            plane_stress: self.plane_stress,
            f"{elements}{_CHECKED}": self.checked_elements,
            f"{plane_stress}{_CHECKED}": self.checked_plane_stress,
        }
        return {kind: estimate for kind, estimate in found.items() if estimate is not None}

    @property
    def checked(self) -> list[Estimate]:
        """Those from finer elements."""
        return [estimate for kind, estimate in self.kinds.items() if kind.endswith(_CHECKED)]

    @classmethod
    def read(cls, fields: dict[str, Any]) -> Judged:
        """From a line of the file of results."""
        for name in ("elements", "plane_stress", "checked_elements", "checked_plane_stress"):
            if own := fields[name]:
                fields = {**fields, name: Estimate(**{**own, "doubts": tuple(own["doubts"])})}
        return cls(**fields)


def seeds(first: int, count: int) -> list[int]:
    """The first ``count`` seeds from one on of designs, and of scenes that make sense."""
    found = []
    while len(found) < count:
        if first % DESIGNS == DESIGNS - 1 or first % 10 >= INVALID_SHARE:
            found.append(first)
        first += 1
    return found


def judge(seed: int) -> Judged:
    """The effectivities of a scene or design."""
    start, designed = time.perf_counter(), seed % DESIGNS == DESIGNS - 1
    found = _judge_design(seed) if designed else judge_scene(seed, random_scene(seed))
    return replace(found, seconds=time.perf_counter() - start)


def judge_scene(seed: int, blueprint: Blueprint) -> Judged:
    """The effectivities at the last equilibrium of a scene."""
    scene = _stiffly_touching(replace(blueprint, samples=blueprint.samples[-1:], most=_FRAMES))
    try:
        return _compared(seed, scene)
    except Unsolved as failure:
        return Judged(seed, scene.summary, left_out=str(failure))


def _judge_design(seed: int) -> Judged:
    """The effectivities of the exported parts of a design."""
    problem = design_scene(seed)
    try:
        found = _compared_parts(seed, problem)
    except Unsolved as failure:
        found = Judged(seed, "", left_out=str(failure))
    return replace(found, scene=problem.summary)


def _compared_parts(seed: int, problem: DesignScene) -> Judged:
    """The effectivities of the parts of a design; raises as ``_compared``."""
    scene = problem.blueprint
    _check_size(scene)
    if scene.forces[0].on in problem.links:
        raise Unsolved("a force on a point that the design moves")
    curve, built = coarse_curve(scene)
    with tempfile.TemporaryDirectory() as folder:
        try:
            design = design_problem(problem, built, problem.factor * curve.frames[0].displacement)
            design.export(folder, design.optimise())
        except fm.FenicsmechError as failure:
            raise Unsolved(f"{type(failure).__name__} of the design") from failure
        parts = {
            built.links[name]: fm.step_file(Path(folder) / f"{name}.step", depth=scene.link(name).depth)
            for name in problem.links
        }
        return _compared(seed, scene, parts)


def _check_size(scene: Blueprint) -> None:
    if most_unknowns(scene) > _UNKNOWNS:
        raise Unsolved("too large")


def _compared(seed: int, scene: Blueprint, shapes: Shapes | None = None) -> Judged:
    """The effectivities of a scene.

    Raises:
        Unsolved: it is too large, or an equilibrium of it, or of finer elements, is not found.
    """
    _check_size(scene)
    curve, _ = coarse_curve(scene, shapes)
    value, better = float(curve.values[-1]), replace(scene, order=max(scene.order, 2))
    resolution = THRESHOLDS.resolved * abs(value)
    if scene.control == "forces":
        resolution += THRESHOLDS.still * scene.length

    @cache
    def fine() -> Finer:
        return finer(better, curve, 1 if scene.space.startswith("3d") else 2, shapes)

    def elements(error: float, doubts: tuple[str, ...]) -> Estimate:
        return Estimate(error, fine().value - value, resolution, doubts)

    @cache
    def space_adds() -> tuple[float, float]:
        deep, flat = finer(replace(better, space="3d-symmetric", order=2), curve, 1, shapes), fine()
        return deep.value + deep.error - flat.value - flat.error, abs(deep.error) + abs(flat.error)

    def plane_stress(error: float, doubts: tuple[str, ...]) -> Estimate:
        added, unknown = space_adds()
        return Estimate(error, added, resolution + unknown, doubts)

    found: list[Estimate | None] = []
    for checked in (False, True):
        for judged, modelling in ((elements, False), (plane_stress, True)):
            here = scene.space == "plane-stress" or not modelling
            found.append(_estimated(partial(_told, curve, modelling, checked), judged) if here else None)
    return Judged(seed, scene.summary, value, *found)


def _told(curve: fm.Curve, modelling: bool, checked: bool) -> tuple[float, tuple[str, ...]]:
    """What a curve tells of the error of its last value, and its doubts."""
    if checked:
        own = curve.checked_errors(modelling=modelling, frame=curve.frames[-1])
        return float(own.errors[0]), own.doubts[0]
    errors, doubts = (
        curve.modelling_errors() if modelling else curve.error_estimates(),
        curve.doubts(modelling=modelling),
    )
    return float(errors[-1]), doubts[-1]


def _estimated(told: Callable[[], tuple], judged: Callable[..., Estimate]) -> Estimate:
    """A ``judged`` estimate that is ``told``; outside where the estimator fails at an equilibrium."""
    try:
        return judged(*told())
    except fm.FenicsmechError as failure:
        return Estimate(failure=f"{type(failure).__name__}: {failure}")


def _stiffly_touching(scene: Blueprint) -> Blueprint:
    """With a stiffness of contact that does not depend on the elements."""
    effects = [
        replace(plan, stiffness=0.1 * scene.link(plan.link).young / scene.link(plan.link).thickness)
        if isinstance(plan, ContactPlan) and plan.stiffness is None
        else plan
        for plan in scene.effects
    ]
    return replace(scene, effects=tuple(effects))


def table(judged: Sequence[Judged]) -> str:
    """Shares of scenes by outcome, and of doubts by whether they were right, in Markdown; what is wrong; and times."""
    estimates = [(found, kind, own) for found in judged for kind, own in found.kinds.items()]
    lines = ["| estimate of | scenes | within | the scene says so | below resolution | outside | doubted, but within |"]
    lines.append("| --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for kind in sorted({kind for _, kind, _ in estimates}):
        every = [own for _, of, own in estimates if of == kind]
        outcomes = Counter(own.outcome for own in every)
        needless = sum(own.outcome == "within" and bool(own.doubts) for own in every)
        lines.append(f"| {kind} | {len(every)} | {' | '.join(str(outcomes[end]) for end in _ENDS)} | {needless} |")
    lines += ["", "| doubt | not within | within | below resolution |", "| --- | ---: | ---: | ---: |"]
    for doubt in sorted({doubt for _, _, own in estimates for doubt in own.doubts}):
        ends = Counter(own.outcome for _, _, own in estimates if doubt in own.doubts)
        lines.append(f"| {doubt} | {ends['said']} | {ends['within']} | {ends['below resolution']} |")
    left_out = Counter(found.left_out for found in judged if found.left_out)
    counts = ", ".join(f"{name} {count}" for name, count in left_out.most_common()) or "nothing"
    seconds = [found.seconds for found in judged]
    lines += [
        "",
        f"Seeds {judged[0].seed} to {judged[-1].seed}: {len(judged) - left_out.total()} of {len(judged)} scenes "
        f"compared; left out: {counts}; {sum(seconds) / len(seconds):.1f} s per scene, {max(seconds):.0f} s at most",
        *(f"{fault}." for fault in faults(judged)),
    ]
    for found, kind, own in estimates:
        if own.outcome == "outside":
            figures = f"{own.estimate:.3g} estimated, {own.difference:.3g} true, of {found.value:.3g}"
            lines.append(f"seed {found.seed} ({found.scene}), {kind}: {own.failure or figures}")
    return "\n".join(lines)


def faults(judged: Sequence[Judged]) -> list[str]:
    """What is wrong with the checked estimates of scenes, a sentence each."""
    estimates = [own for found in judged for own in found.checked]
    outcomes = Counter(own.outcome for own in estimates)
    needless = sum(own.outcome == "within" and bool(own.doubts) for own in estimates)
    left_out = sum(bool(found.left_out) for found in judged)
    shares = (
        ("estimates are off, and in doubt", outcomes["said"], outcomes.total() - outcomes["below resolution"], "said"),
        ("estimates are within, and in doubt", needless, outcomes["within"], "needless"),
        ("scenes are left out", left_out, len(judged), "left_out"),
    )
    found = [f"{outcomes['outside']} estimates are off without a doubt"] if outcomes["outside"] else []
    for what, count, total, threshold in shares:
        most = getattr(THRESHOLDS, threshold)
        if count > most * total:
            found.append(f"{count} of {total} {what}, more than {most:.0%}")
    return found


def failed(seed: int, failure: TimeoutError | Crashed) -> Judged:
    """The effectivities of a scene that hangs or crashes."""
    if isinstance(failure, TimeoutError):
        return Judged(seed, "", left_out="too slow")
    return Judged(seed, "", checked_elements=Estimate(failure="the process crashed"))


def main() -> int:
    """Judges what the command line asks for."""
    parser = command(__doc__)
    parser.add_argument("--count", type=int, default=COUNT, help="number of scenes")
    parser.add_argument("--seed", type=int, default=FIRST, help="the first scene")
    parser.add_argument("--limit", type=float, default=300.0, help="seconds of a processor for each scene")
    parser.add_argument("--processes", type=int, default=os.cpu_count(), help="scenes judged side by side")
    parser.add_argument("--out", type=Path, default=Path("results/effectivity"), metavar="DIR")
    options = parser.parse_args()
    path, wanted = options.out / f"seed-{options.seed}.jsonl", seeds(options.seed, options.count)
    commit = revision(*CODE)
    try:
        known = read(path, commit, Judged.read)
    except OtherCode as other:
        parser.error(str(other))
    missing = [seed for seed in wanted if seed not in known]
    for found in side_by_side(judge, missing, failed, limit=options.limit, processes=options.processes):
        known[found.seed] = found
        append(path, asdict(found), commit)
        print(f"\r{len(known)}/{len(wanted)} scenes, seed {found.seed} ", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    judged = [known[seed] for seed in wanted]
    publish("effectivity", table(judged), write=options.write, commit=commit)
    return int(bool(faults(judged)))


if __name__ == "__main__":
    sys.exit(main())
