"""Search from scattered starts: distinct optima, best first, and evidence where targets are out of reach.

The starts are the drawn design and designs scattered evenly around it, by Latin hypercubes in units of typical lengths
(McKay, Beckman & Conover 1979, doi:10.2307/1268522). Each is optimised for a few iterations; then the better half and
the designs that meet their targets continue; the rest is given up unless it has already ended. A start depends on its
number alone, so that results are the same however many processes share the starts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Protocol

import numpy as np
from mpi4py import MPI
from scipy.stats import qmc

from fenicsmech.collective import on_all
from fenicsmech.design.correction import Correction
from fenicsmech.design.optimisers.problem import Optimiser, Reason
from fenicsmech.design.regularisers import ShapeBounds
from fenicsmech.design.rest_shape import DesignedLink, ParametricShape
from fenicsmech.design.result import DesignResult, read_result
from fenicsmech.design.run import Checkpoint
from fenicsmech.design.shape.handle_optimum import HandlePlacement, ShapeError
from fenicsmech.errors import EquilibriumError, counted, set_options
from fenicsmech.log import Progress
from fenicsmech.model import Design
from fenicsmech.polygons import first_crossing


@dataclass(frozen=True)
class Scatter:
    """Options of a search from scattered starts.

    Attributes:
        starts: their number, the drawn design included.
        spread: largest change of a parameter, in typical lengths: a link's thickness, and for numbers a tenth of the
            interval between their bounds. Thicknesses and numbers change by at most half of the way to the nearer
            bound.
        seed: other seeds give other starts.
        attempts: maximum number of shapes tried for a start until one is feasible.
        trial: iterations after which the worse half is given up, except for designs that meet their targets.
        distinct: two designs count as the same if no parameter differs by more typical lengths.

    Raises:
        DescriptionError: a number is out of its range.
    """

    starts: int = 16
    spread: float = 2.0
    seed: int = 0
    attempts: int = 20
    trial: int = 6
    distinct: float = 1.0

    def __post_init__(self) -> None:
        set_options(self, "a search", starts=1, seed=0, attempts=1, trial=1)


@dataclass(frozen=True)
class StartResult:
    """The end of one start.

    Attributes:
        number: 0 is the drawn design.
        rejected: shapes tried before it that were not feasible.
        failure: the reason why it has no value; None if it has.
        given_up: whether it was ended early because others were better.
        result: the design it led to; None if it has no value.
    """

    number: int
    rejected: int
    failure: str | None
    given_up: bool
    result: DesignResult | None

    def __str__(self) -> str:
        drawn = f", {counted(self.rejected, 'shape')} rejected before" if self.rejected else ""
        if self.result is None:
            return f"start {self.number}: {self.failure}{drawn}"
        worst = max(self.result.targets, key=lambda target: abs(target.error))
        bounds = f", at {', '.join(self.result.active)}" if self.result.active else ""
        return (
            f"start {self.number}: objective {self.result.objective[1]:.3g}, {worst.name} off by {worst.error:+.2%}"
            f"{bounds}{', given up' if self.given_up else ''}{drawn}"
        )


@dataclass(frozen=True)
class SearchResult:
    """The outcome of a search.

    Attributes:
        mechanism: its name.
        optima: distinct designs, best first; at least one.
        sources: the starts that led to each of them.
        starts: the ends of all starts, by number.
        evidence: for targets that no design meets, a sentence each.
    """

    mechanism: str
    optima: tuple[DesignResult, ...]
    sources: tuple[tuple[int, ...], ...]
    starts: tuple[StartResult, ...]
    evidence: tuple[str, ...]

    @property
    def best(self) -> DesignResult:
        """The best design."""
        return self.optima[0]

    def __str__(self) -> str:
        failed = sum(start.result is None for start in self.starts)
        given_up = sum(start.given_up for start in self.starts)
        lines = [
            f"search for {self.mechanism!r}: {counted(len(self.optima), 'distinct design')} from "
            f"{counted(len(self.starts), 'start')}, {failed} infeasible, {given_up} given up"
        ]
        for number, (design, sources) in enumerate(zip(self.optima, self.sources, strict=True), 1):
            lines.append(
                f"  {number}. objective {design.objective[1]:.3g}, worst target error {design.worst_error:.2%}, "
                f"from start {', '.join(map(str, sources))}"
            )
        return "\n".join([*lines, *(f"  {sentence}" for sentence in self.evidence)])


class Searchable(Protocol):
    """A design problem on one process."""

    def rest_shape(self, design: np.ndarray) -> Design:
        """The design of parameters, or a ShapeError."""

    def optimise(
        self, *, optimiser: Optimiser, start: DesignResult | np.ndarray, correction: Correction
    ) -> DesignResult:
        """The optimum from a start, or an EquilibriumError where that has no value."""


class Search:
    """A search from scattered starts, shared out to the processes of ``comm``.

    Args:
        comm: the processes.
        problem: the problem on this process alone.
        rest: its rest shape.
        scatter: numbers of the search.
        optimiser: of each start.
        checkpoint: of a stage of a start, by name; none are written by default.
        resume: whether checkpoints that exist are used.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        problem: Searchable,
        rest: ParametricShape,
        scatter: Scatter,
        optimiser: Optimiser,
        *,
        checkpoint: Callable[[str], Checkpoint] | None = None,
        resume: bool = False,
    ) -> None:
        self._comm, self._problem, self._rest, self._scatter = comm, problem, rest, scatter
        self._optimiser, self._checkpoint, self._resume = optimiser, checkpoint, resume

    def run(self) -> SearchResult:
        """The outcome, on all processes.

        Raises:
            DescriptionError: a checkpoint belongs to another search.
            EquilibriumError: no start carries its loads.
        """
        with Progress(2.0 * self._scatter.starts, "search", shown=self._comm.rank == 0) as progress:
            tried = self._shared("trial", self._tried, progress)
            continued = better_half(tried)
            ends = self._shared("end", lambda k: self._ended(tried[k], continued), progress)
        return outcome(ends, self._rest.lengths, self._scatter.distinct)

    def _shared(self, stage: str, work: Callable[[int], StartResult], progress: Progress) -> list[StartResult]:
        """``work`` of all starts, each on one process, by number."""
        comm, count = self._comm, self._scatter.starts

        def mine() -> list[StartResult]:
            found = []
            for k in range(comm.rank, count, comm.size):
                found.append(self._once(f"{stage}-{k}", lambda: work(k)))  # noqa: B023, called at once
                done = min(len(found) * comm.size, count) + (0 if stage == "trial" else count)
                progress.update(done, str(found[-1]))
            return found

        return sorted(sum(comm.allgather(on_all(comm, mine)), []), key=lambda start: start.number)

    def _once(self, name: str, work: Callable[[], StartResult]) -> StartResult:
        """The content of a checkpoint if that is to be used, else the result of ``work``, which is written to it."""
        if self._checkpoint is None:
            return work()
        checkpoint = self._checkpoint(name)
        if self._resume and checkpoint.path.exists():
            saved = checkpoint.read()["start"]
            return StartResult(**{**saved, "result": saved["result"] and read_result(saved["result"])})
        found = work()
        checkpoint.write({"start": asdict(found)})
        return found

    def _tried(self, k: int) -> StartResult:
        """A start after its trial."""
        p, rejected = self._scattered(k)
        if p is None:
            return StartResult(k, rejected, "no feasible shape was found", False, None)
        return self._optimised(k, rejected, replace(self._optimiser, iterations=self._scatter.trial), p)

    def _ended(self, tried: StartResult, continued: set[int]) -> StartResult:
        """The end of a start that was tried."""
        if tried.result is None or not _unfinished(tried.result):
            return tried
        if tried.number not in continued:
            return replace(tried, given_up=True)
        return self._optimised(tried.number, tried.rejected, self._optimiser, tried.result)

    def _optimised(self, k: int, rejected: int, optimiser: Optimiser, start: DesignResult | np.ndarray) -> StartResult:
        plain = Correction(estimates=False)  # the last per cent does not change which optimum is near
        try:
            result = self._problem.optimise(optimiser=optimiser, start=start, correction=plain)
            return StartResult(k, rejected, None, False, result)
        except (EquilibriumError, ShapeError) as failure:
            return StartResult(k, rejected, str(failure), False, None)

    def _scattered(self, k: int) -> tuple[np.ndarray | None, int]:
        """Parameters of a start, None if no shape was feasible, and the number of shapes rejected before."""
        rest, scatter = self._rest, self._scatter
        if k == 0:
            return rest.initial, 0
        nearest = 0.5 * np.minimum(rest.numbers.initial, 1.0 - rest.numbers.initial)
        numbers = np.minimum(scatter.spread, nearest / rest.lengths[rest.of_numbers])
        reach = np.concatenate([*(_reach(link, scatter.spread) for link in rest.links), numbers]) * rest.lengths
        for attempt in range(scatter.attempts):
            scattered = qmc.LatinHypercube(len(reach), seed=np.random.default_rng([scatter.seed, attempt]))
            p = rest.initial + (2.0 * scattered.random(scatter.starts)[k] - 1.0) * reach
            if self._feasible(p):
                return p, attempt
        return None, scatter.attempts

    def _feasible(self, p: np.ndarray) -> bool:
        """Whether links are within their bounds, do not cross themselves, and have no inverted cells."""
        if ShapeBounds().active(self._rest, HandlePlacement(p, np.empty(0))):
            return False
        for link in self._rest.links:
            if first_crossing(_outline(link, link.parameters.of(p))) is not None:
                return False
        try:
            self._problem.rest_shape(p)
        except ShapeError:
            return False
        return True


