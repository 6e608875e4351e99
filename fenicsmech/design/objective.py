"""The design objective: squared relative errors of simulated displacements, with derivatives.

    O(p) = Σ ½ w_k r_k² + R(p),     r_k = (u_k(p) − ū_k) / |ū_k|,      k over targets

(the paper's equation 5 and section V-A, relative to the targets and so free of units). Each evaluation places the
handles, reshapes the links, follows the equilibria of all targets from those of the best design so far, and takes
their adjoint derivatives to p. Targets are spread over groups of processes, each with a communicator of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from fenicsmech.clock import Clock
from fenicsmech.collective import on_all
from fenicsmech.design.description import Target
from fenicsmech.design.equilibria import Known, TargetEquilibria
from fenicsmech.design.optimisers.problem import Evaluation, Infeasible, TooHigh
from fenicsmech.design.regularisers import Model, Regulariser
from fenicsmech.design.rest_shape import ParametricShape
from fenicsmech.design.shape.handle_optimum import HandlePlacement, ShapeError

_PARTS = MPI.Comm.Create_keyval()  # attribute of a communicator: its parts by their number, split once


@dataclass(frozen=True, eq=False)
class _Base:
    """The best design so far, from which others are reached."""

    value: float
    placement: HandlePlacement
    known: Known


class Objective:
    """O(p) of one simulation.

    Args:
        rest: from p to the rest shape of this group's simulation.
        equilibria: of this group's targets.
        targets: all of them.
        regulariser: R.
        group: this process's group.
        clock: of the phases: handles, regularisers, equilibria, gradients, estimates.

    Attributes:
        lengths: typical change ℓ of each parameter, (parameters,).
        reached: displacement of each target at the last evaluation, (targets,).
    """

    def __init__(
        self,
        rest: ParametricShape,
        equilibria: TargetEquilibria,
        *,
        targets: Sequence[Target],
        regulariser: Regulariser,
        group: Group,
        clock: Clock,
    ) -> None:
        self._rest, self._equilibria, self._regulariser, self._group = rest, equilibria, regulariser, group
        self._wanted = np.array([target.displacement for target in targets])
        self._root_weights = np.sqrt([target.weight for target in targets])
        self._scale = target_scales(targets) / self._root_weights
        self._base: _Base | None = None
        self._near: HandlePlacement | None = None
        self.lengths, self._clock = rest.lengths, clock
        self.reached = np.full(len(targets), np.nan)

    @property
    def placement(self) -> HandlePlacement:
        """Handle positions of the best design so far."""
        return self._best.placement

    def begin(self, near: HandlePlacement | None) -> None:
        """Starts afresh: the next evaluation finds its equilibria from zero load, its handles near ``near``."""
        self._base, self._near = None, near

    def evaluate(self, parameters: np.ndarray, below: float = np.inf) -> Evaluation:
        """O and its derivatives.

        Args:
            parameters: p, (parameters,).
            below: the largest value of use to the caller.

        Raises:
            Infeasible: cells invert, or a target's equilibrium is not found or is unstable.
            TooHigh: the value is above ``below``; derivatives were not computed.
        """
        placement, model, known = on_all(self._group.everyone, lambda: self._solve(parameters, self._base))
        reached = self._displacements(known)
        value = self._value(parameters, model, reached)
        if value > below:
            raise TooHigh(f"the objective is {value:.3g}")
        with self._clock.phase("gradients"):
            everyone = self._group.everyone
            rows = on_all(everyone, lambda: self._rest.gradient(placement, self._equilibria.gradients(known)))
            jacobian = self._gathered(rows) / self._scale[:, None]
        if self._base is None or value < self._base.value:
            self._base = _Base(value, placement, known)
        self.reached = reached
        return Evaluation(
            parameters=np.array(parameters),
            residuals=self._residuals(reached),
            jacobian=jacobian,
            regulariser=model,
            errors=self.errors,
        )

    def errors(self) -> np.ndarray:
        """Estimated errors |e| of the residuals of the best design so far, those of the finite elements, (targets,)."""
        with self._clock.phase("estimates"):
            estimates = on_all(self._group.everyone, lambda: self._equilibria.errors(self._best.known))
        return np.abs(self._gathered(estimates[:, None])[:, 0]) / self._scale

    def traced(self, parameters: np.ndarray) -> float:
        """O, its handles placed near the drawn ones and its equilibria found from zero load.

        Raises:
            Infeasible: cells invert, or a target's equilibrium is not found or is unstable.
        """
        _, model, known = on_all(self._group.everyone, lambda: self._solve(parameters, None))
        return self._value(parameters, model, self._displacements(known))

    def sensitivities(self, evaluation: Evaluation) -> np.ndarray:
        """Relative change of each displacement when a parameter changes by its length ℓ, (targets, parameters)."""
        return evaluation.jacobian * self.lengths / self._root_weights[:, None]

    def active(self, parameters: np.ndarray) -> tuple[str, ...]:
        """The bounds that hold the design ``parameters`` back, in words."""
        placement = on_all(self._group.everyone, lambda: self._rest.place(parameters, self.placement))
        return self._group.everyone.bcast(self._regulariser.active(self._rest, placement), root=0)

    @property
    def _best(self) -> _Base:
        assert self._base is not None, "no design was evaluated yet"
        return self._base

    def _residuals(self, reached: np.ndarray) -> np.ndarray:
        return (reached - self._wanted) / self._scale

    def _value(self, parameters: np.ndarray, model: Model, reached: np.ndarray) -> float:
        residuals = self._residuals(reached)
        value = 0.5 * float(residuals @ residuals) + model(parameters).value
        return self._group.everyone.bcast(value, root=0)  # decisions may depend on its last bit

    def _displacements(self, known: Known) -> np.ndarray:
        return self._gathered(np.array([[sample.displacement] for sample in known.samples]))[:, 0]

    def _solve(self, parameters: np.ndarray, base: _Base | None) -> tuple[HandlePlacement, Model, Known]:
        """Handle placement, model of R and this group's equilibria, followed from those of ``base`` if there is one."""
        with self._clock.phase("handles"):
            try:
                placement = self._rest.place(parameters, base.placement if base else self._near)
            except ShapeError as error:
                raise Infeasible(str(error)) from error
        with self._clock.phase("regularisers"):
            model = self._regulariser.around(self._rest, placement)
        with self._clock.phase("equilibria"):
            known = self._equilibria.follow(base.known) if base else self._equilibria.trace()
        return placement, model, known

    def _gathered(self, rows: np.ndarray) -> np.ndarray:
        """One row per target from the rows of each group's targets, (targets, n)."""
        everyone = self._group.everyone
        parts = everyone.allgather((self._group.mine, rows) if self._group.leads else ((), rows[:0]))
        gathered = np.empty((len(self._wanted), rows.shape[1]))
        for mine, part in parts:
            gathered[list(mine)] = part
        return gathered


