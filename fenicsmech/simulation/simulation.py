"""Simulation of a scene: its fidelity and its curves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from functools import partial
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import from_one
from fenicsmech.continuation import ArcSteps, HermitePredictor, Predictor
from fenicsmech.elasticity import Formulation, MixedFormulation, Quadrature
from fenicsmech.equilibrium import EquilibriumMethod, EquilibriumSolver, PrimalDualNewton, State
from fenicsmech.errors import AssemblyError, DescriptionError, expect, positive
from fenicsmech.estimates import AccuracyControl, Choice, Estimates, FidelityLevel, LevelErrors, cause_of_growth
from fenicsmech.log import Clock, Progress, logger
from fenicsmech.mechanism import (
    DRAWN,
    Configuration,
    FlexibleLink,
    Force,
    ForceGroup,
    Joint,
    Material,
    MaterialPoint,
    Mechanism,
    Output,
    PrescribedPart,
    Scene,
    Shape,
    check_loads,
    in_dimension,
)
from fenicsmech.meshing import radius_ratios
from fenicsmech.model import Design, Fidelity, MechanismModel, read_fidelity
from fenicsmech.multibody import JointChange, Linkage, PlacedPoint, assemble, spring_potentials
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.discretisation import Discretisation
from fenicsmech.simulation.fields import rest_vertices
from fenicsmech.simulation.following import CurveFollower, FollowedCurve, PathEvent, Until, branches, read_path
from fenicsmech.simulation.frame import ModeShape
from fenicsmech.simulation.omitted_effects import coarse_links
from fenicsmech.simulation.request import CurveRequest, check_force, read_others, read_request
from fenicsmech.simulation.safe_range import SafeRange, SafeRangeOptions, SafeRangeSearch, read_bounds
from fenicsmech.simulation.stepping import CurveStepper
from fenicsmech.stress import SingularPlace, StressOptions, check_allowables

_log = logger(__name__)


class RestShape(Protocol):
    """A design on any mesh of its mechanism."""

    def rest_shape(self, simulation: Simulation) -> Design:
        """The rest shape of the simulation's links, and numbers of its parts."""