def _reach(link: DesignedLink, spread: float) -> np.ndarray:
    """Largest changes of a link's parameters, in typical lengths."""
    relative = [bound / link.thickness for bound in link.bounds.thickness]
    least, most = float(np.max(relative[0])), float(np.min(relative[1]))
    return np.where(link.is_thickness, min(spread, 0.5 * min(1.0 - least, most - 1.0)), spread)


def _outline(link: DesignedLink, p: np.ndarray) -> np.ndarray:
    """Both edges of a link as a polygon, p its own parameters, (n, 2)."""
    t = np.linspace(0.0, link.spline.segments, 20 * link.spline.segments + 1)
    points, (dx, dy, _) = link.spline.evaluate(p, t), link.spline.derivative(p, t).T
    samples = link.samples.t
    drawn = np.interp(t, samples, np.broadcast_to(link.thickness, samples.shape))[:, None]
    across = np.stack([-dy, dx], axis=1) / np.hypot(dx, dy)[:, None] * (0.5 * drawn * points[:, 2:])
    return np.concatenate([points[:, :2] + across, (points[:, :2] - across)[::-1]])


def _unfinished(result: DesignResult) -> bool:
    return result.reason == Reason.ITERATIONS.value


def _meets_all(result: DesignResult) -> bool:
    return all(target.met for target in result.targets)


