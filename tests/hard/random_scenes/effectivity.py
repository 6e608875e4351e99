"""Judges error estimates on random scenes: `python -m tests.hard.random_scenes.effectivity`.

The effectivity of an estimate is the estimate over the true difference. That of the elements is the difference from
elements a quarter as wide of the same outline, in space half as wide in all directions, and of order 2 at least; that
of plane stress the difference between both models in such elements, each with its own estimate added.
Where it is not within a factor of two, the scene must say so: by a doubt of the estimate (``Curve.doubts``), or because
the difference is below resolution. Scenes have large elements and one load; designs are those of exported parts.

Results are kept in DIR/seed-SEED.jsonl; the same command goes on after an interruption.
"""

from __future__ import annotations

import io
import itertools
import json
import logging
import math
import multiprocessing
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from unittest.mock import patch

import fenicsmech as fm
from benchmarks.table import command, publish
from fenicsmech import model
from fenicsmech.meshing import LinkMesh, cutting

from ...simulation.refined import quartered
from .blueprint import Blueprint, ContactPlan, build
from .designs import design_problem, design_scene
from .draw import length
from .generator import random_scene
from .scene_result import DESIGNS, INVALID_SHARE
from .thresholds import THRESHOLDS

_CELLS = 160  # in the plane, of scenes that are quick enough
_AROUND_PINS = 40  # cells of a link
_FRAMES = 60  # of a path


@dataclass(frozen=True)
class Estimate:
    """One kind of error of one scene.

    Attributes:
        estimate: of the error.
        difference: the true one.
        resolution: smallest difference that stands out of rounding and the errors of what it is compared with.
        doubts: what the scene says against the estimate.
    """

    estimate: float
    difference: float
    resolution: float
    doubts: str = ""

    @property
    def effectivity(self) -> float:
        """Estimate over difference."""
        return self.estimate / self.difference if self.difference else math.inf

    @property
    def outcome(self) -> str:
        """ "within", "below resolution", "said: …" or "outside"."""
        if 1.0 / THRESHOLDS.effectivity <= self.effectivity <= THRESHOLDS.effectivity:
            return "within"
        if max(abs(self.difference), abs(self.estimate)) <= self.resolution:
            return "below resolution"
        return f"said: {self.doubts}" if self.doubts else "outside"


@dataclass(frozen=True)
class Judged:
    """The estimates of one scene.

    Attributes:
        seed: of the scene.
        scene: in a few words.
        value: the displacement or force.
        elements: the error of its elements.
        plane_stress: of plane stress; None in other models.
        left_out: why nothing is compared, empty if something is.
        seconds: wall-clock time.
    """

    seed: int
    scene: str
    value: float = 0.0
    elements: Estimate | None = None
    plane_stress: Estimate | None = None
    left_out: str = ""
    seconds: float = 0.0

    @property
    def in_space(self) -> bool:
        """Whether links are meshed in space."""
        return ", 3d" in self.scene

    @property
    def designed(self) -> bool:
        """Whether links are designed."""
        return self.seed % DESIGNS == DESIGNS - 1

    @classmethod
    def read(cls, line: str) -> Judged:
        """From a line of the file of results."""
        fields = json.loads(line)
        for name in ("elements", "plane_stress"):
            fields[name] = fields[name] and Estimate(**fields[name])
        return cls(**fields)


class _Unsolved(Exception):
    """A curve that is not found; errors of estimates are not among these."""


def judge(seed: int) -> Judged:
    """The effectivities of a scene or design."""
    start = time.perf_counter()
    try:
        if seed % DESIGNS == DESIGNS - 1:
            found = _judge_design(seed)
        else:
            found = judge_scene(seed, random_scene(seed))
    except _Unsolved as failure:
        found = Judged(seed, "", left_out=str(failure))
    return replace(found, seconds=time.perf_counter() - start)


def judge_scene(seed: int, blueprint: Blueprint) -> Judged:
    """The effectivities at the last equilibrium of a coarse scene."""
    scene = _stiffly_touching(replace(blueprint.coarsened(), most=_FRAMES))
    if _cells(scene) > _CELLS:
        return Judged(seed, scene.summary, left_out="too large")
    finer, curve = replace(scene, order=max(scene.order, 2)), _curve(scene)
    with refined(2 if scene.space in ("plane-stress", "plane-strain") else 1):
        fine = _curve(finer)
    deep = None
    if scene.space == "plane-stress":
        with refined(1):
            deep = _curve(replace(finer, space="3d-symmetric", order=2))
    if not all(comparable(curve, other) for other in (fine, deep) if other is not None):
        return Judged(seed, scene.summary, left_out="a path of another length")
    return _compared(seed, scene, curve, fine, deep)


