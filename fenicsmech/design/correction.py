"""Optimisation on corrected values: those of a simulation, plus corrections that are held fixed meanwhile.

    p_k = argmin O(Q(p) + c_k),     c_{k+1} = Q̂(p_k) + e(p_k) − Q(p_k),     c_0 = 0

Q are the values of the simulation that is minimised, Q̂ those of the simulation that counts, and e the goal-oriented
estimates of the discretisation error of Q̂. Only Q is differentiated. It belongs to

- the same simulation (deferred correction): c = e,
- or a surrogate, plane stress for 3D (space mapping): a few equilibria in 3D, and no gradient there.
  Those of the first round are found from the surrogate's at the same design and followed from round to round; the
  surrogate's at the optimum are loaded from zero again. Equilibria in 3D that are not found in this way are loaded from
  zero.

c changes from round to round because the derivatives of Q and of Q̂ + e differ. At the end the corrected
values are the true ones to within the last change. Where changes of a surrogate's corrections do not contract, the
simulation that counts is minimised itself.

Sources: J. W. Bandler et al., Space mapping: the state of the art (doi:10.1109/TMTT.2003.820904); for deferred
correction V. Pereyra, Iterated deferred corrections for nonlinear operator equations (doi:10.1007/BF02165406).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fenicsmech.design.designed import DesignedSimulation
from fenicsmech.design.equilibria import DesignEquilibria, SampleEquilibria
from fenicsmech.design.objective import Objective
from fenicsmech.design.optimisers.problem import Infeasible, Iterate, Optimiser, Reason, Start
from fenicsmech.design.result import DesignResult, Reached
from fenicsmech.design.run import Checkpoint, DesignIterate, DesignProgress, Optimum, Round, Saved, minimise_together
from fenicsmech.design.shape.handle_optimum import HandlePlacement, ShapeError
from fenicsmech.design.target import MET, Comparison, check_sensitivities
from fenicsmech.errors import EquilibriumError, set_options
from fenicsmech.log import logger
from fenicsmech.quantities import Sample
from fenicsmech.simulation import WholeState

_log = logger(__name__)
_FINER = 1e-2  # tolerance of a minimum that misses a target, over the optimiser's own
_UNREACHED = "loaded from zero, the optimum does not reach all its targets: %s"


@dataclass(frozen=True)
class Correction:
    """Options of the corrections of values before these are compared with targets.

    Attributes:
        estimates: whether error estimates are added; without, targets are met on the mesh of the simulation alone.
        change: largest change of a correction in the last round, over the target's scale: a tenth of the per cent
            within which targets count as met.
        resolved: the same over the component's error estimate, which is itself uncertain by as much; of smoothed
            extremes ``change`` or their own resolution counts.
        contraction: change of corrections over that of the round before. A surrogate whose ratio is larger in two
            rounds in a row is given up, since the gradient of the simulation itself leads to the optimum faster; a
            single round may exceed it, by ending at another design. Where changes grow, the surrogate is given up
            immediately.
        rounds: maximum number of rounds.

    Raises:
        DescriptionError: a number is not positive, or that of rounds not whole.
    """

    estimates: bool = True
    change: float = 1e-3
    resolved: float = 0.1
    contraction: float = 0.5
    rounds: int = 8

    def __post_init__(self) -> None:
        set_options(self, "the correction", rounds=1)


@dataclass(frozen=True, eq=False)
class Corrected:
    """The outcome of some rounds.

    Attributes:
        optimum: of the last round.
        round: the last one, with the correction found there.
        reached: values at the optimum.
        settled: whether further rounds would change nothing.
    """

    optimum: Optimum
    round: Round
    reached: Reached
    settled: bool


# -- values of the simulation that counts ---


def carried(
    equilibria: SampleEquilibria, solved: DesignEquilibria | None, surrogate: Callable[[], Mapping[Sample, WholeState]]
) -> DesignEquilibria:
    """Equilibria at the design that the model holds: from those ``solved`` in the last round, in the first one from
    those of the ``surrogate``; where they do not lead there, from zero load.

    Raises:
        Infeasible: loading leads elsewhere.
    """
    try:
        return equilibria.from_other(surrogate()) if solved is None else equilibria.from_design(solved)
    except Infeasible as failure:
        before = "the surrogate" if solved is None else "the last round"
        _log.info("equilibria of %s do not lead to those of this one: %s", before, failure)
    return equilibria.from_zero()


def verified(
    equilibria: SampleEquilibria, comparison: Comparison, followed: Reached, estimates: bool
) -> tuple[Reached, bool]:
    """Values loaded from zero at the design that the model holds, and whether they are those that were followed.

    Where loading fails, the values followed from design to design are kept; the log names the targets.
    """
    try:
        solved = equilibria.from_zero()
    except Infeasible as failure:
        _log.warning(_UNREACHED, failure)
        return followed, False
    values = equilibria.values(solved)
    same = _agree(comparison, values, followed.values)
    errors = followed.errors if same else equilibria.errors(solved)
    return Reached(values, errors, values + errors if estimates else values), same


def _agree(comparison: Comparison, loaded: np.ndarray, followed: np.ndarray) -> bool:
    """Whether values loaded from zero are those that were followed; the log names those that are not."""
    # values of one equilibrium differ by less
    different = np.flatnonzero(np.abs(loaded - followed) > 1e-6 * comparison.scale_of)
    for k in different:
        _log.warning(
            "%s of the optimum: %.6g when loaded from zero, %.6g when followed from the drawn design",
            *(comparison.names[k], loaded[k], followed[k]),
        )
    return len(different) == 0


# -- rounds ---


def correct(
    objective: Objective,
    begin: Start,
    first: Round,
    options: Correction,
    *,
    minimise: Callable[[Start, Round], tuple[Optimum, Round]],
    truth: Callable[[Optimum], Reached],
    continued: Callable[[np.ndarray], np.ndarray | None],
) -> Corrected:
    """Rounds of minimisation and correction, until corrections have settled, do not contract, or iterations run out.

    Where a later round has no value, the outcome is that of the one before.

    Args:
        objective: the one that is minimised.
        begin: where the first round starts.
        first: the first round.
        options: of the correction.
        minimise: the optimum of one round, and that round with the values at its start.
        truth: values of the simulation that counts.
        continued: the optimiser's memory at the start of the next round, from that at the end of the last.

    Raises:
        Infeasible: there is no value at the start, or the simulation that counts has none at the first optimum.
    """
    round = first
    last: Corrected | None = None
    while True:
        try:
            optimum, round = minimise(begin, round)
            reached = truth(optimum)
        except Infeasible as failure:
            if last is None:
                raise
            _log.warning("round %d has no value, that before it stands: %s", len(round.changes) + 1, failure)
            return last
        needed, scales = reached.compared - objective.reached, objective.comparison.scale_of
        off = np.abs(needed - round.correction)
        uncertain = np.where(objective.comparison.smoothed, 0.0, options.resolved * np.abs(reached.errors))
        enough = np.maximum(options.change, objective.comparison.resolution) * scales
        change = float(np.max(off / np.maximum(enough, uncertain)))
        round = replace(
            round,
            correction=tuple(needed.tolist()),
            changes=(*round.changes, change),
            largest=(*round.largest, float(np.max(off / scales))),
        )
        settled = change <= 1.0 or optimum.reason is Reason.ITERATIONS
        last = Corrected(optimum, round, reached, settled)
        if settled or len(round.changes) >= options.rounds or (round.surrogate and _stalls(round.changes, options)):
            return last
        begin = Start(optimum.parameters, optimum.number, optimum.evaluations, continued(optimum.memory))


def _stalls(changes: Sequence[float], options: Correction) -> bool:
    """Whether the last change grew, or did not contract like the one before."""
    slow = [late > options.contraction * early for early, late in zip(changes, changes[1:], strict=False)]
    return len(slow) > 0 and (changes[-1] > changes[-2] or (len(slow) >= 2 and all(slow[-2:])))


@dataclass(frozen=True, eq=False)
class Outcome:
    """The end of a run.

    Attributes:
        of: the simulation that was minimised.
        optimum, round, reached: as in ``Corrected``.
        placement: of the handles in the simulation that counts.
        verified: whether loading from zero leads there.
    """

    of: DesignedSimulation
    optimum: Optimum
    round: Round
    reached: Reached
    placement: HandlePlacement
    verified: bool


class CorrectedRun:
    """One optimisation of a problem.

    Args:
        problem: the simulation that counts.
        optimiser: of the objective.
        correction: of the values.
        start: initial design.
        saved: the checkpoint, if one is written.
        found: content of the checkpoint, saved by the run that this one continues.
        watch: called with every iterate on the first process.
    """

    def __init__(
        self,
        problem: DesignedSimulation,
        optimiser: Optimiser,
        correction: Correction,
        start: DesignResult | HandlePlacement | np.ndarray | None,
        saved: Checkpoint | None,
        found: Saved | None,
        watch: Callable[[DesignIterate], None] | None,
    ) -> None:
        self._problem, self._optimiser, self._options, self._watch = problem, optimiser, correction, watch
        self._start, self._saved, self._found = start, saved, found
        self._comm = problem.simulation.comm
        self._nothing = Round(False, (0.0,) * Comparison(problem.targets, problem.simulation.scene.units).size)
        self._next: tuple[Start, HandlePlacement | None, Round] | None = None  # where a surrogate was given up

    def from_surrogate(self, cheaper: DesignedSimulation | None) -> Outcome | None:
        """The optimum by a surrogate; None if there is none or its corrections do not settle."""
        problem = self._problem
        if cheaper is None:
            return None
        placement: HandlePlacement | None = None
        solved: DesignEquilibria | None = None

        def truth(optimum: Optimum) -> Reached:
            nonlocal placement, solved
            theta = self._comm.bcast(cheaper.team[1].placement.theta, root=0)
            with problem.clock.phase("verification"):
                try:
                    near = problem.rest.placement_from(optimum.parameters, theta) or placement
                    here = problem.rest.place(optimum.parameters, near)
                except ShapeError as failure:
                    raise Infeasible(str(failure)) from failure
                solved = carried(problem.loaded, solved, cheaper.team[1].equilibria)
                values, errors, placement = problem.loaded.values(solved), problem.loaded.errors(solved), here
            return Reached(values, errors, values + errors if self._options.estimates else values)

        try:
            end = self._rounds(cheaper, *self._beginning(cheaper, replace(self._nothing, surrogate=True)), truth)
        except Infeasible as failure:
            _log.info("the surrogate does not lead to a design: %s", failure)
            return None
        assert placement is not None, "the optimum was verified"
        if end.settled:
            same = self._loads(cheaper, end.optimum)
            return Outcome(cheaper, end.optimum, end.round, end.reached, placement, same)
        _log.info("corrections of the surrogate change by %s of the scale: it is given up", end.round.largest)
        optimum, reached = end.optimum, end.reached
        first = replace(end.round, surrogate=False, correction=tuple(reached.compared - reached.values), changes=())
        self._next = Start(optimum.parameters, optimum.number, optimum.evaluations), placement, first
        return None

    def _loads(self, cheaper: DesignedSimulation, optimum: Optimum) -> bool:
        """Whether the surrogate, loaded from zero, reaches the equilibria that it followed."""
        _, objective = cheaper.team
        placement, followed = self._comm.bcast((objective.placement, objective.reached), root=0)
        with self._problem.clock.phase("verification"):
            try:
                return _agree(objective.comparison, objective.loaded(optimum.parameters, placement), followed)
            except Infeasible as failure:
                _log.warning(_UNREACHED, failure)
                return False

    def directly(self) -> Outcome:
        """The optimum of the simulation itself."""
        problem, estimates = self._problem, self._options.estimates
        _, objective = problem.team

        def truth(optimum: Optimum) -> Reached:
            values, errors = objective.reached, objective.estimates()
            return Reached(values, errors, values + errors if estimates else values)

        try:
            end = self._rounds(problem, *(self._next or self._beginning(problem, self._nothing)), truth)
        except Infeasible as failure:
            # rank 0 alone knows the cause
            shape = self._comm.bcast(failure.__cause__ if isinstance(failure.__cause__, ShapeError) else None, root=0)
            if shape is not None:
                raise shape from None
            raise EquilibriumError(
                f"design of {problem.simulation.scene.mechanism.name!r}",
                f"the design to start from has no value: {failure}",
                "Draw links that carry the targets' loads, or start with smaller loads",
            ) from failure
        placement = self._comm.bcast(objective.placement, root=0)
        with problem.clock.phase("verification"):
            problem.rest.place(end.optimum.parameters, placement)
            reached, same = verified(problem.loaded, objective.comparison, end.reached, estimates)
        return Outcome(problem, end.optimum, end.round, reached, placement, same)

    def _beginning(self, low: DesignedSimulation, first: Round) -> tuple[Start, HandlePlacement | None, Round]:
        """Start, its handles if known, and the first round: where the saved run was if there is one."""
        if self._found is not None:
            start = self._found.start
            return start, low.rest.placement_from(start.parameters, self._found.handles), self._found.round
        parameters, near = self._given(low)
        return Start(parameters), near, first

    def _given(self, low: DesignedSimulation) -> tuple[np.ndarray, HandlePlacement | None]:
        """Parameters of the run's start, and its handles if known."""
        return (low.rest.initial, None) if self._start is None else low.given(self._start)

    def _rounds(
        self,
        low: DesignedSimulation,
        begin: Start,
        near: HandlePlacement | None,
        first: Round,
        truth: Callable[[Optimum], Reached],
    ) -> Corrected:
        _, objective = low.team
        if objective.comparison.relative and not first.drawn and self._start is not None:
            try:
                first = replace(first, drawn=tuple(objective.loaded(low.rest.initial).tolist()))
            except Infeasible as failure:
                _log.info("the least quantities are relative to those at the start, not as drawn: %s", failure)
        objective.begin(near, np.array(first.drawn) if first.drawn else None)
        return correct(
            objective,
            begin,
            first,
            self._options,
            minimise=lambda begin, round: self._minimise(low, begin, round),
            truth=lambda optimum: self._comm.bcast(truth(optimum), root=0),
            continued=self._optimiser.continued,
        )

    def _minimise(self, low: DesignedSimulation, begin: Start, round: Round) -> tuple[Optimum, Round]:
        """The optimum of a round, and the round with values and objective at the start of the optimisation.

        A later round that ends with violated inequalities, which the design of the round before met as they were then,
        is repeated from the run's start. A minimum that misses a target goes on with a smaller tolerance where what
        meets it is a gain that the tolerance neglects beside the rest of O.
        """
        _, objective = low.team
        objective.correction, found, self._found = np.array(round.correction), self._found, None
        optimiser = self._optimiser
        finer = replace(optimiser, tolerance=_FINER * optimiser.least_reduction)
        optimum = None
        if found is not None and found.ended is not None and found.ended[1] in (repr(optimiser), repr(finer)):
            here = objective.evaluate(begin.parameters)
            reason = Reason[found.ended[0]]
            memory = np.zeros(0) if begin.memory is None else begin.memory
            own = (begin.number, begin.evaluations, here.parameters, memory, reason, begin.refusal)
            optimum = Optimum(*own, here.penalty.value)
            if found.ended[1] == repr(finer):
                return optimum, round
        space, number = low.simulation.fidelity.model.name, len(round.changes) + 1

        def watch(iterate: Iterate) -> None:
            nonlocal round
            errors = objective.comparison.errors(objective.compared)
            if round.initial is None:
                check_sensitivities(low.targets, low.designs, sensitivities=objective.sensitivities(), errors=errors)
                started = tuple(objective.reached.tolist())
                drawn = round.drawn or started
                round = replace(round, started=started, drawn=drawn, initial=iterate.evaluation.value)
            if self._saved is not None:
                self._saved.save(iterate, objective.placement.theta, round, optimiser)
            progress.update(iterate, errors)
            if self._watch is not None:
                self._watch(DesignIterate(iterate.number, objective.placement, objective.compared, errors))

        name = f"design, {space}" if number == 1 else f"design, {space}, round {number}"
        with DesignProgress(self._optimiser, leads=self._comm.rank == 0, name=name) as progress:
            if optimum is None:
                optimum = minimise_together(self._comm, objective, optimiser, begin, watch=watch)
            if optimum.reason is Reason.VIOLATED and round.changes:
                again = Start(self._given(low)[0], optimum.number, optimum.evaluations)
                optimum = minimise_together(self._comm, objective, optimiser, again, watch=watch)
            if optimum.reason.converged and self._neglects_targets(objective, optimum):
                kept, optimiser = optimiser.continued(optimum.memory), finer
                again = Start(optimum.parameters, optimum.number, optimum.evaluations, kept)
                optimum = minimise_together(self._comm, objective, optimiser, again, watch=watch)
        return optimum, self._comm.bcast(round, root=0)

    def _neglects_targets(self, objective: Objective, optimum: Optimum) -> bool:
        """Whether a target is missed and ½ ‖r‖² of all is below the optimiser's tolerance times the rest of O."""

        def decide() -> bool:
            comparison, values = objective.comparison, objective.compared
            r, rest = comparison.residuals(values), abs(comparison.plain(values)) + optimum.regulariser
            missed = bool(np.any(np.abs(comparison.errors(values)) > MET))
            return missed and 0.5 * float(r @ r) <= self._optimiser.least_reduction * rest

        return self._comm.bcast(decide() if self._comm.rank == 0 else None)
