"""Equilibria of targets' samples, found once from zero load or another simulation, and followed as the design changes.

Near a fold, where a mechanism is about to snap, a small change of design may leave no equilibrium near the old one, and
Newton's method lands on another branch. So each change of design is checked by a backward prediction with the same
factor:

    ŷ₀ = y + δ,   δ = −K₁⁻¹ R(y; d₀),   y the state y₁ carried back,     |y₀ − ŷ₀| ≤ 2 |δ|

on one branch if d₁ − d₀ is small enough, and halved if that fails. Halves that fail too mean a fold.

The equilibrium y₀ of another simulation (``transfer``) is one of this simulation under additional forces, its residual
R(y₀). These are removed in one step. The same check applies, with R(y; d₀) = R(y) − R(y₀) and so δ = K₁⁻¹ R(y₀), and
8 |δ| as the limit; y may be no farther from y₀ than that is from the unloaded configuration.

Displacements q count from the unloaded configuration y°. Where that moves with the design (a point lies on a flexible
link, or motors strain links or wind up springs), it is an equilibrium that is followed too. A prescribed displacement
v = v̄ + q_v(y°) moves with it:

    Q = g(q(y) − q(y°)),     dQ/dp = ∂g/∂q (dq/dp + dq/dv dq_v°/dp − dq°/dp).

A quantity of two samples depends on each with the other held, and what follows from both adds up:

    dQ/dp = ∂Q/∂p + ∂Q/∂y₁ dy₁/dp + ∂Q/∂y₂ dy₂/dp.

Stability is that under the sample's own control: with a prescribed displacement, parts of a path are stable that are
not under a prescribed force.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import agreed
from fenicsmech.design.optimisers.problem import Infeasible
from fenicsmech.design.target import Target, sample_request
from fenicsmech.equilibrium import (
    Adjoint,
    Control,
    DisplacementControl,
    EquilibriumPoint,
    EquilibriumSolver,
    LoadControl,
    NotConverged,
    State,
)
from fenicsmech.errors import AssemblyError, EquilibriumError, set_options
from fenicsmech.model import Design
from fenicsmech.quantities import (
    Displacement,
    Gradient,
    NumberKind,
    Observable,
    Partial,
    RestObservable,
    Sample,
    Sensitivity,
)
from fenicsmech.simulation import Simulation, WholeState, guess, whole_state


@dataclass(frozen=True)
class FollowOptions:
    """Criteria for an equilibrium at one design to continue the one at another.

    Attributes:
        load_steps: minimum number of steps from zero to the largest load; with fewer, failures cost more than is saved.
        halvings: of a change of design whose equilibrium is not found, or lies elsewhere.
        largest_miss: of the prediction, over |δ|; a larger miss means an equilibrium across a fold.
        largest_transfer_miss: the same from another simulation: up to 2.9 on one branch, as δ includes the stress of
            links that were at rest in a slightly different shape; 30 and more across folds.
        farthest_transfer: distance from the equilibrium of another simulation, over its motion from the unloaded
            configuration: up to 0.3 between plane stress and 3D, more where motors strain links, 2.8 and more across
            folds.
        rounding: misses below this part of the mechanism's length, or rad, are rounding.
        same_design: distance of two design fields, over the mechanism's length, up to which equilibria that were kept
            are of both.

    Raises:
        DescriptionError: a number is out of its range.
    """

    load_steps: int = 8
    halvings: int = 2
    largest_miss: float = 2.0
    largest_transfer_miss: float = 8.0
    farthest_transfer: float = 1.0
    rounding: float = 1e-6
    same_design: float = 1e-12

    def __post_init__(self) -> None:
        set_options(self, "following equilibria", load_steps=1, halvings=0)


@dataclass(frozen=True, eq=False)
class SampleState:
    """The equilibrium of a sample at one design.

    Attributes:
        state: the equilibrium.
        control: under which it was found.
        unloaded: the state without loads, from which displacements count.
    """

    state: State
    control: Control
    unloaded: State


@dataclass(frozen=True, eq=False)
class DesignEquilibria:
    """Equilibria of samples, and values of targets' quantities, at one design.

    Attributes:
        design: that they belong to.
        samples: the equilibrium of each sample.
        raw: values of each target's observable, from the unloaded configuration where they count from there.
    """

    design: Design
    samples: dict[Sample, SampleState]
    raw: tuple[np.ndarray, ...]


class _Path:
    """A sample in one simulation.

    Attributes:
        sample: its description.
        solver: of its equilibria.
    """

    def __init__(
        self, simulation: Simulation, sample: Sample, observables: Iterable[Observable], numbers: Sequence[NumberKind]
    ) -> None:
        self.sample, self._model = sample, simulation.model
        self.solver: EquilibriumSolver = simulation.solver(sample.part, [force for force, _ in sample.others])
        self.moved = None if sample.moved is None else Displacement(sample.moved[0]).on(simulation.model)
        own = observables if self.moved is None else (*observables, self.moved)
        moved = any(observable.on_link for observable in own)
        self._moves = moved or any(kind.moves_unloaded(sample.configuration) for kind in numbers)

    def moves(self, unloaded: State) -> bool:
        """Whether the sample's unloaded configuration, or a point there, moves with the design."""
        return self._moves or unloaded.has_reactions

    def control(self, unloaded: State) -> Control:
        """The sample's control at the design that the model holds."""
        if self.moved is None:
            return LoadControl(self.sample.magnitude)
        self._model.load(unloaded)
        origin = agreed(self._model.mesh.comm, float(self.moved.values(unloaded)[0]))
        return DisplacementControl(self.sample.value + origin)


