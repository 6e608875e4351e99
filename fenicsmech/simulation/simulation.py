"""Simulation of a scene: how finely it is computed, and the curves it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path as FilePath

import numpy as np
from mpi4py import MPI

from fenicsmech.clock import Clock
from fenicsmech.effects import holding
from fenicsmech.elasticity import (
    Formulation,
    Mixed,
    Quadrature,
)
from fenicsmech.equilibrium import (
    ArcSteps,
    EquilibriumSolver,
    Hermite,
    Iteration,
    Predictor,
    PrimalDualNewton,
)
from fenicsmech.errors import DescriptionError
from fenicsmech.linkage import build_linkage
from fenicsmech.mechanism import DRAWN, Configuration, FlexibleLink, Force, Leader, Mechanism, Output, Scene
from fenicsmech.mechanism.checks import positive
from fenicsmech.meshing import radius_ratios
from fenicsmech.report import Panel, Progress, Silent, Trace, draw_configurations
from fenicsmech.simulation.buckling import BucklingLoad, SoftMode, buckling_loads, soft_modes
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.curves import Curves
from fenicsmech.simulation.dial import Choice, Dial, Outcome, Rung, corrections, refuse_beside_accuracy
from fenicsmech.simulation.estimates import Estimates
from fenicsmech.simulation.explanation import Explanation, hints, simulated
from fenicsmech.simulation.export import write_xdmf
from fenicsmech.simulation.fidelity import Fidelity, read_fidelity
from fenicsmech.simulation.followed import FollowedCurve, PathEvent
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.link_meshes import check_links, mesh_mechanism
from fenicsmech.simulation.mode_shape import ModeShape
from fenicsmech.simulation.model import MechanismModel
from fenicsmech.simulation.picture import panel
from fenicsmech.simulation.request import CurveRequest, read_path, read_request
from fenicsmech.simulation.snapshot import gather, rest_vertices
from fenicsmech.simulation.unloaded import unloaded_positions
from fenicsmech.simulation.until import Until, check_until


class Simulation:
    """Equilibria of a scene at one fidelity: the one given, or the cheapest that is accurate enough.

    Nothing is meshed or compiled until the first curve; the description is checked at once.

    Args:
        scene: the mechanism and what acts on it.
        space: "3d", the default; "3d-symmetric", which meshes half the depth of links that joints and forces move in
            the plane; "plane-stress" or "plane-strain".
        order: degree of the displacement field, 1, 2 or 3; 2 by default.
        size: element size in the plane of the links, or one per flexible link.
        accuracy: instead of all that says how finely: relative error allowed in the largest displacement of every
            curve, or in the largest force where displacements are prescribed. ``load_displacement`` finds the cheapest
            fidelity that is good enough with the estimates of its errors added, see ``choice`` and
            ``Curve.corrections``. With links known from files only, ``size`` stands for their thickness.
        layers: of elements through the depth, or half of it where half is meshed; by default from depth and size.
        segments: of elements around pins, at least; 8 by default.
        quadrature: quadrature degree; the measured optimum by default.
        formulation: ``Mixed()`` gives nearly incompressible links the pressure as an unknown of its own;
            ``Displacement()`` none.
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
            raise DescriptionError("formulation", f"it is {formulation!r}", "Give Mixed() or Displacement()")
        self.scene, self.comm, self.clock = scene, comm, Clock()
        self._described = _description(scene.mechanism)
        self._solver, self._predictor = solver or PrimalDualNewton(), predictor or Hermite()
        self._last: Curve | None = None
        self.choice: Choice | None = None
        self._dial: Dial | None = None
        formulation = formulation or Mixed()
        if accuracy is not None:
            refuse_beside_accuracy(space=space, order=order, layers=layers, segments=segments, quadrature=quadrature)
            self._dial = Dial(scene, positive("accuracy", accuracy), size, formulation)
            self._take(self._dial.fidelity(self._dial.rung))
            return
        self._take(
            read_fidelity(
                scene,
                space=space,
                order=order,
                size=size,
                quadrature=quadrature,
                formulation=formulation,
                layers=layers,
                segments=segments,
            )
        )

    @cached_property
    def model(self) -> MechanismModel:
        """The meshed mechanism (collective)."""
        with self.clock.phase("mesh"):
            mesh = mesh_mechanism(self.comm, self.scene.mechanism, self.linkage, self.fidelity)
        with self.clock.phase("setup"):
            return MechanismModel(
                self.scene.mechanism, self.linkage, mesh, self.fidelity, self.clock, self.scene.effects
            )

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
        return self._curves.trace(request, watch)

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
            DescriptionError: the request makes no sense.
            AssemblyError: the configuration does not assemble.
            EquilibriumError: the curve ends early; carries the frames before that.
        """
        self._check_description()
        request = read_path(self.scene.mechanism, part, configuration=configuration, others=others)
        check_until(until, part)
        with Progress(until.frames, configuration.name) if self.comm.rank == 0 else Silent() as progress:
            self._last = self._curves.follow(request, until, steps, progress.update)
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
        return self._curves.branches(curve, event, until, steps, mode)

    def buckling_loads(
        self, curve: Curve | None = None, *, frame: Frame | None = None, count: int = 3
    ) -> tuple[BucklingLoad, ...]:
        """Forces at which the equilibrium would stop being unique, from the tangent and its rate (collective).

        Exact for columns and others that hardly move before they buckle; else the better the nearer the frame is.

        Args:
            curve: the last curve computed by default.
            frame: the equilibrium; the last one of the curve by default.
            count: how many, those nearest to the force of the frame, in both senses, nearest first.

        Raises:
            DescriptionError: no curve was computed yet.
        """
        chosen = self._chosen(curve)
        newton = self.newton(chosen.force_part, chosen.others)
        return buckling_loads(self.model, newton, chosen, frame or chosen.frames[-1], count)

    def soft_modes(
        self, curve: Curve | None = None, *, frame: Frame | None = None, count: int = 3
    ) -> tuple[SoftMode, ...]:
        """The directions in which an equilibrium is softest under dead loads, softest first (collective).

        Arguments and errors as those of ``buckling_loads``.
        """
        chosen = self._chosen(curve)
        newton = self.newton(chosen.part, chosen.others)
        return soft_modes(self.model, newton, chosen, frame or chosen.frames[-1], count)

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
            solver=self._solver,
            predictor=self._predictor,
            comm=comm,
        )

    def error_estimates(self, curve: Curve | None = None, *, output: Output | None = None) -> np.ndarray:
        """What finer elements would add to what each frame leaves open, (frames,) (collective).

        That is the displacement where forces were prescribed, the force where displacements were, or where the curve
        was followed: ``curve.goal``.

        Args:
            curve: the last curve computed by default.
            output: whose displacement is asked for instead, while what was prescribed stays as it is.

        Raises:
            DescriptionError: no curve was computed yet.
        """
        return self.estimates.elements(self._chosen(curve), output)

    def modelling_errors(self, curve: Curve | None = None, *, output: Output | None = None) -> np.ndarray:
        """What a simulation in space would add to plane stress, arguments and result as of ``error_estimates``.

        Raises:
            DescriptionError: no curve was computed yet, or this is not plane stress.
        """
        return self.estimates.depth(self._chosen(curve), output)

    def explain(self, curve: Curve | None = None, *, tolerance: float = 0.01) -> Explanation:
        """What is simulated and what is left out, with figures where that may matter (collective).

        Args:
            curve: whose last frame the figures are of; the last curve computed by default.
            tolerance: relative change of the displacement from which something matters.

        Raises:
            DescriptionError: no curve was computed yet, or the tolerance is not a positive number.
        """
        positive("tolerance of an explanation", tolerance)
        chosen, fidelity = self._chosen(curve), self.fidelity
        left_out = hints(
            self.model,
            self.newton(chosen.force_part),
            chosen,
            order=fidelity.order,
            tolerance=tolerance,
            units=self.scene.units,
        )
        return Explanation(simulated(self.model, fidelity.model.name, fidelity.order), tuple(left_out))

    def newton(self, part: Leader, others: tuple[tuple[Force, float], ...] = ()) -> Iteration:
        """The solver for what leads and some fixed forces, kept for all configurations (collective)."""
        return self._curves.newton(part, others)

    def von_mises(self, frame: Frame) -> np.ndarray | None:
        """Von Mises stress at the midpoints of all cells, on rank 0; None elsewhere (collective).

        Cells are numbered as in ``model.mesh.cells``, (cells,).
        """
        snapshot = gather(self.model, frame)
        return None if snapshot is None else snapshot.von_mises

    def write(self, path: str | FilePath, curve: Curve | None = None) -> None:
        """Writes the frames of ``curve`` (the last one computed) as XDMF for ParaView (collective).

        Raises:
            DescriptionError: no curve was computed yet, or the path does not end in .xdmf.
        """
        write_xdmf(path, self.model, self._chosen(curve).frames)

    def picture(
        self,
        path: str | FilePath,
        curve: Curve | None = None,
        *,
        stress: bool = True,
        traces: Sequence[Trace] = (),
    ) -> None:
        """Draws the first and the last frame of ``curve`` as a PNG (collective).

        Args:
            path: the file.
            curve: the last curve computed by default.
            stress: colour links by von Mises stress.
            traces: paths of points to draw along.

        Raises:
            DescriptionError: no curve was computed yet.
        """
        panel = self.panel(self._chosen(curve), stress=stress, traces=traces)
        if panel is not None:
            units = self.scene.units
            draw_configurations(
                path,
                [panel],
                title=self.scene.mechanism.name,
                colour_label=f"von Mises stress [{units.stress}]" if stress else "",
                unit=units.length,
            )

    def panel(self, curve: Curve, *, stress: bool = True, traces: Sequence[Trace] = ()) -> Panel | None:
        """The picture of a curve's first and last frame, on rank 0; None elsewhere (collective)."""
        return panel(self.model, curve, stress=stress, traces=traces)

    def path(self, part: Force | Output, configurations: Sequence[Configuration]) -> np.ndarray:
        """Where the unloaded point of a force or output is in each configuration, (configurations, dim).

        Raises:
            AssemblyError: one of the configurations does not assemble, or its motors strain the links.
        """
        return unloaded_positions(self.linkage, part, configurations, holding(self.scene.effects, self.linkage))

    @property
    def setup_seconds(self) -> float:
        """Seconds spent before the first frame: mesh, compiled forms, matrix patterns."""
        return sum(self.clock.seconds.get(phase, 0.0) for phase in ("mesh", "setup", "compile"))

    @property
    def mesh_ratio_max(self) -> float:
        """Largest ratio of circumradius to inradius among the cells of the rest shape (collective)."""
        rest, ratio = rest_vertices(self.model), None
        if rest is not None:
            ratio = self.fidelity.model.dim / float(radius_ratios(rest, self.model.mesh.cells).min())
        return self.comm.bcast(ratio, root=0)

    @cached_property
    def _curves(self) -> Curves:
        return Curves(self.model, self._solver, self._predictor, self.scene.units)

    @cached_property
    def estimates(self) -> Estimates:
        """Error estimates at equilibria of the present fidelity (collective)."""
        return Estimates(self.model, self._curves.newton)

    def _check_description(self) -> None:
        """Refuses a mechanism that is not the one this simulation was made for."""
        if _description(self.scene.mechanism) != self._described:
            raise DescriptionError(
                f"mechanism {self.scene.mechanism.name!r}",
                "links, joints or motors were added after the simulation was made",
                "Make a new Simulation",
            )

    def _take(self, fidelity: Fidelity) -> None:
        """Goes on at ``fidelity``; what was computed at another one stays with its curves."""
        linkage = build_linkage(self.scene.mechanism, fidelity.model.mechanism_dim)
        check_links(self.scene.mechanism, linkage, fidelity)
        self.fidelity, self.linkage = fidelity, linkage
        for derived in ("model", "_curves", "estimates"):
            self.__dict__.pop(derived, None)

    def _outcome(self, rung: Rung, request: CurveRequest, watch: Callable[[int], None]) -> Outcome:
        """What a rung of the dial gives for a curve, and how wrong it may be (collective)."""
        fidelity = self._dial.fidelity(rung)
        if fidelity != self.fidelity:
            self._take(fidelity)
        curve = self.trace(request, watch=watch)
        elements, depth = self.estimates.elements_and_depth(curve)
        values, largest = curve.goals, int(np.argmax(np.abs(curve.goals)))
        self._last = replace(curve, corrections=corrections(elements + depth, values))
        unknowns = self.model.rigid_dofs + self.model.flexible_dofs + self.model.pressure_dofs
        return Outcome(float(values[largest]), float(elements[largest]), float(depth[largest]), unknowns)

    def _chosen(self, curve: Curve | None) -> Curve:
        chosen = curve or self._last
        if chosen is None:
            raise DescriptionError("simulation", "no curve was computed yet", "Call load_displacement first")
        return chosen


def _description(mechanism: Mechanism) -> tuple[tuple, ...]:
    """What a simulation is built from; forces and outputs may be added later."""
    return tuple(mechanism.links), tuple(mechanism.joints), tuple(mechanism.motors)
