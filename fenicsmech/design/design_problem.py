"""A design problem: the links of a simulation that may change, and the targets of the mechanism."""

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
    check_sensitivities,
    check_targets,
    shape_request,
)
from fenicsmech.design.equilibria import TargetEquilibria
from fenicsmech.design.objective import Group, Objective, group_count, objective_error, split, target_errors
from fenicsmech.design.optimisers.levenberg_marquardt import LevenbergMarquardt
from fenicsmech.design.optimisers.problem import Infeasible, Iterate, Optimiser, Start
from fenicsmech.design.regularisers import MeshQuality, Regulariser, ShapeBounds, StayClose
from fenicsmech.design.rest_shape import ParametricShape
from fenicsmech.design.result import (
    DesignResult,
    draw_links,
    link_designs,
    rest_meshes,
    verified_targets,
    write_solids,
)
from fenicsmech.design.run import Checkpoint, DesignProgress, Optimum, fingerprint, minimise_together
from fenicsmech.design.shape.handle_optimum import HandlePlacement
from fenicsmech.design.shape.shape_map import LinkShape, shape_links
from fenicsmech.errors import DescriptionError, EquilibriumError
from fenicsmech.meshing import LinkMesh
from fenicsmech.simulation import Simulation

DEFAULT_REGULARISER = MeshQuality() + ShapeBounds() + 1e-4 * StayClose()


