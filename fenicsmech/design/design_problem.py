"""A design problem: which links of a simulation may change, and what is wanted of the mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from time import perf_counter

import numpy as np

from fenicsmech.clock import Clock
from fenicsmech.collective import on_one
from fenicsmech.design.description import (
    SplineDesign,
    Target,
    check_designs,
    check_effects,
    check_targets,
    shape_request,
)
from fenicsmech.design.equilibria import TargetEquilibria
from fenicsmech.design.objective import Group, Objective, group_count, objective_error, split, target_errors
from fenicsmech.design.optimisers.levenberg_marquardt import LevenbergMarquardt
from fenicsmech.design.optimisers.problem import Infeasible, Iterate, Optimiser, Start
from fenicsmech.design.regularisers import MeshQuality, Regulariser, ShapeBounds, StayClose
from fenicsmech.design.rest_shape import RestShape
from fenicsmech.design.result import (
    DesignResult,
    Verification,
    draw_links,
    link_designs,
    rest_meshes,
    target_results,
    verify,
    write_solids,
)
from fenicsmech.design.run import Checkpoint, DesignProgress, Optimum, fingerprint, minimise_together
from fenicsmech.design.shape.handle_optimum import Placement
from fenicsmech.design.shape.shape_map import LinkShape, shape_links
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
        """Parameters of the drawn shapes, (parameters,)."""
        return self._rest.initial

    def apply(self, design: DesignResult | np.ndarray) -> None:
        """Gives the simulation the shapes of a result or of parameters (parameters,).

        Raises:
            DescriptionError: the design is one of other links.
            ShapeError: cells of the mesh are inverted in this shape.
        """
        self._rest.place(*self._given(design))

    def optimise(
        self,
        *,
        optimiser: Optimiser | None = None,
        start: DesignResult | None = None,
        checkpoint: str | Path | None = None,
        resume: bool = False,
    ) -> DesignResult:
        """The best design; the simulation has its shapes afterwards.

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
        values, optimum = self._minimise(optimiser, begin, near, saved)
        placement = comm.bcast(objective.placement, root=0)
        with self._clock.phase("verification"):
            self._rest.place(optimum.parameters, placement)
            found = verify(self.simulation, self.targets, objective.reached)
        spent, phases = perf_counter() - began, self._clock.since(clock)
        result = self._result(optimum, placement, found, values, seconds=spent, phases=phases)
        return comm.bcast(result, root=0)  # processes differ in times and in the last bits

    def picture(self, path: str | Path, design: DesignResult) -> None:
        """Draws the links as drawn and as in ``design``, as a PNG.

        Raises:
            DescriptionError: the design is one of other links.
        """
        simulation, links, shapes = self.simulation, [design.link for design in self.designs], []
        with simulation.model.shaped(simulation.model.elastic.d.x.array.copy()):
            for given in ((self.initial, None), self._given(design)):
                self._rest.place(*given)
                shapes.append((given[0], rest_meshes(simulation, links)))
        on_one(simulation.comm, lambda: draw_links(path, simulation, links, self._rest.links, *shapes))

    def export(self, folder: str | Path, *, pin: float | None = None) -> None:
        """Writes ``NAME.step`` and ``NAME.stl`` of every link that may change, in its present shape.

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
        """Where to start, and the handles there if they are known: from ``saved`` if its file exists."""
        parameters, near = (self.initial, None) if start is None else self._given(start)
        begin = Start(parameters)
        if saved is not None and (found := saved.load_together(self.simulation.comm)) is not None:
            begin, near = found.start, self._rest.known(found.start.parameters, found.handles)
        return begin, near

    def _minimise(
        self, optimiser: Optimiser, begin: Start, near: Placement | None, saved: Checkpoint | None
    ) -> tuple[tuple[float, float], Optimum]:
        """The objective of the drawn and of the best design, and how the minimisation ended."""
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
                optimum = minimise_together(self.simulation.comm, objective, optimiser, begin, watch=watch)
                return (initial, objective.evaluate(optimum.parameters).value), optimum
            except Infeasible as failure:
                raise EquilibriumError(
                    f"design of {self.simulation.scene.mechanism.name!r}",
                    f"the design to start from has no value: {failure}",
                    "Draw links that carry the targets' loads, or start with smaller loads",
                ) from failure

    def _result(
        self,
        optimum: Optimum,
        placement: Placement,
        found: Verification,
        values: tuple[float, float],
        *,
        seconds: float,
        phases: dict[str, float],
    ) -> DesignResult:
        """The verified optimum, which the simulation has, as plain data."""
        (_, objective), comm, error = self._team, self.simulation.comm, None
        if found.errors is not None:
            error = objective_error(self.targets, found.displacements, found.errors)
        return DesignResult(
            mechanism=self.simulation.scene.mechanism.name,
            links=link_designs(self._rest, placement),
            targets=target_results(self.targets, optimum.started, found),
            reason=optimum.reason.value,
            converged=optimum.reason.converged,
            verified=found.same,
            active=objective.active(optimum.parameters),
            objective=values,
            objective_error=error,
            iterations=optimum.number,
            evaluations=optimum.evaluations,
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
        return RestShape(simulation.model, self._shapes, self.designs)

    def _given(self, design: DesignResult | np.ndarray) -> tuple[np.ndarray, Placement | None]:
        """Parameters of a design, and its handle positions if it is a result.

        Raises:
            DescriptionError: the result is one of other links, or the parameters are not as many finite numbers.
        """
        if not isinstance(design, DesignResult):
            parameters = np.array(design, dtype=float)
            if parameters.shape != self.initial.shape or not np.all(np.isfinite(parameters)):
                raise DescriptionError(
                    "design", f"parameters of shape {parameters.shape}", f"Give {len(self.initial)} finite numbers"
                )
            return parameters, None
        given = {link.name: link for link in design.links}
        for link in self._rest.links:
            size, found = link.spline.size, len(given[link.name].parameters) if link.name in given else 0
            if found != size:
                raise DescriptionError(
                    f"design of {design.mechanism!r}",
                    f"it has {found} parameters of link {link.name!r} instead of {size}",
                    "Use a result of the same links and numbers of segments",
                )
        own = [given[link.name] for link in self._rest.links]
        parameters, theta = (np.concatenate(parts) for parts in ([o.parameters for o in own], [o.handles for o in own]))
        return parameters, self._rest.known(parameters, theta)
