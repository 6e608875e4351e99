"""The surface of flexible links on one process, and the stress recovered there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import basix
import numpy as np

from fenicsmech.errors import point_text, set_options, with_error
from fenicsmech.mechanism import Disc, Face, Force
from fenicsmech.model import MechanismModel
from fenicsmech.stress.drawn import SurfaceFit
from fenicsmech.stress.interpolation import InterpolationError, InterpolationOptions, node_places
from fenicsmech.stress.recovered import (
    CellFields,
    FittedFields,
    Recovered,
    fitted_parts,
    principal_strain,
    turned_back,
    von_mises,
)
from fenicsmech.stress.recovery import PatchRecovery, RecoveryOptions, Samples, shape_functions, with_image
from fenicsmech.stress.recovery_error import HIGHER, SMOOTHER, recovery_error
from fenicsmech.stress.singular_places import (
    Facets,
    PlaceFinder,
    SingularityOptions,
    SingularPlace,
    curved_nodes,
    lattice,
)

_FACETS = {2: basix.CellType.interval, 3: basix.CellType.triangle}


@dataclass(frozen=True)
class StressOptions:
    """Numbers of recovered stresses.

    Attributes:
        recovery: of the fits.
        interpolation: of the errors of strains that are taken off before.
        singularity: of the places left out.
        parts: of each side of a facet, at whose corners the peak is looked for.
    """

    recovery: RecoveryOptions = field(default_factory=RecoveryOptions)
    interpolation: InterpolationOptions = field(default_factory=InterpolationOptions)
    singularity: SingularityOptions = field(default_factory=SingularityOptions)
    parts: int = 4

    def __post_init__(self) -> None:
        set_options(self, "recovered stresses", parts=1)


@dataclass(frozen=True)
class StressPeak:
    """The largest stress or strain at the surface of flexible links, singular places left out.

    Attributes:
        value: the von Mises stress, or the largest principal nominal strain of the elastic deformation.
        error: estimated, of the value.
        place: point of the unloaded link, (dim,).
        link: name of the link.
        left_out: names of singular places near which it is above the peak. Where they hold the whole surface
            of the link, the value is one within them, without a limit, and all are named: smaller elements make room.
    """

    value: float
    error: float
    place: tuple[float, ...]
    link: str
    left_out: tuple[str, ...]

    def __str__(self) -> str:
        return f"{with_error(self.value, self.error)} in {self.link!r} at {point_text(self.place)}"


@dataclass(frozen=True)
class SurfacePeaks:
    """Peaks of stress, or of strain, at one equilibrium.

    Attributes:
        whole: the largest of all links.
        links: of each flexible link that has a surface, in their order.
    """

    whole: StressPeak
    links: tuple[StressPeak, ...]


@dataclass(frozen=True, eq=False)
class SurfaceStress:
    """Recovered stress at the surface of flexible links, on one process.

    Attributes:
        nodes: of the cells at rest, (cells, nodes, dim).
        points: at rest, (n, dim).
        links: number of the flexible link of each, (n,).
        stress: Rᵀ σ R, R the rotation of the material there, (n, 3, 3).
        kept: mask of points outside singular places, (n,).
    """

    nodes: np.ndarray
    points: np.ndarray
    links: np.ndarray
    stress: np.ndarray
    kept: np.ndarray


@dataclass(frozen=True, eq=False)
class _Body:
    """The links of one design, on one process.

    Attributes:
        nodes: at rest, linear or quadratic, (cells, nodes, dim).
        touched: vertices of facets that touch obstacles, (k, dim).
        recovery: fits around the vertices of the surface.
        points: at rest, of the surface where the peak is looked for, (facets, p, dim).
        rows: of each corner of each facet in ``recovery``, (facets, dim).
        shares: of the coefficients of each of them at the points, (facets, dim, p, m).
    """

    nodes: np.ndarray
    touched: np.ndarray
    recovery: PatchRecovery
    points: np.ndarray
    rows: np.ndarray
    shares: np.ndarray


@dataclass(frozen=True, eq=False)
class _Looked:
    """What a peak is looked for in.

    Attributes:
        fields: of the equilibrium.
        found: recovered at the points of the surface.
        measure: of recovered fields, (k, p).
        sampled: its largest sample in each cell of the mesh, (cells,).
        others: measures with at most the same relative error.
    """

    fields: CellFields
    found: Recovered
    measure: Callable[[Recovered], np.ndarray]
    sampled: np.ndarray
    others: tuple[Callable[[Recovered], np.ndarray], ...] = ()


class LinkSurface:
    """The surface of all flexible links of a model. All methods are local.

    Where half is meshed, arrays hold the mirror image too: cells after those of the mesh, vertices likewise, those on
    the mid-plane twice, of which cells have the first.

    Args:
        model: the mechanism.
        cells: vertices of all cells, in the order of their nodes, (cells, dim + 1).
        loaded: vertices of facets on which effects act at every equilibrium, (k, dim).
        options: of the recovery.
    """

    def __init__(self, model: MechanismModel, cells: np.ndarray, loaded: np.ndarray, options: StressOptions) -> None:
        mesh, self._model, self._options = model.mesh, model, options
        self._body: _Body | None = None
        self._interpolation: tuple[np.ndarray, InterpolationError] | None = None
        drawn = curved_nodes(mesh.vertices, cells, mesh.curved)
        self._drawn_nodes, self._cells, self._loaded, self._vertices = drawn, cells, loaded, mesh.vertices
        self._link, self._interface = mesh.link_of_cell, mesh.interface_of_cell
        self._image = np.arange(len(mesh.vertices))
        if model.elastic.model.half:
            heights, numbers = mesh.vertices[:, 2], self._image
            self._image = np.where(heights > 1e-9 * heights.max(), numbers + len(numbers), numbers)
            self._drawn_nodes = with_image(drawn)
            self._vertices = with_image(mesh.vertices)
            self._cells, self._loaded = (np.concatenate([own, self._image[own]]) for own in (cells, loaded))
            self._link, self._interface = np.tile(self._link, 2), np.tile(self._interface, 2)

    def whole(self, fields: CellFields) -> CellFields:
        """The fields with their mirror image where half is meshed."""
        if not self._model.elastic.model.half:
            return fields
        touched = np.concatenate([fields.touched, self._image[fields.touched]])
        return CellFields(with_image(fields.nodes), with_image(fields.samples), touched)

    @cached_property
    def _flexible(self) -> np.ndarray:
        """Mask of cells that can deform."""
        return self._interface < 0

    @cached_property
    def _boundary(self) -> tuple[Facets, Facets]:
        """Facets of cells that can deform: on the surface, and on the rims of interfaces."""
        every = Facets.around(self._cells, self._flexible)
        rim = every.shared(Facets.around(self._cells, ~self._flexible))
        return every.only(~rim), every.only(rim)

    @cached_property
    def _meshed(self) -> Facets:
        """Facets of the surface where stress is recovered: those of the mesh, without their mirror images."""
        surface = self._boundary[0]
        return surface.only(surface.cells < len(self._model.mesh.cells))

    @cached_property
    def _acting(self) -> np.ndarray:
        """Vertices of facets on which effects or forces act at every equilibrium, (k, dim)."""
        return np.concatenate([self._loaded, *(self._under(*own) for own in self._forces)])

    def _free(self, touched: np.ndarray) -> Facets:
        """Facets of the surface on which nothing acts, from the vertices of those that touch obstacles, (k, dim)."""
        surface, acting = self._boundary[0], np.sort(np.concatenate([self._acting, touched]), axis=1)
        return surface.only(~surface.shared(Facets(acting[:, 0], acting[:, 0], acting)))

    @property
    def _forces(self) -> list[tuple[Force, int]]:
        """Forces on flexible links, with the numbers of these."""
        model = self._model
        numbers = {id(link): number for number, link in enumerate(model.mechanism.flexible_links)}
        return [(force, numbers[id(force.on)]) for force in model.mechanism.forces if id(force.on) in numbers]

    def _under(self, force: Force, number: int) -> np.ndarray:
        """Vertices of facets on which a force may act, (k, dim)."""
        surface, dim = self._boundary[0], self._model.elastic.model.dim
        if not isinstance(force.region, Face):
            return np.zeros((0, dim), dtype=int)
        mine = surface.only(self._link[surface.cells] == number)
        places = self._vertices[mine.corners]
        if force.region.where is not None:
            inside = np.asarray(force.region.where(places.reshape(-1, dim))).reshape(places.shape[:2])
            return mine.corners[inside.all(axis=1)]
        at = np.array([*force.at, 0.0][:dim])
        lengths = np.linalg.norm(places - places[:, :1], axis=2).max(axis=1)
        _, normals = mine.geometry(self._drawn_nodes, mine.barycentric(np.full((1, dim), 1.0 / dim)))
        heights = np.abs(np.einsum("fcd,fd->fc", places - at, normals[:, 0])).max(axis=1)
        held = heights <= 1e-6 * lengths
        if (within := force.region.within) is not None:
            reach = within.radius if isinstance(within, Disc) else 0.5 * np.hypot(within.length, within.width)
            held &= np.linalg.norm((places - at)[..., :2], axis=2).min(axis=1) <= reach + lengths
        return mine.corners[held]

    @cached_property
    def places(self) -> tuple[SingularPlace, ...]:
        """The places where stress has no limit."""
        model, (surface, rims) = self._model, self._boundary
        outside = Facets.around(self._cells, np.ones(len(self._cells), dtype=bool))
        names = [link.name for link in model.mechanism.flexible_links]
        finder = PlaceFinder(
            self._drawn_nodes, self._cells, self._link, surface, outside, rims, self._options.singularity
        )
        bodies = model.linkage.bodies[len(model.mechanism.rigid_links) :]
        held = Facets.around(self._cells, ~self._flexible)
        holders = held.values_of(self._interface[held.cells], rims)
        found = [*finder.corners(names), *finder.rims(names, [body.name for body in bodies], holders)]
        for force, link in self._forces:
            if force.region is None:
                at = np.array([*force.at, 0.0][: self._vertices.shape[1]])
                found.append(finder.point(f"point of {force.name!r}", link, names, at))
        return tuple(found)

    @cached_property
    def _smooth(self) -> np.ndarray:
        """Mask of cells without a vertex in a singular place of their link."""
        smooth, names = np.ones(len(self._cells), dtype=bool), self._names[self._link]
        for place in self.places:
            held = place.holds(self._vertices)[self._cells].any(axis=1)
            smooth[held & (names == place.link)] = False
        return smooth

    @property
    def _names(self) -> np.ndarray:
        """Names of the flexible links, (links,)."""
        return np.array([link.name for link in self._model.mechanism.flexible_links])

    @cached_property
    def _candidates(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """Barycentric coordinates in their cells of the points of the surface where the peak is looked for,
        (facets, p, dim + 1), and which of them each singular place holds, (facets, p)."""
        surface = self._meshed
        corners = surface.barycentric(lattice(surface.corners.shape[1], self._options.parts))
        points = surface.geometry(self._drawn_nodes, corners)[0]
        flat, names = points.reshape(-1, points.shape[-1]), self._names[self._link[surface.cells]]
        held = [place.holds(flat).reshape(points.shape[:2]) & (names == place.link)[:, None] for place in self.places]
        return corners, held

    def _samples_of(self, fields: CellFields) -> Samples:
        """Places of samples and of the free surface."""
        elastic, nodes, free = self._model.elastic, fields.nodes, self._free(fields.touched)
        dim, flexible = elastic.model.dim, np.flatnonzero(self._flexible)
        places = basix.make_quadrature(_FACETS[dim], 2 * elastic.order - 1)[0]
        places = free.barycentric(np.column_stack([1.0 - places.sum(axis=1), places]))
        points, normals = free.geometry(nodes, places)
        at = elastic.sample_points
        at = shape_functions(np.column_stack([1.0 - at.sum(axis=1), at]), nodes.shape[1])
        number = np.zeros(len(nodes), dtype=int)
        number[flexible] = np.arange(len(flexible))
        return Samples(self._cells[flexible], at @ nodes[flexible], number[free.cells], points, normals)

    def _recovery(
        self, samples: Samples, nodes: np.ndarray, vertices: np.ndarray, variant: tuple[int, float] = (0, 1.0)
    ) -> PatchRecovery:
        """Fits around some vertices (n,) of cells with ``nodes``; a variant has so many degrees and times the decay."""
        places, options, (more, times) = np.zeros_like(self._vertices), self._options.recovery, variant
        places[self._cells] = nodes[:, : self._cells.shape[1]]
        options = replace(options, decay=times * options.decay)
        return PatchRecovery(samples, vertices, places[vertices], self._model.elastic.order + more, options)

    def strain_errors(self, nodes: np.ndarray, numbers: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Estimated errors of ∇u at the samples of cells of the mesh, (cells, q, dim, dim), none at singular places.

        Args:
            nodes: of the cells at rest, (cells, n, dim).
            numbers: of the nodes of u in each cell, (cells, a).
            u: displacements of these, (cells, a, dim).
        """
        free, count = self._flexible, len(nodes)
        if self.mirrored:
            # nodes at mid-depth are their own images
            heights = node_places(numbers.shape[1], nodes)[..., 2]
            image = np.where(np.abs(heights) > 1e-9 * np.abs(heights).max(), numbers + numbers.max() + 1, numbers)
            nodes, u, numbers = with_image(nodes), with_image(u), np.concatenate([numbers, image])
        last = self._interpolation
        if last is None or not np.array_equal(last[0], nodes):
            at = self._model.elastic.sample_points
            at, options = np.column_stack([1.0 - at.sum(axis=1), at]), self._options.interpolation
            own = self._cells[free], nodes[free], numbers[free], self._smooth[free]
            last = self._interpolation = nodes, InterpolationError(*own, at, options)
        found = np.zeros((len(nodes), len(self._model.elastic.sample_points), nodes.shape[2], nodes.shape[2]))
        found[free] = last[1].of(u[free])
        return found[:count]

    def _body_of(self, fields: CellFields) -> _Body:
        """The links at an equilibrium."""
        last, nodes, touched = self._body, fields.nodes, fields.touched
        if last is not None and np.array_equal(last.nodes, nodes) and np.array_equal(last.touched, touched):
            return last
        surface, samples = self._meshed, self._samples_of(fields)
        vertices, rows = np.unique(surface.corners, return_inverse=True)
        recovery = self._recovery(samples, nodes, vertices)
        points = surface.geometry(nodes, self._candidates[0])[0]
        rows = rows.reshape(surface.corners.shape)
        shares = recovery.shares(rows, self._shares, points)
        self._body = _Body(nodes, touched, recovery, points, rows, shares)
        return self._body

    @property
    def mesh(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Drawn vertices (n, dim), vertices of cells (m, dim + 1), the link of each, and whether it can deform, (m,);
        with mirror images."""
        return self._vertices, self._cells, self._link, self._flexible

    def positions(self, cells: np.ndarray, corners: np.ndarray, nodes: np.ndarray | None = None) -> np.ndarray:
        """Points of cells (k,) with barycentric coordinates (k, dim + 1), drawn or with ``nodes``, (k, dim)."""
        own = (self._drawn_nodes if nodes is None else nodes)[cells]
        return np.einsum("kn,knd->kd", shape_functions(corners, own.shape[1]), own)

    @property
    def mirrored(self) -> bool:
        """Whether half is meshed, the upper one."""
        return self._model.elastic.model.half

    @property
    def vertices(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Vertices (n,) of meshed cells that can deform, a cell of each (n,), and its barycentric coordinates there,
        (n, 1, dim + 1)."""
        size, meshed = self._cells.shape[1], len(self._model.mesh.cells)
        cells = np.flatnonzero(self._flexible[:meshed])
        vertices, first = np.unique(self._cells[cells], return_index=True)
        return vertices, cells[first // size], np.eye(size)[first % size][:, None]

    @property
    def points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points of the surface where the peak is looked for: numbers of links (n,), cells (n,), and barycentric
        coordinates in these, (n, 1, dim + 1); without mirror images."""
        corners = self._candidates[0]
        cells = np.repeat(self._meshed.cells, corners.shape[1])
        return self._link[cells], cells, corners.reshape(-1, 1, corners.shape[2])

    def at(
        self, fields: CellFields, cells: np.ndarray, corners: np.ndarray, variant: tuple[int, float] = (0, 1.0)
    ) -> Recovered:
        """Recovered fields at points of cells; zero stress in those that cannot deform.

        Args:
            fields: of the equilibrium.
            cells: numbers of cells, (k,).
            corners: barycentric coordinates in them, (k, p, dim + 1).
            variant: degrees more of the polynomials, and times the decay.
        """
        fields, dim = self.whole(fields), self._model.elastic.model.dim
        nodes, free = fields.nodes, self._flexible[cells]
        points = shape_functions(corners, nodes.shape[1]) @ nodes[cells]
        used = (corners[free] != 0.0).any(axis=1)
        own = self._cells[cells[free]]
        vertices = np.unique(own[used])
        # around vertices that no point needs there is no fit
        rows = np.where(used, np.searchsorted(vertices, own), 0)
        recovery = self._recovery(self._samples_of(fields), nodes, vertices, variant)
        shares = recovery.shares(rows, corners[free], points[free])
        found = self._blended(recovery, fields.samples, rows, shares, points[free])
        stress, F = np.zeros((*points.shape[:2], 3, 3)), np.broadcast_to(np.eye(dim), (*points.shape, dim)).copy()
        elastic = None if found.elastic is None else F.copy()
        stress[free], F[free] = found.stress, found.F
        if elastic is not None:
            elastic[free] = found.elastic
        return Recovered(points, stress, F, elastic)

    def _blended(
        self, recovery: PatchRecovery, samples: np.ndarray, rows: np.ndarray, shares: np.ndarray, points: np.ndarray
    ) -> Recovered:
        """Recovered fields at ``points`` (k, p, dim), where coefficients of fits ``rows`` (k, c) have ``shares``
        (k, c, p, m)."""
        dim = self._model.elastic.model.dim
        T, others = recovery.fit(*fitted_parts(samples[self._flexible], dim))
        coefficients = np.concatenate([T.reshape(*T.shape[:2], -1), others], axis=2)
        found = sum(shares[:, corner] @ coefficients[rows[:, corner]] for corner in range(rows.shape[1]))
        fields = FittedFields.of(found, dim)
        return Recovered(points, fields.stress, fields.F, fields.elastic)

    @cached_property
    def _shares(self) -> np.ndarray:
        """λ of the points of each facet at its vertices, in their ascending order, (facets, p, dim)."""
        surface, corners = self._meshed, self._candidates[0]
        vertices = self._cells[surface.cells]
        order = np.argmax(vertices[:, None, :] == surface.corners[:, :, None], axis=2)
        return np.take_along_axis(corners, order[:, None, :], axis=2)

    @property
    def links(self) -> np.ndarray:
        """Number of the link of each facet, (facets,)."""
        return self._link[self._meshed.cells]

    @cached_property
    def kept(self) -> np.ndarray:
        """Which points of each facet count for the peak of its link, (facets, p): those outside singular places, or
        all where these hold its whole surface."""
        held = self._held
        room = np.isin(self.links, self.links[~held.all(axis=1)])
        return ~held | ~room[:, None]

    @cached_property
    def _held(self) -> np.ndarray:
        """Which points of each facet singular places hold, (facets, p)."""
        corners, held = self._candidates
        return np.logical_or.reduce([np.zeros(corners.shape[:2], dtype=bool), *held])

    def fit(self, fields: CellFields, links: np.ndarray) -> SurfaceFit:
        """The recovery at the surface of the links in a mask, where cells are and touch as in ``fields``."""
        whole, chosen, surface = self.whole(fields), np.flatnonzero(links[self.links]), self._meshed
        vertices, rows = np.unique(surface.corners[chosen], return_inverse=True)
        recovery = self._recovery(self._samples_of(whole), whole.nodes, vertices)
        points = surface.geometry(whole.nodes, self._candidates[0])[0][chosen]
        rows, cells = rows.reshape(len(chosen), -1), np.flatnonzero(self._flexible)
        shares = recovery.shares(rows, self._shares[chosen], points)
        return SurfaceFit(recovery, rows, shares, chosen, cells, self._model.elastic.model.half)

    def recovered(self, fields: CellFields) -> Recovered:
        """Recovered fields at the points of the surface."""
        fields = self.whole(fields)
        body = self._body_of(fields)
        return self._blended(body.recovery, fields.samples, body.rows, body.shares, body.points)

    def errors(
        self, fields: Sequence[CellFields], cells: np.ndarray, corners: np.ndarray, measure: Callable[..., np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray, list[Recovered]]:
        """A measure of the fields recovered at some equilibria, its estimated errors, and these fields.

        Args:
            fields: of each equilibrium.
            cells, corners: as of ``at``.
            measure: of the fields recovered at all of them.
        """
        found, smoother, higher = (
            [self.at(own, cells, corners, variant) for own in fields] for variant in ((0, 1.0), SMOOTHER, HIGHER)
        )
        value = measure(*found)
        return value, recovery_error(value, measure(*smoother), measure(*higher), self._model.elastic.order), found

    def error(self, fields: Sequence[CellFields], facet: int, point: int, measure: Callable[..., np.ndarray]) -> float:
        """The estimated error of a measure, as in ``errors``, at one of the points of the surface."""
        cells, corners = self._meshed.cells[[facet]], self._candidates[0][[facet], [[point]]]
        return float(self.errors(fields, cells, corners, measure)[1].item())

    def peaks(self, fields: CellFields) -> SurfacePeaks:
        """The peaks of the von Mises stress at an equilibrium."""
        # in fits to both sides of a corner the stress vanishes there: samples tell
        stresses = fields.samples[..., :9].reshape(*fields.samples.shape[:2], 3, 3)
        sampled = von_mises(stresses).max(axis=1)
        return self._peaks(_Looked(fields, self.recovered(fields), Recovered.von_mises, sampled))

    def strain_peaks(self, fields: CellFields) -> SurfacePeaks:
        """The peaks of the largest principal strain, from fields with the elastic part of F.

        The law makes one of strain and stress: the fit that sees more of its error speaks for both.
        """
        dim, samples = self._model.elastic.model.dim, fields.samples
        free = self._flexible[: len(samples)]
        elastic = samples[free][..., 9 + dim**2 :]
        sampled = np.zeros(len(samples))
        sampled[free] = principal_strain(elastic.reshape(*elastic.shape[:2], dim, dim)).max(axis=1)
        found, others = self.recovered(fields), (Recovered.von_mises,)
        return self._peaks(_Looked(fields, found, Recovered.principal_strain, sampled, others))

    def _peaks(self, looked: _Looked) -> SurfacePeaks:
        """Those of all links, and of each."""
        links = self.links
        own = tuple(self._peak(looked, links == number) for number in np.unique(links))
        return SurfacePeaks(self._peak(looked, np.ones(len(links), dtype=bool)), own)

    def _peak(self, looked: _Looked, mask: np.ndarray) -> StressPeak:
        """The peak on the facets of ``mask``."""
        values = looked.measure(looked.found)
        held = [own & mask[:, None] for own in self._candidates[1]]
        everywhere = np.broadcast_to(mask[:, None], values.shape)
        kept = everywhere & ~self._held
        room = kept.any()
        kept = kept if room else everywhere
        facet, point = (int(k) for k in np.unravel_index(np.argmax(np.where(kept, values, -np.inf)), values.shape))
        value, links = float(values[facet, point]), self._model.mechanism.flexible_links
        there = [looked.sampled[self._meshed.cells[own.any(axis=1)]].max(initial=0.0) for own in held]
        above = [
            place.name
            for place, own, largest in zip(self.places, held, there, strict=True)
            if largest > value or (not room and own.any())
        ]
        link = links[self._link[self._meshed.cells[facet]]]
        error = self.error([looked.fields], facet, point, looked.measure)
        for other in looked.others:
            stress = float(other(looked.found)[facet, point])
            if stress > 0.0:
                error = max(error, abs(value) / stress * self.error([looked.fields], facet, point, other))
        place = tuple(looked.found.points[facet, point].tolist())
        return StressPeak(value, error, place, link.name, tuple(above))

    def stress(self, fields: CellFields) -> SurfaceStress:
        """The recovered stress at an equilibrium, turned back with the material."""
        fields = self.whole(fields)
        body = self._body_of(fields)
        found = self._blended(body.recovery, fields.samples, body.rows, body.shares, body.points)
        turned = turned_back(found.stress, found.F)
        links = np.broadcast_to(self.links[:, None], self._held.shape)
        points = body.points.reshape(-1, body.points.shape[-1])
        links, turned, kept = links.ravel(), turned.reshape(-1, 9), ~self._held.ravel()
        if self._model.elastic.model.half:
            points, turned = with_image(points), with_image(turned)
            links, kept = np.tile(links, 2), np.tile(kept, 2)
        return SurfaceStress(fields.nodes, points, links, turned.reshape(-1, 3, 3), kept)
