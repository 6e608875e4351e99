"""Curves at prescribed values: the load steps through all of them.

A curve starts from the unloaded configuration, under constant loads. The prescribed part is a force or motors; both
give a curve of force (or torque) over displacement (or position). Equilibria whose loads do not balance along motions
that deform no link are refused (see ``balance``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from time import perf_counter

import numpy as np

from fenicsmech.collective import from_one
from fenicsmech.continuation import ArcSteps, DeadCentreStepper, LoadStepper, LoadSteps, LoadStepsFailed, follow_to
from fenicsmech.equilibrium import (
    Control,
    DisplacementControl,
    EquilibriumPoint,
    LoadControl,
    LoadFactorControl,
    MotorControl,
    NotConverged,
    State,
    Unknown,
)
from fenicsmech.errors import EquilibriumError
from fenicsmech.log import logger
from fenicsmech.multibody import Assembly, BodyPoint, assemble_before_strain, count_freedom, free_motions, is_held
from fenicsmech.simulation.balance import Balance
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.discretisation import Discretisation
from fenicsmech.simulation.frame import Frame, FrameRecorder
from fenicsmech.simulation.request import CurveRequest
from fenicsmech.simulation.rest_start import CurveStart, Effort, RestPose, RestPoses

_log = logger(__name__)
_STIFF = 1e-3  # nodal stiffness over the largest, above which rounding of links hides others
_LOST = 1e-4  # work along motions that deform no link, over loads times the greatest velocity, that leaves rest unknown


class CurveStepper:
    """The unloaded equilibrium of a configuration at the present rest shape, and load steps from there.

    Attributes:
        frames: those of the curve so far.
        solver: for the request's forces.
        freedom: mobility of the configuration.
        unloaded: the equilibrium without forces, effects at load factor 0.
        followed: the control whose value changes along the curve.
        recorder: of frames, which count from the unloaded configuration.
        adrift: whether nothing but loads holds the mechanism.
    """

    def __init__(self, discretisation: Discretisation, request: CurveRequest) -> None:
        self.discretisation, self.request, self._model = discretisation, request, discretisation.model
        self.frames: list[Frame] = []
        model, rigid, springs = self._model, self._model.linkage.rigid, self._model.spring_potentials
        # of one process: decisions that depend on rounding are the same on all
        comm, configuration = discretisation.comm, request.configuration
        soft = tuple(model.compliances)
        assembly = from_one(comm, lambda: assemble_before_strain(model.linkage, configuration, springs, soft))
        motors = rigid.on_the_way(configuration.position, assembly.fraction)
        self.solver = discretisation.solver(request.part, [other for other, _ in request.others])
        self._system, self._joints = self.solver.system, model.linkage.joints
        idle = self._system.idle
        self.freedom = from_one(comm, lambda: count_freedom(rigid, assembly.poses, motors, springs, idle))
        self.followed = discretisation.followed_control(request.part)
        self.recorder = FrameRecorder(discretisation, self._system, self.followed)
        self._poses, self._rigid_motors = assembly.poses, motors
        self._effort = Effort()  # on the way to the next frame
        with self._timed():
            self.unloaded = state = self._unloaded(assembly)
        self.adrift = bool(self.freedom.zero_energy) and not state.has_reactions
        self._rest_poses = RestPoses(model, self._system, state, motors, request.others, request.part, request.where)
        self._start: CurveStart | None = None  # of the last load steps
        self.recorder = self.recorder.zeroed(state)

    def start(self, control: Control) -> CurveStart:
        """Where load steps to ``control`` start: the present start, unless loads are found to prefer another pose.

        Forces of one sign prefer one pose, a force of zero prefers none, and displacements that are reached without
        force have a pose each.
        """
        present, loaded = self._start, control.constrained or control.prescribed
        if present is None or (self.adrift and loaded):
            with self._timed():
                rest = self._rest_poses.under(control) if self.adrift else None
                if present is None or (rest is not None and not self._rest_poses.same(rest, present.rest)):
                    self._start = present = self._started(rest or RestPose(self.unloaded), control)
        return present

    def _started(self, rest: RestPose, control: Control) -> CurveStart:
        state = self._under_constant_loads(rest.state)
        return CurveStart(rest, state, self._steps_from(rest, state, control))

    def _steps_from(self, rest: RestPose, state: State, control: Control) -> LoadStepper:
        """Load steps from the equilibrium under constant loads to which ``rest`` led."""
        self._system.load(state)
        resist = (rest.loads_resist and not rest.reached) or self._springs_below_rounding
        steps = LoadSteps()
        if control.constrained and self._springs_below_rounding:
            steps = replace(steps, failures=steps.failures_hidden)
        if self.freedom.mobility:  # loads balance along motions that deform no link, whatever is hidden
            steps = replace(steps, failures_hidden=steps.failures_held)
        shifts = steps.least_shifts(state.minimum_shift, loads_resist=resist)
        kind = DisplacementControl() if control.constrained else LoadControl()
        if control.constrained and from_one(self.discretisation.comm, lambda: self._is_held(state)):
            steps = replace(steps, failures=steps.failures_held)
        predictor = self.discretisation.predictor
        return LoadStepper(self.solver, state, kind, predictor=predictor, shifts=shifts, steps=steps)

    @contextmanager
    def _timed(self) -> Iterator[None]:
        """A context whose time counts as that of the next frame."""
        clock = self._model.clock
        began, seconds = perf_counter(), dict(clock.seconds)
        try:
            yield
        finally:
            self._effort += Effort(seconds=perf_counter() - began, phases=clock.since(seconds))

    def curve(self, watch: Callable[[int], None]) -> Curve:
        """The frames of all prescribed values; ``watch`` is called with the number of frames so far."""
        request = self.request
        for control in request.controls:
            self.frames.append(self.frame(control))
            watch(len(self.frames))
        return Curve(
            request.part,
            request.configuration,
            self.freedom,
            tuple(self.frames),
            self.discretisation,
            self.unloaded,
            others=request.others,
            unknown=Unknown.FORCE if request.controls[0].constrained else Unknown.DISPLACEMENT,
        )

    def frame(self, control: Control) -> Frame:
        """The equilibrium under ``control``."""
        if control.constrained:
            control = control.at(control.prescribed + self.recorder.origin)
        start = self.start(control)
        steps = start.steps
        iterations, snaps = steps.iterations, steps.snaps
        with self._timed():
            try:
                with self.keeping_frames():
                    point = self._fallen(start, control) if self._falls(start, control) else steps.advance(control)
            except LoadStepsFailed as failure:
                # the first value was sought from rest
                found = self._from_rest(control) if steps.snaps and iterations and not failure.hidden else None
                if found is None and self.adrift and not control.constrained:
                    found = self._reached(control, failure.last)
                if found is None:
                    raise self._unreached(control, failure) from failure
                point = found
            imbalance = 0.0
            if self.freedom.mobility and not control.constrained:
                balance = Balance(self._model, self.solver)
                point, imbalance, spent = balance.improved(point, control)
                self._effort += Effort(spent)
                if imbalance > _LOST and self.adrift and (found := self._reached(control, point)) is not None:
                    point, imbalance, spent = balance.improved(found, control)
                    self._effort += Effort(spent)
            record = self.recorder.frame(point)
            if imbalance > _LOST:
                names = ", ".join(map(repr, self.freedom.mobile))
                lost = (
                    f"rest position of {names} at force {control.prescribed:g} is lost in the rounding of stiff links"
                )
                raise self.error(self.request.where, f"the {lost}", self.frames[-1] if self.frames else None)
        effort = self._effort + Effort(steps.iterations - iterations, steps.snaps - snaps)
        self._effort = Effort()
        return replace(
            record,
            snapped_through=effort.snaps > 0,
            iterations=effort.iterations,
            seconds=effort.seconds,
            phases=effort.phases,
        )

    def _from_rest(self, control: Control) -> EquilibriumPoint | None:
        """The equilibrium that load steps from rest reach, of a curve that has left their path by a snap; None if none.

        The path snapped to may end where the one from rest goes on.
        """
        start = self._start
        assert start is not None, "steps that snap have started"
        stepper = self._steps_from(start.rest, start.state, control)
        try:
            with self.keeping_frames():
                point = stepper.advance(control)
        except (LoadStepsFailed, EquilibriumError):
            return None
        _log.warning("%s: the path snapped to ends; the next equilibria are on that from rest", self.request.where)
        self._effort += Effort(stepper.iterations, stepper.snaps + 1)
        self._start = replace(start, steps=stepper)
        return point

    def _falls(self, start: CurveStart, control: Control) -> bool:
        """Whether links move as rigid bodies before anything resists the first force, which prefers no pose."""
        if not self.adrift or control.constrained or not control.prescribed or start.rest.loads_resist:
            return False
        return not any(frame.force for frame in self.frames)

    def _fallen(self, start: CurveStart, control: Control) -> EquilibriumPoint:
        """The equilibrium of load steps, or that which links reach as rigid bodies once a few of them have failed."""
        try:
            return start.steps.advance(control, failures=LoadSteps().failures_falling)
        except LoadStepsFailed as failure:
            return self._reached(control, failure.last) or start.steps.advance(control)

    def _reached(self, control: Control, last: EquilibriumPoint | None) -> EquilibriumPoint | None:
        """The equilibrium that links reach as rigid bodies: in the pose in which all loads balance, or from the last
        one; None if none is found."""
        start, balance = self.start(control), Balance(self._model, self.solver)
        states = [last.state if last else start.state]
        if (pose := self._rest_poses.balanced(control.prescribed)) is not None:
            states.insert(0, replace(states[0], u=pose.u, poses=pose.poses))
        for state in states:
            found, iterations = balance.reached(state, control)
            self._effort += Effort(iterations)
            if found is not None:
                self._start = replace(start, steps=self._steps_from(start.rest, found.state, control))
                return found
        return None

    @contextmanager
    def keeping_frames(self) -> Iterator[None]:
        """A context in which errors of potentials, which know no frames, get those so far."""
        try:
            yield
        except EquilibriumError as error:
            error.last, error.frames = self.frames[-1] if self.frames else None, tuple(self.frames)
            raise

    def _unloaded(self, assembly: Assembly) -> State:
        """The equilibrium without forces, effects at load factor 0.

        It is the rigid assembly unless motors strain links, or wind up springs that do.
        """
        configuration, fraction = self.request.configuration, assembly.fraction
        drawn, here, there = (self._joints.on_the_way(configuration.position, part) for part in (0.0, fraction, 1.0))
        state = replace(
            self._model.assembled_state(assembly.poses, here),
            load_factor=0.0 if self.request.others or self._model.effects else 1.0,
            constant=np.array([magnitude for _, magnitude in self.request.others]),
            minimum_shift=LoadSteps().minimum_shift if self.freedom.zero_energy else 0.0,
        )
        wound = bool(self._model.spring_potentials) and not np.array_equal(drawn, there)
        if fraction == 1.0 and not wound:
            return state
        control = MotorControl(fraction, there - drawn, origin=drawn)
        stepper = DeadCentreStepper(self.solver, state, control, predictor=self.discretisation.predictor)
        # a quarter of a radian, or of the mechanism's length: in space a motor's equation is periodic
        steps = max(int(np.ceil((1.0 - fraction) * self._joints.travel(there - drawn) / 0.25)), 1)
        start = state
        try:
            for value in np.linspace(fraction, 1.0, steps + 1)[1:]:
                state = stepper.advance(control.at(float(value))).state
        except LoadStepsFailed as failure:
            if failure.hidden:
                raise self._unposed(failure, fraction, wound) from failure
            try:
                first = self.solver.solve(start, control)
                point, iterations, _ = follow_to(
                    self.solver, first.state, control.at(1.0), ArcSteps(), most=LoadSteps().arc_steps
                )
            except NotConverged:
                if (found := self._snapped(failure, control, "the motors")) is None:
                    raise self._unposed(failure, fraction, wound) from failure
                state = found
            else:
                _log.info(
                    "%s: load steps left the path of the motors, which is followed by arc length", self.request.where
                )
                state, self._effort = point.state, self._effort + Effort(first.iterations + iterations)
        self._effort += Effort(stepper.iterations, stepper.snaps)
        return state

    def _snapped(self, failure: LoadStepsFailed, control: MotorControl | LoadFactorControl, what: str) -> State | None:
        """The equilibrium at the end of the way of motors or constant loads, ``what``, after a snap where load steps
        ended; None if none is found.

        The mechanism snaps to where descent, by steps that turn links, leads from the last equilibrium, as little
        farther on the way as it takes to find one: by 1/64 of what is left, 1/32, …, all of it. From there load steps
        go on.
        """
        turning = self.solver.turning
        if failure.last is None or turning is None:
            return None
        solver = turning.patient(LoadSteps().snap_iterations)
        start, reached, iterations = replace(failure.last.state, unstable=False), failure.reached, 0
        for share in 0.5 ** np.arange(6, -1, -1):
            beyond = control.at(reached + float(share) * (1.0 - reached))
            try:
                point = solver.solve(start, beyond)
            except NotConverged as failed:
                iterations += failed.iterations
                continue
            if point.unstable_modes:
                continue
            stepper = DeadCentreStepper(self.solver, point.state, beyond, predictor=self.discretisation.predictor)
            try:
                state = stepper.advance(control.at(1.0)).state
            except LoadStepsFailed:
                continue
            finally:
                iterations += point.iterations + stepper.iterations
            _log.warning(
                "%s: between %g and %g the path turns back; curves start after a snap of %s",
                self.request.where,
                reached,
                beyond.prescribed,
                what,
            )
            self._effort += Effort(iterations, 1)
            return state
        return None

    def _unposed(self, failure: LoadStepsFailed, fraction: float, wound: bool) -> EquilibriumError:
        """The error that motors do not reach the configuration, from the ``fraction`` on that links assemble to."""
        configuration = self.request.configuration
        strained = "links and springs" if wound else "the links"
        beyond = "there" if fraction == 1.0 else f"beyond {failure.reached:.1%} of their way"
        tried, nearer = failure.reason, "nearer to the drawn ones"
        if failure.fold is not None:
            moved = ((motor, position) for motor, position in configuration.positions if position)
            turn = ", ".join(f"{motor.name!r} at {failure.fold * position:.6g}" for motor, position in moved)
            tried = f"the path turns back near {turn}; {tried}"
            nearer = "before the turn, which follow() goes round"
        remedy = (
            self._stiffer_or_rigid if failure.hidden else f"Choose motor positions {nearer}, or a softer link or spring"
        )
        return EquilibriumError(
            f"configuration {configuration.name!r}",
            f"the motors strain {strained}, and no equilibrium was found {beyond} ({tried})",
            remedy,
            last=self._last(failure),
        )

    def _under_constant_loads(self, state: State) -> State:
        """The configuration under the request's constant forces and the scene's effects, which grow together."""
        if not (self.request.others or self._model.effects):
            return state
        control = LoadFactorControl()
        if (found := self._against_obstacles(state, control.at(1.0))) is not None:
            return found
        if self._springs_below_rounding and (settled := self._settled(control)) is not None:
            return settled
        start, predictor = control.prepare(state), self.discretisation.predictor
        stepper = DeadCentreStepper(self.solver, start, control, predictor=predictor)
        try:
            with self.keeping_frames():
                state = stepper.advance(control.at(1.0)).state
        except LoadStepsFailed as failure:
            if (found := self._settled(control)) is not None and not found.unstable:
                _log.warning(
                    "%s: steps of constant loads end early; curves start where these and springs balance",
                    self.request.where,
                )
                self._effort += Effort(snaps=1)
                return found
            if not failure.hidden and (found := self._snapped(failure, control, "constant loads")) is not None:
                return found
            halfway = control.at(0.5 * failure.reached)
            if not failure.hidden and (found := self._followed(start, halfway)) is not None:
                return found
            forces = [repr(force.name) for force, _ in self.request.others]
            names = ", ".join([*forces, *(effect.explain() for effect in self._model.effects)])
            raise self.error(
                f"constant loads ({names}) in configuration {self.request.configuration.name!r}",
                f"no equilibrium beyond {100.0 * failure.reached:.3g}% of them ({failure.reason})",
                self._last(failure),
                otherwise="Choose smaller ones",
            ) from failure
        self._effort += Effort(stepper.iterations, stepper.snaps)
        return state

    def _against_obstacles(self, state: State, control: LoadFactorControl) -> State | None:
        """The configuration where obstacles are all that acts: ``state`` if it touches none, or the stable equilibrium
        less than a load step away; else None.

        An obstacle does not grow as loads do: the least part of its stiffness pushes links out of it.
        """
        if self.request.others or not all(effect.obstructs for effect in self._model.effects):
            return None
        all_loads = control.prepare(state)
        self._system.load(all_loads)
        residual = self._system.residual(all_loads, control)
        if residual.norm == 0.0:
            return all_loads
        if self._system.contact is None:
            return None
        try:
            point = self.solver.solve(all_loads, control)
        except NotConverged as failure:
            self._effort += Effort(failure.iterations)
            return None
        self._effort += Effort(point.iterations)
        moved = self._system.size(self._system.difference(point.state, state))
        return point.state if moved <= LoadSteps().motion and not point.state.unstable else None

    def _followed(self, start: State, control: LoadFactorControl) -> State | None:
        """The first stable equilibrium under all constant loads on the path from ``start`` through that at ``control``,
        past its turns; None if none is found."""
        if not control.prescribed:
            return None
        stepper = LoadStepper(self.solver, start, control, predictor=self.discretisation.predictor)
        steps, most = ArcSteps(), LoadSteps().arc_steps
        try:
            first = stepper.advance(control)
            found, iterations, turned = follow_to(
                self.solver, first.state, control.at(1.0), steps, most=most, past_turns=True
            )
        except (LoadStepsFailed, NotConverged, EquilibriumError):  # the last one of a potential, on the way
            return None
        if turned:
            _log.warning("%s: the path of constant loads turns back; curves start where it ends", self.request.where)
        self._effort += Effort(stepper.iterations + iterations, int(turned))
        return found.state

    def _settled(self, control: LoadFactorControl) -> State | None:
        """The equilibrium under all constant loads, from the rigid pose in which springs balance with them; None if
        none is found.

        Constant loads that are not far weaker than springs swing a mechanism far, past folds where it snaps. Where
        springs are softer than the rounding of what loads the links, each load step comes to rest elsewhere.
        """
        if not self._model.spring_potentials or (pose := self._rest_poses.balanced()) is None:
            return None
        all_loads = control.at(1.0)
        start = replace(all_loads.prepare(pose), minimum_shift=LoadSteps().minimum_shift)
        stepper = LoadStepper(self.solver, start, all_loads, predictor=self.discretisation.predictor)
        try:
            with self.keeping_frames():
                state = stepper.advance(all_loads).state
        except LoadStepsFailed:
            return None
        self._effort += Effort(stepper.iterations)
        return state

    # -- failures ----------------------------------------------------------------------------------------------

    def _unreached(self, control: Control, failure: LoadStepsFailed) -> EquilibriumError:
        last, where, zero = self._last(failure), self.request.where, self.recorder.origin
        start = self._start
        assert start is not None, "steps that fail have started"
        if control.constrained and from_one(self.discretisation.comm, lambda: self._is_held(start.state)):
            return EquilibriumError(
                where,
                f"no equilibrium at displacement {control.prescribed - zero:g}: joints and motors hold its "
                "point, which cannot move along its direction",
                "Choose another point or direction, or load control",
                last=last,
                frames=self.frames,
            )
        what, origin = ("displacement", zero) if control.constrained else ("force", 0.0)
        force = f" with a force of {last.force:g}" if control.constrained and last is not None else ""
        tried, remedy = f"{failure.reason}; {len(failure.tried)} smaller steps were tried", {}
        if failure.fold is not None:
            tried = f"the path turns back near {failure.fold - origin:.6g}; {tried}"
            other = "" if control.constrained else " or displacement control"
            remedy = {"otherwise": f"Use follow(){other}, which goes round the turn, or values before it"}
        elif control.constrained and failure.straight:
            remedy = {"otherwise": "The links stretch straight, and the force grows: prescribe less, or the force"}
        problem = (
            f"no equilibrium at {what} {control.prescribed - origin:g}; the last one is at {failure.reached - origin:g}"
            f"{force} ({tried})"
        )
        return self.error(where, problem, last, **remedy)

    def error(
        self,
        where: str,
        problem: str,
        last: Frame | None,
        *,
        otherwise: str = "Try follow() or displacement control past a limit point, other values, or a finer mesh",
    ) -> EquilibriumError:
        """The error with a remedy that fits the mechanism, or else the one given."""
        if self._springs_below_rounding:
            otherwise = (
                "The springs are softer than the rounding of the stiffest links: "
                f"make {self._stiffest_links} rigid, or springs stiffer"
            )
        elif self.freedom.zero_energy:
            names = ", ".join(map(repr, self.freedom.zero_energy))
            otherwise = f"Nothing but the force holds {names}: add a joint or a motor, or check the force's direction"
        else:
            state = last.state if last else self.unloaded
            if self.solver.hides(state, self.followed.at(self.followed.value(self._system, state))):
                otherwise = self._stiffer_or_rigid
        return EquilibriumError(where, problem, otherwise, last=last, frames=self.frames)

    def _last(self, failure: LoadStepsFailed) -> Frame | None:
        """The last equilibrium reached, on the way to a prescribed value too."""
        return None if failure.last is None else self.recorder.frame(failure.last)

    def _is_held(self, state: State) -> bool:
        """Whether no motion that the joints leave at ``state`` moves the force's point along its direction."""
        joints = self._joints
        rate = np.zeros(joints.size)
        for point, direction in self._system.controlled.acting:
            if not isinstance(point, BodyPoint):
                return False
            rate[joints.columns[point.body]] += direction @ point.gradient(state.poses)
        return is_held(joints, state.poses, state.motors, rate, self._system.rigid_rows)

    @property
    def _stiffer_or_rigid(self) -> str:
        """The remedy where soft links resist less than the rounding of stiff ones."""
        hidden = "What resists some motion is less than the rounding of the stiffest links"
        return f"{hidden}: make {self._stiffest_links} rigid, or soft ones stiffer"

    @property
    def _stiffest_links(self) -> str:
        """The links whose nodal stiffness, E b of width b, is more than a thousandth of the largest, by name."""
        model = self._model
        stiffness = [material.law.E * depth for material, depth in zip(model.materials, model.depths, strict=True)]
        links = zip(model.mechanism.flexible_links, stiffness, strict=True)
        return ", ".join(repr(link.name) for link, own in links if own > _STIFF * max(stiffness))

    @cached_property
    def _springs_below_rounding(self) -> bool:
        """Whether some freedom is held by springs softer than rounding, 1e-15 of the links' stiffness."""
        rigid, motors = self._model.linkage.rigid, self._joints.motor_values(self.request.configuration.position)
        motors = np.concatenate([motors, np.zeros(len(rigid.connections) - len(motors))])  # welds of links
        springs, least = self._model.spring_potentials, 1e-15 * self._system.unknowns.unit**2

        def softer() -> bool:
            free = free_motions(rigid, self._poses, motors, springs)
            held = np.abs(np.linalg.eigvalsh(free.curvature))
            return bool(np.min(held[held > free.rounding], initial=np.inf) < least)

        return bool(springs) and from_one(self.discretisation.comm, softer)
