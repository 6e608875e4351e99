"""Sampled curves: from the assembled configuration, under constant loads, through all samples, recording frames.

Rounding of the nodal forces of stiff links may exceed small loads, so that a residual of the size of rounding does not
fix the rest position of a zero-energy mode. The forces inside an element cancel along motions that deform no
link, and so do their errors: the work along these is precise, and samples whose loads do not balance along them are
refused.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np
from mpi4py import MPI

from fenicsmech.continuation import LoadStepper, LoadSteps, LoadStepsFailed, MotorStepper
from fenicsmech.equilibrium import (
    Control,
    DisplacementControl,
    EquilibriumPoint,
    LoadControl,
    LoadFactorControl,
    MotorControl,
    Quantity,
    Residual,
    State,
    joint_reactions,
    motor_torques,
)
from fenicsmech.errors import AssemblyError, EquilibriumError
from fenicsmech.mechanism import Configuration, Force, Output, in_dimension
from fenicsmech.multibody import (
    Assembly,
    BodyPoint,
    Linkage,
    Motion,
    SpringPotential,
    assemble,
    assemble_before_strain,
    count_freedom,
    free_motions,
    is_held,
    stiff_motions,
)
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.discretisation import Discretisation
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.request import CurveRequest, followed_control


class CurveTracer:
    """The unloaded equilibrium of a configuration, and load steps from there.

    Args:
        discretisation: of the scene, at its present rest shape.
        request: of the curve.

    Attributes:
        solver: for the request's forces.
        freedom: mobility of the configuration.
        followed: the control whose value changes along the curve.
        origin: zero of displacements: that of the force's point in the unloaded configuration.

    Raises:
        AssemblyError: the configuration does not assemble.
        EquilibriumError: motors that strain the links, or the constant forces, lead to no equilibrium.
    """

    def __init__(self, discretisation: Discretisation, request: CurveRequest) -> None:
        self.discretisation, self.request, self._model = discretisation, request, discretisation.model
        model, rigid = self._model, self._model.linkage.rigid
        assembly = assemble_before_strain(model.linkage, request.configuration, model.spring_potentials)
        motors = assembly.fraction * rigid.motor_values(request.configuration.position)
        self.freedom = count_freedom(rigid, assembly.poses, motors, model.spring_potentials)
        self.solver = discretisation.newton(request.part, request.others)
        self._system, self._joints = self.solver.system, model.linkage.joints
        self.followed = followed_control(request.part, self._joints)
        self.origin, self._origins = 0.0, dict.fromkeys(model.mechanism.outputs, 0.0)
        self._snaps = 0  # of the path so far that no frame reports
        self._poses = assembly.poses
        state = self._unloaded(assembly)
        self._system.load(state)
        if not self.followed.displaces:  # motors count from where they were drawn
            self.origin = self.followed.conjugate(self._system, state)
        self._origins = {output: model.travel(output, state) for output in model.mechanism.outputs}
        if request.others or model.effects:
            state = self._under_constant_loads(state)
            self._system.load(state)
        self._state = state
        control = DisplacementControl() if any(c.constrained for c in request.controls) else LoadControl()
        self._path = LoadStepper(self.solver, state, control, predictor=discretisation.predictor)

    def curve(self, watch: Callable[[int], None]) -> Curve:
        """The frames of all samples; ``watch`` is called with the number of frames so far.

        Raises:
            EquilibriumError: a sample was not reached; carries the frames before it.
        """
        request = self.request
        frames: list[Frame] = []
        for control in request.controls:
            frames.append(self.frame(control, frames))
            watch(len(frames))
        return Curve(
            request.part,
            request.configuration,
            self.freedom,
            tuple(frames),
            self.discretisation,
            others=request.others,
            quantity=Quantity.FORCE if request.controls[0].constrained else Quantity.DISPLACEMENT,
        )

    def frame(self, control: Control, before: Sequence[Frame]) -> Frame:
        """The equilibrium under ``control``; ``before`` are the frames so far.

        Raises:
            EquilibriumError: it was not reached; carries the frames before it.
        """
        clock, path = self._model.clock, self._path
        start, seconds, iterations, snaps = perf_counter(), dict(clock.seconds), path.iterations, path.snaps
        if control.constrained:
            control = control.at(control.target + self.origin)
        try:
            point = path.advance(control)
        except LoadStepsFailed as failure:
            raise self._unreached(control, failure, before) from failure
        record = self.record(point)
        if self.freedom.mobility and not control.constrained and self._imbalance(point.state, control) > 1e-4:
            names = ", ".join(map(repr, self.freedom.mobile))
            problem = f"at force {control.target:g} where {names} come to rest is lost in the rounding of stiff links"
            raise self._error(self.request.where, problem, before[-1] if before else None, before)
        snapped_through, self._snaps = self._snaps + path.snaps > snaps, 0
        return replace(
            record,
            snapped_through=snapped_through,
            iterations=path.iterations - iterations,
            seconds=perf_counter() - start,
            phases=clock.since(seconds),
        )

    def record(self, point: EquilibriumPoint) -> Frame:
        """The measured quantities of an equilibrium; the caller adds iterations and times."""
        model, state, followed = self._model, point.state, self.followed
        self._system.load(state)
        with model.clock.phase("measure"):
            stress = float(model.elastic.von_mises().max(initial=0.0))
            value, conjugate = followed.value(self._system, state), followed.conjugate(self._system, state)
            displacement, force = (value, conjugate) if followed.displaces else (conjugate, value)
            return Frame(
                force=force,
                displacement=displacement - self.origin,
                stable=point.unstable_modes == 0,
                snapped_through=False,
                unstable_modes=point.unstable_modes,
                stable_under_control=point.unstable_under_control == 0,
                strain_energy=model.elastic.strain_energy(),
                max_stress=model.mesh.mesh.comm.allreduce(stress, op=MPI.MAX),
                outputs={output: model.travel(output, state) - zero for output, zero in self._origins.items()},
                reactions=joint_reactions(self._joints, state),
                motors=motor_torques(self._joints, state),
                iterations=point.iterations,
                residuals=point.residuals,
                seconds=0.0,
                phases={},
                state=state,
                design=model.elastic.d.x.array.copy(),
            )

    def _unloaded(self, assembly: Assembly) -> State:
        """The configuration without force or effect: the rigid assembly, or the equilibrium with strained links."""
        configuration, fraction = self.request.configuration, assembly.fraction
        motors = self._joints.motor_values(configuration.position)
        state = replace(
            self._model.assembled_state(assembly.poses, fraction * motors),
            load_factor=0.0 if self.request.others or self._model.effects else 1.0,
            minimum_shift=LoadSteps().minimum_shift if self.freedom.zero_energy else 0.0,
        )
        if fraction == 1.0:
            return state
        control = MotorControl(fraction, motors)
        path = MotorStepper(self.solver, state, control, predictor=self.discretisation.predictor)
        # a quarter of a radian, or of the mechanism's length: in space a motor's equation is periodic
        steps = int(np.ceil((1.0 - fraction) * self._joints.travel(motors) / 0.25))
        try:
            for value in np.linspace(fraction, 1.0, steps + 1)[1:]:
                state = path.advance(control.at(float(value))).state
            self._snaps += path.snaps
        except LoadStepsFailed as failure:
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
        control = LoadFactorControl()
        path = LoadStepper(self.solver, control.prepare(state), control, predictor=self.discretisation.predictor)
        try:
            state = path.advance(control.at(1.0)).state
            self._snaps += path.snaps
        except LoadStepsFailed as failure:
            forces = [repr(force.name) for force, _ in self.request.others]
            names = ", ".join([*forces, *(effect.explain() for effect in self._model.effects)])
            raise self._error(
                f"constant loads ({names}) in configuration {self.request.configuration.name!r}",
                f"no equilibrium beyond {100.0 * failure.reached:.3g}% of them ({failure.reason})",
                self._last(failure),
                otherwise="Choose smaller ones",
            ) from failure
        return state

    # -- failures ----------------------------------------------------------------------------------------------

    def _unreached(self, control: Control, failure: LoadStepsFailed, before: Sequence[Frame]) -> EquilibriumError:
        last, where = self._last(failure), self.request.where
        if control.constrained and self._is_held():
            return EquilibriumError(
                where,
                f"no equilibrium at displacement {control.target - self.origin:g}: joints and motors hold its point, "
                "which cannot move along its direction",
                "Choose another point or direction, or load control",
                last=last,
                frames=before,
            )
        what, origin = ("displacement", self.origin) if control.constrained else ("force", 0.0)
        force = f" with a force of {last.force:g}" if control.constrained and last is not None else ""
        problem = (
            f"no equilibrium at {what} {control.target - origin:g}; the last one is at {failure.reached - origin:g}"
            f"{force} ({failure.reason}; {len(failure.tried)} smaller steps were tried)"
        )
        return self._error(where, problem, last, before)

    def _error(
        self,
        where: str,
        problem: str,
        last: Frame | None,
        before: Sequence[Frame] = (),
        *,
        otherwise: str = "Try follow() or displacement control past a limit point, other samples, or a finer mesh",
    ) -> EquilibriumError:
        """The error with a remedy that fits the mechanism, or else the one given."""
        if self._springs_are_lost():
            otherwise = (
                "The springs are softer than the rounding of the stiffest links: "
                "make links rigid that hardly bend, or springs stiffer"
            )
        elif self.freedom.zero_energy:
            names = ", ".join(map(repr, self.freedom.zero_energy))
            otherwise = f"Nothing but the force holds {names}: add a joint or a motor, or check the force's direction"
        return EquilibriumError(where, problem, otherwise, last=last, frames=before)

    def _last(self, failure: LoadStepsFailed) -> Frame | None:
        """The last equilibrium reached, on the way to a sample too."""
        return None if failure.last is None else self.record(failure.last)

    def _is_held(self) -> bool:
        """Whether no motion of the joints moves the force's point along its direction."""
        load, joints, poses = self._system.controlled, self._joints, self._state.poses
        if not isinstance(load.point, BodyPoint):
            return False
        rate = np.zeros(joints.size)
        rate[joints.columns[load.point.body]] = load.direction @ load.point.gradient(poses)
        return is_held(joints, poses, self._state.motors, rate, self._system.rigid_rows)

    def _springs_are_lost(self) -> bool:
        """Whether some freedom is held by springs softer than rounding, 1e-15 of the links' stiffness."""
        rigid, motors = self._model.linkage.rigid, self._joints.motor_values(self.request.configuration.position)
        motors = np.concatenate([motors, np.zeros(len(rigid.connections) - len(motors))])  # welds of links
        free = free_motions(rigid, self._poses, motors, self._model.spring_potentials)
        held = np.abs(np.linalg.eigvalsh(free.curvature)) if self._model.spring_potentials else np.zeros(0)
        return bool(np.min(held[held > 0.0], initial=np.inf) < 1e-15 * self._system.unknowns.unit**2)

    # -- residual along zero-energy modes -----------------------------------------------------------------------

    def _imbalance(self, state: State, control: Control) -> float:
        """Largest work of a loaded equilibrium along motions that deform no link, over loads times greatest velocity.

        Of the work of each reaction, 1e-12 is left by rounding of their sum, which vanishes; 0 where nothing acts, or
        nothing moves.
        """
        model, joints, residual = self._model, self._joints, self._system.residual(state, control)
        size = abs(state.force) + sum(abs(state.load_factor * magnitude) for _, magnitude in self.request.others)
        size, worst = size + self._effects(state), 0.0
        parts = np.abs(state.multipliers) @ np.abs(joints.gradient(state.poses, state.motors))
        for motion in stiff_motions(model.linkage, state.poses, state.motors):
            rounding = 1e-12 * float(parts @ np.abs(motion.z))
            worst = max(worst, (self._work(residual, state, motion) - rounding) / motion.fastest(model.linkage.length))
        return worst / size if size > 0.0 else 0.0

    def _work(self, residual: Residual, state: State, motion: Motion) -> float:
        """|r · u̇ + ∂L/∂z · ż| of a motion."""
        model, linkage, owned = self._model, self._model.linkage, self._model.interfaces.owned
        u = state.u[: owned * model.interfaces.block].reshape(owned, -1)
        velocity = np.zeros(u.shape)
        for number, link in enumerate(model.mechanism.flexible_links):
            body = linkage.interfaces[link][0]
            nodes = np.flatnonzero(model.node_link[:owned] == number)
            centre = np.array(linkage.bodies[body].centre) + state.poses[body, : linkage.dim]
            offsets = (model.elastic.drawn_nodes[nodes] + u[nodes])[:, : linkage.dim] - centre
            velocity[nodes, : linkage.dim] = motion.at(body, offsets)
        nodal = model.mesh.mesh.comm.allreduce(float(residual.nodal @ velocity.ravel()))
        return abs(nodal + float(residual.rigid @ motion.z))

    def _effects(self, state: State) -> float:
        """Sum of the sizes of all forces of effects that grow with the load factor."""
        model, total = self._model, 0.0
        if model.elastic.depends_on_load_factor:
            local = float(np.abs(model.elastic.load_factor_residuals()).sum())
            total += model.mesh.mesh.comm.allreduce(local, op=MPI.SUM)
        for potential in model.potentials:
            if not potential.holds:
                slope = potential.gradient(state.poses).reshape(len(potential.bodies), -1)
                total += float(np.abs(slope[:, : model.linkage.dim]).sum())
                total += float(np.abs(slope[:, model.linkage.dim :]).sum()) / model.linkage.length
        return total


def unloaded_positions(
    linkage: Linkage, part: Force | Output, configurations: Sequence[Configuration], springs: Sequence[SpringPotential]
) -> np.ndarray:
    """Positions of the point of a force or output in each unloaded configuration, (configurations, dim).

    Raises:
        AssemblyError: one of the configurations does not assemble, or its motors strain the links.
    """
    body = linkage.body_of(part.on)
    space, centre = linkage.joints.space, np.array(linkage.bodies[body].centre)
    drawn = np.array(in_dimension(part.at, linkage.dim))
    positions = []
    for configuration in configurations:
        assembly = assemble(linkage, configuration, springs)
        if assembly.fraction < 1.0:
            raise AssemblyError(
                f"configuration {configuration.name!r}",
                f"its motors strain the links beyond {assembly.fraction:.1%} of their way",
                "Use load_displacement with an output at the point",
            )
        positions.append(drawn + space.displace(assembly.poses[body], (drawn - centre)[None])[0])
    return np.array(positions)
