"""Equilibria of a curve in elements of the next order on the same mesh, from those of the curve.

Displacements of order k are some of those of order k + 1, so that an equilibrium is a guess there as it is: a few steps
of Newton's method lead to the one near. With the estimate η of its own error, the error of a value Q is

    Q(u) − Q(u_k) ≈ Q(u_(k+1)) − Q(u_k) + η(u_(k+1)),

to all orders in the error of the displacement but for what η leaves. It is within a factor of two where η is and
|η| < ½ |Q(u_(k+1)) − Q(u_k) + η|. Edges of designs of order 1 stay straight.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from dolfinx import fem

from fenicsmech.compat import owned_values
from fenicsmech.equilibrium import (
    Control,
    DisplacementControl,
    EquilibriumPoint,
    LoadControl,
    NotConverged,
    State,
    Unknown,
)
from fenicsmech.errors import EquilibriumError
from fenicsmech.estimates import DoubtOptions
from fenicsmech.model import Design
from fenicsmech.simulation.frame import Frame, FrameRecorder
from fenicsmech.simulation.frame_series import FrameSeries


class FinerElements:
    """Frames of a curve in elements of the next order.

    Args:
        curve: the curve.
        options: when an equilibrium continues one of the curve's.

    Raises:
        EquilibriumError: no unloaded equilibrium is near.
    """

    def __init__(self, curve: FrameSeries, options: DoubtOptions) -> None:
        self._options, self._curve, self._coarse = options, curve, curve.discretisation.model
        self._discretisation, part = curve.discretisation.finer, curve.part
        self._solver = self._discretisation.solver(part, [other for other, _ in curve.others])
        followed = self._discretisation.followed_control(part)
        with self._shaped(curve.frames[0].design):
            self._unloaded = self._lifted(curve.unloaded)
            if curve.unloaded.has_reactions:
                self._unloaded = self._near(curve.unloaded, LoadControl(0.0)).state
            self._recorder = FrameRecorder(self._discretisation, self._solver.system, followed).zeroed(self._unloaded)

    def series(self, frames: Sequence[Frame]) -> FrameSeries:
        """Such ``frames``."""
        return replace(self._curve, frames=tuple(frames), discretisation=self._discretisation, unloaded=self._unloaded)

    def frame(self, frame: Frame) -> Frame:
        """The equilibrium near one of the curve's, under the same force or displacement.

        Raises:
            EquilibriumError: none is near.
        """
        with self._shaped(frame.design):
            control: Control = LoadControl(frame.force)
            if self._curve.unknown is Unknown.FORCE:
                control = DisplacementControl(frame.displacement + self._recorder.origin)
            found = self._near(frame.state, control)
            if found.unstable_modes != frame.unstable_modes:
                raise self._none("the one found is of another stability")
            return self._recorder.frame(found)

    def _near(self, state: State, control: Control) -> EquilibriumPoint:
        """The equilibrium that continues one of the curve's."""
        solver, system = self._solver, self._solver.system
        start = control.prepare(self._lifted(state))
        try:
            found = solver.solve(start, control)
        except NotConverged as failure:
            raise self._none(failure.reason) from failure
        system.load(start)
        missing = system.residual(start, control).vector
        system.unknowns.turn(found.state.poses)
        if found.linearisation.missed(start, found.state, missing, self._options.rounding) > self._options.miss:
            raise self._none("a fold lies between")
        return found

    def _lifted(self, state: State) -> State:
        """An equilibrium of the curve, in elements of the next order."""
        coarse, fine = self._coarse.elastic, self._discretisation.model.elastic
        self._coarse.load(state)
        values = []
        for own, other in zip(fine.fields, [*coarse.fields, None], strict=False):
            lifted = fem.Function(own.function_space)
            if other is not None:
                lifted.interpolate(other)
            values.append(owned_values(lifted).copy())
        return replace(state, u=np.concatenate(values))

    @contextmanager
    def _shaped(self, design: Design) -> Iterator[None]:
        """A context in which both models have a design of the curve."""
        coarse, fine = self._coarse, self._discretisation.model
        field = fem.Function(coarse.elastic.shape.function_space)
        field.x.array[:] = design.field
        lifted = fem.Function(fine.elastic.shape.function_space)
        lifted.interpolate(field)
        with coarse.shaped(design), fine.shaped(replace(design, field=lifted.x.array)):
            yield

    def _none(self, reason: str) -> EquilibriumError:
        curve = self._curve
        return EquilibriumError(
            f"{curve.part.name!r} in configuration {curve.configuration.name!r}",
            f"no equilibrium is near in elements of the next order ({reason})",
            "Use smaller elements",
        )
