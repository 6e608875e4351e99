"""Simulation of a scene: how finely it is computed, and the curves it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path as FilePath

import numpy as np
from mpi4py import MPI

from fenicsmech.clock import Clock
from fenicsmech.elasticity import (
    MID_PLANE_SYMMETRIC,
    PLANE_STRAIN,
    PLANE_STRESS,
    SPATIAL,
    Formulation,
    Mixed,
    Quadrature,
)
from fenicsmech.equilibrium import (
    ArcSteps,
    EquilibriumSolver,
    Hermite,
    Iteration,
    LoadControl,
    Predictor,
    PrimalDualNewton,
    Sense,
)
from fenicsmech.errors import AssemblyError, DescriptionError
from fenicsmech.linkage import Freedom, assemble, build_linkage, count_freedom
from fenicsmech.mechanism import DRAWN, Configuration, FlexibleLink, Force, Mechanism, Output, Scene
from fenicsmech.mechanism.checks import positive
from fenicsmech.mechanism.places import in_dimension
from fenicsmech.meshing import radius_ratios
from fenicsmech.meshing.sizing import LEAST_SEGMENTS
from fenicsmech.report import Panel, Progress, Silent, Trace, draw_configurations
from fenicsmech.simulation.buckling import BucklingLoad, SoftMode, buckling_loads, soft_modes
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.depth_error import DepthError
from fenicsmech.simulation.dial import Choice, Dial, Outcome, Rung
from fenicsmech.simulation.explanation import Explanation, hints, simulated
from fenicsmech.simulation.export import write_xdmf
from fenicsmech.simulation.followed import FollowedCurve, PathEvent
from fenicsmech.simulation.follower import Follower
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.goal_error import GoalError
from fenicsmech.simulation.model import Fidelity, MechanismModel, check_links, check_scene, mesh_mechanism
from fenicsmech.simulation.picture import Draughtsman
from fenicsmech.simulation.request import CurveRequest, read_request
from fenicsmech.simulation.snapshot import gather, rest_vertices
from fenicsmech.simulation.tracer import Tracer
from fenicsmech.simulation.until import Until

SPACES = {model.name: model for model in (SPATIAL, MID_PLANE_SYMMETRIC, PLANE_STRESS, PLANE_STRAIN)}
"""Names of the elastic models, as users type them."""


class Simulation:
    """Equilibria of a scene at one fidelity: the one given, or the cheapest that is accurate enough.

    Nothing is meshed or compiled until the first curve; the description is checked at once.

    Args:
        scene: the mechanism and what acts on it.
        space: "3d"; "3d-symmetric", which meshes half the depth of links that joints and forces move in the plane;
            "plane-stress" or "plane-strain".
        order: degree of the displacement field, 1, 2 or 3.
        size: element size in the plane of the links, or one per flexible link.
        accuracy: instead of ``space``, ``order`` and ``size``: relative error allowed in the largest displacement of
            every curve. ``load_displacement`` finds the cheapest fidelity whose estimated error is below it, see
            ``choice``. With links known from files only, ``size`` stands for their thickness.
        layers: of elements through the depth, or half of it where half is meshed; by default from depth and size.
        segments: of elements around pins, at least.
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
        space: str = "3d",
        order: int = 2,
        size: float | Mapping[FlexibleLink, float] | None = None,
        accuracy: float | None = None,
        layers: int | None = None,
        segments: int = LEAST_SEGMENTS,
        quadrature: Quadrature | None = None,
        formulation: Formulation | None = None,
        solver: EquilibriumSolver | None = None,
        predictor: Predictor | None = None,
        comm: MPI.Comm = MPI.COMM_WORLD,
    ) -> None:
        if space not in SPACES:
            raise DescriptionError("space", f"{space!r} is not known", f"Choose one of {', '.join(SPACES)}")
        if order not in (1, 2, 3):
            raise DescriptionError("order", f"{order!r} is not 1, 2 or 3", "Choose 1 for speed, 2 for accuracy")
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
            self._dial = Dial(scene, positive("accuracy", accuracy), size, formulation)
            self._take(self._dial.fidelity(self._dial.rung))
            return
        model, links = SPACES[space], scene.mechanism.flexible_links
        if size is None:
            raise DescriptionError("size", "it is missing", "Give an element size, or accuracy=… to have one chosen")
        per_link = size if isinstance(size, Mapping) else dict.fromkeys(links, size)
        sizes = {link: positive(f"element size of {link.name!r}", per_link.get(link)) for link in links}
        rule = quadrature or Quadrature.for_order(order, model.dim)
        fidelity = Fidelity(model, order, sizes, rule, formulation, layers, segments)
        check_scene(scene, model)
        self._take(fidelity)

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
        tracer, _, freedom = self._tracer(request)
        frames: list[Frame] = []
        for control in request.controls:
            frames.append(tracer.frame(control, frames))
            watch(len(frames))
        return Curve(
            request.force,
            request.configuration,
            freedom,
            tuple(frames),
            units=self.scene.units,
            leads=self.comm.rank == 0,
            others=request.others,
        )

    def follow(
        self,
        force: Force,
        *,
        until: Until,
        configuration: Configuration = DRAWN,
        others: Mapping[Force, float] | None = None,
        steps: ArcSteps | None = None,
    ) -> FollowedCurve:
        """The whole curve under a changing force, past limit points and where it turns back (collective).

        Starts without the force and goes towards the first displacement, or else the first force, of ``until``.

        Args:
            force: the force that changes.
            until: where the curve ends.
            configuration: motor positions.
            others: constant magnitudes of other forces.
            steps: how finely it is followed.

        Raises:
            DescriptionError: the request makes no sense.
            AssemblyError: the configuration does not assemble.
            EquilibriumError: the curve ends early; carries the frames before that.
        """
        self._check_description()
        _check_until(until)
        request = read_request(
            self.scene.mechanism, force, forces=[0.0], displacements=None, configuration=configuration, others=others
        )
        with Progress(until.frames, configuration.name) if self.comm.rank == 0 else Silent() as progress:
            follower, freedom = self._follower(request, until, steps)
            follower.from_rest(progress.update)
        self._last = self._followed(request, freedom, follower)
        return self._last

    def branches(
        self, curve: FollowedCurve, event: PathEvent, *, until: Until, steps: ArcSteps | None = None
    ) -> tuple[FollowedCurve, FollowedCurve]:
        """The curve that crosses ``curve`` at a simple bifurcation, from there in both senses (collective).

        Args:
            curve: a followed curve.
            event: one of its bifurcations.
            until: where each of the two ends.
            steps: how finely they are followed.

        Raises:
            DescriptionError: the event is no bifurcation of the curve, or not a simple one.
            EquilibriumError: the curve is not found, or ends early; carries the frames before that.
        """
        self._check_description()
        _check_until(until)
        if event not in curve.bifurcations:
            raise DescriptionError(
                "branches", "the event is no bifurcation of the curve", "Choose from its bifurcations"
            )
        if event.modes != 1:
            raise DescriptionError(
                "branches",
                f"{event.modes} modes become unstable at once",
                "Break the symmetry a little, or follow the curve with a smaller tolerance in ArcSteps",
            )
        request = CurveRequest(curve.force_part, (LoadControl(0.0),), curve.configuration, curve.others)
        found = []
        with self.model.shaped(event.frame.design):
            for sense in Sense:
                follower, freedom = self._follower(request, until, steps)
                follower.from_bifurcation(event, sense, lambda done: None)
                found.append(self._followed(request, freedom, follower))
        return found[0], found[1]

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
        newton = self.newton(chosen.force_part, chosen.others)
        return soft_modes(self.model, newton, chosen, frame or chosen.frames[-1], count)

    def _follower(self, request: CurveRequest, until: Until, steps: ArcSteps | None) -> tuple[Follower, Freedom]:
        tracer, newton, freedom = self._tracer(request)
        idle, steps = freedom.mobility > 0, steps or ArcSteps()
        return Follower(self.model, newton, request, tracer, until=until, steps=steps, idle=idle), freedom

    def _followed(self, request: CurveRequest, freedom: Freedom, follower: Follower) -> FollowedCurve:
        return FollowedCurve(
            request.force,
            request.configuration,
            freedom,
            tuple(follower.frames),
            units=self.scene.units,
            leads=self.comm.rank == 0,
            others=request.others,
            events=tuple(follower.events),
        )

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

    def error_estimates(self, curve: Curve | None = None) -> np.ndarray:
        """What finer elements would add to the displacement of each frame, (frames,) (collective).

        Args:
            curve: the last curve computed by default.

        Raises:
            DescriptionError: no curve was computed yet.
        """
        chosen = self._chosen(curve)
        error = self._goal_error(chosen)
        return np.array([error.estimate(frame, chosen.freedom) for frame in chosen.frames])

    def modelling_errors(self, curve: Curve | None = None) -> np.ndarray:
        """What a simulation in space would add to displacements in plane stress, (frames,) (collective).

        Args:
            curve: the last curve computed by default.

        Raises:
            DescriptionError: no curve was computed yet, or this is not plane stress.
        """
        chosen = self._chosen(curve)
        error = self._depth_error(chosen)
        return np.array([error.estimate(frame, chosen.freedom) for frame in chosen.frames])

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

    def newton(self, force: Force, others: tuple[tuple[Force, float], ...] = ()) -> Iteration:
        """The solver for one controlled and some fixed forces, kept for all configurations (collective)."""
        key = (force, others)
        if key not in self._newtons:
            model = self.model
            loads = tuple((model.point_load(other), float(magnitude)) for other, magnitude in others)
            self._newtons[key] = self._solver.on(model.system(model.point_load(force), loads))
        return self._newtons[key]

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
        first, last = (gather(self.model, curve.frames[k]) for k in (0, -1))
        if first is None:
            return None
        pen = Draughtsman(self.scene.mechanism, self.linkage, self.model.mesh)
        force, units = curve.frames[-1].force, self.scene.units
        return Panel(
            pen.shape(first, stress=False),
            (pen.shape(last, stress=stress),),
            (pen.arrow(curve.force_part, force, last, label=f"{force:g} {units.force}"),),
            tuple(traces),
            f"{curve.configuration.name}: {force:.3g} {units.force}, "
            f"{curve.frames[-1].displacement:.3g} {units.length}",
        )

    def path(self, part: Force | Output, configurations: Sequence[Configuration]) -> np.ndarray:
        """Where the unloaded point of a force or output is in each configuration, (configurations, dim).

        Raises:
            AssemblyError: one of the configurations does not assemble, or its motors strain the links.
        """
        body = self.linkage.body_of(part.on)
        space, centre = self.linkage.joints.space, np.array(self.linkage.bodies[body].centre)
        drawn = np.array(in_dimension(part.at, self.linkage.dim))
        positions = []
        for configuration in configurations:
            assembly = assemble(self.linkage, configuration)
            if assembly.fraction < 1.0:
                raise AssemblyError(
                    f"configuration {configuration.name!r}",
                    f"its motors strain the links beyond {assembly.fraction:.1%} of their way",
                    "Use load_displacement with an output at the point",
                )
            positions.append(drawn + space.displace(assembly.poses[body], (drawn - centre)[None])[0])
        return np.array(positions)

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

    def _tracer(self, request: CurveRequest) -> tuple[Tracer, Iteration, Freedom]:
        """What starts the path of a request, its solver, and the freedom of its configuration (collective)."""
        assembly = assemble(self.linkage, request.configuration)
        rigid = self.linkage.rigid
        freedom = count_freedom(rigid, assembly.poses, rigid.motor_values(request.configuration.position))
        newton = self.newton(request.force, request.others)
        tracer = Tracer(self.model, newton, request, assembly=assembly, freedom=freedom, predictor=self._predictor)
        return tracer, newton, freedom

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
        self.__dict__.pop("model", None)
        self._newtons: dict[tuple, Iteration] = {}
        self._errors: dict[tuple, GoalError] = {}
        self._depth_errors: dict[tuple, DepthError] = {}

    def _outcome(self, rung: Rung, request: CurveRequest, watch: Callable[[int], None]) -> Outcome:
        """What a rung of the dial gives for a curve, and how wrong it may be (collective)."""
        fidelity = self._dial.fidelity(rung)
        if fidelity != self.fidelity:
            self._take(fidelity)
        self._last = curve = self.trace(request, watch=watch)
        frame = max(curve.frames, key=lambda frame: abs(frame.displacement))
        elements = self._goal_error(curve).estimate(frame, curve.freedom)
        depth = 0.0
        if fidelity.model is PLANE_STRESS:
            depth = self._depth_error(curve).estimate(frame, curve.freedom)
        unknowns = self.model.rigid_dofs + self.model.flexible_dofs + self.model.pressure_dofs
        return Outcome(frame.displacement, elements, depth, unknowns)

    def _goal_error(self, curve: Curve) -> GoalError:
        key = (curve.force_part, curve.others)
        if key not in self._errors:
            self._errors[key] = GoalError(self.model, self.newton(*key))
        return self._errors[key]

    def _depth_error(self, curve: Curve) -> DepthError:
        key = (curve.force_part, curve.others)
        if key not in self._depth_errors:
            self._depth_errors[key] = DepthError(self.model, self.newton(*key))
        return self._depth_errors[key]

    def _chosen(self, curve: Curve | None) -> Curve:
        chosen = curve or self._last
        if chosen is None:
            raise DescriptionError("simulation", "no curve was computed yet", "Call load_displacement first")
        return chosen


def _check_until(until: Until) -> None:
    if not isinstance(until, Until):
        raise DescriptionError("end of a path", f"{until!r} does not say where", "Give until=Until(displacement=…)")


def _description(mechanism: Mechanism) -> tuple[tuple, ...]:
    """What a simulation is built from; forces and outputs may be added later."""
    return tuple(mechanism.links), tuple(mechanism.joints), tuple(mechanism.motors)