class DesignProblem:
    """Optimisation of the shapes of some links for target displacements.

        min over p   Σ_k ½ w_k ((u_k(p) − ū_k) / ū_k)² + R(p)

    Nothing is meshed or compiled before it is needed; the description is checked at once.

    Args:
        simulation: of the displacements; it keeps its shapes. ``simulation.with_design`` gives one of a result.
        designs: the links that may change.
        targets: wanted displacements.
        regulariser: R; by default mesh quality, bounds of fabrication, and closeness to the drawing with weight 1e-4,
            where the paper has 1: with 1 the targets of the demos are missed by 19–79 %.

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

    def rest_shape(self, design: DesignResult | np.ndarray) -> np.ndarray:
        """The design field of a result or of parameters (parameters,), as ``Simulation.with_design`` takes it.

        This rank's values, ghosts last, flat. Parameters alone fix displacements to about 1 % only: several positions
        of the handles can be good, and results hold those found.

        Raises:
            DescriptionError: the design is one of other links.
            ShapeError: cells of the mesh are inverted in this shape.
        """
        return self._rest.field(*self._given(design))

    def optimise(
        self,
        *,
        optimiser: Optimiser | None = None,
        start: DesignResult | None = None,
        checkpoint: str | Path | None = None,
        resume: bool = False,
    ) -> DesignResult:
        """The best design; the simulation stays as it is.

        Targets that cannot be reached lead to the best design found, with the error of each and the bounds that hold
        it back.

        Args:
            optimiser: Levenberg–Marquardt by default.
            start: initial design, as the result of a cheaper simulation; the drawn shapes by default.
            checkpoint: file updated after each iteration.
            resume: whether to continue from ``checkpoint`` if it exists.

        Raises:
            DescriptionError: the checkpoint or the start is one of another problem, or no shape that may change moves
                the point of a target.
            EquilibriumError: the initial design does not carry its loads.
        """
        began, clock, model = perf_counter(), dict(self._clock.seconds), self.simulation.model
        optimiser, comm = optimiser or LevenbergMarquardt(), self.simulation.comm
        _, objective = self._team
        saved = None
        if checkpoint is not None:
            problem = fingerprint(self.simulation, self._rest, self.targets, self._regulariser, optimiser)
            saved = Checkpoint(Path(checkpoint), problem)
        begin, near = self._beginning(start, saved if resume else None)
        with model.shaped(model.elastic.d.x.array.copy()):
            values, optimum = self._minimise(optimiser, begin, near, saved)
            placement = comm.bcast(objective.placement, root=0)
            with self._clock.phase("verification"):
                self._rest.place(optimum.parameters, placement)
                targets, same = verified_targets(self.simulation, self.targets, optimum.started, objective.reached)
            result = DesignResult(
                mechanism=self.simulation.scene.mechanism.name,
                links=link_designs(self._rest, self.designs, placement),
                targets=targets,
                reason=optimum.reason.value,
                converged=optimum.reason.converged,
                verified=same,
                active=objective.active(optimum.parameters),
                objective=values,
                objective_error=objective_error(
                    self.targets,
                    np.array([target.reached for target in targets]),
                    [target.finer_elements_add for target in targets],
                ),
                iterations=optimum.number,
                evaluations=optimum.evaluations,
                mesh_ratio_max=self._rest.worst_ratio(),
                seconds=perf_counter() - began,
                phases=self._clock.since(clock),
                processes=comm.size,
                groups=group_count(comm.size, len(self.targets)),
            )
        return comm.bcast(result, root=0)  # processes differ in times and in the last bits

    def picture(self, path: str | Path, design: DesignResult) -> None:
        """Draws the links as drawn and as in ``design``, as a PNG.

        Raises:
            DescriptionError: the design is one of other links.
        """
        before, after = ((given[0], self._meshes(given)) for given in ((self.initial, None), self._given(design)))
        links = [design.link for design in self.designs]
        on_one(
            self.simulation.comm,
            lambda: draw_links(path, self.simulation, links, self._rest.links, before, after),
        )

    def export(
        self, folder: str | Path, design: DesignResult | np.ndarray, *, pin_diameter: float | None = None
    ) -> None:
        """Writes ``NAME.step`` and ``NAME.stl`` of every link that may change.

        Args:
            folder: where to; it is created.
            design: the shapes of the links.
            pin_diameter: of the holes left for the pins of round interfaces; none are left by default.

        Raises:
            DescriptionError: the design is one of other links.
            MeshingError: no solid can be made of a link.
        """
        links, meshes = [own.link for own in self.designs], self._meshes(self._given(design))
        on_one(self.simulation.comm, lambda: write_solids(folder, self.simulation.linkage, links, meshes, pin_diameter))

    # -- steps of ``optimise`` -------------------------------------------------------------------------------

    def _beginning(self, start: DesignResult | None, saved: Checkpoint | None) -> tuple[Start, HandlePlacement | None]:
        """The start, and its handles if known: those of ``saved`` if its file exists."""
        parameters, near = (self.initial, None) if start is None else self._given(start)
        begin = Start(parameters)
        if saved is not None and (found := saved.load_together(self.simulation.comm)) is not None:
            begin, near = found.start, self._rest.known(found.start.parameters, found.handles)
        return begin, near

    def _minimise(
        self, optimiser: Optimiser, begin: Start, near: HandlePlacement | None, saved: Checkpoint | None
    ) -> tuple[tuple[float, float], Optimum]:
        """The objective of the drawn and of the best design, and how the minimisation ended."""
        _, objective = self._team

        def watch(iterate: Iterate) -> None:
            if iterate.number == begin.number:
                relative = objective.sensitivities(iterate.evaluation)
                errors = target_errors(self.targets, objective.reached)
                check_sensitivities(self.targets, self.designs, sensitivities=relative, errors=errors)
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

    # -- parts ---------------------------------------------------------------------------------------------

    @cached_property
    def _shapes(self) -> list[LinkShape]:
        """Handles and weights of the links that change, the same on all processes."""
        with self._clock.phase("setup"):
            mesh = self.simulation.model.mesh
        with self._clock.phase("weights"):
            return shape_links(mesh, self._requests)

    @cached_property
    def _rest(self) -> ParametricShape:
        return ParametricShape(self.simulation.model, self._shapes, self.designs)

    @cached_property
    def _team(self) -> tuple[Group, Objective]:
        """This process's group, and the objective on its simulation."""
        rest = self._rest
        with self._clock.phase("setup"):
            group, simulation = split(self.simulation.comm, len(self.targets)), self.simulation
            if group.comm is not simulation.comm:
                simulation = simulation.on(group.comm)
                rest = ParametricShape(simulation.model, self._shapes, self.designs)
            equilibria = TargetEquilibria(simulation, [self.targets[k] for k in group.mine])
            objective = Objective(
                rest, equilibria, targets=self.targets, regulariser=self._regulariser, group=group, clock=self._clock
            )
        return group, objective

    def _meshes(self, given: tuple[np.ndarray, HandlePlacement | None]) -> list[LinkMesh]:
        """Meshes of the links that may change, on the first process alone."""
        model = self.simulation.model
        with model.shaped(self._rest.field(*given)):
            return rest_meshes(self.simulation, [design.link for design in self.designs])

    def _given(self, design: DesignResult | np.ndarray) -> tuple[np.ndarray, HandlePlacement | None]:
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
