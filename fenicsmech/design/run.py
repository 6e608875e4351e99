"""Runs of an optimiser, with progress output and checkpoints.

The optimiser runs on the first process, and all evaluate the objective: decisions that depend on rounding cannot differ
between processes.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, log
from pathlib import Path
from time import perf_counter

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import from_one, on_all
from fenicsmech.design.description import Target
from fenicsmech.design.objective import Objective
from fenicsmech.design.optimisers.problem import Evaluation, Infeasible, Iterate, Optimiser, Reason, Start
from fenicsmech.design.regularisers import Regulariser
from fenicsmech.design.rest_shape import ParametricShape
from fenicsmech.errors import DescriptionError
from fenicsmech.files import atomic_write
from fenicsmech.log import Progress, Silent
from fenicsmech.simulation import Simulation


@dataclass(frozen=True, eq=False)
class Optimum:
    """The optimum found by a run.

    Attributes:
        number, evaluations, parameters, reason: as in ``Iterate`` and its evaluation.
        started: displacement of each target at the start, (targets,).
    """

    number: int
    evaluations: int
    parameters: np.ndarray
    reason: Reason
    started: np.ndarray


def minimise_together(
    comm: MPI.Comm, objective: Objective, optimiser: Optimiser, start: Start, *, watch: Callable[[Iterate], None]
) -> Optimum:
    """The optimum found by ``optimiser``, on all processes; ``watch`` is called on the first.

    Raises:
        Infeasible: at the start.
        Exception: whatever ``watch`` raises, on all processes.
    """

    def decide() -> Optimum:
        started = []

        def watch_first(iterate: Iterate) -> None:
            started.append(objective.reached)
            watch(iterate)

        try:
            last = optimiser.minimise(_Shared(comm, objective), start, watch=watch_first)
        finally:
            comm.bcast(None, root=0)
        assert last.reason is not None, "an optimiser ends for a reason"
        return Optimum(last.number, last.evaluations, last.evaluation.parameters, last.reason, started[0])

    return comm.bcast(on_all(comm, lambda: decide() if comm.rank == 0 else _follow(comm, objective)), root=0)


class _Shared:
    """The objective on the first process: all processes compute each call."""

    def __init__(self, comm: MPI.Comm, objective: Objective) -> None:
        self._comm, self._objective, self.lengths = comm, objective, objective.lengths

    def evaluate(self, parameters: np.ndarray, below: float = np.inf) -> Evaluation:
        return replace(self._ask("evaluate", parameters, below), errors=lambda: self._ask("errors"))

    def _ask(self, method: str, *arguments):
        self._comm.bcast((method, arguments), root=0)
        return getattr(self._objective, method)(*arguments)


def _follow(comm: MPI.Comm, objective: Objective) -> None:
    """Evaluates with the first process until that is done.

    Raises:
        Exception: the first error that may not have been raised on the first process.
    """
    failure = None
    while (request := comm.bcast(None, root=0)) is not None:
        method, arguments = request
        try:
            getattr(objective, method)(*arguments)
        except Infeasible:
            pass  # raised on the first process too, which decides
        except Exception as error:  # as a rule raised there as well, which ends the run; until then it needs answers
            failure = failure or error
    if failure is not None:
        raise failure


_FORMAT = "fenicsmech checkpoint 1"


@dataclass(frozen=True, eq=False)
class Saved:
    """Contents of a checkpoint: the start of the next run, and the handle positions θ there."""

    start: Start
    handles: np.ndarray


@dataclass(frozen=True)
class Checkpoint:
    """A checkpoint file of one problem, from which a run resumes after its process was killed, as JSON.

    Attributes:
        path: the file.
        problem: the problem and its optimiser as plain data; checkpoints of others are refused.
    """

    path: Path
    problem: Mapping[str, object]

    def save(self, iterate: Iterate, handles: np.ndarray) -> None:
        """Local. Writes an iterate and its handle positions; the file before stays until this one is complete."""
        data = {
            "format": _FORMAT,
            "problem": self.problem,
            "number": iterate.number,
            "evaluations": iterate.evaluations,
            "objective": iterate.evaluation.value,
            "parameters": iterate.evaluation.parameters.tolist(),
            "handles": handles.tolist(),
            "memory": iterate.memory.tolist(),
        }
        with atomic_write(self.path) as file:
            file.write(json.dumps(data))

    def load(self) -> Saved:
        """Local. The start saved in the file.

        Raises:
            DescriptionError: the file does not exist, is not a checkpoint, or is one of another problem.
        """
        part = f"checkpoint {str(self.path)!r}"
        try:
            data = json.loads(self.path.read_text())
        except FileNotFoundError:
            raise DescriptionError(part, "there is no such file", "Start without resuming") from None
        except (UnicodeDecodeError, json.JSONDecodeError):
            data = None
        if not isinstance(data, dict) or data.get("format") != _FORMAT:
            raise DescriptionError(part, "it is not a checkpoint of this program", "Start without resuming")
        mine = json.loads(json.dumps(self.problem))
        if data["problem"] != mine:
            other = [key for key in mine if data["problem"].get(key) != mine[key]]
            raise DescriptionError(
                part,
                f"it belongs to another problem: {', '.join(other)} differ(s)",
                "Resume with the options of the first run, or start anew",
            )
        start = Start(
            np.array(data["parameters"]), data["number"], data["evaluations"], np.array(data["memory"], dtype=float)
        )
        return Saved(start, np.array(data["handles"]))

    def load_together(self, comm: MPI.Comm) -> Saved | None:
        """The start on all processes, errors too; None if the file does not exist yet."""
        return from_one(comm, lambda: self.load() if self.path.exists() else None)


def fingerprint(
    simulation: Simulation,
    rest: ParametricShape,
    targets: Sequence[Target],
    regulariser: Regulariser,
    optimiser: Optimiser,
) -> dict[str, object]:
    """The problem and its optimiser as plain data, with which a checkpoint must agree."""
    fidelity, mechanism = simulation.fidelity, simulation.scene.mechanism
    return {
        "mechanism": mechanism.name,
        "space": fidelity.model.name,
        "order": fidelity.order,
        "sizes": list(fidelity.sizes.values()),
        "effects": [repr(effect) for effect in simulation.scene.effects],
        "drawing": [repr(link) for link in mechanism.flexible_links],
        "links": [[link.name, link.spline.initial.tolist()] for link in rest.links],
        "bounds": [repr(link.bounds) for link in rest.links],
        "forces": [[t.part.name, *t.part.at, *t.part.direction] for t in targets],
        "configurations": [[t.configuration.name, *(at for _, at in t.configuration.positions)] for t in targets],
        "targets": [[t.force, t.displacement, t.weight] for t in targets],
        "regulariser": repr(regulariser),
        "optimiser": type(optimiser).__name__,
    }


class DesignProgress:
    """Shows iteration, objective, worst target error and time left on standard error; a context manager.

    Time left is extrapolated from the predicted reduction of the last six iterations, up to the optimiser's limit of
    iterations.

    Args:
        optimiser: gives the criteria of its end.
        leads: whether this process shows anything.
    """

    def __init__(self, optimiser: Optimiser, *, leads: bool) -> None:
        self._minimiser = optimiser
        self._progress = Progress(None, "design") if leads else Silent()
        self._recent: deque[tuple[float, float]] = deque(maxlen=6)

    def update(self, iterate: Iterate, errors: np.ndarray) -> None:
        """Shows an iterate; ``errors`` (targets,) are relative."""
        self._recent.append((perf_counter(), max(iterate.promise, 1e-300)))
        note = f"objective {iterate.evaluation.value:.3g}, worst target error {np.abs(errors).max():.2%}"
        left = self._left(iterate)
        self._progress.update(iterate.number, note if left is None else f"{note}, about {left:.0f} s left")

    def __enter__(self) -> DesignProgress:
        self._progress.__enter__()
        return self

    def __exit__(self, *error) -> None:
        self._progress.__exit__(*error)

    def _left(self, iterate: Iterate) -> float | None:
        if len(self._recent) < 2 or iterate.reason is not None:
            return None
        (start, first), (now, last) = self._recent[0], self._recent[-1]
        each = (now - start) / (len(self._recent) - 1)
        falling = (log(first) - log(last)) / (len(self._recent) - 1)
        wanted = log(last / self._minimiser.least_promise) / falling if falling > 0.0 else inf
        return each * max(1.0, min(wanted, self._minimiser.iterations - iterate.number))