class _Shared:
    """What the equilibria of several sets of targets in one simulation share.

    Attributes:
        sensitivity: compiled when first needed.
        kept: the equilibria kept last; None before.
    """

    def __init__(self, sensitivity: Sensitivity) -> None:
        self.sensitivity = sensitivity
        self.kept: DesignEquilibria | None = None


class SampleEquilibria:
    """The equilibria of the samples of ``targets`` in one simulation, and the values of their quantities.

    Args:
        simulation: in which equilibria are computed.
        targets: whose samples these are.
        options: of following them from design to design.
        numbers: with respect to which derivatives are wanted, in addition to those by the design field.
        like: those of other targets in the same simulation; compiled sensitivities are shared, and with the same
            numbers the equilibria kept.
    """

    def __init__(
        self,
        simulation: Simulation,
        targets: Sequence[Target],
        options: FollowOptions | None = None,
        numbers: Sequence[NumberKind] = (),
        like: SampleEquilibria | None = None,
    ) -> None:
        self._simulation, self._model, self._options = simulation, simulation.model, options or FollowOptions()
        self.targets, self._numbers = tuple(targets), tuple(numbers)
        if like is not None and like._numbers == tuple(numbers):
            self._shared: _Shared = like._shared
        else:
            own = Sensitivity(simulation.model, ()) if like is None else like._shared.sensitivity
            self._shared = _Shared(own.with_numbers(numbers))
        kinds = {target.quantity: target.quantity.on(simulation.model) for target in targets}
        self._observables = [kinds[target.quantity] for target in targets]
        self._at_rest = {k: own for k, own in enumerate(self._observables) if isinstance(own, RestObservable)}
        # of each component its target, of each target its components
        self._owners = [k for k, target in enumerate(targets) for _ in range(target.size)]
        self._places = [[c for c, owner in enumerate(self._owners) if owner == k] for k in range(len(targets))]
        self._paths: dict[Sample, _Path] = {}
        for sample in dict.fromkeys(sample for target in targets for sample in target.samples):
            counted = [kinds[own.quantity] for own in targets if sample in own.samples and own.quantity.from_unloaded]
            self._paths[sample] = _Path(simulation, sample, counted, numbers)

    # -- equilibria ----------------------------------------------------------------------------------------------

    def from_zero(self) -> DesignEquilibria:
        """The equilibria of all samples, from zero load, at the present design.

        Raises:
            Infeasible: an equilibrium is not found or is unstable.
        """
        found: dict[Sample, SampleState] = {}
        for samples in self._on_one_path():
            found.update(self._traced(samples))
        return self._at_design({sample: found[sample] for sample in self._paths})

    def keep(self, solved: DesignEquilibria) -> None:
        """Keeps equilibria, the last ones alone, for ``kept``."""
        self._shared.kept = solved

    def kept(self) -> DesignEquilibria | None:
        """Those kept last if they are of the present design, within rounding, and hold all samples; else None."""
        found, design = self._shared.kept, self._model.design
        if found is None or any(sample not in found.samples for sample in self._paths):
            return None
        apart = float(np.max(np.abs(found.design.field - design.field), initial=0.0))
        same = (
            found.design.numbers == design.numbers
            and apart <= self._options.same_design * self._model.linkage.joints.length
        )
        if not self._model.mesh.comm.allreduce(same, op=MPI.LAND):
            return None
        return self._at_design({sample: found.samples[sample] for sample in self._paths})

    def from_other(self, guesses: Mapping[Sample, WholeState]) -> DesignEquilibria:
        """The equilibria of all samples at the present design, from those of another simulation at the same design.

        Raises:
            Infeasible: an equilibrium is not found, is unstable or is not a continuation of the guess.
        """
        samples: dict[Sample, SampleState] = {}
        for first, *others in self._on_one_path():
            unloaded = self._unloaded(first)
            for sample in (first, *others):
                samples[sample] = self._from_guess(self._paths[sample], guesses[sample], unloaded)
        return self._at_design({sample: samples[sample] for sample in self._paths})

    def from_design(self, solved: DesignEquilibria) -> DesignEquilibria:
        """The equilibria at the present design, from those of another one.

        Raises:
            Infeasible: an equilibrium is not found or is unstable.
        """
        design = self._model.design
        try:
            samples = {
                path.sample: self._followed(path, solved.samples[path.sample], solved.design, design)
                for path in self._paths.values()
            }
        finally:
            self._model.reshape(design)
        return self._at_design(samples)

    def whole(self, solved: DesignEquilibria) -> dict[Sample, WholeState]:
        """Equilibria as ``from_other`` of another simulation takes them, on all processes of this one."""
        with self._model.shaped(solved.design):
            return {sample: whole_state(self._model, at.state) for sample, at in solved.samples.items()}

    # -- values of the targets' quantities -----------------------------------------------------------------------

    def values(self, solved: DesignEquilibria) -> np.ndarray:
        """The components that are wanted, target by target, (components,)."""
        reduced = [t.quantity.reduce(raw)[0][: t.size] for t, raw in zip(self.targets, solved.raw, strict=True)]
        return np.concatenate([*reduced, np.zeros(0)])

    def gradients(self, solved: DesignEquilibria) -> list[Gradient]:
        """Derivatives of the components at the design that the model holds."""
        found: list[list[Gradient]] = [[] for _ in self._owners]
        for k, observable in self._at_rest.items():
            found[self._places[k][0]].append(self._shared.sensitivity.at_rest(observable))
        for path in self._paths.values():
            own = self._of(path.sample, solved.samples)
            at = solved.samples[path.sample]
            places, partials = self._partials(solved, path, at.state, own)
            loaded = self._shared.sensitivity.of(path.solver, at.state, at.control, partials)
            if path.moves(at.unloaded):
                loaded = self._less_unloaded(solved, path, places, loaded)
            for place, gradient in zip(places, loaded, strict=True):
                found[place].append(gradient)
        return [reduce(add, parts) for parts in found]

    def errors(self, solved: DesignEquilibria) -> np.ndarray:
        """Estimated discretisation errors of the components, to be added, and those of smoothing, (components,)."""
        with self._model.shaped(solved.design):
            found = np.zeros(len(self._owners))
            for k, observable in self._at_rest.items():
                found[self._places[k]] += observable.smoothing_errors(None)
            for path in self._paths.values():
                at = solved.samples[path.sample]
                places, partials = self._partials(solved, path, at.state, self._of(path.sample, solved.samples))
                adjoints = self._shared.sensitivity.adjoints(path.solver, at.state, at.control, partials)
                errors, slopes = self._estimated(adjoints), [own.by_control() if own else 0.0 for own in adjoints]
                if path.moves(at.unloaded):
                    from_there, counted, prescribed = self._unloaded_partials(solved, path, places)
                    unloaded = self._estimated(
                        self._shared.sensitivity.adjoints(path.solver, at.unloaded, LoadControl(0.0), from_there)
                    )
                    for place, error in zip(counted, unloaded, strict=False):
                        errors[place] -= error
                    if prescribed:
                        errors = [own + slope * unloaded[-1] for own, slope in zip(errors, slopes, strict=True)]
                found[places] += errors
                self._add_smoothing(solved, path, found)
        return found

    # -- values and derivatives of one sample --------------------------------------------------------------------

    def _of(self, sample: Sample, states: Mapping[Sample, SampleState]) -> list[tuple[Observable, int]]:
        """The observables that depend on a sample, the others held in their ``states``, with the places of targets."""
        found = []
        for k, (target, observable) in enumerate(zip(self.targets, self._observables, strict=True)):
            if sample in target.samples:
                others = (states[own].state for own in target.samples if own != sample)
                found.append((reduce(lambda own, other: own.holding(other), others, observable), k))
        return found

    def _evaluated(self, sample: Sample, states: Mapping[Sample, SampleState]) -> list[tuple[Observable, int]]:
        """Those whose value is taken there: each at one sample."""
        return [pair for pair in self._of(sample, states) if self.targets[pair[1]].sample == sample]

    def _at_design(self, samples: dict[Sample, SampleState]) -> DesignEquilibria:
        raw = {k: np.array([observable.value()]) for k, observable in self._at_rest.items()}
        for sample, at in samples.items():
            own = self._evaluated(sample, samples)
            counted = [pair for pair in own if self.targets[pair[1]].quantity.from_unloaded]
            for state, pairs, sign in ((at.unloaded, counted, -1.0), (at.state, own, 1.0)):
                self._model.load(state)
                for observable, k in pairs:
                    raw[k] = raw.get(k, 0.0) + sign * observable.values(state)
        design = self._model.design
        return DesignEquilibria(design, samples, tuple(raw[k] for k in range(len(self.targets))))

    def _partials(
        self, solved: DesignEquilibria, path: _Path, state: State, own: Sequence[tuple[Observable, int]]
    ) -> tuple[list[int], list[Partial]]:
        """The partial derivatives of the wanted components at a state, each with its place among all."""
        self._model.load(state)
        places, partials = [], []
        for observable, k in own:
            target = self.targets[k]
            _, slopes = target.quantity.reduce(solved.raw[k])
            parts = observable.partials(path.solver.system, state)
            places += self._places[k]
            for row in slopes[: target.size]:
                pairs = zip(row, parts, strict=True)
                partials.append(sum((float(s) * part for s, part in pairs if s), start=Partial()))
        return places, partials

    def _add_smoothing(self, solved: DesignEquilibria, path: _Path, errors: np.ndarray) -> None:
        """Adds those of smoothing at a path's sample to the errors of the wanted components."""
        state = solved.samples[path.sample].state
        self._model.load(state)
        for observable, k in self._evaluated(path.sample, solved.samples):
            target = self.targets[k]
            _, slopes = target.quantity.reduce(solved.raw[k])
            errors[self._places[k]] += slopes[: target.size] @ observable.smoothing_errors(state)

    def _unloaded_partials(
        self, solved: DesignEquilibria, path: _Path, places: Sequence[int]
    ) -> tuple[list[Partial], list[int], bool]:
        """Partial derivatives in the unloaded configuration: of the components that count from there, then of the
        prescribed displacement; which components these are; and whether a displacement is prescribed.
        """
        unloaded = solved.samples[path.sample].unloaded
        quantities = [self.targets[self._owners[place]].quantity for place in places]
        counted = [place for place, quantity in enumerate(quantities) if quantity.from_unloaded]
        own = self._of(path.sample, solved.samples)
        own = [pair for pair in own if self.targets[pair[1]].quantity.from_unloaded]
        _, partials = self._partials(solved, path, unloaded, own)
        if path.moved is not None:
            partials += path.moved.partials(path.solver.system, unloaded)
        return partials, counted, path.moved is not None

    def _less_unloaded(
        self, solved: DesignEquilibria, path: _Path, places: Sequence[int], loaded: Sequence[Gradient]
    ) -> list[Gradient]:
        """Derivatives of components less those in the unloaded configuration."""
        partials, counted, prescribed = self._unloaded_partials(solved, path, places)
        origin = solved.samples[path.sample].unloaded
        unloaded = self._shared.sensitivity.of(path.solver, origin, LoadControl(0.0), partials)
        found = list(loaded)
        for place, gradient in zip(counted, unloaded, strict=False):
            found[place] = found[place] + -1.0 * gradient
        if prescribed:
            found = [own + given.control * unloaded[-1] for own, given in zip(found, loaded, strict=True)]
        return found

    def _estimated(self, adjoints: Sequence[Adjoint | None]) -> list[float]:
        """Discretisation errors of quantities at the state that the model holds, from their adjoints."""
        return [self._simulation.estimates.of(adjoint)[0] if adjoint else 0.0 for adjoint in adjoints]

    def _on_one_path(self) -> list[list[Sample]]:
        """The samples, grouped by the path from zero load that they lie on."""
        groups: dict[tuple, list[Sample]] = {}
        for sample in self._paths:
            key = sample.part, sample.others, sample.configuration, sample.moved is None, sample.value < 0.0
            groups.setdefault(key, []).append(sample)
        return list(groups.values())

    # -- paths from zero load ------------------------------------------------------------------------------------

    def _traced(self, samples: Sequence[Sample]) -> dict[Sample, SampleState]:
        """The states of samples on one path, which differ in the size of their load alone."""
        ordered = sorted(samples, key=lambda own: abs(own.value))
        loads, before, last = list[float](), 0.0, ordered[-1].value
        for sample in ordered:
            count = math.ceil(self._options.load_steps * (sample.value - before) / last) if last else 1
            loads += np.linspace(before, sample.value, max(count, 1) + 1)[1:].tolist()
            before = sample.value
        try:
            curve = self._simulation.compute(sample_request(self._simulation, ordered[0], loads))
        except (EquilibriumError, AssemblyError) as error:
            raise Infeasible(str(error)) from error
        found, snapped = dict[Sample, SampleState](), False
        for load, frame in zip(loads, curve.frames, strict=True):
            snapped = snapped or frame.snapped_through
            if load != ordered[len(found)].value:
                continue
            sample = ordered[len(found)]
            if not frame.stable_under_control:
                raise Infeasible(_unstable(sample))
            if snapped:
                raise Infeasible(_lost(sample, "the mechanism snaps on the way there from zero load"))
            control = self._paths[sample].control(curve.unloaded)
            found[sample] = SampleState(frame.state, control, curve.unloaded)
        return found

    # -- from another simulation ---------------------------------------------------------------------------------

    def _unloaded(self, sample: Sample) -> State:
        try:
            return self._simulation.unloaded(sample_request(self._simulation, sample, [sample.value]))
        except (EquilibriumError, AssemblyError) as error:
            raise Infeasible(str(error)) from error

    def _from_guess(self, path: _Path, other: WholeState, unloaded: State) -> SampleState:
        """The equilibrium near the one in another simulation, whose residual is removed in one step."""
        system, control = path.solver.system, path.control(unloaded)
        start = control.prepare(guess(self._model, other, unloaded))
        found = self._solved(path, start, control)
        missed = path.solver.missed(start, found, self._options.rounding)
        distance, motion = (system.size(system.difference(start, other)) for other in (found.state, unloaded))
        farthest = max(self._options.farthest_transfer * motion, self._options.rounding)
        if missed > self._options.largest_transfer_miss or distance > farthest:
            raise _Lost(_lost(path.sample, "a fold lies between this simulation and the other one"))
        return SampleState(found.state, control, unloaded)

    # -- from one design to another ------------------------------------------------------------------------------

    def _followed(self, path: _Path, at: SampleState, before: Design, after: Design) -> SampleState:
        unloaded, halvings, nothing = at.unloaded, self._options.halvings, LoadControl(0.0)
        if path.moves(unloaded):
            unloaded = self._moved(path, unloaded, _Prescribed(before, nothing), _Prescribed(after, nothing), halvings)
        self._model.reshape(after)
        control = path.control(unloaded)
        state = self._moved(path, at.state, _Prescribed(before, at.control), _Prescribed(after, control), halvings)
        return SampleState(state, control, unloaded)

    def _moved(self, path: _Path, state: State, before: _Prescribed, after: _Prescribed, halvings: int) -> State:
        """The equilibrium at design ``after``, from the one at ``before``, halfway first if need be."""
        try:
            return self._next(path, state, before, after)
        except _Lost:
            if halvings == 0:
                raise
        halfway = before.halfway(after)
        state = self._moved(path, state, before, halfway, halvings - 1)
        return self._moved(path, state, halfway, after, halvings - 1)

    def _next(self, path: _Path, start: State, before: _Prescribed, after: _Prescribed) -> State:
        """The equilibrium at design ``after``, in one step."""
        model, system = self._model, path.solver.system
        model.reshape(before.design)
        found = self._solved(path, model.carry(start, after.design), after.control)
        # y, the state carried back
        back = before.control.prepare(model.carry(found.state, before.design))
        model.load(back)
        missing = system.residual(back, before.control).vector
        missing.scale(-1.0)
        missed = found.linearisation.missed(start, back, missing, self._options.rounding)
        model.reshape(after.design)
        if missed > self._options.largest_miss:
            raise _Lost(_lost(path.sample, "a fold lies between this design and the last one"))
        return found.state

    def _solved(self, path: _Path, start: State, control: Control) -> EquilibriumPoint:
        """The stable equilibrium that Newton's method finds from ``start``, where all potentials hold."""
        try:
            found = path.solver.solve(start, control)
        except NotConverged as failure:
            raise _Lost(f"no equilibrium under {path.sample} ({failure.reason})") from failure
        if found.unstable_under_control:
            raise Infeasible(_unstable(path.sample))
        try:
            for potential in path.solver.system.potentials:
                potential.check_step(start.poses, found.state.poses)
        except EquilibriumError as error:
            raise Infeasible(str(error)) from error
        return found


@dataclass(frozen=True, eq=False)
class _Prescribed:
    """A design, and the control there."""

    design: Design
    control: Control

    def halfway(self, other: _Prescribed) -> _Prescribed:
        """Their mean."""
        value = 0.5 * (self.control.prescribed + other.control.prescribed)
        return _Prescribed(self.design.halfway(other.design), self.control.at(value))


class _Lost(Infeasible):
    """The equilibrium at another design is not found, or is not a continuation."""


def _unstable(sample: Sample) -> str:
    return f"the equilibrium under {sample} is unstable"


def _lost(sample: Sample, where: str) -> str:
    return f"the equilibrium under {sample} is lost: {where}"
