"""The design objective: targets as residuals, inequalities and a plain objective, with derivatives.

    O(p) = Σ ½ w_k r_k² + Σ w_k Q_k(p) / s_k + R(p),     r_k = (Q_k(p) − Q̄_k) / s_k,     c_k = ± (Q_k(p) − Q̄_k) / s_k

(the paper's equation 5 and section V-A, relative to the targets and so free of units), where Q_k are the simulation's
values plus a correction that is held fixed (``correction``). Each evaluation places the handles, reshapes the links,
follows the equilibria of all samples from those of the best design so far, and computes the adjoint derivatives of all
targets with respect to p. Samples are spread over groups of processes, each with a communicator of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import on_all
from fenicsmech.design.equilibria import DesignEquilibria, SampleEquilibria
from fenicsmech.design.optimisers.problem import Evaluation, Inequalities, Infeasible, Plain, TooHigh, merit
from fenicsmech.design.regularisers import Model, Regulariser
from fenicsmech.design.rest_shape import ParametricShape
from fenicsmech.design.shape.handle_optimum import HandlePlacement, ShapeError
from fenicsmech.design.target import Comparison, Target
from fenicsmech.log import Clock
from fenicsmech.quantities import Sample
from fenicsmech.simulation import WholeState

_SPLITS = MPI.Comm.Create_keyval()  # attribute of a communicator: its splits by their number, each made once


@dataclass(frozen=True, eq=False)
class _Base:
    """The best design so far, from which others are reached."""

    placement: HandlePlacement
    solved: DesignEquilibria


class Objective:
    """O(p) of one simulation.

    Args:
        rest: from p to the rest shape of this group's simulation.
        equilibria: of this group's targets.
        comparison: of values with all targets.
        regulariser: R.
        group: this process's group.
        clock: of the phases: handles, regularisers, equilibria, gradients, estimates.

    Attributes:
        lengths: typical change ℓ of each parameter, (parameters,).
        correction: added to the simulation's values before they are compared, (components,).
        reached: the simulation's values at the last evaluation, (components,).
    """

    def __init__(
        self,
        rest: ParametricShape,
        equilibria: SampleEquilibria,
        *,
        comparison: Comparison,
        regulariser: Regulariser,
        group: Group,
        clock: Clock,
    ) -> None:
        self._rest, self._equilibria, self._regulariser, self._group = rest, equilibria, regulariser, group
        self.comparison = comparison
        self._base: _Base | None = None
        self._near: HandlePlacement | None = None
        self._scaled = False
        self.lengths, self._clock = rest.lengths, clock
        self._rows = np.zeros((comparison.size, len(rest.lengths)))
        self.reached, self.correction = np.full(comparison.size, np.nan), np.zeros(comparison.size)

    @property
    def compared(self) -> np.ndarray:
        """Corrected values, which targets are compared with, at the last evaluation, (components,)."""
        return self.reached + self.correction

    @property
    def placement(self) -> HandlePlacement:
        """Handle positions of the best design so far."""
        return self._best.placement

    def begin(self, near: HandlePlacement | None, drawn: np.ndarray | None = None) -> None:
        """Starts afresh: the next evaluation has equilibria that were kept of its design, or finds them from zero load.

        Args:
            near: handle positions to start from.
            drawn: components to which minimised quantities are relative; by default those of the next evaluation.
        """
        self._base, self._near, self._scaled = None, near, drawn is not None
        if drawn is not None:
            self.comparison = self.comparison.relative_to(drawn)

    def loaded(self, parameters: np.ndarray, near: HandlePlacement | None = None) -> np.ndarray:
        """The simulation's values at a design, loaded from zero, (components,).

        Args:
            parameters: p, (parameters,).
            near: handle positions to start from; those drawn by default.

        Raises:
            Infeasible: cells invert, or a target's equilibrium is not found or is unstable.
        """
        from_zero = self._equilibria.from_zero
        return self._values(on_all(self._group.everyone, lambda: self._solve(parameters, near, from_zero))[2])

    def evaluate(
        self, parameters: np.ndarray, below: float = np.inf, penalties: np.ndarray | float = 0.0
    ) -> Evaluation:
        """O and its derivatives; the design becomes the best so far.

        Args:
            parameters: p, (parameters,).
            below: the largest merit of use to the caller.
            penalties: ν of the inequalities in the merit, (inequalities,).

        Raises:
            Infeasible: cells invert, or a target's equilibrium is not found or is unstable.
            TooHigh: the merit is above ``below``; derivatives were not computed.
        """
        everyone = self._group.everyone
        base, equilibria = self._base, self._equilibria
        near = base.placement if base else self._near

        def find() -> DesignEquilibria:
            return equilibria.from_design(base.solved) if base else equilibria.kept() or equilibria.from_zero()

        placement, model, solved = on_all(everyone, lambda: self._solve(parameters, near, find))
        reached = self._values(solved)
        if not self._scaled:
            self.comparison, self._scaled = self.comparison.relative_to(reached), True
        compared, values = self.comparison, reached + self.correction
        residuals, inequalities = compared.residuals(values), compared.inequalities(values)
        value = 0.5 * float(residuals @ residuals) + compared.plain(values) + model(parameters).value
        # decisions may depend on its last bit
        reached_merit = everyone.bcast(merit(value, inequalities, penalties), root=0)
        if reached_merit > below:
            raise TooHigh(reached_merit, residuals)
        with self._clock.phase("gradients"):
            try:
                rows = self._gathered(
                    on_all(everyone, lambda: self._rest.slopes(placement, self._equilibria.gradients(solved)))
                )
            except ShapeError as error:
                raise Infeasible(str(error)) from error
        self._base = _Base(placement, solved)
        if base is None:  # those followed from design to design may be on paths that loads do not reach
            equilibria.keep(solved)
        self.reached, self._rows = reached, rows
        by_residuals, by_plain, by_inequalities = compared.slopes(rows)
        return Evaluation(
            parameters=np.array(parameters),
            residuals=residuals,
            jacobian=by_residuals,
            regulariser=model,
            errors=self.errors,
            plain=Plain(compared.plain(values), by_plain),
            inequalities=Inequalities(compared.bounded(), inequalities, by_inequalities),
        )

    def errors(self) -> np.ndarray:
        """Estimated errors |e| of the residuals of the best design so far, those of the finite elements."""
        return self.comparison.residual_errors(self.estimates())

    def estimates(self) -> np.ndarray:
        """Estimated discretisation errors of the best design so far, to be added to its values, (components,)."""
        with self._clock.phase("estimates"):
            estimates = on_all(self._group.everyone, lambda: self._equilibria.errors(self._best.solved))
        return self._gathered(estimates[:, None])[:, 0]

    def equilibria(self) -> dict[Sample, WholeState]:
        """The equilibria of all samples at the best design so far."""
        group, targets = self._group, self.comparison.targets
        own = on_all(group.everyone, lambda: self._equilibria.whole(self._best.solved))
        # by number: samples of another process are other objects
        mine = group.mine if group.leads else ()
        places = {sample: (k, number) for k in mine for number, sample in enumerate(targets[k].samples)}
        parts = group.everyone.allgather([(places[sample], state) for sample, state in own.items() if places])
        return {targets[k].samples[number]: state for part in parts for (k, number), state in part}

    def sensitivities(self) -> np.ndarray:
        """Relative change of each component when a parameter changes by its length ℓ, (components, parameters)."""
        return self.comparison.relative_slopes(self._rows) * self.lengths

    def active(self, parameters: np.ndarray) -> tuple[str, ...]:
        """The bounds that hold the design ``parameters`` back, in words."""
        placement = on_all(self._group.everyone, lambda: self._rest.place(parameters, self.placement))
        return self._group.everyone.bcast(self._regulariser.active(self._rest, placement), root=0)

    @property
    def _best(self) -> _Base:
        assert self._base is not None, "no design was evaluated yet"
        return self._base

    def _values(self, solved: DesignEquilibria) -> np.ndarray:
        return self._gathered(self._equilibria.values(solved)[:, None])[:, 0]

    def _solve(
        self, parameters: np.ndarray, near: HandlePlacement | None, find: Callable[[], DesignEquilibria]
    ) -> tuple[HandlePlacement, Model, DesignEquilibria]:
        """Handle placement, from the one ``near``, model of R, and the equilibria of this group."""
        with self._clock.phase("handles"):
            try:
                placement = self._rest.place(parameters, near)
            except ShapeError as error:
                raise Infeasible(str(error)) from error
        with self._clock.phase("regularisers"):
            model = self._regulariser.around(self._rest, placement)
        with self._clock.phase("equilibria"):
            solved = find()
        return placement, model, solved

    def _gathered(self, rows: np.ndarray) -> np.ndarray:
        """One row per component from the rows of each group's targets, (components, n)."""
        everyone = self._group.everyone
        parts = everyone.allgather((self._group.mine, rows) if self._group.leads else ((), rows[:0]))
        gathered = np.empty((self.comparison.size, rows.shape[1]))
        for mine, part in parts:
            first = 0
            for place in (self.comparison.places[k] for k in mine):
                size = place.stop - place.start
                gathered[place], first = part[first : first + size], first + size
        return gathered


