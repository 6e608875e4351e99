"""A design problem: the links of a simulation that may change, and the targets of the mechanism."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Literal

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import on_one
from fenicsmech.design.correction import CorrectedRun, Correction
from fenicsmech.design.description import SplineDesign, check_designs
from fenicsmech.design.designed import DesignedSimulation
from fenicsmech.design.numbers import Number
from fenicsmech.design.optimisers.levenberg_marquardt import LevenbergMarquardt
from fenicsmech.design.optimisers.problem import Infeasible, Optimiser, Quadratic
from fenicsmech.design.optimisers.sqp import SQP
from fenicsmech.design.regularisers import MeshQuality, NumberBounds, Regulariser, ShapeBounds, StayClose
from fenicsmech.design.result import (
    DesignResult,
    LinkDesign,
    draw_links,
    link_designs,
    rest_meshes,
    target_results,
    write_parts,
    write_solids,
)
from fenicsmech.design.run import Checkpoint, DesignIterate, fingerprint
from fenicsmech.design.search import Scatter, Search, SearchResult
from fenicsmech.design.shape.handle_optimum import HandlePlacement
from fenicsmech.design.target import Target
from fenicsmech.design.verification import part_simulations, placed_points, verified_parts
from fenicsmech.errors import DescriptionError, EquilibriumError
from fenicsmech.log import Clock, logger
from fenicsmech.mechanism import FlexibleLink, Joint
from fenicsmech.meshing import LinkMesh
from fenicsmech.model import Design
from fenicsmech.multibody import JointChange, build_linkage
from fenicsmech.quantities import NumberKind, joint_changes
from fenicsmech.simulation import Simulation, joint_points

_log = logger(__name__)

DEFAULT_REGULARISER = MeshQuality() + ShapeBounds() + NumberBounds() + 1e-4 * StayClose()
DEFAULT_CORRECTION = Correction()


@dataclass(frozen=True, eq=False)
class DesignLinearisation:
    """The targets' quantities near one design.

        Q(p + s) ≈ Q + e + J s,     R(p + s) ≈ R + ∂R/∂p s + ½ sᵀ ∂²R/∂p² s

    Attributes:
        placement: parameters p and handle positions.
        links: shapes of the links.
        lengths: typical change of each parameter, (parameters,).
        values: Q, (components,).
        errors: e, estimated discretisation errors, to be added, (components,).
        jacobian: J, (components, parameters).
        by_numbers: ∂Q/∂v of further numbers v, held as drawn, (components, numbers).
        regulariser: R.
        active: the bounds that hold the design back, in words.
        entries: the parameter that each component of each link's control points is, −1 where it is none, as
            ``LinkDesign.controls``.
        controls_by_numbers: how control points of each link follow joints that the further numbers shift, (points, 2,
            3, numbers).
    """

    placement: HandlePlacement
    links: tuple[LinkDesign, ...]
    lengths: np.ndarray
    values: np.ndarray
    errors: np.ndarray
    jacobian: np.ndarray
    by_numbers: np.ndarray
    regulariser: Quadratic
    active: tuple[str, ...]
    entries: tuple[np.ndarray, ...]
    controls_by_numbers: tuple[np.ndarray, ...]


class DesignProblem:
    """Optimisation of the shapes of some links, and of numbers of parts, for targets.

        min over p   Σ ½ w_k ((Q_k(p) − Q̄_k) / s_k)² + Σ w_k Q_k(p) / s_k + R(p)   subject to   ± (Q_k(p) − Q̄_k) ≤ 0

    over the targets that equal something, those that are as small as possible, and those that are bounded; Q_k are
    values of the simulation with their error estimates. Nothing is meshed or compiled before it is needed; the
    description is checked at once.

    Args:
        simulation: of the scene as drawn, which it stays; ``simulation.with_design`` gives one of a result.
        designs: the links and the numbers that may change.
        targets: requirements on the mechanism.
        regulariser: R; by default mesh quality, bounds of fabrication, and closeness to the drawing with weight 1e-4,
            where the paper has 1: with 1 the demos miss their targets (benchmarks/closeness.py).

    Raises:
        DescriptionError: the problem contradicts itself or the simulation's scene, or the simulation belongs to another
            design.
        AssemblyError: a target's configuration does not assemble.
    """

    def __init__(
        self,
        simulation: Simulation,
        designs: Sequence[SplineDesign | Number],
        *,
        targets: Sequence[Target],
        regulariser: Regulariser = DEFAULT_REGULARISER,
    ) -> None:
        self.designs, self.targets = tuple(designs), tuple(targets)
        self.regulariser, self._clock = regulariser, Clock()
        check_designs(self.designs)
        self._own = DesignedSimulation(simulation, self.designs, self.targets, regulariser, self._clock)
        self.simulation = self._own.simulation

    @property
    def initial(self) -> np.ndarray:
        """Parameters of the drawn design, (parameters,): those of shapes, then of numbers, in the order given."""
        return self._own.rest.initial

    @property
    def fits_plane_stress(self) -> bool:
        """Whether plane stress has the scene, the targets and the numbers of a problem in space."""
        return self._own.in_plane_stress is not None

    def with_targets(self, targets: Sequence[Target]) -> DesignProblem:
        """The same problem with other targets; handles, weights and the last equilibria from zero load are shared.

        Raises:
            DescriptionError: a target belongs to another mechanism.
            AssemblyError: its configuration does not assemble.
        """
        other = DesignProblem(self.simulation, self.designs, targets=targets, regulariser=self.regulariser)
        other._own, other._clock = self._own.with_targets(targets), self._clock
        return other

    def linearise(
        self, design: DesignResult | HandlePlacement | np.ndarray, *, numbers: Sequence[NumberKind] = ()
    ) -> DesignLinearisation:
        """Values of all targets' quantities at a design, and their derivatives with respect to its parameters.

        Args:
            design: of this problem.
            numbers: further ones, held as drawn, by which derivatives are wanted too, from the same adjoints.

        Raises:
            DescriptionError: the design belongs to other links, or a further number is one that changes.
            ShapeError: cells of the mesh are inverted in this shape, or a number is out of its bounds.
            EquilibriumError: a target's equilibrium is not found, or is unstable.
        """
        own, rest, model = self._own, self._own.rest, self.simulation.model
        parameters, near = own.given(design)
        wider = own.with_numbers(numbers) if numbers else own
        every = wider.rest
        with model.shaped(model.design):
            placement = rest.place(parameters, near)
            try:
                solved = own.loaded.from_zero()
            except Infeasible as failure:
                raise EquilibriumError(
                    f"design of {self.simulation.scene.mechanism.name!r}", str(failure), "Give smaller loads"
                ) from failure
            own.loaded.keep(solved)
            count = len(placement.p)
            slopes = every.slopes(every.widened(placement), wider.loaded.gradients(solved))
            return DesignLinearisation(
                placement=placement,
                links=link_designs(rest, placement),
                lengths=rest.lengths,
                values=own.loaded.values(solved),
                errors=own.loaded.errors(solved),
                jacobian=slopes[:, :count],
                by_numbers=slopes[:, count:] / every.numbers.width[len(rest.numbers.numbers) :],
                regulariser=self.regulariser.around(rest, placement)(parameters),
                active=self.regulariser.active(rest, placement),
                entries=tuple(link.entries for link in rest.links),
                controls_by_numbers=every.control_rates()[: len(rest.links)],
            )

    def placement(self, design: DesignResult | HandlePlacement | np.ndarray) -> HandlePlacement:
        """Parameters and handle positions of a design.

        Raises:
            DescriptionError: the design belongs to other links.
            ShapeError: cells of the mesh are inverted in this shape.
        """
        rest, model = self._own.rest, self.simulation.model
        with model.shaped(model.design):
            return rest.place(*self._own.given(design))

    def rest_shape(self, design: DesignResult | HandlePlacement | np.ndarray) -> Design:
        """The design of a result, a placement or parameters (parameters,), as ``Simulation.with_design`` takes it.

        Parameters alone need not fix the shape: several positions of the handles can be minima, and results hold those
        found.

        Raises:
            DescriptionError: the design belongs to other links.
            ShapeError: cells of the mesh are inverted in this shape, or a number is out of its bounds.
        """
        return self._own.rest.design(*self._own.given(design))

    def optimise(
        self,
        *,
        optimiser: Optimiser | None = None,
        start: DesignResult | HandlePlacement | np.ndarray | None = None,
        surrogate: Simulation | Literal["plane-stress"] | None = "plane-stress",
        correction: Correction = DEFAULT_CORRECTION,
        checkpoint: str | Path | None = None,
        resume: bool = False,
        watch: Callable[[DesignIterate], None] | None = None,
    ) -> DesignResult:
        """The best design; the simulation stays as it is.

        Targets that cannot be reached lead to the best design found, with the error of each and the bounds that hold
        it back.

        Args:
            optimiser: by default Levenberg–Marquardt where every target equals something, else sequential quadratic
                programming.
            start: initial design, such as the result of a cheaper simulation, or the placement of an iterate, or
                parameters (parameters,); the drawn shapes by default.
            surrogate: a cheaper simulation of the same scene that is minimised in place of this one, with corrections
                to the values of this one. By default, for a simulation in 3D, one in plane stress if the scene allows
                it; None: this simulation itself is minimised.
            correction: of the values that are compared with targets.
            checkpoint: file updated after each iteration.
            resume: whether to continue from ``checkpoint`` if it exists.
            watch: called with every iterate, on the first process; the optimisation ends by what it raises.

        Raises:
            DescriptionError: the checkpoint or the start belongs to another problem, or no shape that may change moves
                the point of a target.
            EquilibriumError: the initial design does not carry its loads.
            ShapeError: its mesh does not follow its handles.
        """
        began, clock = perf_counter(), dict(self._clock.seconds)
        comm, cheaper = self.simulation.comm, self._surrogate(surrogate)
        optimiser = optimiser or self._default_optimiser
        saved = found = None
        if checkpoint is not None:
            other = cheaper.simulation if cheaper else None
            problem = fingerprint(self.simulation, self._own.rest, self.targets, self.regulariser, optimiser, other)
            saved = Checkpoint(Path(checkpoint), problem)
            found = saved.load_together(comm) if resume else None
        if found is not None and not found.round.surrogate:
            cheaper = None  # it was given up before
        with ExitStack() as held:
            for model in (own.simulation.model for own in (self._own, cheaper) if own is not None):
                held.enter_context(model.shaped(model.design))
            run = CorrectedRun(self._own, optimiser, correction, start, saved, found, watch)
            end = run.from_surrogate(cheaper) or run.directly()
            reached, round, (group, objective) = end.reached, end.round, end.of.team
            compared = objective.comparison
            residuals = compared.residuals(reached.compared)
            final = 0.5 * float(residuals @ residuals) + compared.plain(reached.compared) + end.optimum.regulariser
            assert round.initial is not None, "every run has a start"
            result = DesignResult(
                mechanism=self.simulation.scene.mechanism.name,
                links=link_designs(self._own.rest, end.placement),
                numbers=self._own.rest.numbers.designs(
                    end.placement.p[self._own.rest.of_numbers], self.simulation.scene.units
                ),
                targets=target_results(compared, self.simulation.scene.units, np.array(round.started), reached),
                reason=end.optimum.reason.words(end.optimum.refusal),
                converged=end.optimum.reason.converged,
                verified=end.verified,
                active=objective.active(end.optimum.parameters),
                objective=(round.initial, final),
                objective_error=compared.objective_error(reached.values, reached.compared - reached.values),
                surrogate=None if end.of is self._own else end.of.simulation.fidelity.model.name,
                corrections=round.largest,
                iterations=end.optimum.number,
                evaluations=end.optimum.evaluations,
                mesh_ratio_max=self._own.rest.worst_ratio(),
                seconds=perf_counter() - began,
                phases=self._clock.since(clock),
                processes=comm.size,
                groups=comm.size // group.comm.size,
            )
        return comm.bcast(result, root=0)  # processes differ in times and in the last bits

    def search(
        self,
        scatter: Scatter | None = None,
        *,
        optimiser: Optimiser | None = None,
        checkpoint: str | Path | None = None,
        resume: bool = False,
    ) -> SearchResult:
        """Distinct optima from scattered starts, best first, at the cheapest fidelity.

        That is plane stress where the scene allows it, with elements not smaller than the links are thick.
        ``optimise(start=found.best)`` takes an optimum to this problem's fidelity. Each process works on a start of
        its own; starts without an equilibrium are listed in the result. Where the drawn design does not carry its
        loads, minimised quantities are relative to those of each start, and designs compare only if these targets have
        a ``scale``.

        Args:
            scatter: number of starts (16 by default), how far apart they are, and other options.
            optimiser: of each start; by default that of ``optimise``.
            checkpoint: folder with files for each start, written as it ends.
            resume: whether to continue from the files in ``checkpoint``.

        Raises:
            DescriptionError: a checkpoint belongs to another search, or no shape that may change moves the point of a
                target.
            EquilibriumError: no start carries its loads.
        """
        scatter, comm = scatter or Scatter(), self.simulation.comm
        alone = DesignProblem(
            self._own.cheapest.on(MPI.COMM_SELF), self.designs, targets=self.targets, regulariser=self.regulariser
        )
        optimiser, saved = optimiser or self._default_optimiser, None
        if checkpoint is not None:
            problem = fingerprint(alone.simulation, alone._own.rest, self.targets, self.regulariser, optimiser, None)
            problem |= {"scatter": asdict(scatter), "options of the optimiser": repr(optimiser)}

            def saved(name: str) -> Checkpoint:
                return Checkpoint(Path(checkpoint) / f"{name}.json", problem)

        return Search(comm, alone, alone._own.rest, scatter, optimiser, checkpoint=saved, resume=resume).run()

    def picture(self, path: str | Path, design: DesignResult) -> None:
        """Draws the links as drawn and as in ``design``, as a PNG.

        Raises:
            DescriptionError: the design belongs to other links.
        """
        links = [link for own in self._own.shapes for link in own.links]
        both = (self.initial, None), self._own.given(design)
        before, after = ((given[0], self._meshes(links, given)[0]) for given in both)
        linkage = self.simulation.linkage
        with self.simulation.model.shaped(self._own.rest.design(*both[1])):
            joints = joint_points(linkage, linkage.joints.drawn)
        on_one(
            self.simulation.comm,
            lambda: draw_links(path, self.simulation, links, self._own.rest.links, before, after, joints),
        )

    def export(
        self,
        folder: str | Path,
        design: DesignResult | HandlePlacement | np.ndarray,
        *,
        pin_diameter: float | None = None,
    ) -> None:
        """Writes ``NAME.step`` and ``NAME.stl`` of every link whose shape or depth may change, in mm.

        Each is at its place in the mechanism. ``parts.json`` lists how many to make of each part: links that share
        shape, material and depth are the same part. Lengths in another unit are written as they are, with a warning.

        Args:
            folder: where to; it is created.
            design: the shapes of the links.
            pin_diameter: of the holes left for the pins of round interfaces; none are left by default.

        Raises:
            DescriptionError: the design belongs to other links.
            MeshingError: no solid can be made of a link.
        """
        unit = self.simulation.scene.units.length
        if unit != "mm":
            _log.warning("STEP and STL files are in mm, and lengths of those in %s in %s: scale them", folder, unit)
        links, given = self._own.changed, self._own.given(design)
        solids, mechanism, model = self._meshes(links, given), self.simulation.scene.mechanism, self.simulation.model
        with model.shaped(self._own.rest.design(*given)):
            materials = dict(zip(mechanism.flexible_links, model.materials, strict=True))
        linkage = build_linkage(mechanism, self.simulation.linkage.dim, self._moved(given[0]))
        shared = [own.links for own in self._own.shapes]
        alone = [(link,) for link in links if not any(link in own for own in shared)]

        def write() -> None:
            write_solids(folder, linkage, links, *solids, pin_diameter)
            write_parts(folder, [*shared, *alone], materials, dict(zip(links, solids[1], strict=True)))

        on_one(self.simulation.comm, write)

    def verify(self, result: DesignResult, folder: str | Path | None = None, *, finer: float = 2.0) -> DesignResult:
        """The result with the values of its targets in the parts to be made.

        The links that may change are written as STEP files without holes for pins; the same scene with links read from
        these files is remeshed with smaller elements, and every sample is loaded again.

        Args:
            result: of this problem's targets.
            folder: where the files stay; nowhere by default.
            finer: ratio of the simulation's element size to that of the parts.

        Raises:
            DescriptionError: the result belongs to other links or targets, or an effect acts on a part of the boundary
                of a link that may change that a predicate of drawn points chooses.
            MeshingError: a part cannot be written or meshed.
        """
        if [target.name for target in result.targets] != [target.name for target in self.targets]:
            raise DescriptionError(
                f"verification of {result.mechanism!r}",
                "the result belongs to other targets",
                "Give a result of this problem",
            )
        links, given, model = self._own.changed, self._own.given(result), self.simulation.model
        solids = self._meshes(links, given)
        with model.shaped(self._own.rest.design(*given)):
            placed = placed_points(self.simulation, links, self.targets)
        with TemporaryDirectory() as temporary:  # only the first process writes and reads
            folder, moved = Path(folder or temporary), self._moved(given[0])
            coarse, fine = part_simulations(self.simulation, links, *solids, folder, finer, moved, placed, self.targets)
            verified = verified_parts(result, coarse, fine, self.targets, links)
        return self.simulation.comm.bcast(verified, root=0)

    @property
    def _default_optimiser(self) -> Optimiser:
        return LevenbergMarquardt() if all(target.relation == "equals" for target in self.targets) else SQP()

    # -- parts ---------------------------------------------------------------------------------------------

    def _surrogate(self, given: Simulation | str | None) -> DesignedSimulation | None:
        """The same problem in a surrogate."""
        if isinstance(given, Simulation):
            return self._own.on(given)
        if given not in (None, "plane-stress"):
            raise DescriptionError("surrogate", f"it is {given!r}", 'Give a Simulation, "plane-stress" or None')
        return None if given is None else self._own.in_plane_stress

    def _moved(self, parameters: np.ndarray) -> dict[Joint, JointChange]:
        """Where a design places joints otherwise than drawn."""
        rest = self._own.rest
        return joint_changes(rest.numbers.values(parameters[rest.of_numbers]), self.simulation.linkage.dim)

    def _meshes(
        self, links: Sequence[FlexibleLink], given: tuple[np.ndarray, HandlePlacement | None]
    ) -> tuple[list[LinkMesh], list[float]]:
        """Meshes of some links, on the first process alone, and their depths."""
        model, everyone = self.simulation.model, self.simulation.scene.mechanism.flexible_links
        with model.shaped(self._own.rest.design(*given)):
            return rest_meshes(self.simulation, links), [model.depths[everyone.index(link)] for link in links]
