"""Results of designs as plain data, and files of their links."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import on_one
from fenicsmech.design.description import FollowingLink, SplineDesign
from fenicsmech.design.numbers import Number, NumberDesign
from fenicsmech.design.rest_shape import DesignedLink, ParametricShape
from fenicsmech.design.shape.handle_optimum import HandlePlacement
from fenicsmech.design.shape.shape_map import gather_links
from fenicsmech.design.target import MET, Comparison
from fenicsmech.errors import DescriptionError, counted, point_text
from fenicsmech.export import PinHole, write_step, write_stl
from fenicsmech.files import atomic_write, file_names, read_json, write_json
from fenicsmech.mechanism import Disc, FlexibleLink, Material, Scene, Units
from fenicsmech.meshing import Isometry, LinkMesh, boundary_polygons, section_of
from fenicsmech.model import Design
from fenicsmech.multibody import Linkage
from fenicsmech.plot import DesignShape, OutlineShape, draw_designs
from fenicsmech.quantities import NumberKind, read_kind
from fenicsmech.simulation import MechanismPlotter, Simulation, rest_geometry

_FORMAT = "fenicsmech design 4"


@dataclass(frozen=True)
class LinkDesign:
    """The shape of one link.

    Attributes:
        name: of the link.
        parameters: its part of p; empty if the link follows its joints alone.
        handles: positions θ of its handles, the best near those of the designs on the way. Several can be good: the
            parameters alone need not fix the shape.
        controls: position and thickness (x, y, δ), then tangent, of every control point, (points, 2, 3).
        thickness: least and largest thickness in the plane.
        bend: largest curvature ratio.
        centreline: points that the drawn centreline runs through, as given, drawn or found.
        same, mirrored: names of links that are the same part, and of mirror images of it.
        ends_move: whether the places of free ends are among the parameters.
    """

    name: str
    parameters: tuple[float, ...]
    handles: tuple[float, ...]
    controls: tuple[tuple[tuple[float, ...], ...], ...]
    thickness: tuple[float, float]
    bend: float
    centreline: tuple[tuple[float, ...], ...] | None = None
    same: tuple[str, ...] = ()
    mirrored: tuple[str, ...] = ()
    ends_move: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all links with this shape."""
        return (self.name, *self.same, *self.mirrored)


Value = float | tuple[float, ...]


@dataclass(frozen=True)
class PartValue:
    """A target's quantity in the exported parts, remeshed with finer elements.

    Attributes:
        value: of the quantity.
        finer_elements_add: estimated discretisation error, to be added.
        error: of the value with this estimate, relative as that of the target.
    """

    value: Value
    finer_elements_add: Value
    error: float

    @property
    def met(self) -> bool:
        """Whether the error is at most one per cent."""
        return abs(self.error) <= MET


@dataclass(frozen=True)
class TargetResult:
    """A target and the value reached; vectors are tuples.

    Attributes:
        name: the quantity and its sample, in words.
        configuration: motor positions of the sample; empty for links at rest.
        force: magnitude of the sample's force, of the first one of several; None where a displacement is prescribed.
        unit: of the values.
        relation: "equals", "at most", "at least" or "least".
        wanted: value or bound; None of a quantity that is to be as small as possible.
        started: value of the design the optimisation started from, as the optimiser saw it: that of a surrogate.
        reached: value of the best design on the simulation's mesh.
        finer_elements_add: estimated discretisation error of the reached value, to be added: the change by infinitely
            fine elements. Of a smooth extreme, what the true one adds to it.
        corrected: their sum, with which the target is compared; the reached value alone of an optimisation without
            estimates. Of a simulation in plane stress it is the value in plane stress; ``Curve.corrected`` is that in
            3D.
        error: of the corrected value, relative to the target's scale; for a bound how far it is missed, for a vector
            the length of its error.
        part: the same in the exported parts; None before ``DesignProblem.verify``, and of quantities that parts do not
            have, such as displacements of points on them.
    """

    name: str
    configuration: str
    force: float | None
    unit: str
    relation: str
    wanted: Value | None
    started: Value
    reached: Value
    finer_elements_add: Value
    corrected: Value
    error: float
    part: PartValue | None = None

    @property
    def met(self) -> bool:
        """Whether the error is at most one per cent."""
        return abs(self.error) <= MET

    def __str__(self) -> str:
        unit, reached = f" {self.unit}" if self.unit else "", _text(self.corrected)
        part = "" if self.part is None else f"; in the part {_text(self.part.value)}{unit}"
        if self.part is not None:
            part += f", to which finer elements add {_text(self.part.finer_elements_add)}"
        if self.wanted is None:
            return f"{self.name}: {reached}{unit}, from {_text(self.started)}{unit}{part}"
        if self.part is not None:
            part += f", {_met_text(self.part)}"
        wanted = f"{'' if self.relation == 'equals' else self.relation + ' '}{_text(self.wanted)}"
        return f"{self.name}: {reached}{unit} of {wanted}{unit}, {_met_text(self)}{part}"