def target_scales(targets: Sequence[Target]) -> np.ndarray:
    """|ū_k|, or a tenth of the largest where ū_k is less, (targets,)."""
    wanted = np.abs([target.displacement for target in targets])
    return np.maximum(wanted, 0.1 * wanted.max()) if wanted.any() else np.ones(len(wanted))


def target_errors(targets: Sequence[Target], reached: np.ndarray) -> np.ndarray:
    """Errors of displacements ``reached`` (targets,) relative to these scales, (targets,)."""
    return (reached - [target.displacement for target in targets]) / target_scales(targets)


def objective_error(targets: Sequence[Target], reached: np.ndarray, errors: Sequence[float | None]) -> float | None:
    """Discretisation error of the objective, O(u + d) − O(u).

    With the errors d_k of the targets' displacements, of scale s_k, and with residuals r_k,

        O(u + d) − O(u) = Σ w_k (r_k d_k / s_k + ½ (d_k / s_k)²).

    Far from the targets the first term counts, and the estimate is as good as those of displacements; where targets
    are met the second one is left, whose factor is the square of theirs. R depends on the design alone.

    Args:
        targets: wanted displacements.
        reached: displacements u, (targets,).
        errors: d, their estimated discretisation errors, (targets,); None where not known.
    """
    if any(error is None for error in errors):
        return None
    weights = np.array([target.weight for target in targets])
    relative = np.asarray(errors) / target_scales(targets)
    return float(weights @ (target_errors(targets, reached) * relative + 0.5 * relative**2))


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


def group_count(processes: int, targets: int) -> int:
    """The number of groups with the shortest expected time.

    A group of n processes works off ⌈targets / groups⌉ equilibria, each in a time of 1 / √n: two are 1.4
    times as fast as one.
    """
    choices = range(1, min(processes, targets) + 1)
    return min(choices, key=lambda groups: -(-targets // groups) / (processes // groups) ** 0.5)


def split(comm: MPI.Comm, targets: int) -> Group:
    """Groups of neighbouring processes of ``comm``; target k goes to group k modulo their number."""
    count = group_count(comm.size, targets)
    if count == 1:
        return Group(comm, comm, tuple(range(targets)))
    mine = comm.rank * count // comm.size
    parts = comm.Get_attr(_PARTS)
    if not isinstance(parts, dict):
        parts = {}
        comm.Set_attr(_PARTS, parts)
    if count not in parts:
        parts[count] = comm.Split(color=mine, key=comm.rank)
    return Group(comm, parts[count], tuple(range(mine, targets, count)))