# -- groups of processes ---


@dataclass(frozen=True)
class Group:
    """This process's group.

    Attributes:
        everyone: the communicator of all groups.
        comm: the communicator of this one.
        mine: indices of the targets of this group.
    """

    everyone: MPI.Comm
    comm: MPI.Comm
    mine: tuple[int, ...]

    @property
    def leads(self) -> bool:
        """Whether this process is the first of its group."""
        return self.comm.rank == 0


def group_count(processes: int, samples: int) -> int:
    """The number of groups with the shortest expected time.

    A group of n processes computes ⌈samples / groups⌉ equilibria, each in a time of 1 / √n: two processes are 1.4 times
    as fast as one.
    """
    choices = range(1, min(processes, max(samples, 1)) + 1)
    return min(choices, key=lambda groups: -(-samples // groups) / (processes // groups) ** 0.5)


def split(comm: MPI.Comm, samples: Sequence[int]) -> Group:
    """Groups of neighbouring processes of ``comm``; targets of sample k go to group k modulo their number.

    Args:
        comm: all processes.
        samples: the number of each target's sample, from ``sample_numbers``; targets of links at rest, which cost
            little, go to the first group.
    """
    count = group_count(comm.size, len(set(samples) - {-1}))
    if count == 1:
        return Group(comm, comm, tuple(range(len(samples))))
    mine = comm.rank * count // comm.size
    parts = comm.Get_attr(_SPLITS)
    if not isinstance(parts, dict):
        parts = {}
        comm.Set_attr(_SPLITS, parts)
    if count not in parts:
        parts[count] = comm.Split(color=mine, key=comm.rank)
    return Group(comm, parts[count], tuple(k for k, own in enumerate(samples) if max(own, 0) % count == mine))


def sample_numbers(targets: Sequence[Target]) -> list[int]:
    """The number of each target's sample among all, −1 for links at rest."""
    numbers = {own: k for k, own in enumerate(dict.fromkeys(t.sample for t in targets if t.sample is not None))}
    return [-1 if target.sample is None else numbers[target.sample] for target in targets]