def _met_text(found: TargetResult | PartValue) -> str:
    return f"{'met' if found.met else 'missed'} ({found.error:+.2%})"


def _text(value: Value) -> str:
    return f"{value:.4g}" if isinstance(value, float) else point_text(value)


@dataclass(frozen=True)
class DesignResult:
    """The outcome of an optimisation.

    Attributes:
        mechanism: its name.
        links: the best shapes found.
        numbers: the best numbers found.
        targets: their results, in the order they were given.
        reason: why the optimisation ended, in words.
        converged: whether the optimisation ended at a minimum.
        verified: whether loading the mechanism from zero leads to the equilibria that were followed from design to
            design; the log says where not.
        active: the bounds that hold the design back, in words.
        objective: of the design at the start as the optimiser saw it, and of the best one with corrected values.
        objective_error: part of the objective of the best design that is due to corrections.
        surrogate: the space of the surrogate that led to this design; None if the simulation itself was minimised.
        corrections: largest change of the corrections after each round, over the targets' scales; of a surrogate that
            was given up first.
        iterations, evaluations: of the objective.
        mesh_ratio_max: largest circumradius over inradius among the cells that can deform.
        seconds: wall-clock time.
        phases: wall-clock time by phase, on the first process: setup, weights, handles, regularisers,
            equilibria, gradients, verification; the rest is the optimiser's own.
        processes, groups: their numbers.
        part_fidelity: at which the exported parts were simulated, in words; empty if they were not.
    """

    mechanism: str
    links: tuple[LinkDesign, ...]
    numbers: tuple[NumberDesign, ...]
    targets: tuple[TargetResult, ...]
    reason: str
    converged: bool
    verified: bool
    active: tuple[str, ...]
    objective: tuple[float, float]
    objective_error: float
    surrogate: str | None
    corrections: tuple[float, ...]
    iterations: int
    evaluations: int
    mesh_ratio_max: float
    seconds: float
    phases: Mapping[str, float]
    processes: int
    groups: int
    part_fidelity: str = ""

    def __str__(self) -> str:
        every = (*self.targets, *self.numbers)
        reached, ended = (f"  {found}" for found in every), counted(self.iterations, "iteration")
        return "\n".join([f"design of {self.mechanism!r} after {ended}: {self.reason}", *reached])

    @property
    def worst_error(self) -> float:
        """Largest relative error among the targets."""
        return max(abs(target.error) for target in self.targets)

    @property
    def worst_part_error(self) -> float | None:
        """Largest relative error among the targets in the exported parts; None if they were not simulated."""
        return max((abs(target.part.error) for target in self.targets if target.part is not None), default=None)

    @property
    def thickness(self) -> tuple[float, float] | None:
        """Least and largest thickness among all links whose shape changed; None if there are none."""
        if not self.links:
            return None
        return min(link.thickness[0] for link in self.links), max(link.thickness[1] for link in self.links)

    @property
    def parameters(self) -> int:
        """Number of parameters."""
        return sum(len(link.parameters) for link in self.links) + len(self.numbers)

    def rest_shape(self, simulation: Simulation) -> Design:
        """The design on the mesh of a simulation of the same mechanism.

        Raises:
            DescriptionError: the mechanism has no such links, their splines have not as many parameters, or it has no
                parts with such numbers.
            ShapeError: cells of the mesh are inverted in this shape.
        """
        links = {link.name: link for link in simulation.scene.mechanism.flexible_links}
        for name in (name for own in self.links for name in own.names):
            if name not in links:
                raise DescriptionError(
                    f"design of {self.mechanism!r}",
                    f"{simulation.scene.mechanism.name!r} has no flexible link {name!r}",
                    "Give a simulation of the same mechanism",
                )
        designs = [
            SplineDesign(
                links[own.name],
                len(own.controls) - 1,
                centreline=own.centreline,
                ends_move=own.ends_move,
                same=[links[name] for name in own.same],
                mirrored=[links[name] for name in own.mirrored],
            )
            if own.parameters
            else FollowingLink(links[own.name], len(own.controls) - 1, centreline=own.centreline)
            for own in self.links
        ]
        values, dim = self.values(simulation.scene), simulation.linkage.dim
        places = [(kind, own) for kind, own in zip(values, self.numbers, strict=True) if kind.changes(dim)]
        rest = ParametricShape.of(simulation, designs, [Number(kind, *own.bounds) for kind, own in places])
        scaled, chosen = [own.scaled for _, own in places], shapes_of(self, rest.links)
        p, theta = (
            np.concatenate([np.zeros(0), *parts])
            for parts in ([*(own.parameters for own in chosen), scaled], [own.handles for own in chosen])
        )
        return replace(rest.design(p, rest.placement_from(p, theta)), numbers=values)

    def values(self, scene: Scene) -> dict[NumberKind, float]:
        """The numbers by their kinds, of parts of a scene of the same mechanism. Local.

        Raises:
            DescriptionError: the scene has no such part.
        """
        return {read_kind(scene, own.kind, own.words): own.value for own in self.numbers}

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
        data = read_json(path, "design", form=_FORMAT, remedy="Give a file written by DesignResult.save")
        try:
            return read_result({key: value for key, value in data.items() if key != "format"})
        except (KeyError, TypeError) as error:
            part = f"design {str(path)!r}"
            raise DescriptionError(part, f"it is incomplete ({error})", "Give an unchanged file") from None


