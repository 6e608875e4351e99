"""Runs of an optimiser, with progress output and checkpoints.

The optimiser runs on the first process, and all evaluate the objective: decisions that depend on rounding cannot differ
between processes.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from math import inf, log
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import from_one, on_all
from fenicsmech.design.objective import Objective
from fenicsmech.design.optimisers.problem import Evaluation, Infeasible, Iterate, Optimiser, Reason, Start
from fenicsmech.design.regularisers import Regulariser
from fenicsmech.design.rest_shape import ParametricShape
from fenicsmech.design.shape.handle_optimum import HandlePlacement
from fenicsmech.design.target import Target
from fenicsmech.errors import DescriptionError
from fenicsmech.files import atomic_write, read_json
from fenicsmech.log import Progress
from fenicsmech.simulation import Simulation


@dataclass(frozen=True, eq=False)
class Optimum:
    """The optimum found by a run.

    Attributes:
        number, evaluations, parameters, memory, reason, refusal: as in ``Iterate`` and its evaluation.
        regulariser: R there.
    """

    number: int
    evaluations: int
    parameters: np.ndarray
    memory: np.ndarray
    reason: Reason
    refusal: str
    regulariser: float


def minimise_together(
    comm: MPI.Comm, objective: Objective, optimiser: Optimiser, start: Start, *, watch: Callable[[Iterate], None]
) -> Optimum:
    """The optimum found by ``optimiser``, on all processes; ``watch`` is called on the first.

    Raises:
        Infeasible: at the start.
        Exception: whatever ``watch`` raises, on all processes.
    """

    def decide() -> Optimum:
        try:
            last = optimiser.minimise(_Shared(comm, objective), start, watch=watch)
        finally:
            comm.bcast(None, root=0)
        assert last.reason is not None, "an optimiser ends for a reason"
        here = last.evaluation
        own = (last.number, last.evaluations, here.parameters, last.memory, last.reason, last.refusal)
        return Optimum(*own, here.penalty.value)

    return comm.bcast(on_all(comm, lambda: decide() if comm.rank == 0 else _follow(comm, objective)), root=0)


class _Shared:
    """The objective on the first process: all processes compute each call."""

    def __init__(self, comm: MPI.Comm, objective: Objective) -> None:
        self._comm, self._objective, self.lengths = comm, objective, objective.lengths

    def evaluate(
        self, parameters: np.ndarray, below: float = np.inf, penalties: np.ndarray | float = 0.0
    ) -> Evaluation:
        return replace(self._ask("evaluate", parameters, below, penalties), errors=lambda: self._ask("errors"))

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


@dataclass(frozen=True, eq=False)
class DesignIterate:
    """A design on the way of an optimisation.

    Attributes:
        number: iterations so far.
        placement: parameters and handle positions, which ``optimise(start=…)`` and ``rest_shape`` take.
        values: corrected values that targets are compared with, (components,).
        errors: of the targets, relative, (targets,).
    """

    number: int
    placement: HandlePlacement
    values: np.ndarray
    errors: np.ndarray


_FORMAT = "fenicsmech checkpoint 6"


@dataclass(frozen=True)
class Round:
    """The minimisation of one simulation's values plus a correction.

    Attributes:
        surrogate: whether the simulation is a surrogate.
        correction: of its values, (components,).
        changes: of the corrections so far, over the allowed ones.
        largest: the changes over the scales of the targets.
        started, initial: components at the start of the optimisation, (components,), and the objective there; empty
            and None before.
        drawn: components to which minimised quantities are relative, (components,); empty before the start.
    """

    surrogate: bool
    correction: tuple[float, ...]
    changes: tuple[float, ...] = ()
    largest: tuple[float, ...] = ()
    started: tuple[float, ...] = ()
    initial: float | None = None
    drawn: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Saved:
    """Contents of a checkpoint.

    Attributes:
        start: of the next run.
        handles: positions θ there.
        round: the one in progress.
        ended: reason for the end of its minimisation, and the optimiser; None if it was interrupted.
    """

    start: Start
    handles: np.ndarray
    round: Round
    ended: tuple[str, str] | None


@dataclass(frozen=True)
class Checkpoint:
    """A checkpoint file of one problem, from which a run resumes after its process was killed, as JSON.

    Attributes:
        path: the file.
        problem: the problem and its optimiser as plain data; checkpoints of others are refused.
    """

    path: Path
    problem: Mapping[str, object]

    def save(self, iterate: Iterate, handles: np.ndarray, round: Round, optimiser: Optimiser) -> None:
        """Local. Writes an iterate and its handle positions; the file before stays until this one is complete."""
        data = {
            "number": iterate.number,
            "evaluations": iterate.evaluations,
            "objective": iterate.evaluation.value,
            "parameters": iterate.evaluation.parameters.tolist(),
            "handles": handles.tolist(),
            "memory": iterate.memory.tolist(),
            "refusal": iterate.refusal,
            "round": asdict(round),
            "ended": None if iterate.reason is None else [iterate.reason.name, repr(optimiser)],
        }
        self.write(data)

    def load(self) -> Saved:
        """Local. The start saved in the file.

        Raises:
            DescriptionError: the file does not exist, is not a checkpoint, or belongs to another problem.
        """
        data = self.read()
        memory = np.array(data["memory"], dtype=float)
        own = (np.array(data["parameters"]), data["number"], data["evaluations"], memory)
        start = Start(*own, resumed=True, refusal=data["refusal"])
        round: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in data["round"].items()
        }
        return Saved(start, np.array(data["handles"]), Round(**round), data["ended"] and tuple(data["ended"]))

    def load_together(self, comm: MPI.Comm) -> Saved | None:
        """The start on all processes, errors too; None if the file does not exist yet."""
        return from_one(comm, lambda: self.load() if self.path.exists() else None)

    def write(self, data: Mapping[str, object]) -> None:
        """Local. Writes plain data; the file before stays until this one is complete."""
        with atomic_write(self.path) as file:
            file.write(json.dumps({"format": _FORMAT, "problem": self.problem, **data}))

    def read(self) -> dict:
        """Local. The data in the file.

        Raises:
            DescriptionError: as ``load``.
        """
        data = read_json(self.path, "checkpoint", form=_FORMAT, remedy="Start without resuming")
        mine = json.loads(json.dumps(self.problem))
        if data["problem"] != mine:
            other = [key for key in mine if data["problem"].get(key) != mine[key]]
            raise DescriptionError(
                f"checkpoint {str(self.path)!r}",
                f"it belongs to another problem, with other {', '.join(other)}",
                "Resume with the options of the first run, or start without resuming",
            )
        return data


def fingerprint(
    simulation: Simulation,
    rest: ParametricShape,
    targets: Sequence[Target],
    regulariser: Regulariser,
    optimiser: Optimiser,
    surrogate: Simulation | None,
) -> dict[str, object]:
    """The problem, its optimiser and surrogate as plain data, with which a checkpoint must agree."""
    mechanism = simulation.scene.mechanism
    parts = (mechanism.links, mechanism.joints, mechanism.motors)
    return {
        "mechanism": mechanism.name,
        **_simulated(simulation),
        "effects": plain_data(simulation.scene.effects),
        "drawing": plain_data(parts),
        "links": [
            [link.name, *((i.name, i.isometry.mirrors) for i in link.images), link.spline.initial.tolist()]
            for link in rest.links
        ],
        "bounds": plain_data([link.bounds for link in rest.links]),
        "numbers": plain_data(rest.numbers.numbers),
        "targets": plain_data(targets),
        "regulariser": plain_data(regulariser),
        "optimiser": type(optimiser).__name__,
        "surrogate": None if surrogate is None else _simulated(surrogate),
    }


def _simulated(simulation: Simulation) -> dict[str, object]:
    """What a simulation adds to its scene."""
    own = simulation.fidelity
    return {
        "space": own.model.name,
        "order": own.order,
        "sizes": list(own.sizes.values()),
        "elements": plain_data((own.layers, own.segments, own.quadrature, own.formulation)),
        "shapes": plain_data(tuple(simulation.shapes.values())),
        "materials": plain_data(simulation.model.materials),
    }


def plain_data(value: object) -> object:
    """``value`` as data of JSON, the same in every run: objects by their attributes, functions by their names."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return [plain_data(pair) for pair in value.items()]
    if isinstance(value, Sequence):
        return [plain_data(own) for own in value]
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "__qualname__"):
        return value.__qualname__
    names = [own.name for own in fields(value)] if is_dataclass(value) else list(getattr(value, "__dict__", ()))
    return {"kind": type(value).__name__} | {name: plain_data(getattr(value, name)) for name in names}


class DesignProgress:
    """Shows iteration, objective, worst target error and time left on standard error; a context manager.

    Time left is extrapolated from the predicted reduction of the last six iterations, up to the optimiser's limit of
    iterations.

    Args:
        optimiser: gives the criteria of its end.
        leads: whether this process shows anything.
        name: of the task shown.
        clock: seconds from an arbitrary start, increasing.
    """

    def __init__(
        self, optimiser: Optimiser, *, leads: bool, name: str = "design", clock: Callable[[], float] = monotonic
    ) -> None:
        self._optimiser, self._clock = optimiser, clock
        self._progress = Progress(None, name, shown=leads, clock=clock)
        self._recent: deque[tuple[float, float]] = deque(maxlen=6)

    def update(self, iterate: Iterate, errors: np.ndarray) -> None:
        """Shows an iterate; ``errors`` (targets,) are relative."""
        self._recent.append((self._clock(), max(iterate.reduction, 1e-300)))
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
        wanted = log(last / self._optimiser.least_reduction) / falling if falling > 0.0 else inf
        return each * max(1.0, min(wanted, self._optimiser.iterations - iterate.number))
