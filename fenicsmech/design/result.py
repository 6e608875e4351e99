"""Results of designs as plain data, their verification, and files of their links."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import on_one
from fenicsmech.design.description import SplineDesign, Target
from fenicsmech.design.equilibria import TargetEquilibria
from fenicsmech.design.objective import target_errors, target_scales
from fenicsmech.design.optimisers.problem import Infeasible
from fenicsmech.design.rest_shape import DesignedLink, ParametricShape
from fenicsmech.design.shape.handle_optimum import HandlePlacement
from fenicsmech.design.shape.shape_map import gather_links
from fenicsmech.errors import DescriptionError
from fenicsmech.export import PinHole, write_step, write_stl
from fenicsmech.files import atomic_write
from fenicsmech.log import logger
from fenicsmech.mechanism import DRAWN, Disc, FlexibleLink
from fenicsmech.meshing import LinkMesh, boundary_loops, plan_of
from fenicsmech.multibody import Linkage, assemble
from fenicsmech.plot import DesignShape, LinkOutline, draw_designs
from fenicsmech.simulation import MechanismPlotter, Simulation, rest_vertices

_log = logger(__name__)
_FORMAT = "fenicsmech design 1"


@dataclass(frozen=True)
class LinkDesign:
    """The shape of one link.

    Attributes:
        name: of the link.
        parameters: its part of p.
        handles: positions θ of its handles, the best near those of the designs on the way. Several can be good: the
            parameters alone fix displacements to about 1 % only.
        controls: position and thickness (x, y, δ), then tangent, of every control point, (points, 2, 3).
        thickness: least and largest thickness in the plane.
        bend: largest curvature ratio.
        centreline: points that the drawn centreline runs through, if they were given.
    """

    name: str
    parameters: tuple[float, ...]
    handles: tuple[float, ...]
    controls: tuple[tuple[tuple[float, ...], ...], ...]
    thickness: tuple[float, float]
    bend: float
    centreline: tuple[tuple[float, ...], ...] | None = None


@dataclass(frozen=True)
class TargetResult:
    """A target and the displacement reached.

    Attributes:
        force_name, configuration: name of the force, motor positions.
        force: its magnitude.
        wanted, started, reached: displacement that is wanted, of the design the optimisation started from, and of
            the best design.
        error: of the reached displacement, relative to the wanted one, or to a tenth of the largest wanted one where
            that is more.
        finer_elements_add: estimate of what infinitely fine elements would add to the reached displacement; None if
            loading the mechanism from zero does not lead there.
    """

    force_name: str
    configuration: str
    force: float
    wanted: float
    started: float
    reached: float
    error: float
    finer_elements_add: float | None


@dataclass(frozen=True)
class DesignResult:
    """The outcome of an optimisation.

    Attributes:
        mechanism: its name.
        links: the best shapes found.
        targets: their results, in the order they were given.
        reason: of the end of the optimisation, in words.
        converged: whether it ended at a minimum.
        verified: whether loading the mechanism from zero leads to the equilibria that were followed from design to
            design; the log says where not.
        active: the bounds that hold the design back, in words.
        objective: of the initial and of the final design.
        objective_error: estimate of what infinitely fine elements would add to the final one; None if one of its
            targets' displacements is not known.
        iterations, evaluations: of the objective.
        mesh_ratio_max: largest circumradius over inradius among the cells.
        seconds: wall-clock time.
        phases: the same by phase, on the first process: setup, weights, handles, regularisers, equilibria, gradients,
            verification; the rest is the optimiser's own.
        processes, groups: their numbers.
    """

    mechanism: str
    links: tuple[LinkDesign, ...]
    targets: tuple[TargetResult, ...]
    reason: str
    converged: bool
    verified: bool
    active: tuple[str, ...]
    objective: tuple[float, float]
    objective_error: float | None
    iterations: int
    evaluations: int
    mesh_ratio_max: float
    seconds: float
    phases: Mapping[str, float]
    processes: int
    groups: int

    def __str__(self) -> str:
        reached = (
            f"  {t.force_name!r} of {t.force:g}, {t.configuration}: {t.reached:.4g} of {t.wanted:.4g} ({t.error:+.2%})"
            for t in self.targets
        )
        return "\n".join([f"design of {self.mechanism!r} after {self.iterations} iterations: {self.reason}", *reached])

    @property
    def worst_error(self) -> float:
        """Largest relative error among the targets."""
        return max(abs(target.error) for target in self.targets)

    @property
    def thickness(self) -> tuple[float, float]:
        """Least and largest thickness among all links."""
        return min(link.thickness[0] for link in self.links), max(link.thickness[1] for link in self.links)

    @property
    def parameters(self) -> int:
        """Number of parameters."""
        return sum(len(link.parameters) for link in self.links)

    def rest_shape(self, simulation: Simulation) -> np.ndarray:
        """The design field on the mesh of a simulation of the same mechanism: this rank's values, ghosts last, flat.

        Raises:
            DescriptionError: the mechanism has no such links.
            ShapeError: cells of the mesh are inverted in this shape.
        """
        links = {link.name: link for link in simulation.scene.mechanism.flexible_links}
        for own in self.links:
            if own.name not in links:
                raise DescriptionError(
                    f"design of {self.mechanism!r}",
                    f"{simulation.scene.mechanism.name!r} has no flexible link {own.name!r}",
                    "Give a simulation of the same mechanism",
                )
        rest = ParametricShape.of(
            simulation,
            [SplineDesign(links[own.name], len(own.controls) - 1, centreline=own.centreline) for own in self.links],
        )
        p, theta = (np.concatenate(own) for own in zip(*((o.parameters, o.handles) for o in self.links), strict=True))
        return rest.field(p, rest.known(p, theta))

    def save(self, path: str | Path, *, comm: MPI.Comm = MPI.COMM_WORLD) -> None:
        """Writes the result as JSON.

        Args:
            path: the file.
            comm: the processes that call it; one of them writes.

        Raises:
            OSError: the file cannot be written.
        """

        def write() -> None:
            with atomic_write(path) as file:
                file.write(json.dumps({"format": _FORMAT, **asdict(self)}, indent=2, ensure_ascii=False))

        on_one(comm, write)

    @staticmethod
    def load(path: str | Path) -> DesignResult:
        """Local. A result that was saved.

        Raises:
            DescriptionError: the file does not exist, or does not hold a design.
        """
        part = f"design {str(path)!r}"
        try:
            data = json.loads(Path(path).read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise DescriptionError(part, "there is no such file", "Check its name") from None
        except (UnicodeDecodeError, json.JSONDecodeError):
            data = None
        if not isinstance(data, dict) or data.pop("format", None) != _FORMAT:
            raise DescriptionError(part, "it does not hold a design", "Give a file written by DesignResult.save")
        try:
            return _read(data)
        except (KeyError, TypeError) as error:
            raise DescriptionError(part, f"it is incomplete ({error})", "Give an unchanged file") from None


def _read(data: dict) -> DesignResult:
    def frozen(value):
        return tuple(map(frozen, value)) if isinstance(value, list) else value

    links = tuple(LinkDesign(**{key: frozen(value) for key, value in link.items()}) for link in data.pop("links"))
    targets = tuple(TargetResult(**target) for target in data.pop("targets"))
    return DesignResult(links=links, targets=targets, **{key: frozen(value) for key, value in data.items()})


def verified_targets(
    simulation: Simulation, targets: Sequence[Target], started: np.ndarray, followed: np.ndarray
) -> tuple[tuple[TargetResult, ...], bool]:
    """Results of the targets, each loaded from zero as a user will do; logs those that are not reached.

    Args:
        simulation: its model has the shapes of the optimum.
        targets: wanted displacements.
        started: displacements at the start, (targets,).
        followed: displacements of the equilibria that were followed from design to design, (targets,).

    Returns:
        The targets' results, with the displacements as followed and without an estimate if one of them is not reached,
        and whether loading leads to the equilibria that were followed.
    """
    equilibria, same = TargetEquilibria(simulation, targets), False
    reached, finer = followed, [None] * len(targets)
    try:
        traced = equilibria.trace()
    except Infeasible as failure:
        _log.warning("loaded from zero, the optimum does not reach all its targets: %s", failure)
    else:
        reached, finer = (
            np.array([sample.displacement for sample in traced.samples]),
            equilibria.errors(traced).tolist(),
        )
        # displacements of one equilibrium differ by less
        different = np.flatnonzero(np.abs(reached - followed) > 1e-6 * target_scales(targets))
        same = len(different) == 0
        for k in different:
            _log.warning(
                "target %d of the optimum: %.6g when loaded from zero, %.6g when followed from the drawn design",
                *(k + 1, reached[k], followed[k]),
            )
    errors = target_errors(targets, reached)
    results = tuple(
        TargetResult(
            force_name=target.part.name,
            configuration=target.configuration.name,
            force=target.force,
            wanted=target.displacement,
            started=float(started[k]),
            reached=float(reached[k]),
            error=float(errors[k]),
            finer_elements_add=finer[k],
        )
        for k, target in enumerate(targets)
    )
    return results, same


def link_designs(
    rest: ParametricShape, wanted: Sequence[SplineDesign], placement: HandlePlacement
) -> tuple[LinkDesign, ...]:
    """The shapes of all links at a placement."""
    designs = []
    for link, design, handles in zip(rest.links, wanted, rest.handles(placement), strict=True):
        own, drawn = placement.p[link.place], design.centreline
        thickness, bend = link.thickness * link.samples.thickness(own), link.samples.curvature(own)
        designs.append(
            LinkDesign(
                name=link.name,
                parameters=tuple(own.tolist()),
                handles=tuple(handles.tolist()),
                controls=tuple(tuple(map(tuple, point)) for point in link.spline.controls_at(own).tolist()),
                thickness=(float(thickness.min()), float(thickness.max())),
                bend=float(np.abs(bend).max(initial=0.0)),
                centreline=None if drawn is None else tuple(tuple(map(float, point)) for point in drawn),
            )
        )
    return tuple(designs)


def rest_meshes(simulation: Simulation, links: Sequence[FlexibleLink]) -> list[LinkMesh]:
    """Meshes of some links in their present shape, on the first process alone.

    Links of which one half is meshed are given by their plan.
    """
    meshes = gather_links(simulation.model.mesh, rest_vertices(simulation.model))
    everyone, halves = simulation.scene.mechanism.flexible_links, simulation.fidelity.model.half
    chosen = [meshes[everyone.index(link)] for link in links]
    return on_one(simulation.comm, lambda: [plan_of(mesh).mesh for mesh in chosen] if halves else chosen) or []


def _outline(link: DesignedLink, mesh: LinkMesh, p: np.ndarray) -> LinkOutline:
    """The outline of a link, with centreline, thickness and control points of its parameters ``p``."""
    plan = plan_of(mesh).mesh
    loops = [plan.points[loop] for loop in boundary_loops(f"link {link.name!r}", plan)]
    return LinkOutline(
        loops,
        centreline=link.spline.evaluate(p, link.samples.t)[:, :2],
        thickness=link.thickness * link.samples.thickness(p),
        controls=link.spline.controls_at(p)[:, 0, :2],
    )


def draw_links(
    path: str | Path,
    simulation: Simulation,
    links: Sequence[FlexibleLink],
    designed: Sequence[DesignedLink],
    before: tuple[np.ndarray, Sequence[LinkMesh]],
    after: tuple[np.ndarray, Sequence[LinkMesh]],
) -> None:
    """Local. Draws links before and after a change, from the parameters p and the meshes of both."""
    scene, linkage, shapes = simulation.scene, simulation.linkage, []
    for k, (link, change) in enumerate(zip(links, designed, strict=True)):
        old, new = (_outline(change, meshes[k], p[change.place]) for p, meshes in (before, after))
        joints = np.array([linkage.bodies[i].centre[:2] for i in linkage.interfaces[link]])
        shapes.append(DesignShape(link.name, old, new, joints))
    rigid = MechanismPlotter(simulation.model).rigid(assemble(linkage, DRAWN).poses)
    draw_designs(path, shapes, rigid=rigid, unit=scene.units.length, title=f"{scene.mechanism.name}: links")


def write_solids(
    folder: str | Path,
    linkage: Linkage,
    links: Sequence[FlexibleLink],
    meshes: Sequence[LinkMesh],
    hole: float | None,
) -> None:
    """Local. Writes ``NAME.step`` and ``NAME.stl`` of every link, with holes of this diameter for pins if given."""
    for link, mesh in zip(links, meshes, strict=True):
        regions = [linkage.bodies[i] for i in linkage.interfaces[link]]
        pins = [PinHole((b.centre[0], b.centre[1]), hole) for b in regions if hole and isinstance(b.region, Disc)]
        stem = Path(folder) / link.name.replace(" ", "-")
        for suffix, write in ((".step", write_step), (".stl", write_stl)):
            write(stem.with_suffix(suffix), mesh, depth=link.shape.depth, pins=pins, name=link.name)