def _rank(result: DesignResult) -> tuple[float, float]:
    """Sort key: designs that violate no bound come first, then those of lower objective."""
    bounded = [abs(own.error) for own in result.targets if own.relation.startswith("at ") and not own.met]
    return max(bounded, default=0.0), result.objective[1]


def _ordered(starts: Sequence[StartResult]) -> list[tuple[DesignResult, int]]:
    """The results of starts that have a value and are not given up, best first, with their numbers."""
    ended = [(start.result, start.number) for start in starts if start.result is not None and not start.given_up]
    return sorted(ended, key=lambda own: (_rank(own[0]), own[1]))


def better_half(tried: Sequence[StartResult]) -> set[int]:
    """Numbers of the better half of the starts that have a value, and of those that meet their targets."""
    ordered = _ordered(tried)
    half = (len(ordered) + 1) // 2
    return {number for place, (result, number) in enumerate(ordered) if place < half or _meets_all(result)}


def outcome(starts: Sequence[StartResult], lengths: np.ndarray, distinct: float) -> SearchResult:
    """Distinct designs among the ends of starts, and evidence for targets out of reach.

    Raises:
        EquilibriumError: no start carries its loads.
    """
    ended = _ordered(starts)
    if not ended:
        raise EquilibriumError(
            "search",
            f"none of {len(starts)} starts has a value: {starts[0]}",
            "Draw links that carry the targets' loads",
        )
    optima: list[tuple[DesignResult, list[int]]] = []
    for result, number in ended:
        same = (numbers for other, numbers in optima if _distance(result, other, lengths) <= distinct)
        if (numbers := next(same, None)) is not None:
            numbers.append(number)
        else:
            optima.append((result, [number]))
    return SearchResult(
        optima[0][0].mechanism,
        tuple(result for result, _ in optima),
        tuple(tuple(numbers) for _, numbers in optima),
        tuple(starts),
        evidence([result for result, _ in ended], len(starts)),
    )


def _distance(one: DesignResult, other: DesignResult, lengths: np.ndarray) -> float:
    """Largest difference of a parameter, in typical lengths."""
    p, q = (
        np.concatenate([*(link.parameters for link in result.links), [own.scaled for own in result.numbers]])
        for result in (one, other)
    )
    return float(np.max(np.abs(p - q) / lengths))


def evidence(ended: Sequence[DesignResult], starts: int) -> tuple[str, ...]:
    """A sentence for each target that no design meets, or one if no design meets all of them; none if one does.

    Bounds are named at which all designs end that miss the target by at most twice the least miss.
    """
    if any(map(_meets_all, ended)):
        return ()
    sentences = []
    for k, target in enumerate(ended[0].targets):
        if any(result.targets[k].met for result in ended):
            continue
        nearest = min(ended, key=lambda result: abs(result.targets[k].error))
        least = abs(nearest.targets[k].error)
        near = [result for result in ended if abs(result.targets[k].error) <= 2.0 * least]
        held = Counter(bound for result in near for bound in result.active)
        common = [bound for bound, number in held.items() if number == len(near)]
        missed = (
            f"{target.name} is missed by {counted(len(ended), 'design')} from {counted(starts, 'start')}, "
            f"by at least {least:.2%} ({nearest.targets[k]})"
        )
        if common:
            best = "all" if len(near) == len(ended) else f"the {len(near)} nearest"
            sentences.append(f"{missed}; {best} end at {', '.join(common)}: widen that, or relax the target")
        else:
            most = "".join(f", {number} of {len(near)} end at {bound}" for bound, number in held.most_common(1))
            sentences.append(f"{missed}; no bound is common to them{most}: scatter more starts, or farther")
    if not sentences:
        worst = max(ended[0].targets, key=lambda target: abs(target.error))
        sentences.append(
            f"each target is met by some design, but no design meets all of them: the best misses {worst.name} by "
            f"{worst.error:+.2%}"
        )
    return tuple(sentences)
