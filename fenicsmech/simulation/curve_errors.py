"""Errors of the values of one curve: estimates, what speaks against them, and errors from equilibria elsewhere.

Displacements count from the unloaded configuration: its own error is taken from theirs, or moves with the place that a
prescribed one counts from.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fenicsmech.elasticity import SPATIAL, ElasticModel
from fenicsmech.equilibrium import EquilibriumSolver, PointLoad, Unknown
from fenicsmech.errors import EquilibriumError
from fenicsmech.estimates import (
    AccuracyOptions,
    DoubtOptions,
    Equilibrium,
    ErrorKind,
    Estimates,
    Origin,
    cause_of_growth,
    examined,
    growth_by_halving,
)
from fenicsmech.log import logger
from fenicsmech.mechanism import Output
from fenicsmech.simulation.discretisation import Discretisation
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.frame_series import FrameSeries
from fenicsmech.simulation.omitted_effects import ExplanationOptions
from fenicsmech.simulation.recomputed import Recomputed

_log = logger(__name__)
_AT_POINT = "force at a point of a flexible link"


@dataclass(frozen=True, eq=False)
class CheckedErrors:
    """Errors of the values of a curve, from equilibria in finer elements or in space.

    Attributes:
        errors: to be added to the values, (frames,); estimates where there is no such equilibrium near.
        checked: whether there is one, (frames,).
        doubts: why errors may be off by more than a factor of two all the same, for every frame.
    """

    errors: np.ndarray
    checked: np.ndarray
    doubts: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, eq=False)
class _Elsewhere:
    """Values of a curve in another discretisation, NaN where no equilibrium is near.

    Attributes:
        values: of the curve's unknown, (frames,).
        rest: estimates of what elements leave of them, (frames,).
        growth: with each halving of the elements, without limit, (frames,).
        failures: why there is none, by frame.
    """

    values: np.ndarray
    rest: np.ndarray
    growth: np.ndarray
    failures: Mapping[int, str]


class CurveErrors:
    """The errors of a ``curve``.

    Args:
        curve: the curve.
        known: estimates made before, (frames,) each, to which others are added.
    """

    def __init__(
        self, curve: FrameSeries, known: dict[tuple[ErrorKind, Output | None], np.ndarray] | None = None
    ) -> None:
        self._curve, self._known = curve, {} if known is None else known

    def estimated(self, kinds: Sequence[ErrorKind], output: Output | None = None) -> list[np.ndarray]:
        """Estimates of errors of each kind, (frames,) each; those not known yet from one adjoint per frame."""
        missing = [kind for kind in kinds if (kind, output) not in self._known]
        if missing:
            point = None if output is None else self._curve.discretisation.model.point_load(output)
            origin, zero = self._unloaded(missing, point)
            at = map(self._curve.equilibrium, self._curve.frames)
            rows = [self._estimates.at(self._solver, own, missing, point, origin=origin) for own in at]
            for kind, column, less in zip(missing, np.array(rows).T, zero, strict=True):
                self._keep(kind, output, column - less)
        return [self._known[kind, output].copy() for kind in kinds]

    def doubts(self, kind: ErrorKind, options: DoubtOptions) -> list[tuple[str, ...]]:
        """Why estimates of a kind may be off by more than a factor of two, for every frame."""
        curve, origin = self._curve, Origin()
        if (unloaded := self._moved_origin) is not None:
            origin = Origin.at(self._estimates, self._solver, unloaded, kind)
        prescribed = curve.displacements if curve.unknown is Unknown.FORCE else curve.forces
        given, largest = np.abs(prescribed).max(), self._largest
        scale = largest / given if given else np.inf
        at = map(curve.equilibrium, curve.frames)
        own = [examined(self._estimates, self._solver, one, kind, origin, scale, options) for one in at]
        errors = np.array([error for error, _ in own])
        if (kind, None) not in self._known:
            self._keep(kind, None, errors)
        growth = np.abs(self.growth(SPATIAL if kind is ErrorKind.PLANE_STRESS else None))
        of_curve = {
            "estimate above a tenth of the largest value": np.abs(errors) > AccuracyOptions().first_order * largest,
            _AT_POINT: growth > options.growth * np.abs(errors),
        }
        return [first + reasons for first, (_, reasons) in zip(_reasons(of_curve, len(own)), own, strict=True)]

    def checked(self, kind: ErrorKind, options: DoubtOptions) -> CheckedErrors:
        """Errors of a kind from equilibria elsewhere: in finer elements, or in space; estimates where there is none."""
        here, (errors,) = self._curve.discretisation, self.estimated([kind])
        zero = np.zeros(len(errors))
        before, after = _Elsewhere(self._curve.values, zero, zero, {}), self._elsewhere(here.finer, options)
        if kind is ErrorKind.PLANE_STRESS:
            before, after = after, self._elsewhere(here.finer.in_space, options)
        rest = after.rest - before.rest
        found = after.values - before.values + rest
        checked = np.isfinite(found)
        errors[checked] = found[checked]
        said = {
            "most of the error is an estimate": np.abs(rest) > options.left * np.abs(errors),
            _AT_POINT: after.growth > options.left * np.abs(errors),  # the next order sees one halving, about
        }
        failures = [tuple(own.failures[k] for own in (before, after) if k in own.failures) for k in range(len(errors))]
        doubts = [first or own for first, own in zip(failures, _reasons(said, len(errors)), strict=True)]
        return CheckedErrors(errors, checked, tuple(doubts))

    def _elsewhere(self, discretisation: Discretisation, options: DoubtOptions) -> _Elsewhere:
        """The values in another discretisation."""
        curve, found = self._curve, dict[int, Frame]()
        missing = np.full(len(curve.frames), np.nan)
        values, rest, growth, failures = missing, missing.copy(), missing.copy(), {}
        try:
            other = Recomputed(curve, discretisation, options)
        except EquilibriumError as failure:
            return _Elsewhere(values, rest, growth, dict.fromkeys(range(len(missing)), failure.problem))
        for k, frame in enumerate(curve.frames):
            try:
                found[k] = other.frame(frame)
            except EquilibriumError as failure:
                failures[k] = failure.problem
        if found:
            at, series = list(found), other.series(tuple(found.values()))
            there = CurveErrors(series)
            values[at], (rest[at],) = series.values, there.estimated([ErrorKind.ELEMENTS])
            growth[at] = np.abs(there.growth())
        return _Elsewhere(values, rest, growth, failures)

    def growth(self, kind: ElasticModel | None = None) -> np.ndarray:
        """``Curve.growth_by_halving`` in an elastic model, that of the curve by default."""
        curve, found = self._curve, self._curve.discretisation
        growth = growth_by_halving(curve.part, found.model, found.fidelity.sizes, kind) * curve.forces
        if curve.unknown is Unknown.DISPLACEMENT:
            return growth
        # at a given displacement the force is smaller in proportion as its displacement would be larger
        moved = curve.displacements
        return -growth * np.divide(curve.forces, moved, out=0.0 * growth, where=moved != 0.0)

    @property
    def _estimates(self) -> Estimates:
        return self._curve.discretisation.estimates

    @property
    def _solver(self) -> EquilibriumSolver:
        return self._curve.solver

    @property
    def _largest(self) -> float:
        """The largest value of the curve."""
        return float(np.abs(self._curve.values).max())

    def _keep(self, kind: ErrorKind, output: Output | None, errors: np.ndarray) -> None:
        """Keeps estimates, (frames,), and warns of values that have no limit."""
        self._known[kind, output] = errors
        growth, largest = np.abs(self.growth()).max(), self._largest
        if kind is ErrorKind.ELEMENTS and output is None and growth > ExplanationOptions().tolerance * largest:
            _log.warning("%s (each halving adds %.2g of it)", cause_of_growth(self._curve.part), growth / largest)

    @cached_property
    def _moved_origin(self) -> Equilibrium | None:
        """The unloaded equilibrium, from which displacements count; None in a rigid assembly."""
        if not self._curve.unloaded.has_reactions:
            return None
        return Equilibrium(self._curve.unloaded, self._curve.frames[0].design, Unknown.DISPLACEMENT)

    def _unloaded(self, kinds: Sequence[ErrorKind], output: PointLoad | None) -> tuple[list[float], list[float]]:
        """Estimated errors of each kind in the unloaded configuration: of the force's displacement, and of the quantity
        in question where it counts from there; 0 in a rigid assembly."""
        nothing = [0.0] * len(kinds)
        if (at := self._moved_origin) is None:
            return nothing, nothing
        origin = self._estimates.at(self._solver, at, kinds)
        if output is not None:
            return origin, self._estimates.at(self._solver, at, kinds, output)
        return origin, nothing if self._curve.unknown is Unknown.FORCE else origin


def _reasons(said: Mapping[str, np.ndarray], count: int) -> list[tuple[str, ...]]:
    """The reasons that hold, for each of so many frames."""
    return [tuple(reason for reason, holds in said.items() if holds[k]) for k in range(count)]
