"""Traces the curve of a request: from the assembled configuration through all samples, recording frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np
from mpi4py import MPI

from fenicsmech.equilibrium import (
    ZERO_ENERGY_SHIFT,
    Control,
    Iteration,
    MotorControl,
    MotorPath,
    Path,
    PathFailed,
    Predictor,
    ShareControl,
    Solution,
    State,
    joint_reactions,
    motor_torques,
)
from fenicsmech.errors import EquilibriumError
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import Assembly, BodyPoint, Freedom, free_motions, is_held
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.idle_balance import idle_imbalance
from fenicsmech.simulation.leading import leading
from fenicsmech.simulation.request import CurveRequest

_UNBALANCED = 1e-4  # of the loads: what may be left along idle freedoms
_DROWNED = 1e-15  # of the links' stiffness: springs this soft are beside its rounding
_OTHERWISE = "Try follow() or displacement control past a limit point, other samples, or a finer mesh"
_LARGEST_TURN = 0.25  # rad, or mechanism lengths, of a motor between equilibria


class Tracer:
    """The unloaded equilibrium of a configuration, and the path of equilibria from there (collective).

    Args:
        model: the discretised mechanism.
        newton: the solver for the request's forces.
        request: what is asked for.
        assembly: the rigid assembly of the configuration.
        freedom: its mobility.
        predictor: how the next equilibrium is guessed.

    Raises:
        EquilibriumError: motors that strain the links, or the constant forces, lead to no equilibrium.
    """

    def __init__(
        self,
        model: MechanismModel,
        newton: Iteration,
        request: CurveRequest,
        *,
        assembly: Assembly,
        freedom: Freedom,
        predictor: Predictor,
    ) -> None:
        self._model, self._newton, self._request, self._predictor = model, newton, request, predictor
        self._system, self._joints = newton.system, model.linkage.joints
        self._poses = assembly.poses
        self._freedom, self._idle = freedom, bool(freedom.idle)
        self._lead = leading(request.part).lead(self._joints)
        self._origin, self._origins = 0.0, dict.fromkeys(model.mechanism.outputs, 0.0)
        self._leaps = 0  # of the path so far that no frame tells of
        state = self._unloaded(assembly)
        self._system.load(state)
        if not self._lead.displaces:  # motors count from where they were drawn
            self._origin = self._lead.conjugate(self._system, state)
        self._origins = {output: model.travel(output, state) for output in model.mechanism.outputs}
        if request.others or model.effects:
            state = self._under_constant_loads(state)
            self._system.load(state)
        self._state = state
        constrained = any(control.constrained for control in request.controls)
        start = self._system.load_displacement(state) if constrained else 0.0
        self._path = Path(newton, state, start, predictor=predictor)

    @property
    def origin(self) -> float:
        """What displacements are counted from: that of the force's point in the unloaded configuration."""
        return self._origin

    def frame(self, control: Control, before: Sequence[Frame]) -> Frame:
        """The equilibrium under ``control``; ``before`` are the frames so far (collective).

        Raises:
            EquilibriumError: it was not reached; carries the frames before it.
        """
        clock, path = self._model.clock, self._path
        start, seconds, iterations, leaps = perf_counter(), dict(clock.seconds), path.iterations, path.leaps
        if control.constrained:
            control = control.at(control.target + self._origin)
        try:
            solution = path.advance(control)
        except PathFailed as failure:
            raise self._unreached(control, failure, before) from failure
        record = self.record(solution)
        if self._freedom.mobility and not control.constrained and self._unbalanced(solution, control) > _UNBALANCED:
            raise self._lost_in_rounding(control, before)
        jumped, self._leaps = self._leaps + path.leaps > leaps, 0
        return replace(
            record,
            jumped=jumped,
            iterations=path.iterations - iterations,
            seconds=perf_counter() - start,
            phases=clock.since(seconds),
        )

    def _unbalanced(self, solution: Solution, control: Control) -> float:
        """Part of the loads that idle freedoms do not balance in a state that is loaded (collective)."""
        state = solution.state
        loads = [state.force, *(state.share * magnitude for _, magnitude in self._request.others)]
        return idle_imbalance(self._model, self._system.residual(state, control), state, loads)

    def _lost_in_rounding(self, control: Control, before: Sequence[Frame]) -> EquilibriumError:
        names = ", ".join(map(repr, self._freedom.mobile))
        return EquilibriumError(
            f"{self._request.part.name!r} in configuration {self._request.configuration.name!r}",
            f"at force {control.target:g} where {names} come to rest is lost in the rounding of stiff links",
            self._remedy(),
            last=before[-1] if before else None,
            frames=before,
        )

    def _unloaded(self, assembly: Assembly) -> State:
        """The configuration without force or effect: the rigid assembly, or where motors that strain links lead."""
        configuration = self._request.configuration
        motors = self._joints.motor_values(configuration.position)
        constant = bool(self._request.others or self._model.effects)
        state = replace(self._model.assembled_state(assembly.poses, motors), share=0.0 if constant else 1.0)
        state = replace(state, minimum_shift=ZERO_ENERGY_SHIFT if self._freedom.idle else 0.0)
        if assembly.fraction == 1.0:
            return state
        state = replace(state, motors=assembly.fraction * motors)
        path = MotorPath(self._newton, state, assembly.fraction, predictor=self._predictor)
        # in space a motor's equation is periodic: steps must stay well below a half turn
        steps = int(np.ceil((1.0 - assembly.fraction) * self._joints.travel(motors) / _LARGEST_TURN))
        try:
            for value in np.linspace(assembly.fraction, 1.0, steps + 1)[1:]:
                state = path.advance(MotorControl(float(value), motors)).state
            self._leaps += path.leaps
        except PathFailed as failure:
            raise EquilibriumError(
                f"configuration {configuration.name!r}",
                f"the motors strain the links, and no equilibrium was found beyond {failure.reached:.1%} of their way "
                f"({failure.reason})",
                "Choose motor positions nearer to the drawn ones, or a softer link",
                last=self._last(failure),
            ) from failure
        return state

    def _under_constant_loads(self, state: State) -> State:
        """The configuration under the request's constant forces and the scene's effects, which grow together."""
        path = Path(self._newton, replace(state, share=0.0), 0.0, predictor=self._predictor)
        try:
            state = path.advance(ShareControl(1.0)).state
            self._leaps += path.leaps
        except PathFailed as failure:
            names = ", ".join(
                [repr(force.name) for force, _ in self._request.others]
                + [effect.explain() for effect in self._model.effects]
            )
            raise EquilibriumError(
                f"constant loads ({names}) in configuration {self._request.configuration.name!r}",
                f"no equilibrium beyond {100.0 * failure.reached:.3g}% of them ({failure.reason})",
                self._remedy("Choose smaller ones"),
                last=self._last(failure),
            ) from failure
        return state

    def _unreached(self, control: Control, failure: PathFailed, before: Sequence[Frame]) -> EquilibriumError:
        if control.constrained and self._held():
            return EquilibriumError(
                f"{self._request.part.name!r} in configuration {self._request.configuration.name!r}",
                f"no equilibrium at displacement {control.target - self._origin:g}: joints and motors hold its point, "
                "which cannot move along its direction",
                "Choose another point or direction, or load control",
                last=self._last(failure),
                frames=before,
            )
        what, origin = ("displacement", self._origin) if control.constrained else ("force", 0.0)
        last = self._last(failure)
        where = f" with a force of {last.force:g}" if control.constrained and last is not None else ""
        return EquilibriumError(
            f"{self._request.part.name!r} in configuration {self._request.configuration.name!r}",
            f"no equilibrium at {what} {control.target - origin:g}; "
            f"the last one is at {failure.reached - origin:g}{where} "
            f"({failure.reason}; {len(failure.tried)} smaller steps were tried)",
            self._remedy(),
            last=last,
            frames=before,
        )

    def _held(self) -> bool:
        """Whether no motion of the joints takes the force's point along its direction."""
        load, joints, poses = self._system.controlled, self._joints, self._state.poses
        if not isinstance(load.point, BodyPoint):
            return False
        rate = np.zeros(joints.size)
        rate[joints.columns[load.point.body]] = load.direction @ load.point.gradient(poses)
        return is_held(joints, poses, self._state.motors, rate, self._system.rigid_rows)

    def _remedy(self, otherwise: str = _OTHERWISE) -> str:
        if self._drowned():
            return (
                "The springs are softer than the rounding of the stiffest links: "
                "make links rigid that hardly bend, or springs stiffer"
            )
        if self._idle:
            names = ", ".join(map(repr, self._freedom.idle))
            return f"Nothing but the force holds {names}: add a joint or a motor, or check the force's direction"
        return otherwise

    def _drowned(self) -> bool:
        """Whether some freedom is held by springs that rounding of the links' stiffness outweighs."""
        rigid, motors = self._model.linkage.rigid, self._joints.motor_values(self._request.configuration.position)
        motors = np.concatenate([motors, np.zeros(len(rigid.connections) - len(motors))])  # welds of links
        free = free_motions(rigid, self._poses, motors, self._model.holding)
        held = np.abs(np.linalg.eigvalsh(free.curvature)) if self._model.holding else np.zeros(0)
        return bool(np.min(held[held > 0.0], initial=np.inf) < _DROWNED * self._system.unknowns.unit**2)

    def _last(self, failure: PathFailed) -> Frame | None:
        """The last equilibrium reached, on the way to a sample too."""
        return None if failure.last is None else self.record(failure.last)

    def record(self, solution: Solution) -> Frame:
        """What is measured in an equilibrium; the caller adds what it cost (collective)."""
        model, state, lead = self._model, solution.state, self._lead
        self._system.load(state)
        with model.clock.phase("measure"):
            stress = float(model.elastic.von_mises().max(initial=0.0))
            value, conjugate = lead.value(state), lead.conjugate(self._system, state)
            displacement, force = (value, conjugate) if lead.displaces else (conjugate, value)
            return Frame(
                force=force,
                displacement=displacement - self._origin,
                stable=solution.unstable_modes == 0,
                jumped=False,
                unstable_modes=solution.unstable_modes,
                stable_under_control=solution.unstable_under_control == 0,
                strain_energy=model.elastic.strain_energy(),
                max_stress=model.mesh.mesh.comm.allreduce(stress, op=MPI.MAX),
                outputs={output: model.travel(output, state) - zero for output, zero in self._origins.items()},
                reactions=joint_reactions(self._joints, state),
                motors=motor_torques(self._joints, state),
                iterations=solution.iterations,
                residuals=solution.residuals,
                seconds=0.0,
                phases={},
                state=state,
                design=model.elastic.d.x.array.copy(),
            )
