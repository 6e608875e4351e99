"""Errors of the values of one curve: estimates, what speaks against them, and errors from finer elements.

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
from fenicsmech.simulation.finer_elements import FinerElements
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.frame_series import FrameSeries
from fenicsmech.simulation.omitted_effects import ExplanationOptions

_log = logger(__name__)
_AT_POINT = "force at a point of a flexible link"


@dataclass(frozen=True, eq=False)
class CheckedErrors:
    """Errors of the values of a curve, from equilibria in finer elements.

    Attributes:
        errors: to be added to the values, (frames,); estimates where there is no such equilibrium near.
        checked: whether there is one, (frames,).
        doubts: why errors may be off by more than a factor of two all the same, for every frame.
    """

    errors: np.ndarray
    checked: np.ndarray
    doubts: tuple[tuple[str, ...], ...]


class CurveErrors:
    """The errors of a ``curve``; estimates are kept."""

    def __init__(self, curve: FrameSeries) -> None:
        self._curve = curve
        self._known: dict[tuple[ErrorKind, Output | None], np.ndarray] = {}

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

    def doubts(self, kind: ErrorKind, options: DoubtOptions, like: CurveErrors | None = None) -> list[tuple[str, ...]]:
        """Why estimates of a kind may be off by more than a factor of two, for every frame.

        Args:
            kind: of the errors.
            options: when estimates are in doubt.
            like: errors of a curve whose largest values count; this one's by default.
        """
        curve, origin = self._curve, Origin()
        if (unloaded := self._moved_origin) is not None:
            origin = Origin.at(self._estimates, self._solver, unloaded, kind)
        given, largest = (like or self)._largest
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

    def checked(self, kind: ErrorKind, options: DoubtOptions, like: CurveErrors | None = None) -> CheckedErrors:
        """Errors of a kind from finer elements, estimates where there is no equilibrium; arguments as of ``doubts``."""
        curve, found = self._curve, dict[int, Frame]()
        (errors,) = self.estimated([kind])
        doubts: list[tuple[str, ...]] = [()] * len(errors)
        try:
            finer = FinerElements(curve, options)
        except EquilibriumError as failure:
            return CheckedErrors(errors, np.zeros(len(errors), bool), ((failure.problem,),) * len(errors))
        for k, frame in enumerate(curve.frames):
            try:
                found[k] = finer.frame(frame)
            except EquilibriumError as failure:
                doubts[k] = (failure.problem,)
        at = np.array(list(found), dtype=int)
        if found:
            series = finer.series(tuple(found.values()))
            there = CurveErrors(series)
            (rest,) = there.estimated([kind])
            if kind is ErrorKind.ELEMENTS:
                errors[at] = series.values - curve.values[at] + rest
                left = there._left(rest, errors[at], options)
            else:
                errors[at], left = rest, there.doubts(kind, options, like or self)
            for k, own in zip(found, left, strict=True):
                doubts[k] = own
        return CheckedErrors(errors, np.isin(np.arange(len(errors)), at), tuple(doubts))

    def _left(self, rest: np.ndarray, errors: np.ndarray, options: DoubtOptions) -> list[tuple[str, ...]]:
        """Doubts that are left of ``errors`` of the elements that this curve finds, its own estimates ``rest`` among
        them, (frames,) each."""
        said = {
            "most of the error left in the next order": np.abs(rest) > options.left * np.abs(errors),
            _AT_POINT: np.abs(self.growth()) > options.growth * np.abs(errors),
        }
        return _reasons(said, len(errors))

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
    def _largest(self) -> tuple[float, float]:
        """The largest prescribed value and the largest value of the curve."""
        curve = self._curve
        prescribed = curve.displacements if curve.unknown is Unknown.FORCE else curve.forces
        return float(np.abs(prescribed).max()), float(np.abs(curve.values).max())

    def _keep(self, kind: ErrorKind, output: Output | None, errors: np.ndarray) -> None:
        """Keeps estimates, (frames,), and warns of values that have no limit."""
        self._known[kind, output] = errors
        growth, (_, largest) = np.abs(self.growth()).max(), self._largest
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