def _judge_design(seed: int) -> Judged:
    """The effectivities of the exported parts of a design."""
    problem = design_scene(seed)
    scene = problem.blueprint
    if _cells(scene) > _CELLS:
        return Judged(seed, problem.summary, left_out="too large")
    if scene.forces[0].on in problem.links:
        return Judged(seed, problem.summary, left_out="a force on a point that the design moves")
    built = build(scene)
    wanted = problem.factor * _curve(scene).frames[0].displacement
    design = design_problem(problem, built, wanted)
    with tempfile.TemporaryDirectory() as folder:
        result = design.optimise()
        design.export(folder, result)
        parts = {
            built.links[name]: fm.step_file(Path(folder) / f"{name}.step", depth=scene.link(name).depth)
            for name in problem.links
        }
        curve = _curve(scene, parts)
        with refined(2):
            fine = _curve(scene, parts)
        with refined(1):
            deep = _curve(replace(scene, space="3d-symmetric"), parts)
    return replace(_compared(seed, scene, curve, fine, deep), scene=problem.summary)


def _compared(seed: int, scene: Blueprint, curve: fm.Curve, fine: fm.Curve, deep: fm.Curve | None) -> Judged:
    value = float(curve.values[-1])
    resolution = THRESHOLDS.resolved * abs(value)
    if scene.control == "forces":
        resolution += THRESHOLDS.still * scene.length
    found = float(curve.error_estimates()[-1]), float(fine.values[-1]) - value
    elements, plane_stress = Estimate(*found, resolution, "; ".join(curve.doubts()[-1])), None
    if deep is not None:
        left = [float(other.error_estimates()[-1]) for other in (fine, deep)]
        added = float(deep.values[-1]) + left[1] - float(fine.values[-1]) - left[0]
        resolution += abs(left[0]) + abs(left[1])
        plane_stress = Estimate(
            float(curve.modelling_errors()[-1]), added, resolution, "; ".join(curve.doubts(modelling=True)[-1])
        )
    return Judged(seed, scene.summary, value, elements, plane_stress)


@contextmanager
def refined(levels: int) -> Iterator[None]:
    """Simulations made within have triangles cut in four ``levels`` times, and layers in two."""
    mesh_links, extrude = model.mesh_links, cutting.extrude

    def finer(mesh: LinkMesh) -> LinkMesh:
        for _ in range(levels):
            mesh = quartered(mesh)
        return mesh

    def flat(*arguments) -> list[LinkMesh]:
        return [finer(mesh) if mesh.dim == 2 else mesh for mesh in mesh_links(*arguments)]

    def deep(plan: LinkMesh, depth: float, layers: int, *, half: bool = False) -> LinkMesh:
        return extrude(finer(plan), depth, 2**levels * layers, half=half)

    with patch.object(model, "mesh_links", flat), patch.object(cutting, "extrude", deep):
        yield


def comparable(curve: fm.Curve, other: fm.Curve) -> bool:
    """Whether the last equilibria of both curves belong to the same value of the control."""
    displaced = curve.unknown is curve.unknown.FORCE
    ends = [c.displacements[-1] if displaced else c.forces[-1] for c in (curve, other)]
    return abs(ends[0] - ends[1]) <= THRESHOLDS.energy * abs(ends[0])


def _curve(scene: Blueprint, shapes: dict | None = None) -> fm.Curve:
    """The curve of a scene, with some links of other ``shapes``."""
    try:
        built = build(scene)
        if shapes:
            own = {built.links[link.name]: shape for link, shape in shapes.items()}
            built.simulation = built.simulation.with_shapes(own)
        return built.curve(scene)
    except fm.FenicsmechError as error:
        raise _Unsolved(f"{type(error).__name__} in one of the meshes") from error


def _stiffly_touching(scene: Blueprint) -> Blueprint:
    """With a stiffness of contact that does not depend on the elements."""
    effects = [
        replace(plan, stiffness=0.1 * scene.link(plan.link).young / scene.link(plan.link).thickness)
        if isinstance(plan, ContactPlan) and plan.stiffness is None
        else plan
        for plan in scene.effects
    ]
    return replace(scene, effects=tuple(effects))


def _cells(scene: Blueprint) -> float:
    """About how many triangles the links have in the plane."""
    return sum(
        2.0 * max(1.0, link.thickness / link.size) * length(link) / link.size + _AROUND_PINS for link in scene.flexible
    )


