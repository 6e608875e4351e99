"""One process decides, all compute: a optimiser runs on the first process, the others evaluate with it.

Decisions that hang on the last bit of a number can then not differ between processes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import on_all
from fenicsmech.design.objective import Objective
from fenicsmech.design.optimisers import Evaluation, Infeasible, Iterate, Optimiser, Reason, Start


@dataclass(frozen=True, eq=False)
class Outcome:
    """How a minimisation ended.

    Attributes:
        number, evaluations, parameters, reason: as in ``Iterate`` and its evaluation.
        started: displacement of each target at the start, (targets,).
    """

    number: int
    evaluations: int
    parameters: np.ndarray
    reason: Reason
    started: np.ndarray


@dataclass(frozen=True, eq=False)
class _Evaluate:
    """A request to evaluate the objective."""

    parameters: np.ndarray
    below: float

    def answer(self, objective: Objective) -> Evaluation:
        return objective.evaluate(self.parameters, self.below)


@dataclass(frozen=True)
class _Estimate:
    """A request for the errors of the residuals at the best design so far."""

    def answer(self, objective: Objective) -> np.ndarray:
        return objective.errors()


class _Leader:
    """The objective as the first process sees it: the others are told what to evaluate."""

    def __init__(self, comm: MPI.Comm, objective: Objective) -> None:
        self._comm, self._objective, self.lengths = comm, objective, objective.lengths

    def evaluate(self, parameters: np.ndarray, below: float = np.inf) -> Evaluation:
        return replace(self._ask(_Evaluate(parameters, below)), errors=lambda: self._ask(_Estimate()))

    def _ask(self, request: _Evaluate | _Estimate):
        self._comm.bcast(request, root=0)
        return request.answer(self._objective)


def minimise_together(
    comm: MPI.Comm, objective: Objective, optimiser: Optimiser, start: Start, *, watch: Callable[[Iterate], None]
) -> Outcome:
    """The outcome of ``optimiser`` on all processes (collective); ``watch`` is called on the first.

    Raises:
        Infeasible: at the start.
        Exception: whatever ``watch`` raises, on all processes.
    """

    def lead() -> Outcome:
        started = []

        def watch_first(iterate: Iterate) -> None:
            started.append(objective.reached)
            watch(iterate)

        try:
            last = optimiser.minimise(_Leader(comm, objective), start, watch=watch_first)
        finally:
            comm.bcast(None, root=0)
        return Outcome(last.number, last.evaluations, last.evaluation.parameters, last.reason, started[0])

    return comm.bcast(on_all(comm, lambda: lead() if comm.rank == 0 else _follow(comm, objective)), root=0)


def _follow(comm: MPI.Comm, objective: Objective) -> None:
    """Takes part until the first process is done.

    Raises:
        Exception: the first error met on the way that the first process may not have seen.
    """
    failure = None
    while (request := comm.bcast(None, root=0)) is not None:
        try:
            request.answer(objective)
        except Infeasible:
            pass  # the first process has seen it too, and decides
        except Exception as error:  # as a rule it has seen this as well, and ends; until then it needs answers
            failure = failure or error
    if failure is not None:
        raise failure
