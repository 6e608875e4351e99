"""Equilibria of targets, found once from zero load and then followed as the design changes.

Near a fold, where a mechanism is about to snap, a small change of design may leave no equilibrium near the old one, and
Newton's method lands on another branch. So each change of design is predicted backwards from where it led, with the
factor that is there already:

    ŷ₀ = y + δ,   δ = −K₁⁻¹ R(y; d₀),   y the state y₁ carried back,     |y₀ − ŷ₀| ≤ 2 |δ|

on one branch if d₁ − d₀ is small enough, and halved if that fails. Halves that fail too tell a fold.

A displacement counts from the unloaded configuration. Where that moves with the design (the force acts on a flexible
link, or motors strain the links), it is an equilibrium that is followed too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fenicsmech.design.description import Target
from fenicsmech.design.optimisers.problem import Infeasible
from fenicsmech.design.sensitivity import Adjoint
from fenicsmech.equilibrium import EquilibriumPoint, Iteration, LoadControl, NotConverged, Quantity, State
from fenicsmech.errors import EquilibriumError
from fenicsmech.estimates import Equilibrium
from fenicsmech.mechanism import FlexibleLink
from fenicsmech.multibody import assemble
from fenicsmech.simulation import CurveRequest, Simulation

_HALVINGS = 2  # of a change of design whose equilibrium is not found, or lies elsewhere
_ASTRAY = 2.0  # times δ, how far the prediction may miss: up to 1.7 on one branch, 3.8 and more across folds
_LEAST_MISS = 1e-6  # of the mechanism's length, or rad: what is a miss at all


@dataclass(frozen=True, eq=False)
class Sample:
    """The equilibrium of a target at one design.

    Attributes:
        state: under the target's force.
        origin: unloaded; None if it does not depend on the design.
        displacement: of the target's point, from the unloaded configuration.
    """

    state: State
    origin: State | None
    displacement: float


@dataclass(frozen=True, eq=False)
class Known:
    """Equilibria of some targets at one design.

    Attributes:
        design: this rank's values of the design field, flat.
        samples: one per target.
    """

    design: np.ndarray
    samples: tuple[Sample, ...]


class TargetEquilibria:
    """The equilibria of ``targets`` in one simulation; all methods are collective on its communicator."""

    def __init__(self, simulation: Simulation, targets: Sequence[Target]) -> None:
        self._simulation, self._model = simulation, simulation.model
        self.targets = tuple(targets)
        forces = dict.fromkeys(target.force_part for target in targets)
        self._newtons = {part: simulation.newton(part) for part in forces}
        self._adjoints = {part: Adjoint(self._model, newton) for part, newton in self._newtons.items()}
        self._fixed_origin: dict[Target, float] = {}

    def trace(self) -> Known:
        """From zero load to every target, at the present design.

        Raises:
            Infeasible: an equilibrium is not found or is unstable.
        """
        samples: dict[Target, Sample] = {}
        paths: dict[tuple, list[Target]] = {}
        for target in self.targets:
            key = target.force_part, target.configuration, target.force < 0.0
            paths.setdefault(key, []).append(target)
        for targets in paths.values():
            samples.update(self._traced(targets))
        return Known(self._model.elastic.d.x.array.copy(), tuple(samples[target] for target in self.targets))

    def follow(self, known: Known) -> Known:
        """At the present design, from those of another one.

        Raises:
            Infeasible: an equilibrium is not found or is unstable.
        """
        design = self._model.elastic.d.x.array.copy()
        try:
            samples = [
                self._followed(target, sample, known.design, design)
                for target, sample in zip(self.targets, known.samples, strict=True)
            ]
        finally:
            self._model.reshape(design)
        return Known(design, tuple(samples))

    def gradients(self, known: Known) -> np.ndarray:
        """Derivatives of the displacements by the design field that the model holds, (targets, owned values)."""
        fields = [self._gradient(*pair) for pair in zip(self.targets, known.samples, strict=True)]
        return np.array(fields).reshape(len(fields), -1)

    def errors(self, known: Known) -> np.ndarray:
        """What finer elements would add to the displacements, (targets,)."""
        return np.array([self._error(*pair, known.design) for pair in zip(self.targets, known.samples, strict=True)])

    def _error(self, target: Target, sample: Sample, design: np.ndarray) -> float:
        newton = self._newtons[target.force_part]

        def error(state: State) -> float:
            (added,) = self._simulation.estimates.at(newton, Equilibrium(state, design, Quantity.DISPLACEMENT))
            return added

        return error(sample.state) - (0.0 if sample.origin is None else error(sample.origin))

    def _gradient(self, target: Target, sample: Sample) -> np.ndarray:
        adjoint = self._adjoints[target.force_part]
        outputs = [self._newtons[target.force_part].system.controlled]
        (loaded,) = adjoint.gradients(sample.state, outputs)
        if sample.origin is None:
            return loaded.design
        (unloaded,) = adjoint.gradients(sample.origin, outputs)
        return loaded.design - unloaded.design

    def _traced(self, targets: Sequence[Target]) -> dict[Target, Sample]:
        """The samples of targets on one path, which differ in the size of their force alone."""
        part, configuration = targets[0].force_part, targets[0].configuration
        moving = self._origin_moves(targets[0])
        loads = {0.0} if moving else set()
        loads |= {target.force for target in targets}
        controls = tuple(LoadControl(load) for load in sorted(loads, key=abs))
        request = CurveRequest(part, controls, configuration, others=())
        try:
            curve = self._simulation.trace(request)
        except EquilibriumError as error:
            raise Infeasible(str(error)) from error
        frames = {frame.force: frame for frame in curve.frames}
        samples = {}
        for target in targets:
            frame = frames[target.force]
            if not frame.stable:
                raise Infeasible(_unstable(target))
            if any(before.jumped for before in curve.frames if abs(before.force) <= abs(frame.force)):
                raise Infeasible(_folded(target, "the mechanism snaps on the way there from zero load"))
            self._fixed_origin[target] = self._travel(target, frame.state) - frame.displacement
            origin = self._unloaded(target, curve.frames[0].state) if moving else None
            samples[target] = Sample(frame.state, origin, frame.displacement)
        return samples

    def _unloaded(self, target: Target, state: State) -> State:
        """The equilibrium without force and without effects, from one without force."""
        newton = self._newtons[target.force_part]
        try:
            return newton.solve(replace(state, load_factor=0.0), LoadControl(0.0)).state
        except NotConverged as failure:
            raise Infeasible(f"no equilibrium without loads ({failure.reason})") from failure

    def _followed(self, target: Target, sample: Sample, before: np.ndarray, after: np.ndarray) -> Sample:
        state = self._moved(target, sample.state, LoadControl(target.force), before, after, _HALVINGS)
        if sample.origin is None:
            return Sample(state, None, self._travel(target, state) - self._fixed_origin[target])
        origin = self._moved(target, sample.origin, LoadControl(0.0), before, after, _HALVINGS)
        return Sample(state, origin, self._travel(target, state) - self._travel(target, origin))

    def _moved(
        self, target: Target, state: State, control: LoadControl, before: np.ndarray, after: np.ndarray, halvings: int
    ) -> State:
        """The equilibrium at design ``after``, from the one at ``before``, halfway first if need be."""
        self._model.reshape(before)
        guess = self._model.carry(state, after)
        newton: Iteration = self._newtons[target.force_part]
        try:
            solution = newton.solve(guess, control)
        except NotConverged as failure:
            if halvings == 0:
                raise Infeasible(f"no equilibrium at {target.force:g} ({failure.reason})") from failure
            return self._halved(target, state, control, before, after, halvings)
        if solution.unstable_modes:
            raise Infeasible(_unstable(target))
        if self._astray(newton, state, solution, control, before, after):
            if halvings == 0:
                raise Infeasible(_folded(target, "a fold lies between this design and the last one"))
            return self._halved(target, state, control, before, after, halvings)
        return solution.state

    def _halved(
        self, target: Target, state: State, control: LoadControl, before: np.ndarray, after: np.ndarray, halvings: int
    ) -> State:
        halfway = 0.5 * (before + after)
        state = self._moved(target, state, control, before, halfway, halvings - 1)
        return self._moved(target, state, control, halfway, after, halvings - 1)

    def _astray(
        self,
        newton: Iteration,
        start: State,
        found: EquilibriumPoint,
        control: LoadControl,
        before: np.ndarray,
        after: np.ndarray,
    ) -> bool:
        """Whether what was ``found`` is no continuation of ``start``."""
        model, system = self._model, newton.system
        back = model.carry(found.state, before)
        model.load(back)
        x = found.linearisation.solve(system.residual(back, control).vector)
        x.scale(-1.0)
        step = system.unknowns.step(x)
        miss = system.size(system.difference(start, system.moved(back, step)))
        model.reshape(after)
        return miss > max(_ASTRAY * system.size(step), _LEAST_MISS)

    def _origin_moves(self, target: Target) -> bool:
        """Whether the unloaded position of the target's point depends on the design."""
        on_link = isinstance(target.force_part.on, FlexibleLink)
        return on_link or assemble(self._simulation.linkage, target.configuration).fraction < 1.0

    def _travel(self, target: Target, state: State) -> float:
        self._model.load(state)
        return self._model.travel(target.force_part, state)


def _unstable(target: Target) -> str:
    return f"the equilibrium at {target.force:g} in configuration {target.configuration.name!r} is unstable"


def _folded(target: Target, where: str) -> str:
    return f"the equilibrium at {target.force:g} in configuration {target.configuration.name!r} is lost: {where}"
