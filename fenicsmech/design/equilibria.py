"""Equilibria of targets, found once from zero load and then followed as the design changes.

Near a fold, where a mechanism is about to snap, a small change of design may leave no equilibrium near the old one, and
Newton's method lands on another branch. So each change of design is checked by a backward prediction with the same
factor:

    ŷ₀ = y + δ,   δ = −K₁⁻¹ R(y; d₀),   y the state y₁ carried back,     |y₀ − ŷ₀| ≤ 2 |δ|

on one branch if d₁ − d₀ is small enough, and halved if that fails. Halves that fail too mean a fold.

A displacement counts from the unloaded configuration. Where that moves with the design (the force acts on a flexible
link, or motors strain the links), it is an equilibrium that is followed too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fenicsmech.design.description import Target
from fenicsmech.design.optimisers.problem import Infeasible
from fenicsmech.design.sensitivity import Sensitivity
from fenicsmech.equilibrium import LoadControl, NotConverged, Quantity, State
from fenicsmech.errors import EquilibriumError
from fenicsmech.estimates import Equilibrium
from fenicsmech.mechanism import FlexibleLink
from fenicsmech.multibody import assemble
from fenicsmech.simulation import CurveRequest, Simulation


@dataclass(frozen=True)
class FollowOptions:
    """Criteria for an equilibrium at one design to continue the one at another.

    Attributes:
        halvings: of a change of design whose equilibrium is not found, or lies elsewhere.
        largest_miss: of the prediction, over |δ|: up to 1.7 on one branch, 3.8 and more across folds.
        rounding: misses below this part of the mechanism's length, or rad, are rounding.
    """

    halvings: int = 2
    largest_miss: float = 2.0
    rounding: float = 1e-6


@dataclass(frozen=True, eq=False)
class Sample:
    """The equilibrium of a target at one design.

    Attributes:
        state: under the target's force.
        origin: unloaded; None if it does not depend on the design.
        start: travel of the target's point there.
        displacement: of the target's point, from there.
    """

    state: State
    origin: State | None
    start: float
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
    """The equilibria of ``targets`` in one simulation."""

    def __init__(self, simulation: Simulation, targets: Sequence[Target], options: FollowOptions | None = None) -> None:
        self._simulation, self._model, self._options = simulation, simulation.model, options or FollowOptions()
        self.targets = tuple(targets)
        forces = dict.fromkeys(target.part for target in targets)
        self._newtons = {part: simulation.newton(part) for part in forces}
        self._sensitivities = {part: Sensitivity(self._model, newton) for part, newton in self._newtons.items()}

    def trace(self) -> Known:
        """The equilibria of all targets, from zero load, at the present design.

        Raises:
            Infeasible: an equilibrium is not found or is unstable.
        """
        samples: dict[Target, Sample] = {}
        paths: dict[tuple, list[Target]] = {}
        for target in self.targets:
            key = target.part, target.configuration, target.force < 0.0
            paths.setdefault(key, []).append(target)
        for targets in paths.values():
            samples.update(self._traced(targets))
        return Known(self._model.elastic.d.x.array.copy(), tuple(samples[target] for target in self.targets))

    def follow(self, known: Known) -> Known:
        """The equilibria at the present design, from those of another one.

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
        """Estimated discretisation errors of the displacements, (targets,)."""
        return np.array([self._error(*pair, known.design) for pair in zip(self.targets, known.samples, strict=True)])

    def _error(self, target: Target, sample: Sample, design: np.ndarray) -> float:
        newton = self._newtons[target.part]

        def error(state: State) -> float:
            (added,) = self._simulation.estimates.at(newton, Equilibrium(state, design, Quantity.DISPLACEMENT))
            return added

        return error(sample.state) - (0.0 if sample.origin is None else error(sample.origin))

    def _gradient(self, target: Target, sample: Sample) -> np.ndarray:
        adjoint = self._sensitivities[target.part]
        outputs = [self._newtons[target.part].system.controlled]
        (loaded,) = adjoint.gradients(sample.state, outputs)
        if sample.origin is None:
            return loaded.design
        (unloaded,) = adjoint.gradients(sample.origin, outputs)
        return loaded.design - unloaded.design

    def _traced(self, targets: Sequence[Target]) -> dict[Target, Sample]:
        """The samples of targets on one path, which differ in the size of their force alone."""
        part, configuration = targets[0].part, targets[0].configuration
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
            if any(before.snapped_through for before in curve.frames if abs(before.force) <= abs(frame.force)):
                raise Infeasible(_folded(target, "the mechanism snaps on the way there from zero load"))
            start = self._travel(target, frame.state) - frame.displacement
            origin = self._unloaded(target, curve.frames[0].state) if moving else None
            samples[target] = Sample(frame.state, origin, start, frame.displacement)
        return samples

    def _unloaded(self, target: Target, state: State) -> State:
        """The equilibrium without force and without effects, from one without force."""
        newton = self._newtons[target.part]
        try:
            return newton.solve(replace(state, load_factor=0.0), LoadControl(0.0)).state
        except NotConverged as failure:
            raise Infeasible(f"no equilibrium without loads ({failure.reason})") from failure

    def _followed(self, target: Target, sample: Sample, before: np.ndarray, after: np.ndarray) -> Sample:
        halvings, origin, start = self._options.halvings, sample.origin, sample.start
        state = self._moved(target, sample.state, LoadControl(target.force), before, after, halvings)
        reached = self._travel(target, state)
        if origin is not None:
            origin = self._moved(target, origin, LoadControl(0.0), before, after, halvings)
            start = self._travel(target, origin)
        return Sample(state, origin, start, reached - start)

    def _moved(
        self, target: Target, state: State, control: LoadControl, before: np.ndarray, after: np.ndarray, halvings: int
    ) -> State:
        """The equilibrium at design ``after``, from the one at ``before``, halfway first if need be."""
        try:
            return self._next(target, state, control, before, after)
        except _Lost:
            if halvings == 0:
                raise
        halfway = 0.5 * (before + after)
        state = self._moved(target, state, control, before, halfway, halvings - 1)
        return self._moved(target, state, control, halfway, after, halvings - 1)

    def _next(self, target: Target, start: State, control: LoadControl, before: np.ndarray, after: np.ndarray) -> State:
        """The equilibrium at design ``after``, in one step."""
        model, newton = self._model, self._newtons[target.part]
        model.reshape(before)
        guess = model.carry(start, after)
        try:
            found = newton.solve(guess, control)
        except NotConverged as failure:
            raise _Lost(f"no equilibrium at {target.force:g} ({failure.reason})") from failure
        if found.unstable_modes:
            raise Infeasible(_unstable(target))
        # δ = −K₁⁻¹ R(y; d₀) with y the state carried back, and how far ŷ₀ = y + δ misses y₀
        system, back = newton.system, model.carry(found.state, before)
        model.load(back)
        x = found.linearisation.solve(system.residual(back, control).vector)
        x.scale(-1.0)
        step = system.unknowns.step(x)
        miss = system.size(system.difference(start, system.moved(back, step)))
        model.reshape(after)
        if miss > max(self._options.largest_miss * system.size(step), self._options.rounding):
            raise _Lost(_folded(target, "a fold lies between this design and the last one"))
        return found.state

    def _origin_moves(self, target: Target) -> bool:
        """Whether the unloaded position of the target's point depends on the design."""
        on_link = isinstance(target.part.on, FlexibleLink)
        return on_link or assemble(self._simulation.linkage, target.configuration).fraction < 1.0

    def _travel(self, target: Target, state: State) -> float:
        self._model.load(state)
        return self._model.travel(target.part, state)


class _Lost(Infeasible):
    """The equilibrium at another design is not found, or is not a continuation."""


def _unstable(target: Target) -> str:
    return f"the equilibrium at {target.force:g} in configuration {target.configuration.name!r} is unstable"


def _folded(target: Target, where: str) -> str:
    return f"the equilibrium at {target.force:g} in configuration {target.configuration.name!r} is lost: {where}"