def read_result(data: dict) -> DesignResult:
    """The inverse of ``dataclasses.asdict`` and JSON; ``data`` is used up."""

    def frozen(value):
        return tuple(map(frozen, value)) if isinstance(value, list) else value

    links = tuple(LinkDesign(**{key: frozen(value) for key, value in link.items()}) for link in data.pop("links"))
    numbers = [NumberDesign(**{k: frozen(value) for k, value in own.items()}) for own in data.pop("numbers")]
    targets = []
    for own in data.pop("targets"):
        part = own.pop("part", None)
        part = part and PartValue(**{key: frozen(value) for key, value in part.items()})
        targets.append(TargetResult(**{key: frozen(value) for key, value in own.items()}, part=part))
    rest = {key: frozen(value) for key, value in data.items()}
    return DesignResult(links=links, numbers=tuple(numbers), targets=tuple(targets), **rest)


@dataclass(frozen=True, eq=False)
class Reached:
    """Values at one design of the simulation that counts.

    Attributes:
        values: of the components, (components,).
        errors: estimated discretisation errors, to be added, (components,).
        compared: the values that targets are compared with, (components,).
    """

    values: np.ndarray
    errors: np.ndarray
    compared: np.ndarray


def target_results(
    comparison: Comparison, units: Units, started: np.ndarray, reached: Reached
) -> tuple[TargetResult, ...]:
    """Results of all targets, from their components at the start and at the end."""

    def of(values: np.ndarray, k: int) -> Value:
        return component_values(values[comparison.places[k]])

    errors = comparison.errors(reached.compared)
    return tuple(
        TargetResult(
            name=target.name,
            configuration="" if target.sample is None else target.sample.configuration.name,
            force=None if target.sample is None or target.sample.moved else target.sample.magnitude,
            unit=target.quantity.unit(units),
            relation=target.relation,
            wanted=(target.wanted[0] if target.size == 1 else target.wanted) if target.wanted else None,
            started=of(started, k),
            reached=of(reached.values, k),
            finer_elements_add=of(reached.errors, k),
            corrected=of(reached.compared, k),
            error=float(errors[k]),
        )
        for k, target in enumerate(comparison.targets)
    )


def component_values(components: np.ndarray) -> Value:
    """A number, or the tuple of several."""
    own = tuple(components.tolist())
    return own[0] if len(own) == 1 else own


def link_designs(rest: ParametricShape, placement: HandlePlacement) -> tuple[LinkDesign, ...]:
    """The shapes of all links at a placement."""
    designs = []
    for link, handles in zip(rest.links, rest.handles(placement), strict=True):
        own = link.parameters.of(placement.p)
        thickness, bend = link.thickness * link.samples.thickness(own), link.samples.curvature(own)
        designs.append(
            LinkDesign(
                name=link.name,
                parameters=tuple(placement.p[link.parameters.place].tolist()),
                handles=tuple(handles.tolist()),
                controls=tuple(tuple(map(tuple, point)) for point in link.spline.controls_at(own).tolist()),
                thickness=(float(thickness.min()), float(thickness.max())),
                bend=float(np.abs(bend).max(initial=0.0)),
                centreline=tuple(map(tuple, link.centreline.tolist())),
                same=tuple(image.name for image in link.images if not image.isometry.mirrors),
                mirrored=tuple(image.name for image in link.images if image.isometry.mirrors),
                ends_move=link.spline.ends_move,
            )
        )
    return tuple(designs)


def shapes_of(result: DesignResult, links: Sequence[DesignedLink]) -> list[LinkDesign]:
    """Local. The shapes in a result of ``links``, in their order.

    Raises:
        DescriptionError: a link has another number of parameters there.
    """
    given = {link.name: link for link in result.links}
    for link in links:
        size = link.parameters.place.stop - link.parameters.place.start
        found = len(given[link.name].parameters) if link.name in given else 0
        if found != size:
            raise DescriptionError(
                f"design of {result.mechanism!r}",
                f"it has {found} parameters of link {link.name!r} instead of {size}",
                "Use a result of the same links, numbers of segments and ends_move",
            )
    return [given[link.name] for link in links]


