"""Simulation of a scene: how finely it is computed, and the curves it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from fenicsmech.checks import positive
from fenicsmech.clock import Clock
from fenicsmech.effects import holding
from fenicsmech.elasticity import (
    Formulation,
    MixedFormulation,
    Quadrature,
)
from fenicsmech.equilibrium import (
    ArcSteps,
    EquilibriumSolver,
    Hermite,
    Predictor,
    PrimalDualNewton,
)
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import DRAWN, Configuration, FlexibleLink, Force, Leader, Mechanism, Output, Scene
from fenicsmech.report import Progress, Silent
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.dial import Choice, Dial, Outcome, Rung, corrections, refuse_beside_accuracy
from fenicsmech.simulation.discretisation import Discretisation
from fenicsmech.simulation.fidelity import read_fidelity
from fenicsmech.simulation.followed import FollowedCurve, PathEvent
from fenicsmech.simulation.mode_shape import ModeShape
from fenicsmech.simulation.postprocessing import Postprocessing
from fenicsmech.simulation.request import CurveRequest, read_path, read_request
from fenicsmech.simulation.unloaded import unloaded_positions
from fenicsmech.simulation.until import Until, check_until


class Simulation(Postprocessing):
    """Equilibria of a scene at one fidelity: the one given, or the cheapest that is accurate enough.

    Nothing is meshed or compiled until the first curve; the description is checked at once (collective).

    Args:
        scene: the mechanism and what acts on it.
        space: "3d", the default; "3d-symmetric", which meshes half the depth of links that joints and forces move in
            the plane; "plane-stress" or "plane-strain".
        order: degree of the displacement field, 1, 2 or 3; 2 by default.
        size: element size in the plane of the links, or one per flexible link.
        accuracy: instead of all that says how finely: relative error allowed in the largest displacement of every
            curve, or in the largest force where displacements are prescribed. ``load_displacement`` finds the cheapest
            fidelity that is good enough with the estimates of its errors added, see ``choice`` and
            ``Curve.corrections``; ``follow`` and ``branches`` compute at the one chosen last, and refuse before. With
            links known from files only, ``size`` stands for their thickness.
        layers: of elements through the depth, or half of it where half is meshed; by default from depth and size.
        segments: of elements around pins, at least; 8 by default.
        quadrature: quadrature degree; the measured optimum by default.
        formulation: ``MixedFormulation()``: pressures are unknowns in nearly incompressible links;
            ``DisplacementFormulation()``: in none.
        solver: how equilibria are found.
        predictor: how the next equilibrium on a curve is guessed.
        comm: processes that share the work.

    Raises:
        DescriptionError: the scene cannot be simulated as described.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        space: str | None = None,
        order: int | None = None,
        size: float | Mapping[FlexibleLink, float] | None = None,
        accuracy: float | None = None,
        layers: int | None = None,
        segments: int | None = None,
        quadrature: Quadrature | None = None,
        formulation: Formulation | None = None,
        solver: EquilibriumSolver | None = None,
        predictor: Predictor | None = None,
        comm: MPI.Comm = MPI.COMM_WORLD,
    ) -> None:
        if formulation is not None and not isinstance(formulation, Formulation):
            raise DescriptionError(
                "formulation", f"it is {formulation!r}", "Give MixedFormulation() or DisplacementFormulation()"
            )
        formulation = formulation or MixedFormulation()
        self.choice: Choice | None = None
        self._dial: Dial | None = None
        if accuracy is None:
            fidelity = read_fidelity(
                scene,
                space=space,
                order=order,
                size=size,
                quadrature=quadrature,
                formulation=formulation,
                layers=layers,
                segments=segments,
            )
        else:
            refuse_beside_accuracy(space=space, order=order, layers=layers, segments=segments, quadrature=quadrature)
            self._dial = Dial(scene, positive("accuracy", accuracy), size, formulation)
            fidelity = self._dial.fidelity(self._dial.rung)
        solver, predictor = solver or PrimalDualNewton(), predictor or Hermite()
        super().__init__(Discretisation(scene, fidelity, solver=solver, predictor=predictor, clock=Clock(), comm=comm))
        self._described = _description(scene.mechanism)

    def load_displacement(
        self,
        force: Force,
        *,
        forces: Sequence[float] | None = None,
        displacements: Sequence[float] | None = None,
        configuration: Configuration = DRAWN,
        others: Mapping[Force, float] | None = None,
    ) -> Curve:
        """The equilibria under a changing force (collective).

        Args:
            force: the force that changes.
            forces: its magnitudes (load control), or
            displacements: displacements of its point along it (displacement control).
            configuration: motor positions.
            others: constant magnitudes of other forces.

        Raises:
            DescriptionError: the request makes no sense.
            AssemblyError: the configuration does not assemble.
            EquilibriumError: a sample was not reached; carries the frames before it.
        """
        self._check_description()
        request = read_request(
            self.scene.mechanism,
            force,
            forces=forces,
            displacements=displacements,
            configuration=configuration,
            others=others,
        )
        with Progress(len(request.controls), configuration.name) if self.comm.rank == 0 else Silent() as progress:
            if self._dial is None:
                self._last = self.trace(request, watch=progress.update)
            else:
                self.choice = self._dial.settle(lambda rung: self._outcome(rung, request, progress.update))
        return self._last

    def trace(self, request: CurveRequest, *, watch: Callable[[int], None] = lambda done: None) -> Curve:
        """The curve of a checked request, as ``load_displacement`` without showing progress (collective).

        Args:
            request: what is asked for.
            watch: called with the number of frames so far.
        """
        return self._discretisation.curves.trace(request, watch)

    def follow(
        self,
        part: Leader,
        *,
        until: Until,
        configuration: Configuration = DRAWN,
        others: Mapping[Force, float] | None = None,
        steps: ArcSteps | None = None,
    ) -> FollowedCurve:
        """The whole curve under a changing force or a moving motor, past limit points and folds (collective).

        Starts in the configuration, without the force that leads, and goes towards the first displacement or position,
        or else the first force, of ``until``. Across the curve of a motor lies its position, up its torque or force.

        Args:
            part: the force that changes, or the motor that moves, or a ``Drive`` of several.
            until: where the curve ends.
            configuration: motor positions; where the motor that moves starts from.
            others: constant magnitudes of other forces.
            steps: how finely it is followed.

        Raises:
            DescriptionError: the request makes no sense, or an accuracy was asked for and no fidelity chosen yet.
            AssemblyError: the configuration does not assemble.
            EquilibriumError: the curve ends early; carries the frames before that.
        """
        self._check_description()
        self._check_rung(part)
        request = read_path(self.scene.mechanism, part, configuration=configuration, others=others)
        check_until(until, part)
        with Progress(until.frames, configuration.name) if self.comm.rank == 0 else Silent() as progress:
            self._last = self._discretisation.curves.follow(request, until, steps, progress.update)
        return self._last

    def branches(
        self,
        curve: FollowedCurve,
        event: PathEvent,
        *,
        until: Until,
        steps: ArcSteps | None = None,
        mode: ModeShape | None = None,
    ) -> tuple[FollowedCurve, FollowedCurve]:
        """The curve that crosses ``curve`` at a bifurcation, from there in both senses (collective).

        Args:
            curve: a followed curve.
            event: one of its bifurcations.
            until: where each of the two ends.
            steps: how finely they are followed.
            mode: one of the event's ``null_space``, if several modes become unstable at once; the curve that is nearest
                to it where it has left ``curve`` is found.

        Raises:
            DescriptionError: the event is no bifurcation of the curve, or the mode is missing or none of its.
            EquilibriumError: the curve is not found, or ends early; carries the frames before that.
        """
        self._check_description()
        check_until(until, curve.part)
        return self._discretisation.curves.branches(self._chosen(curve), event, until, steps, mode)

    def on(self, comm: MPI.Comm) -> Simulation:
        """The same scene at the same fidelity for other processes, as drawn."""
        return Simulation(
            self.scene,
            space=self.fidelity.model.name,
            order=self.fidelity.order,
            size=self.fidelity.sizes,
            quadrature=self.fidelity.quadrature,
            layers=self.fidelity.layers,
            segments=self.fidelity.segments,
            formulation=self.fidelity.formulation,
            solver=self._discretisation.solver,
            predictor=self._discretisation.predictor,
            comm=comm,
        )

    def path(self, part: Force | Output, configurations: Sequence[Configuration]) -> np.ndarray:
        """Where the unloaded point of a force or output is in each configuration, (configurations, dim).

        Raises:
            AssemblyError: one of the configurations does not assemble, or its motors strain the links.
        """
        return unloaded_positions(self.linkage, part, configurations, holding(self.scene.effects, self.linkage))

    def _check_description(self) -> None:
        """Refuses a mechanism that is not the one this simulation was made for."""
        if _description(self.scene.mechanism) != self._described:
            raise DescriptionError(
                f"mechanism {self.scene.mechanism.name!r}",
                "links, joints or motors were added after the simulation was made",
                "Make a new Simulation",
            )

    def _check_rung(self, part: Leader) -> None:
        """Refuses to follow anything as long as the accuracy asked for has chosen nothing."""
        if self._dial is not None and self.choice is None:
            raise DescriptionError(
                f"curve of {part.name!r}",
                "the accuracy asked for is settled by load_displacement, which was not called yet",
                "Call it first, with forces of the size in question, or give space, order and size instead of accuracy",
            )

    def _outcome(self, rung: Rung, request: CurveRequest, watch: Callable[[int], None]) -> Outcome:
        """What a rung of the dial gives for a curve, and how wrong it may be (collective)."""
        fidelity = self._dial.fidelity(rung)
        if fidelity != self.fidelity:
            # what was computed at another one stays with its curves, and is no answer at this one
            self._discretisation = self._discretisation.at(fidelity)
            self._last = self.choice = None
        curve = self.trace(request, watch=watch)
        elements, depth = self.estimates.elements_and_depth(curve)
        values, largest = curve.goals, int(np.argmax(np.abs(curve.goals)))
        self._last = replace(curve, corrections=corrections(elements + depth, values))
        unknowns = self.model.rigid_dofs + self.model.flexible_dofs + self.model.pressure_dofs
        return Outcome(float(values[largest]), float(elements[largest]), float(depth[largest]), unknowns)


def _description(mechanism: Mechanism) -> tuple[tuple, ...]:
    """What a simulation is built from; forces and outputs may be added later."""
    return tuple(mechanism.links), tuple(mechanism.joints), tuple(mechanism.motors)
