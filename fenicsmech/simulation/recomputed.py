"""Frames of a curve in another discretisation of its scene, with the equilibria of the curve as guesses.

In elements of the next order, in the plane half as wide too, with the estimate η of the error there, the error of a
value Q is

    Q(u) − Q(u_k) ≈ Q(u_f) − Q(u_k) + min(1, θ) η(u_f),     θ = (Q(u_f) − Q(u_k)) / (η(u_k) − η(u_f)),

to all orders in the error of the displacement but for what is left of it, within a factor of two where η is, which is
less than half of it. θ is the part of the fall that estimates state which values show; it counts where it is positive.
Estimates alone miss corners, and where links begin to touch: the next order leaves much of those, smaller elements
less. What space adds to plane stress is the difference of values in space and in plane stress, both in elements of the
next order (3 at most in space), as large: what elements leave of both is nearly the same, and its estimates are not.
Edges of designs of order 1 stay straight.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

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
from fenicsmech.simulation.discretisation import Discretisation
from fenicsmech.simulation.frame import Frame, FrameRecorder
from fenicsmech.simulation.frame_series import FrameSeries
from fenicsmech.simulation.transfer import carried_design, guess, whole_state


class Recomputed:
    """Frames of a curve in another discretisation.

    Args:
        curve: the curve.
        discretisation: the other one, of the same scene.
        options: when an equilibrium continues one of the curve's.

    Raises:
        EquilibriumError: no unloaded equilibrium is near.
    """

    def __init__(self, curve: FrameSeries, discretisation: Discretisation, options: DoubtOptions) -> None:
        self._curve, self._discretisation, self._options = curve, discretisation, options
        self._own, self._other = curve.discretisation.model, discretisation.model
        self._solver = discretisation.solver(curve.part, [other for other, _ in curve.others])
        followed = discretisation.followed_control(curve.part)
        with self._shaped(curve.frames[0].design):
            self._unloaded = self._guess(curve.unloaded)
            if curve.unloaded.has_reactions:
                self._unloaded = self._near(curve.unloaded, LoadControl(0.0)).state
            self._recorder = FrameRecorder(discretisation, self._solver.system, followed).zeroed(self._unloaded)

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
        start = control.prepare(self._guess(state))
        try:
            found = self._solver.solve(start, control)
        except NotConverged as failure:
            raise self._none(failure.reason) from failure
        if self._solver.missed(start, found, self._options.rounding) > self._options.miss:
            raise self._none("a fold lies between")
        return found

    def _guess(self, state: State) -> State:
        """An equilibrium of the curve as a guess."""
        other = self._other
        poses = other.linkage.joints.space.converted(state.poses)
        like = other.assembled_state(poses, state.motors)
        return guess(
            other,
            whole_state(self._own, state),
            replace(like, constant=state.constant, minimum_shift=state.minimum_shift, unstable=state.unstable),
        )

    @contextmanager
    def _shaped(self, design: Design) -> Iterator[None]:
        """A context in which both models have a design of the curve."""
        own, other = self._own, self._other
        same = own.mesh is other.mesh and min(own.elastic.order, 2) == min(other.elastic.order, 2)
        with own.shaped(design), other.shaped(design if same else carried_design(own, design, other)):
            yield

    def _none(self, reason: str) -> EquilibriumError:
        curve, fidelity = self._curve, self._discretisation.fidelity
        return EquilibriumError(
            f"{curve.part.name!r} in configuration {curve.configuration.name!r}",
            f"no equilibrium is near in elements of order {fidelity.order} in {fidelity.model.name} ({reason})",
            "Use smaller elements",
        )