class Judge:
    """One process that judges scene after scene; one that takes longer than ``limit`` seconds is left out."""

    def __init__(self, limit: float) -> None:
        self._limit, self._pool = limit, None

    def __call__(self, seed: int) -> Judged:
        """The effectivities of a scene."""
        if self._pool is None:
            self._pool = multiprocessing.get_context("spawn").Pool(1, _quiet)
        try:
            return self._pool.apply_async(_judge_quietly, (seed,)).get(self._limit)
        except multiprocessing.TimeoutError:
            self.close()
            return Judged(seed, "", left_out="too slow, or crashed", seconds=self._limit)

    def close(self) -> None:
        """Ends the process."""
        if self._pool is not None:
            self._pool.terminate()
            self._pool = None


def _quiet() -> None:
    logging.getLogger("fenicsmech").setLevel(logging.CRITICAL)


def _judge_quietly(seed: int) -> Judged:
    with redirect_stderr(io.StringIO()):  # progress of curves
        return judge(seed)


def table(judged: Sequence[Judged]) -> str:
    """Shares of scenes by outcome, in Markdown, and every one outside."""
    compared = [found for found in judged if not found.left_out]
    kinds = {
        "elements, in the plane": [(f, f.elements) for f in compared if not f.in_space and not f.designed],
        "elements, in space": [(f, f.elements) for f in compared if f.in_space and not f.designed],
        "elements, designs": [(f, f.elements) for f in compared if f.designed],
        "plane stress": [(f, f.plane_stress) for f in compared if f.plane_stress and not f.designed],
        "plane stress, designs": [(f, f.plane_stress) for f in compared if f.plane_stress and f.designed],
    }
    ends = ("within", "said", "below resolution", "outside")
    lines = ["| estimate of | scenes | within | the scene says so | below resolution | outside | doubted, but within |"]
    lines.append("| --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for kind, found in kinds.items():
        outcomes = Counter(own.outcome.split(":")[0] for _, own in found)
        needless = sum(own.outcome == "within" and bool(own.doubts) for _, own in found)
        lines.append(f"| {kind} | {len(found)} | {' | '.join(str(outcomes[end]) for end in ends)} | {needless} |")
    doubts = Counter(own.doubts for found in kinds.values() for _, own in found if own.outcome.startswith("said"))
    left_out = Counter(found.left_out for found in judged if found.left_out)
    lines += [
        "",
        f"{len(compared)} of {len(judged)} scenes compared; left out: {_counts(left_out)}; said: {_counts(doubts)}",
    ]
    for kind, found in kinds.items():
        for f, own in found:
            if own.outcome == "outside":
                figures = f"{own.estimate:.3g} estimated, {own.difference:.3g} true, of {f.value:.3g}"
                lines.append(f"seed {f.seed} ({f.scene}), {kind}: {figures}")
    return "\n".join(lines)


def _counts(counter: Counter) -> str:
    return ", ".join(f"{name} {count}" for name, count in counter.most_common()) or "nothing"


def read(path: Path) -> dict[int, Judged]:
    """Results by seed; a line cut short by a stop is left out."""
    results = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        try:
            found = Judged.read(line)
        except ValueError:
            continue
        results[found.seed] = found
    return results


def main() -> int:
    """Judges scenes from a seed on until enough are compared."""
    parser = command(__doc__)
    parser.add_argument("--count", type=int, default=300, help="number of scenes that are compared")
    parser.add_argument("--seed", type=int, default=0, help="the first scene")
    parser.add_argument("--limit", type=float, default=120.0, help="seconds after which a scene is left out")
    parser.add_argument("--out", type=Path, default=Path("results/effectivity"), metavar="DIR")
    options = parser.parse_args()
    path, worker = options.out / f"seed-{options.seed}.jsonl", Judge(options.limit)
    known, judged, compared = read(path), [], 0
    for seed in itertools.count(options.seed):
        if compared == options.count:
            break
        if seed % DESIGNS != DESIGNS - 1 and seed % 10 < INVALID_SHARE:
            continue
        if seed not in known:
            known[seed] = worker(seed)
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("a") as file:
                file.write(json.dumps(asdict(known[seed])) + "\n")
        judged.append(known[seed])
        compared += not known[seed].left_out
        print(f"\r{compared}/{options.count} scenes compared, seed {seed} ", end="", file=sys.stderr, flush=True)
    worker.close()
    print(file=sys.stderr)
    publish("effectivity", table(judged), write=options.write)
    outcomes = Counter(own.outcome.split(":")[0] for f in judged for own in (f.elements, f.plane_stress) if own)
    resolved = outcomes["within"] + outcomes["said"] + outcomes["outside"]
    return int(outcomes["outside"] > 0 or outcomes["within"] < THRESHOLDS.effective * resolved)


if __name__ == "__main__":
    sys.exit(main())
