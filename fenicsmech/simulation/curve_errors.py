"""Errors of the values of one curve: estimates, what speaks against them, and errors from equilibria elsewhere.

Displacements count from the unloaded configuration: its own error is taken from theirs, or moves with the place that a
prescribed one counts from.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fenicsmech.elasticity import SPATIAL, ElasticModel
from fenicsmech.equilibrium import EquilibriumSolver, PointLoad, Unknown
from fenicsmech.errors import EquilibriumError
from fenicsmech.estimates import (
    ROUNDED,
    AccuracyOptions,
    DoubtOptions,
    Equilibrium,
    ErrorKind,
    Estimates,
    Origin,
    adjoint_at,
    cause_of_growth,
    check_plane_stress,
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
_ESTIMATED = "most of the error is an estimate"


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
    """Frames of a curve in another discretisation.

    Attributes:
        count: of the curve's frames.
        found: the numbers of those near which there is an equilibrium.
        series: these equilibria, None without any.
        failures: why there is none, by frame.
    """

    count: int
    found: Sequence[int]
    series: FrameSeries | None
    failures: Mapping[int, str]

    @property
    def values(self) -> np.ndarray:
        """Of the curve's unknown, (count,), NaN where no equilibrium is near."""
        return self._all(lambda series: series.values)

    @property
    def rest(self) -> np.ndarray:
        """Estimates of what elements leave of them, (count,)."""
        return self._all(lambda series: CurveErrors(series).estimated([ErrorKind.ELEMENTS])[0])

    @property
    def growth(self) -> np.ndarray:
        """Growth of values that have no limit with each halving of the elements, (count,)."""
        return self._all(lambda series: np.abs(CurveErrors(series).growth()))

    @property
    def imbalance(self) -> np.ndarray:
        """Bounds of what residuals change values by, (count,), see ``CurveErrors``."""
        return self._all(lambda series: CurveErrors(series).imbalance)

    def _all(self, some: Callable[[FrameSeries], np.ndarray]) -> np.ndarray:
        """What ``some`` gives for the frames found, NaN for the others."""
        every = np.full(self.count, np.nan)
        if self.series is not None:
            every[list(self.found)] = some(self.series)
        return every


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
        """Errors of a kind from equilibria elsewhere: in finer elements, or in space; estimates where there is none.

        Raises a DescriptionError where the error is that of plane stress and the curve is in another model.
        """
        own, discretisation = self._curve.values, self._curve.discretisation
        if kind is ErrorKind.PLANE_STRESS:
            check_plane_stress(discretisation.fidelity.model)
            finer = discretisation.finer
            there, space = (self._elsewhere(other, options) for other in (finer, finer.in_space))
            return self._found(kind, space.values - there.values, space.rest - there.rest, (there, space), options)
        there = self._elsewhere(discretisation.refined, options)
        (before,), fall = self.estimated([kind]), there.values - own
        left = _left(fall, before, there.rest)
        return self._found(kind, fall + left, left, (there,), options)

    def _found(
        self,
        kind: ErrorKind,
        errors: np.ndarray,
        left: np.ndarray,
        elsewhere: Sequence[_Elsewhere],
        options: DoubtOptions,
    ) -> CheckedErrors:
        """Errors of a kind that were found ``elsewhere``, of which some is ``left`` to estimates, (frames,) each."""
        checked, count = np.isfinite(errors), len(errors)
        if not checked.all():
            (estimates,) = self.estimated([kind])
            errors = np.where(checked, errors, estimates)
        least = options.left * np.abs(errors)
        said = {
            _ESTIMATED: np.abs(left) > least,
            _AT_POINT: elsewhere[-1].growth > least,
            ROUNDED: self.imbalance + sum(own.imbalance for own in elsewhere) > least,
        }
        failures = [tuple(own.failures[k] for own in elsewhere if k in own.failures) for k in range(count)]
        doubts = [first or own for first, own in zip(failures, _reasons(said, count), strict=True)]
        return CheckedErrors(errors, checked, tuple(doubts))

    def _elsewhere(self, discretisation: Discretisation, options: DoubtOptions) -> _Elsewhere:
        """The frames in another discretisation."""
        frames, found, failures = self._curve.frames, dict[int, Frame](), dict[int, str]()
        try:
            other = Recomputed(self._curve, discretisation, options)
        except EquilibriumError as failure:
            return _Elsewhere(len(frames), [], None, dict.fromkeys(range(len(frames)), failure.problem))
        for k, frame in enumerate(frames):
            try:
                found[k] = other.frame(frame)
            except EquilibriumError as failure:
                failures[k] = failure.problem
        series = other.series(tuple(found.values())) if found else None
        return _Elsewhere(len(frames), list(found), series, failures)

    @cached_property
    def imbalance(self) -> np.ndarray:
        """Bounds of what residuals change values by, of equilibria known to rounding only, (frames,); 0 of others."""
        curve, bounds = self._curve, np.zeros(len(self._curve.frames))
        for k, frame in enumerate(curve.frames):
            if frame.residuals[-1] > self._solver.options.tolerance:
                own = curve.equilibrium(frame)
                with self._estimates.shaped(own.design):
                    bounds[k] = adjoint_at(self._solver, own).imbalance
        return bounds

    def growth(self, kind: ElasticModel | None = None) -> np.ndarray:
        """``Curve.growth_by_halving`` in an elastic model, that of the curve by default."""
        curve, found = self._curve, self._curve.discretisation
        with found.model.shaped(curve.frames[0].design):
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


def _left(fall: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """The error left in finer elements, from estimates η₀ ``before`` and η₁ ``after`` it fell by d, (frames,) each.

    Estimates that overstate how it falls overstate what is left: min(1, θ) η₁ with θ = d / (η₀ − η₁) > 0, else η₁.
    """
    stated = before - after
    part = np.divide(fall, stated, out=np.ones_like(fall), where=stated != 0.0)
    return after * np.where((part > 0.0) & (part < 1.0), part, 1.0)


def _reasons(said: Mapping[str, np.ndarray], count: int) -> list[tuple[str, ...]]:
    """The reasons that hold, for each of so many frames."""
    return [tuple(reason for reason, holds in said.items() if holds[k]) for k in range(count)]
