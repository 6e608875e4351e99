"""A design problem: which links of a simulation may change, and what is wanted of the mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from time import perf_counter

import numpy as np

from fenicsmech.clock import Clock
from fenicsmech.collective import on_one
from fenicsmech.design.checkpoint import Checkpoint, fingerprint
from fenicsmech.design.conclusion import Verification, link_designs, target_results, verify
from fenicsmech.design.equilibria import TargetEquilibria
from fenicsmech.design.groups import Group, group_count, split
from fenicsmech.design.handle_optimum import Placement
from fenicsmech.design.link_files import draw_links, outline, rest_meshes, write_solids
from fenicsmech.design.link_shape import LinkShape, shape_links
from fenicsmech.design.objective import Objective, target_errors
from fenicsmech.design.objective_error import objective_error
from fenicsmech.design.optimisers import Infeasible, Iterate, LevenbergMarquardt, Optimiser, Start
from fenicsmech.design.problem_checks import check_designs, check_effects, check_targets
from fenicsmech.design.progress import DesignProgress
from fenicsmech.design.regularisers import MeshQuality, Regulariser, ShapeBounds, StayClose
from fenicsmech.design.rest_shape import RestShape
from fenicsmech.design.result import DesignResult
from fenicsmech.design.spline_design import SplineDesign, Target, bounds_of, shape_request
from fenicsmech.design.team import Outcome, minimise_together
from fenicsmech.errors import DescriptionError, EquilibriumError
from fenicsmech.simulation import Simulation

DEFAULT_REGULARISER = MeshQuality() + ShapeBounds() + 1e-4 * StayClose()


class DesignProblem:
    """Shapes of some links that make points move as far as wanted.

        min over p   Σ_k ½ w_k ((u_k(p) − ū_k) / ū_k)² + R(p)

    Nothing is meshed or compiled before it is needed; the description is checked at once.

    Args:
        simulation: how displacements are computed. It has the drawn shape until ``apply`` or ``optimise`` change it.
        designs: the links that may change.
        targets: what is wanted.
        regulariser: R; mesh quality, bounds of fabrication and a little closeness to the drawing by default.

    Raises:
        DescriptionError: the problem contradicts itself or the simulation's scene.
        AssemblyError: a target's configuration does not assemble.
    """

    def __init__(
        self,
        simulation: Simulation,
        designs: Sequence[SplineDesign],
        *,
        targets: Sequence[Target],
        regulariser: Regulariser = DEFAULT_REGULARISER,
    ) -> None:
        self.simulation, self.designs, self.targets = simulation, tuple(designs), tuple(targets)
        self._regulariser, self._clock = regulariser, Clock()
        check_designs(self.designs)
        check_targets(simulation, self.targets)
        mechanism, linkage = simulation.scene.mechanism, simulation.linkage
        self._requests = [shape_request(design, mechanism, linkage) for design in self.designs]

    @property
    def initial(self) -> np.ndarray:
        """Parameters of the drawn shapes, (parameters,) (collective)."""
        return self._rest.initial

    def apply(self, design: DesignResult | np.ndarray) -> None:
        """Gives the simulation the shapes of a result or of parameters (parameters,) (collective).

        Raises:
            DescriptionError: the design is one of other links.
            ShapeError: cells of the mesh are inverted in this shape.
        """
        if isinstance(design, DesignResult):
            self._rest.place(self._parameters(design), self._placement(design))
            return
        parameters = np.array(design, dtype=float)
        if parameters.shape != self.initial.shape or not np.all(np.isfinite(parameters)):
            raise DescriptionError(
                "design", f"parameters of shape {parameters.shape}", f"Give {len(self.initial)} finite numbers"
            )
        self._rest.place(parameters, None)

    def optimise(
        self,
        *,
        optimiser: Optimiser | None = None,
        start: DesignResult | None = None,
        checkpoint: str | Path | None = None,
        resume: bool = False,
    ) -> DesignResult:
        """The best design; the simulation has its shapes afterwards (collective).

        Targets that cannot be reached lead to the best design found, with the error of each and the bounds that hold
        it back.

        Args:
            optimiser: Levenberg–Marquardt by default.
            start: where to start, as the result of a cheaper simulation; the drawn shapes by default.
            checkpoint: file that is brought up to date after each iteration.
            resume: go on from ``checkpoint`` if it exists.

        Raises:
            DescriptionError: the checkpoint or the start is one of another problem, or no shape that may change moves
                the point of a target.
            EquilibriumError: the initial design does not carry its loads.
        """
        began, clock = perf_counter(), dict(self._clock.seconds)
        optimiser, comm = optimiser or LevenbergMarquardt(), self.simulation.comm
        _, objective = self._team
        saved = None
        if checkpoint is not None:
            problem = fingerprint(self.simulation, self._rest, self.targets, self._regulariser, optimiser)
            saved = Checkpoint(Path(checkpoint), problem)
        begin, near = self._beginning(start, saved if resume else None)
        values, outcome = self._minimise(optimiser, begin, near, saved)
        placement = comm.bcast(objective.placement, root=0)
        with self._clock.phase("verification"):
            self._rest.place(outcome.parameters, placement)
            found = verify(self.simulation, self.targets, objective.reached)
        spent, phases = perf_counter() - began, self._clock.since(clock)
        result = self._result(outcome, placement, found, values, seconds=spent, phases=phases)
        return comm.bcast(result, root=0)  # processes differ in times and in the last bits

    def picture(self, path: str | Path, design: DesignResult) -> None:
        """Draws the links as drawn and as in ``design``, as a PNG (collective).

        Raises:
            DescriptionError: the design is one of other links.
        """
        links, model = [design.link for design in self.designs], self.simulation.model
        shapes = []
        with model.shaped(model.elastic.d.x.array.copy()):
            for parameters, near in ((self.initial, None), (self._parameters(design), self._placement(design))):
                self._rest.place(parameters, near)
                shapes.append((parameters, rest_meshes(self.simulation, links)))

        def draw() -> None:
            before, after = (
                [outline(link, mesh, p[link.place]) for link, mesh in zip(self._rest.links, meshes, strict=True)]
                for p, meshes in shapes
            )
            draw_links(path, self.simulation, links, before, after)

        on_one(self.simulation.comm, draw)

    def export(self, folder: str | Path, *, pin: float | None = None) -> None:
        """Writes ``NAME.step`` and ``NAME.stl`` of every link that may change, in its present shape (collective).

        Args:
            folder: where to; it is created.
            pin: diameter of the holes left for pins; none by default.

        Raises:
            MeshingError: no solid can be made of a link.
        """
        links = [design.link for design in self.designs]
        meshes = rest_meshes(self.simulation, links)
        on_one(self.simulation.comm, lambda: write_solids(folder, self.simulation.linkage, links, meshes, pin))

    # -- steps of ``optimise`` -------------------------------------------------------------------------------

    def _beginning(self, start: DesignResult | None, saved: Checkpoint | None) -> tuple[Start, Placement | None]:
        """Where to start, and the handles there if they are known: from ``saved`` if its file exists (collective)."""
        begin, near = Start(self.initial), None
        if start is not None:
            begin, near = Start(self._parameters(start)), self._placement(start)
        if saved is not None and (found := saved.load_together(self.simulation.comm)) is not None:
            begin, near = found.start, self._rest.known(found.start.parameters, found.handles)
        return begin, near

    def _minimise(
        self, optimiser: Optimiser, begin: Start, near: Placement | None, saved: Checkpoint | None
    ) -> tuple[tuple[float, float], Outcome]:
        """The objective of the drawn and of the best design, and how the minimisation ended (collective)."""
        _, objective = self._team

        def watch(iterate: Iterate) -> None:
            if iterate.number == begin.number:
                effects = objective.effects(iterate.evaluation)
                errors = target_errors(self.targets, objective.reached)
                check_effects(self.targets, self.designs, effects=effects, errors=errors)
            if saved is not None:
                saved.save(iterate, objective.placement.theta)
            progress.update(iterate, target_errors(self.targets, objective.reached))

        with DesignProgress(optimiser, leads=self.simulation.comm.rank == 0) as progress:
            try:
                objective.begin(None)
                initial = objective.traced(self.initial)
                objective.begin(near)
                outcome = minimise_together(self.simulation.comm, objective, optimiser, begin, watch=watch)
                return (initial, objective.evaluate(outcome.parameters).value), outcome
            except Infeasible as failure:
                raise EquilibriumError(
                    f"design of {self.simulation.scene.mechanism.name!r}",
                    f"the design to start from has no value: {failure}",
                    "Draw links that carry the targets' loads, or start with smaller loads",
                ) from failure

    def _result(
        self,
        outcome: Outcome,
        placement: Placement,
        found: Verification,
        values: tuple[float, float],
        *,
        seconds: float,
        phases: dict[str, float],
    ) -> DesignResult:
        """The verified optimum, which the simulation has, as plain data (collective)."""
        (_, objective), comm, error = self._team, self.simulation.comm, None
        if found.errors is not None:
            error = objective_error(self.targets, found.displacements, found.errors)
        return DesignResult(
            mechanism=self.simulation.scene.mechanism.name,
            links=link_designs(self._rest, placement),
            targets=target_results(self.targets, outcome.started, found),
            reason=outcome.reason.value,
            converged=outcome.reason.converged,
            verified=found.same,
            active=objective.active(outcome.parameters),
            objective=values,
            objective_error=error,
            iterations=outcome.number,
            evaluations=outcome.evaluations,
            mesh_ratio_max=self.simulation.mesh_ratio_max,
            seconds=seconds,
            phases=phases,
            processes=comm.size,
            groups=group_count(comm.size, len(self.targets)),
        )

    # -- parts ---------------------------------------------------------------------------------------------

    @cached_property
    def _shapes(self) -> list[LinkShape]:
        """Handles and weights of the links that change, the same on all processes."""
        with self._clock.phase("setup"):
            mesh = self.simulation.model.mesh
        with self._clock.phase("weights"):
            return shape_links(mesh, self._requests)

    @cached_property
    def _rest(self) -> RestShape:
        return self._rest_of(self.simulation)

    @cached_property
    def _team(self) -> tuple[Group, Objective]:
        """This process's group, and the objective as its simulation sees it."""
        rest = self._rest
        with self._clock.phase("setup"):
            group, simulation = split(self.simulation.comm, len(self.targets)), self.simulation
            if group.comm is not simulation.comm:
                simulation = simulation.on(group.comm)
                rest = self._rest_of(simulation)
            equilibria = TargetEquilibria(simulation, [self.targets[k] for k in group.mine])
            objective = Objective(
                rest, equilibria, targets=self.targets, regulariser=self._regulariser, group=group, clock=self._clock
            )
        return group, objective

    def _rest_of(self, simulation: Simulation) -> RestShape:
        bounds = [bounds_of(design, shape.thickness) for design, shape in zip(self.designs, self._shapes, strict=True)]
        return RestShape(simulation.model, self._shapes, [design.link.name for design in self.designs], bounds)

    def _parameters(self, result: DesignResult) -> np.ndarray:
        """Parameters of a result of the same links."""
        wanted = [(link.name, link.place.stop - link.place.start) for link in self._rest.links]
        given = {link.name: link.parameters for link in result.links}
        for name, size in wanted:
            if len(given.get(name, ())) != size:
                raise DescriptionError(
                    f"design of {result.mechanism!r}",
                    f"it has {len(given.get(name, ()))} parameters of link {name!r} instead of {size}",
                    "Use a result of the same links and numbers of segments",
                )
        return np.concatenate([given[name] for name, _ in wanted])

    def _placement(self, result: DesignResult) -> Placement | None:
        """Handle positions of a result of the same links."""
        given = {link.name: link.handles for link in result.links}
        return self._rest.known(
            self._parameters(result), np.concatenate([given[link.name] for link in self._rest.links])
        )
