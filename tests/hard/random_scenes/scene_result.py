"""The outcome of a scene, and whether it is right.

A scene that makes sense must end in equilibria that pass the residual check, or in an error that is true: no assembly
where the loop cannot close, no equilibrium where none can be expected. One that makes no sense must be refused by name.
"""

from __future__ import annotations

import math
import resource
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

import fenicsmech as fm

from .blueprint import Blueprint, Built, build
from .designs import design_scene, run, with_goal
from .generator import random_scene
from .invalid import spoiled_scene
from .potential import Potential
from .reasons import true_reason
from .residual_check import check, fault
from .stability_check import checkable, unstable_directions
from .thresholds import THRESHOLDS

INVALID_SHARE = 3  # in ten
DESIGNS = 40  # scenes for one design problem
ROUNDED = "equilibrium to rounding"


@dataclass(frozen=True)
class SceneResult:
    """The end of one scene.

    Attributes:
        seed: of the scene.
        scene: its topology, or its fault.
        outcome: "equilibrium", "equilibrium to rounding", "designed: …", "refused", "true: …" or "wrong: …".
        detail: the error, or the figures.
        seconds: wall-clock time.
        cpu: processor time, that of compilers included; without that of the judge, but for designs, which it checks by
            a second start.
        frames: how many equilibria were checked.
        residual: the largest relative one.
        iterations: of Newton's method, on the way to all frames.
        unchecked: checks that are left out.
        proof: the number by which an error is true.
    """

    seed: int
    scene: str
    outcome: str
    detail: str
    seconds: float
    cpu: float = 0.0
    frames: int = 0
    residual: float = 0.0
    iterations: int = 0
    unchecked: str = ""
    proof: str = ""

    @property
    def wrong(self) -> bool:
        """Whether something must be mended."""
        return self.outcome.startswith("wrong")

    def record(self) -> dict:
        """As plain data."""
        return asdict(self)


@dataclass(frozen=True)
class _Verdict:
    """What frames and errors are worth; see ``SceneResult``."""

    outcome: str
    detail: str = ""
    frames: int = 0
    residual: float = 0.0
    iterations: int = 0
    unchecked: str = ""
    proof: str = ""
    cpu: float = 0.0


def judge(seed: int, *, quick: bool = False) -> SceneResult:
    """Runs the scene of a seed; three in ten make no sense, one in forty is a design problem.

    ``quick`` scenes have larger elements and fewer loads; design problems are what they are.
    """
    start, used = time.perf_counter(), _cpu()
    if seed % DESIGNS == DESIGNS - 1:
        scene, verdict = _judge_design(seed)
    elif seed % 10 < INVALID_SHARE:
        scene, verdict = _judge_spoiled(seed)
    else:
        blueprint = random_scene(seed)
        scene, verdict = blueprint.summary, judge_sound(blueprint.coarsened() if quick else blueprint)
    verdict = replace(verdict, cpu=verdict.cpu or _cpu() - used)
    return SceneResult(seed, scene, seconds=time.perf_counter() - start, **asdict(verdict))


def _cpu() -> float:
    """Processor time of this process and of those that it has waited for, s."""
    own, others = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + others.ru_utime + others.ru_stime


def _judge_spoiled(seed: int) -> tuple[str, _Verdict]:
    spoiled = spoiled_scene(seed)
    try:
        spoiled.run()
    except fm.FenicsmechError as error:
        complaint = _unclear(error)
        if not isinstance(error, spoiled.errors):
            complaint = f"{type(error).__name__} instead of {' or '.join(e.__name__ for e in spoiled.errors)}"
        elif not any(word in error.part for word in spoiled.names):
            complaint = f"names {error.part!r}, not {' or '.join(map(repr, spoiled.names))}"
        outcome = f"wrong: {complaint}" if complaint else f"refused: {type(error).__name__}"
        return spoiled.what, _Verdict(outcome, str(error))
    except Exception as error:
        return spoiled.what, _Verdict(f"wrong: {type(error).__name__} escaped", str(error))
    return spoiled.what, _Verdict("wrong: accepted")


def _judge_design(seed: int) -> tuple[str, _Verdict]:
    problem = with_goal(design_scene(seed), seed)
    try:
        outcome, detail = run(problem)
    except fm.FenicsmechError as error:
        return problem.summary, _Verdict(f"wrong: {_unclear(error) or type(error).__name__}", str(error))
    except Exception as error:
        return problem.summary, _Verdict(f"wrong: {type(error).__name__} escaped", str(error))
    return problem.summary, _Verdict(outcome, detail)