class Simulation:
    """Equilibria of a scene at one fidelity: the one given, or the cheapest that is accurate enough.

    Nothing is meshed or compiled until the first curve; the description is checked at once.

    Args:
        scene: the mechanism and its effects.
        space: "3d", the default; "3d-symmetric", which meshes half the depth of links that joints and forces move in
            the plane; "plane-stress" or "plane-strain".
        order: degree of the displacement field, 1, 2 or 3; 2 by default.
        size: element size in the plane of the links, or one per flexible link; that of a mesh file's elements serves
            warnings and estimates.
        accuracy: instead of space, order, layers, segments and quadrature: relative error allowed in the largest
            displacement of every curve, or in the largest force where displacements are prescribed, once the estimates
            of its errors are added (``Curve.corrected``). ``load_displacement`` finds the cheapest fidelity that is
            good enough, see ``choice``; ``follow``, ``branches``, simulations derived from this one and design problems
            use the one chosen last, and raise an error if there is none yet. Links from STEP files are measured; for
            those from mesh files ``size`` gives the thickness.
        layers: of elements through the depth of strips and outlines in space, or half of it where half is meshed; by
            default from depth and size.
        segments: of elements around pins, at least; 8 by default.
        quadrature: quadrature degree; the measured optimum by default.
        formulation: ``MixedFormulation()``: pressures are unknowns in nearly incompressible links;
            ``DisplacementFormulation()``: in none.
        solver: method for equilibria.
        predictor: of the next equilibrium on a curve.
        stress: numbers of the recovery of stresses and of singular places.
        comm: processes that share the work.

    Attributes:
        choice: the fidelity chosen for the required accuracy; None before.

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
        solver: EquilibriumMethod | None = None,
        predictor: Predictor | None = None,
        stress: StressOptions | None = None,
        comm: MPI.Comm = MPI.COMM_WORLD,
    ) -> None:
        expect("simulation", scene, Scene, "a scene", "Give Scene(mechanism, effects=[…])")
        for name, value, kind, remedy in (
            ("formulation", formulation, Formulation, "MixedFormulation() or DisplacementFormulation()"),
            ("quadrature", quadrature, Quadrature, "Quadrature(degree)"),
            ("solver", solver, EquilibriumMethod, "PrimalDualNewton(…)"),
            ("predictor", predictor, Predictor, "HermitePredictor(), TangentPredictor() or ConstantPredictor()"),
            ("stress", stress, StressOptions, "StressOptions(…)"),
        ):
            if value is not None:
                expect(name, value, kind, f"a {name}", f"Give {remedy}")
        formulation = formulation or MixedFormulation()
        self.scene, self.comm, self.clock = scene, comm, Clock()
        self.choice: Choice | None = None
        self._control: AccuracyControl | None = None
        self._design: Design | None = None
        given = dict[str, Any](space=space, order=order, layers=layers, segments=segments, quadrature=quadrature)
        if accuracy is None:
            fidelity = read_fidelity(scene, size=size, formulation=formulation, **given)
        else:
            both = next((name for name, value in given.items() if value is not None), None)
            if both:
                raise DescriptionError(
                    f"accuracy and {both}",
                    f"both are given, and {both}={given[both]!r} would decide what accuracy is to choose",
                    f"Leave out {both}, or give {both} and size=… instead of an accuracy",
                )
            self._control = AccuracyControl(scene, accuracy, size, formulation, comm=comm)
            fidelity = self._control.fidelity(self._control.level)
        solver, predictor = solver or PrimalDualNewton(), predictor or HermitePredictor()
        self._discretisation = Discretisation(scene, fidelity, solver, predictor, self.clock, comm, stress=stress)
        if accuracy is None:
            self._warn_of_coarse_links()
        self._described = _description(scene.mechanism)

    def __repr__(self) -> str:
        own, design = self.fidelity, ", another design" if self._design is not None else ""
        return (
            f"<Simulation of {self.scene.mechanism.name!r}: {own.model.name}, order {own.order}, "
            f"elements of {own.size_text} {self.scene.units.length}{design}>"
        )

    # -- curves --------------------------------------------------------------------------------------------------

    def load_displacement(
        self,
        part: Force | ForceGroup,
        *,
        forces: Sequence[float] | None = None,
        displacements: Sequence[float] | None = None,
        configuration: Configuration = DRAWN,
        others: Mapping[Force, float] | None = None,
    ) -> Curve:
        """The equilibria under a changing force.

        Args:
            part: the force that changes, or a ``ForceGroup`` of several.
            forces: its magnitudes (load control), or
            displacements: of its point along its direction, for a group Σ ratio · displacement (displacement control).
            configuration: motor positions.
            others: constant magnitudes of other forces.

        Raises:
            DescriptionError: the request contradicts itself or the mechanism.
            AssemblyError: the configuration does not assemble.
            EquilibriumError: a prescribed value was not reached; carries the frames before it.
        """
        self._check_description()
        request = read_request(
            self.scene.mechanism,
            part,
            forces=forces,
            displacements=displacements,
            configuration=configuration,
            others=others,
        )
        with Progress(len(request.controls), configuration.name, shown=self.comm.rank == 0) as progress:
            control = self._control
            if control is None:
                return self.compute(request, watch=progress.update)
            curves: list[Curve] = []

            def run(level: FidelityLevel) -> LevelErrors:
                fidelity = control.fidelity(level)
                if fidelity != self.fidelity:  # curves keep theirs
                    self._discretisation, self.choice = self._discretisation.at(fidelity, self.clock, self.comm), None
                curves[:] = [self.compute(request, watch=progress.update)]
                return _errors(curves[0])

            self.choice = control.choose(run, cause_of_growth(part))
            return curves[0]

    def follow(
        self,
        part: PrescribedPart,
        *,
        until: Until,
        configuration: Configuration = DRAWN,
        others: Mapping[Force, float] | None = None,
        steps: ArcSteps | None = None,
    ) -> FollowedCurve:
        """The whole curve under a changing force or a moving motor, past limit points and folds.

        Starts in the configuration, without the force that changes, and goes towards the first displacement or
        position, or else the first force, of ``until``. The abscissa of a motor's curve is its position, the ordinate
        its torque or force.

        Args:
            part: the force that changes, or the motor that moves, or a ``Drive`` of several.
            until: where the curve ends.
            configuration: motor positions; where the motor that moves starts from.
            others: constant magnitudes of other forces.
            steps: how finely it is followed.

        Raises:
            DescriptionError: the request contradicts itself or the mechanism, or no fidelity was chosen for an accuracy
                yet.
            AssemblyError: the configuration does not assemble.
            EquilibriumError: the curve ends early; carries the frames before that.
        """
        self._check_description()
        self._check_chosen(f"curve of {part.name!r}")
        request = read_path(self.scene.mechanism, part, until, configuration, others)
        with Progress(until.frames, configuration.name, shown=self.comm.rank == 0) as progress, self._shaped():
            return CurveFollower(self._discretisation, request, until, steps or ArcSteps()).from_rest(progress.update)

    def branches(
        self,
        curve: FollowedCurve,
        event: PathEvent,
        *,
        until: Until,
        steps: ArcSteps | None = None,
        mode: ModeShape | None = None,
    ) -> tuple[FollowedCurve, FollowedCurve]:
        """The curve that crosses ``curve`` at a bifurcation, from there in both directions, at the design of ``curve``.

        Args:
            curve: a followed curve.
            event: one of its bifurcations.
            until: where each of the two ends.
            steps: how finely they are followed.
            mode: one of the event's ``null_space``, if several modes become unstable at once; the curve that is nearest
                to it where it has left ``curve`` is found.

        Raises:
            DescriptionError: the event is not a bifurcation of the curve, the mode is missing or none of its, or the
                curve was computed at another fidelity.
            EquilibriumError: the curve is not found, or ends early; carries the frames before that.
        """
        self._check_description()
        if curve.discretisation is not self._discretisation:
            raise DescriptionError(
                f"curve of {curve.part.name!r}",
                "it was computed at another fidelity than the present one of this simulation",
                "Call branches() on the simulation that computed it, before it changes to a finer mesh",
            )
        return branches(curve, event, until, steps or ArcSteps(), mode)

    def safe_range(
        self,
        part: Force | ForceGroup,
        *,
        forces: Sequence[float] | None = None,
        displacements: Sequence[float] | None = None,
        factor: float = 1.0,
        configuration: Configuration = DRAWN,
        others: Mapping[Force, float] | None = None,
        options: SafeRangeOptions | None = None,
    ) -> SafeRange:
        """The forces and displacements between which every link bears its stress, in both senses of the force.

        In each sense the force grows from zero until the first link reaches its allowable (``Frame.safety``), or the
        mechanism would snap or buckle. Links of unknown strength do not count; the result names them.

        Args:
            part: the force that changes, or a ``ForceGroup`` of several.
            forces: ends of the range that is searched, one on each side of zero; without ends by default. Or
            displacements: such ends; displacements are prescribed then, past limit points of the force.
            factor: of safety, required.
            configuration: motor positions.
            others: constant magnitudes of other forces.
            options: of the search.

        Raises:
            DescriptionError: the request contradicts itself or the mechanism, no material has an allowable, or no
                fidelity was chosen for an accuracy yet.
            AssemblyError: the configuration does not assemble.
            EquilibriumError: the mechanism has no equilibrium near rest, nothing resists, or no end is found.
        """
        self._check_description()
        self._check_chosen(f"safe range of {part!r}")
        check_force(self.scene.mechanism, part)
        constant, factor = read_others(self.scene.mechanism, part, configuration, others), positive("factor", factor)
        low, high = read_bounds(part, forces, displacements)
        check_allowables(self._discretisation.stresses.materials)
        request, options = CurveRequest(part, (), configuration, constant), options or SafeRangeOptions()
        displaces, units = displacements is not None, self.scene.units
        with self._shaped():
            search = SafeRangeSearch(self._discretisation, request, displaces=displaces, factor=factor, options=options)
            lower, upper = (search.end(bound) for bound in (low, high))
        return SafeRange(part, factor, lower, upper, (units.force, units.length))

    def path(self, part: Force | Output, configurations: Sequence[Configuration]) -> np.ndarray:
        """Position of the point of a force or output in each rigid assembly, (configurations, dim).

        Raises:
            AssemblyError: one of the configurations does not assemble, or its motors strain the links.
            EquilibriumError: its motors turn a spring in space by more than a full turn.
        """
        linkage, designed = self.linkage, self._design is not None
        # designs change the model's springs; those drawn need no mesh
        springs = self.model.spring_potentials if designed else spring_potentials(self.scene.effects, linkage)
        with self._shaped():
            elsewhere = designed or part.material in self._discretisation.placed
            rest = self.model.rest_position(part) if elsewhere else np.array(in_dimension(part.at, linkage.dim))
        point, positions = linkage.point(part.on, rest.tolist()), []
        for configuration in configurations:
            with self._shaped():
                assembly = from_one(self.comm, partial(assemble, linkage, configuration, springs))
            if assembly.fraction < 1.0:
                raise AssemblyError(
                    f"configuration {configuration.name!r}",
                    f"its motors strain the links beyond {assembly.fraction:.1%} of their way",
                    "Use load_displacement with an output at the point",
                )
            positions.append(rest + point.displacement(None, assembly.poses))
        return np.array(positions)

    # -- simulations derived from this one ------------------------------------------------------------------------

    def with_design(self, design: RestShape | Design | np.ndarray) -> Simulation:
        """The same scene at the same fidelity with links of another rest shape, and parts with other numbers.

        Mesh and compiled forms are shared. A result shifts joints and flexible links together; the numbers of a
        ``Design`` shift joints alone, and its field has to carry flexible links along.

        Args:
            design: the result of a design problem, or a design on the mesh of this simulation, or its design field
                alone, this rank's values with ghosts, flat.

        Raises:
            DescriptionError: the design belongs to other links or another mesh, or the scene has no parts with such
                numbers; or no fidelity was chosen for an accuracy yet.
            ShapeError: cells of the mesh are inverted in this shape.
        """
        other = self._derived()
        if isinstance(design, np.ndarray):
            given = Design(design)
        else:
            given = design if isinstance(design, Design) else design.rest_shape(self)
        for kind in given.numbers:
            kind.check(self.scene, self.linkage.dim)
        size = len(self.model.elastic.shape.x.array)
        if self.comm.allreduce(int(given.field.shape != (size,))):
            raise DescriptionError(
                f"design of {self.scene.mechanism.name!r}",
                f"it has values of shape {given.field.shape}, and the mesh has {size}",
                "Give the design field of this simulation",
            )
        other._design = Design(given.field, dict(given.numbers))
        return other

    def with_material(self, drawn: Material, other: Material) -> Simulation:
        """The same scene at the same fidelity with links of another material; the mesh is shared.

        Args:
            drawn: the material of some links.
            other: their new material; effects keep the drawn one, such as its density in ``Gravity``.

        Raises:
            DescriptionError: no link is made of ``drawn``, ``other`` is not a material in the units of the scene, or no
                fidelity was chosen for an accuracy yet.
        """
        simulation = self._derived()
        simulation._discretisation = self._discretisation.with_material(drawn, other)
        return simulation

    def with_shapes(
        self,
        shapes: Mapping[FlexibleLink, Shape],
        *,
        fidelity: Fidelity | None = None,
        moved: Mapping[Joint, JointChange] | None = None,
        placed: Mapping[MaterialPoint, PlacedPoint] | None = None,
    ) -> Simulation:
        """The same scene with links of other shapes, remeshed; joints keep their interfaces.

        Quantities, samples, targets and effects that name these links apply to them in their new shapes. Links keep the
        centreline they were described with.

        Args:
            shapes: of some flexible links, such as ``step_file`` of a designed part.
            fidelity: by default that of this simulation.
            moved: joints that are placed otherwise than drawn, such as those of a designed part.
            placed: points of these links that are elsewhere than drawn, likewise.

        Raises:
            DescriptionError: these are not shapes of flexible links of the mechanism, or points of them; or it does not
                fit the fidelity, or none was chosen for an accuracy yet.
            MeshingError: a file cannot be read, or a joint is not on its link.
        """
        for link, shape in shapes.items():
            if link not in self.scene.mechanism.flexible_links or not isinstance(shape, Shape):
                raise DescriptionError(
                    f"shapes of links of {self.scene.mechanism.name!r}",
                    f"{shape!r} is given as the shape of {link!r}",
                    "Give {link: shape, …} of flexible links of the mechanism",
                )
        for material, place in (placed or {}).items():
            of_link = isinstance(material, tuple) and len(material) == 3
            of_link = of_link and material[0] in self.scene.mechanism.flexible_links
            if not of_link or not isinstance(place, PlacedPoint):
                raise DescriptionError(
                    f"placed points of {self.scene.mechanism.name!r}",
                    f"{place!r} is given as the place of {material!r}",
                    "Give {force.material: PlacedPoint(…), …} of points of flexible links of the mechanism",
                )
        other = self._derived()
        other.clock, other.choice, other._design = Clock(), None, None
        fidelity = fidelity or self.fidelity
        other._discretisation = self._discretisation.at(fidelity, other.clock, self.comm, shapes, moved, placed)
        if shapes:
            other._warn_of_coarse_links()
        return other

    def on(self, comm: MPI.Comm) -> Simulation:
        """The same scene at the same fidelity for other processes, as drawn.

        Raises:
            DescriptionError: no fidelity was chosen for an accuracy yet.
        """
        other = self._derived()
        other.comm, other.clock, other._design = comm, Clock(), None
        other._discretisation = self._discretisation.on(comm, other.clock)
        return other

    def _derived(self) -> Simulation:
        """A copy of the fidelity that was given or chosen."""
        self._check_chosen(f"simulation of {self.scene.mechanism.name!r}")
        other = copy(self)
        other._control = None
        return other

    # -- parts ------------------------------------------------------------------------------------------------------

    @property
    def fidelity(self) -> Fidelity:
        """The present fidelity."""
        return self._discretisation.fidelity

    @property
    def shapes(self) -> Mapping[FlexibleLink, Shape]:
        """The present shapes of the flexible links: as drawn, or others given to ``with_shapes``."""
        return self._discretisation.shapes

    @property
    def materials(self) -> Mapping[FlexibleLink, Material]:
        """The material of each flexible link. *Local.*"""
        return dict(zip(self.scene.mechanism.flexible_links, self._discretisation.materials, strict=True))

    @property
    def linkage(self) -> Linkage:
        """The mechanism's bodies and joints."""
        return self._discretisation.linkage

    @property
    def model(self) -> MechanismModel:
        """The meshed mechanism, which simulations of several designs share; as drawn between their methods' calls."""
        return self._discretisation.model

    @property
    def estimates(self) -> Estimates:
        """Error estimates at equilibria of the present fidelity."""
        return self._discretisation.estimates

    @property
    def singular_places(self) -> tuple[SingularPlace, ...]:
        """The places of flexible links where stress has no limit, which ``Frame.peak`` leaves out."""
        return self._discretisation.stresses.singular_places

    @property
    def setup_seconds(self) -> float:
        """Seconds spent before the first frame: mesh, compiled forms, matrix patterns."""
        return sum(self.clock.seconds.get(phase, 0.0) for phase in ("mesh", "setup", "compile"))

    @property
    def mesh_ratio_max(self) -> float:
        """Largest ratio of circumradius to inradius among the cells of the rest shape."""
        with self._shaped():
            rest, cells, dim = rest_vertices(self.model), self.model.mesh.cells, self.fidelity.model.dim
        return from_one(self.comm, lambda: 1.0 if rest is None else dim / float(radius_ratios(rest, cells).min()))

    def solver(self, part: PrescribedPart, others: Sequence[Force] = ()) -> EquilibriumSolver:
        """The solver for a force or motors that change and some constant forces, whose magnitudes states hold."""
        return self._discretisation.solver(part, others)

    def forget(self, part: PrescribedPart) -> None:
        """Gives the memory of the solvers of a part back, which are made anew when they are needed. Local."""
        self._discretisation.forget(part)

    def compute(self, request: CurveRequest, *, watch: Callable[[int], None] = lambda done: None) -> Curve:
        """The curve of a checked request, like ``load_displacement`` but without showing progress.

        Args:
            request: of the curve.
            watch: called with the number of frames so far.
        """
        with self._shaped():
            return CurveStepper(self._discretisation, request).curve(watch)

    def unloaded(self, request: CurveRequest) -> State:
        """The equilibrium of a checked request without forces, effects at load factor 0.

        Raises:
            EquilibriumError: motors strain the links or wind up springs, and no equilibrium was found.
        """
        with self._shaped():
            return CurveStepper(self._discretisation, request).unloaded

    def check_drawn(self, part: str) -> Simulation:
        """This simulation for a ``part`` that changes the design itself; its fidelity stays, whatever curves follow.

        Raises:
            DescriptionError: it is one ``with_design``, its mechanism changed since it was made, or no fidelity was
                chosen for an accuracy yet.
        """
        self._check_description()
        self._check_chosen(part)
        if self._design is not None:
            raise DescriptionError(
                part,
                f"its simulation of {self.scene.mechanism.name!r} has another design than the drawn one",
                "Give it as drawn, before with_design(); problem.optimise(start=result) starts from a result",
            )
        return self._derived()

    @contextmanager
    def _shaped(self) -> Iterator[None]:
        """A context in which the model has the design of this simulation."""
        if self._design is None:
            yield
        else:
            with self.model.shaped(self._design):
                yield

    def _warn_of_coarse_links(self) -> None:
        """Logs a warning for links whose elements are too long to resolve their bending."""
        if text := coarse_links(self._discretisation, self.scene.units):
            _log.warning("%s", text)

    def _check_chosen(self, part: str) -> None:
        """Refuses, for a ``part``, the pilot mesh of an accuracy for which no fidelity was chosen yet."""
        if self._control is not None and self.choice is None:
            raise DescriptionError(
                part,
                "no fidelity has been chosen for the required accuracy yet",
                "Call load_displacement() first, up to such forces, or give space, order and size instead of accuracy",
            )

    def _check_description(self) -> None:
        """Refuses a mechanism that is not the one this simulation was made for, and forces and outputs it cannot have.

        These may have been added since.
        """
        if _description(self.scene.mechanism) != self._described:
            raise DescriptionError(
                f"mechanism {self.scene.mechanism.name!r}",
                "links, joints or motors were added after the simulation was made",
                "Make a new Simulation",
            )
        check_loads(self.scene.mechanism, self.linkage.dim)


def _errors(curve: Curve) -> LevelErrors:
    """The largest value of a curve and the estimates of its errors."""
    largest, model = int(np.argmax(np.abs(curve.values))), curve.discretisation.model
    value, elements, plane_stress = (float(v[largest]) for v in (curve.values, *curve.errors_by_kind()))
    unknowns = model.rigid_dofs + model.flexible_dofs + model.pressure_dofs
    return LevelErrors(value, elements, plane_stress, unknowns, float(curve.growth_by_halving[largest]))


def _description(mechanism: Mechanism) -> tuple[tuple, ...]:
    """The arguments of a simulation; forces and outputs may be added later."""
    return tuple(mechanism.links), tuple(mechanism.joints), tuple(mechanism.motors)