def rest_meshes(simulation: Simulation, links: Sequence[FlexibleLink]) -> list[LinkMesh]:
    """Meshes of some links in their present shape, on the first process alone.

    Links of which one half is meshed are given by their section.
    """
    meshes = gather_links(simulation.model.mesh, rest_geometry(simulation.model))
    everyone, halves = simulation.scene.mechanism.flexible_links, simulation.fidelity.model.half
    chosen = [meshes[everyone.index(link)] for link in links]
    return on_one(simulation.comm, lambda: [section_of(mesh) for mesh in chosen] if halves else chosen) or []


def _outline(link: DesignedLink, place: Isometry, mesh: LinkMesh, p: np.ndarray) -> OutlineShape:
    """The outline of a link, with centreline, thickness and control points of its parameters ``p``, in its place."""
    loops = boundary_polygons(f"link {link.name!r}", section_of(mesh))
    return OutlineShape(
        loops,
        centreline=place.points(link.spline.evaluate(p, link.samples.t)[:, :2]),
        thickness=link.thickness * link.samples.thickness(p),
        controls=place.points(link.spline.controls_at(p)[:, 0, :2]),
    )


def draw_links(
    path: str | Path,
    simulation: Simulation,
    links: Sequence[FlexibleLink],
    designed: Sequence[DesignedLink],
    before: tuple[np.ndarray, Sequence[LinkMesh]],
    after: tuple[np.ndarray, Sequence[LinkMesh]],
    joints: np.ndarray,
) -> None:
    """Local. Draws links before and after a change, from the parameters p and the meshes of both.

    ``joints`` are points of connections after it, on both of their bodies, (connections, 2, 2).
    """
    scene, linkage, shapes = simulation.scene, simulation.linkage, []
    ends = np.array([(c.a, c.b) for c in linkage.joints.connections])
    places = [
        (change, place)
        for change in designed
        for place in (Isometry.identity(), *(image.isometry for image in change.images))
    ]
    for k, (link, (change, place)) in enumerate(zip(links, places, strict=True)):
        old, new = (_outline(change, place, meshes[k], change.parameters.of(p)) for p, meshes in (before, after))
        shapes.append(DesignShape(link.name, old, new, joints[np.isin(ends, linkage.interfaces[link])]))
    rigid = MechanismPlotter(simulation.model).rigid(linkage.joints.drawn, joints)
    draw_designs(path, shapes, rigid=rigid, unit=scene.units.length, title=f"{scene.mechanism.name}: links")


def write_solids(
    folder: str | Path,
    linkage: Linkage,
    links: Sequence[FlexibleLink],
    meshes: Sequence[LinkMesh],
    depths: Sequence[float],
    hole: float | None,
) -> None:
    """Local. Writes ``NAME.step`` and ``NAME.stl`` of every link, with holes of this diameter for pins if given."""
    files = solid_files(links)
    for link, mesh, depth in zip(links, meshes, depths, strict=True):
        regions = [linkage.bodies[i] for i in linkage.interfaces[link]]
        pins = [PinHole((b.centre[0], b.centre[1]), hole) for b in regions if hole and isinstance(b.region, Disc)]
        for suffix, write in ((".step", write_step), (".stl", write_stl)):
            write(Path(folder) / f"{files[link]}{suffix}", mesh, depth=depth, pins=pins, name=link.name)


def write_parts(
    folder: str | Path,
    shapes: Sequence[Sequence[FlexibleLink]],
    materials: Mapping[FlexibleLink, Material],
    depths: Mapping[FlexibleLink, float],
) -> None:
    """Local. Writes ``parts.json``: how many to make of each part, and the links that it is.

    Links that share a shape are one part where they are of one material; so are mirror images, turned over.

    Args:
        folder: where to.
        shapes: the links that have each shape.
        materials: of the links, as the design has them.
        depths: likewise, of all links that are written.
    """
    files = solid_files(depths)
    parts: dict[tuple, list[FlexibleLink]] = {}
    for number, links in enumerate(shapes):
        for link in links:
            parts.setdefault((number, materials[link], depths[link]), []).append(link)
    listed = [
        {
            "file": f"{files[links[0]]}.step",
            "count": len(links),
            "links": [link.name for link in links],
            "material": material.name,
            "law": material.law.parameters,
            "depth": depth,
        }
        for (_, material, depth), links in parts.items()
    ]
    write_json(Path(folder) / "parts.json", {"parts": listed})


def solid_files(links: Iterable[FlexibleLink]) -> dict[FlexibleLink, str]:
    """Names of the files of exported links, without their endings."""
    links = list(links)
    return dict(zip(links, file_names(link.name for link in links), strict=True))