def judge_sound(blueprint: Blueprint) -> _Verdict:
    """Outcome of a scene that makes sense."""
    frames, failure, built, used = (), None, None, _cpu()
    try:
        built = build(blueprint)
        curve = built.curve(blueprint)
        frames = curve.frames
    except fm.EquilibriumError as error:
        frames, failure = error.frames, error
    except fm.FenicsmechError as error:
        failure = error
    except Exception as error:
        return _Verdict(f"wrong: {type(error).__name__} escaped", str(error))
    verdict, used = _Verdict(""), _cpu() - used
    if frames or failure is None:
        verdict = judge_frames(blueprint, built, frames, ended=failure is None)
    if failure is not None and not verdict.outcome.startswith("wrong"):
        unclear, excuse = _unclear(failure), true_reason(blueprint, built, failure)
        outcome = f"wrong: {unclear or type(failure).__name__}"
        if excuse is not None and not unclear:
            outcome = f"true: {type(failure).__name__}, {excuse.reason}"
            verdict = replace(verdict, proof=excuse.proof)
        verdict = replace(verdict, outcome=outcome, detail=str(failure))
    return replace(verdict, cpu=used)


def judge_frames(blueprint: Blueprint, built: Built, frames: Sequence[fm.Frame], *, ended: bool) -> _Verdict:
    """What the frames of a curve are worth, which has ``ended`` as it was to or by an error.

    Of paths some frames are checked, spread evenly, and whether the last one is where they were to end.
    """
    if ended and len(frames) < (1 if blueprint.control == "path" else len(blueprint.samples)):
        return _Verdict("wrong: frames missing", f"{len(frames)} of {len(blueprint.samples)}", len(frames))
    potential, worst, outcome = Potential.of(blueprint, built.simulation), None, "equilibrium"
    origin, samples = unloaded_travel(potential, built), blueprint.samples
    chosen = [*frames]
    if blueprint.control == "path":
        chosen = [frames[k] for k in np.unique(np.linspace(0, len(frames) - 1, THRESHOLDS.frames).astype(int))]
        stopped = len(frames) >= blueprint.most
        samples = [None] * (len(chosen) - 1) + [samples[0] if ended and not stopped else None]
    count, iterations = len(chosen), sum(frame.iterations for frame in frames)
    for frame, sample in zip(chosen, samples, strict=False):
        if not _finite(frame):
            return _Verdict("wrong: NaN", repr(frame), count, math.inf, iterations)
        found = check(potential, frame, origin)
        error = fault(blueprint, frame, sample, found)
        if worst is None or found.relative > worst.relative:
            worst = found
        if error:
            return _Verdict(f"wrong: {error}", str(found), count, found.relative, iterations)
        if found.force > THRESHOLDS.residual * found.scale:
            outcome = ROUNDED
    unstable = unstable_directions(potential, chosen[-1]) if checkable(potential) else None
    if unstable is not None and unstable != chosen[-1].unstable_modes:
        detail = f"{chosen[-1].unstable_modes} unstable modes, and {unstable} by second differences"
        return _Verdict("wrong: stability", detail, count, worst.relative, iterations)
    unchecked = [*(["displacement"] if math.isnan(origin) else []), *(["stability"] if unstable is None else [])]
    return _Verdict(outcome, str(worst), count, worst.relative, iterations, " and ".join(unchecked))


def unloaded_travel(potential: Potential, built: Built) -> float:
    """Travel of the force's point in the configuration without loads: 0 as drawn; not known, NaN, if posed."""
    if built.configuration is fm.DRAWN or not potential.blueprint.motors:
        return 0.0
    return math.nan


def _finite(frame: fm.Frame) -> bool:
    numbers = [frame.force, frame.displacement, frame.strain_energy, frame.max_stress, *frame.motors.values()]
    arrays = [frame.state.u, frame.state.poses, frame.state.multipliers]
    arrays += [part for reaction in frame.reactions.values() for part in (reaction.force, reaction.moment)]
    return bool(np.all(np.isfinite(numbers)) and all(np.all(np.isfinite(array)) for array in arrays))


def _unclear(error: fm.FenicsmechError) -> str:
    """The omission of an error, which must give part, problem and remedy; empty if there is none."""
    missing = [name for name in ("part", "problem", "remedy") if not getattr(error, name).strip()]
    return f"no {missing[0]} in {type(error).__name__}" if missing else ""
