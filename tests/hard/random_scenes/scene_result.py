"""The outcome of a scene, and whether it is right.

A scene that makes sense must end in equilibria that pass the residual check, or in an error that is true: no assembly
where the loop cannot close, no equilibrium where none can be expected. One that makes no sense must be refused by name.
"""

from __future__ import annotations

import math
import time
from dataclasses import asdict, dataclass

import numpy as np

import fenicsmech as fm

from .blueprint import Blueprint, Built, build
from .generator import random_scene
from .invalid import spoiled_scene
from .potential import Potential
from .reasons import true_reason
from .residual_check import Residual, check

TOLERANCE = 1e-6  # of the largest load or reaction
ROUNDING = 10.0  # times the rounding of displacements
BALANCED = 1e-5  # of what works along motions that deform no link
CLOSED = 1e-9  # of the mechanism's length
INVALID_SHARE = 3  # in ten


@dataclass(frozen=True)
class SceneResult:
    """The end of one scene.

    Attributes:
        seed: of the scene.
        scene: its topology, or its fault.
        outcome: "equilibrium", "equilibrium to rounding", "refused", "true: …" or "wrong: …".
        detail: the error, or the figures.
        seconds: wall-clock time.
        frames: how many equilibria were checked.
        residual: the largest relative one.
    """

    seed: int
    scene: str
    outcome: str
    detail: str
    seconds: float
    frames: int = 0
    residual: float = 0.0

    @property
    def wrong(self) -> bool:
        """Whether something must be mended."""
        return self.outcome.startswith("wrong")

    def record(self) -> dict:
        """As plain data."""
        return asdict(self)


def judge(seed: int) -> SceneResult:
    """Runs the scene of a seed; three in ten make no sense."""
    start = time.perf_counter()
    scene, outcome, detail, frames, residual = (_judge_spoiled if seed % 10 < INVALID_SHARE else _judge_sound)(seed)
    return SceneResult(seed, scene, outcome, detail, time.perf_counter() - start, frames, residual)


def _judge_spoiled(seed: int) -> tuple[str, str, str, int, float]:
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
        return spoiled.what, outcome, str(error), 0, 0.0
    except Exception as error:
        return spoiled.what, f"wrong: {type(error).__name__} escaped", str(error), 0, 0.0
    return spoiled.what, "wrong: accepted", "", 0, 0.0


def _judge_sound(seed: int) -> tuple[str, str, str, int, float]:
    blueprint = random_scene(seed)
    name = f"{blueprint.topology}, {blueprint.space}"
    frames, failure, built = (), None, None
    try:
        built = build(blueprint)
        frames = built.curve(blueprint).frames
    except fm.EquilibriumError as error:
        frames, failure = error.frames, error
    except fm.FenicsmechError as error:
        failure = error
    except Exception as error:
        return name, f"wrong: {type(error).__name__} escaped", str(error), 0, 0.0
    outcome, figures, worst = judge_frames(blueprint, built, frames) if frames else ("", "", 0.0)
    if failure is not None and not outcome.startswith("wrong"):
        unclear, reason = _unclear(failure), true_reason(blueprint, built, failure)
        kind = type(failure).__name__
        outcome = f"wrong: {unclear}" if unclear else f"true: {kind}, {reason}" if reason else f"wrong: {kind}"
        figures = str(failure)
    return name, outcome, figures, len(frames), worst


def judge_frames(blueprint: Blueprint, built: Built, frames) -> tuple[str, str, float]:
    """Outcome, figures and largest relative residual of the frames of a scene."""
    potential, worst, outcome = Potential.of(blueprint, built.simulation), None, "equilibrium"
    origin = unloaded_travel(potential, built)
    for frame, sample in zip(frames, blueprint.samples, strict=False):
        if not _finite(frame):
            return "wrong: NaN", repr(frame), math.inf
        found = check(potential, frame, origin)
        error = _error(blueprint, frame, sample, found)
        if worst is None or found.relative > worst.relative:
            worst = found
        if error:
            return f"wrong: {error}", str(found), found.relative
        if found.force > TOLERANCE * found.scale:
            outcome = "equilibrium to rounding"
    return outcome, str(worst), worst.relative


def unloaded_travel(potential: Potential, built: Built) -> float:
    """Travel of the force's point in the configuration without loads: 0 as drawn; as the simulation has it if posed."""
    if built.configuration is fm.DRAWN or not potential.blueprint.motors:
        return 0.0
    return math.nan


def _error(blueprint: Blueprint, frame: fm.Frame, sample: float, found: Residual) -> str:
    """The fault of a frame, empty if there is none."""
    controlled = frame.force if blueprint.control == "forces" else frame.displacement
    size = abs(sample) if blueprint.control == "forces" else blueprint.length
    if abs(controlled - sample) > 1e-9 * size:
        return "control missed"
    if found.gap > CLOSED:
        return "joints apart"
    if found.force > max(TOLERANCE * found.scale, ROUNDING * found.floor):
        return "no equilibrium"
    if found.unstrained_work > BALANCED:
        return "motions that deform no link are out of balance"
    if not math.isnan(found.travel_error) and found.travel_error > 1e-9:
        return "displacement"
    if found.energy_error > 1e-6:
        return "strain energy"
    return ""


def _finite(frame: fm.Frame) -> bool:
    numbers = [frame.force, frame.displacement, frame.strain_energy, frame.max_stress, *frame.motors.values()]
    arrays = [frame.state.u, frame.state.poses, frame.state.multipliers]
    arrays += [part for reaction in frame.reactions.values() for part in (reaction.force, reaction.moment)]
    return bool(np.all(np.isfinite(numbers)) and all(np.all(np.isfinite(array)) for array in arrays))


def _unclear(error: fm.FenicsmechError) -> str:
    """The omission of an error, which must give part, problem and remedy; empty if there is none."""
    missing = [name for name in ("part", "problem", "remedy") if not getattr(error, name).strip()]
    return f"no {missing[0]} in {type(error).__name__}" if missing else ""
