"""Simulation of a scene: how finely it is computed, and the curves it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path as FilePath

import numpy as np
from mpi4py import MPI

from fenicsmech.clock import Clock
from fenicsmech.elasticity import PLANE_STRAIN, PLANE_STRESS, SPATIAL, Quadrature
from fenicsmech.equilibrium import Hermite, Newton, NewtonOptions, Predictor
from fenicsmech.errors import AssemblyError, DescriptionError
from fenicsmech.linkage import assemble, build_linkage, count_freedom
from fenicsmech.mechanism import DRAWN, Configuration, FlexibleLink, Force, Mechanism, Output, Scene, validate
from fenicsmech.mechanism.checks import positive
from fenicsmech.mechanism.places import in_dimension
from fenicsmech.meshing import radius_ratios
from fenicsmech.report import Panel, Progress, Silent, Trace, draw_configurations
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.explanation import Explanation, hints, simulated
from fenicsmech.simulation.export import write_xdmf
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.goal_error import GoalError
from fenicsmech.simulation.model import Fidelity, MechanismModel, check_links, mesh_mechanism
from fenicsmech.simulation.picture import Draughtsman
from fenicsmech.simulation.request import CurveRequest, read_request
from fenicsmech.simulation.snapshot import gather, rest_vertices
from fenicsmech.simulation.tracer import Tracer

SPACES = {model.name: model for model in (SPATIAL, PLANE_STRESS, PLANE_STRAIN)}
"""Names of the elastic models, as users type them."""


class Simulation:
    """Equilibria of a scene at one fidelity.

    Nothing is meshed or compiled until the first curve; the description is checked at once.

    Args:
        scene: the mechanism and what acts on it.
        space: "3d", "plane-stress" or "plane-strain".
        order: degree of the displacement field, 1, 2 or 3.
        size: element size in the plane of the links, or one per flexible link.
        quadrature: quadrature degree; the measured optimum by default.
        newton: limits of the equilibrium iteration.
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
        size: float | Mapping[FlexibleLink, float],
        quadrature: Quadrature | None = None,
        newton: NewtonOptions | None = None,
        predictor: Predictor | None = None,
        comm: MPI.Comm = MPI.COMM_WORLD,
    ) -> None:
        if space not in SPACES:
            raise DescriptionError("space", f"{space!r} is not known", f"Choose one of {', '.join(SPACES)}")
        if order not in (1, 2, 3):
            raise DescriptionError("order", f"{order!r} is not 1, 2 or 3", "Choose 1 for speed, 2 for accuracy")
        model = SPACES[space]
        mechanism = scene.mechanism
        validate(mechanism, model.dim)
        links = mechanism.flexible_links
        if not links:
            raise DescriptionError(
                f"mechanism {mechanism.name!r}", "no link is flexible: nothing would bend", "Add one with flexible()"
            )
        per_link = size if isinstance(size, Mapping) else dict.fromkeys(links, size)
        sizes = {link: positive(f"element size of {link.name!r}", per_link.get(link)) for link in links}
        for link in links:
            model.check(link.name, link.material)
        for effect in scene.effects:
            effect.check(mechanism, model.dim)
        self.scene, self.comm, self.clock = scene, comm, Clock()
        self._described = _description(mechanism)
        self.fidelity = Fidelity(model, order, sizes, quadrature or Quadrature.for_order(order, model.dim))
        self.linkage = build_linkage(mechanism, model.dim)
        check_links(mechanism, self.linkage, self.fidelity)
        self._options, self._predictor = newton or NewtonOptions(), predictor or Hermite()
        self._newtons: dict[tuple, Newton] = {}
        self._errors: dict[Force, GoalError] = {}
        self._last: Curve | None = None

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
        if _description(self.scene.mechanism) != self._described:
            raise DescriptionError(
                f"mechanism {self.scene.mechanism.name!r}",
                "links, joints or motors were added after the simulation was made",
                "Make a new Simulation",
            )
        request = read_request(
            self.scene.mechanism,
            force,
            forces=forces,
            displacements=displacements,
            configuration=configuration,
            others=others,
        )
        with Progress(len(request.controls), configuration.name) if self.comm.rank == 0 else Silent() as progress:
            self._last = self.trace(request, watch=progress.update)
        return self._last

    def trace(self, request: CurveRequest, *, watch: Callable[[int], None] = lambda done: None) -> Curve:
        """The curve of a checked request, as ``load_displacement`` without showing progress (collective).

        Args:
            request: what is asked for.
            watch: called with the number of frames so far.
        """
        assembly = assemble(self.linkage, request.configuration)
        rigid = self.linkage.rigid
        freedom = count_freedom(rigid, assembly.poses, rigid.motor_values(request.configuration.position))
        newton = self.newton(request.force, request.others)
        tracer = Tracer(self.model, newton, request, assembly=assembly, freedom=freedom, predictor=self._predictor)
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
        )

    def on(self, comm: MPI.Comm) -> Simulation:
        """The same scene at the same fidelity for other processes, as drawn."""
        return Simulation(
            self.scene,
            space=self.fidelity.model.name,
            order=self.fidelity.order,
            size=self.fidelity.sizes,
            quadrature=self.fidelity.quadrature,
            newton=self._options,
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
        part = chosen.force_part
        if part not in self._errors:
            self._errors[part] = GoalError(self.model, self.newton(part))
        return np.array([self._errors[part].estimate(frame, chosen.freedom) for frame in chosen.frames])

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

    def newton(self, force: Force, others: tuple[tuple[Force, float], ...] = ()) -> Newton:
        """The solver for one controlled and some fixed forces, kept for all configurations (collective)."""
        key = (force, others)
        if key not in self._newtons:
            model = self.model
            loads = tuple((model.point_load(other), float(magnitude)) for other, magnitude in others)
            self._newtons[key] = Newton(model.system(model.point_load(force), loads), self._options)
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
            ratio = self.linkage.dim / float(radius_ratios(rest, self.model.mesh.cells).min())
        return self.comm.bcast(ratio, root=0)

    def _chosen(self, curve: Curve | None) -> Curve:
        chosen = curve or self._last
        if chosen is None:
            raise DescriptionError("simulation", "no curve was computed yet", "Call load_displacement first")
        return chosen


def _description(mechanism: Mechanism) -> tuple[tuple, ...]:
    """What a simulation is built from; forces and outputs may be added later."""
    return tuple(mechanism.links), tuple(mechanism.joints), tuple(mechanism.motors)
