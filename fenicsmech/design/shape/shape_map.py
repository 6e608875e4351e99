"""The map from spline parameters and handle positions to the design field, and its transpose.

    d_i = Σ_j w_ij T_j(p, θ_j) (X_i − X_j, 1) = Σ_j T_j r_ij,     d linear in the maps T_j (2 × 3) of the handles.

The transpose takes a field g to the moments ∂/∂T_j = Σ_i g_i ⊗ r_ij of each handle, and from there to ∂/∂p and ∂/∂θ.

Links that share a shape share p and θ. With the motion x′ = Q x + c from the first of them to another one, r_ij are
those of the points Qᵀ (X′_i − c), and d′_i = Q Σ_j T_j r_ij.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.collective import on_all
from fenicsmech.compat import original_cells
from fenicsmech.design.shape.edges import EdgeWeights, edge_weights
from fenicsmech.design.shape.handles import BETWEEN, LinkHandles
from fenicsmech.design.shape.spline import LinkSpline, SplineFit, SplineSamples, fit_spline, lay_out
from fenicsmech.design.shape.weights import handle_weights, pierced
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import Centreline
from fenicsmech.meshing import (
    FREE,
    CurvedEdges,
    Isometry,
    LinkMesh,
    LinkOutline,
    MechanismMesh,
    cell_measures,
    edge_corners,
    edge_rows,
    image_of,
    node_ends,
    plan_of,
)
from fenicsmech.polygons import chord_lengths, distance_to_edges

_HANDLES = 100  # along a link, at most: the memory for their weights grows with the square, and splines are smooth


@dataclass(frozen=True, eq=False)
class ShapeRequest:
    """The spline and handles wanted for one link.

    Attributes:
        link: index of the flexible link.
        name: its name, for messages.
        joints: positions of its interfaces, in the order of the mesh, (sites, 2).
        turns: whether the joints of each interface let it turn about z, (sites,).
        reach: how far each interface extends from its joint in the plane, (sites,).
        segments: number of cubic segments.
        centreline: approximated by the spline.
        thickness: in the plane, where δ = 1, or the outline that it is measured on.
        ends_move: whether free ends may move.
        joints_move: whether joints may.
        follows: whether the shape has no parameters of its own, and follows joints alone.
        images: links that share the shape.
    """

    link: int
    name: str
    joints: tuple[tuple[float, float], ...]
    turns: tuple[bool, ...]
    reach: tuple[float, ...]
    segments: int
    centreline: Centreline
    thickness: float | LinkOutline
    ends_move: bool = False
    joints_move: bool = False
    follows: bool = False
    images: tuple[ImageRequest, ...] = ()


@dataclass(frozen=True, eq=False)
class ImageRequest:
    """A link that shares the shape of another one.

    Attributes:
        link: index of the flexible link.
        name: its name.
        isometry: from the other link to this one.
        sites: this link's interface at the place of each of the other's, (sites,).
    """

    link: int
    name: str
    isometry: Isometry
    sites: np.ndarray


@dataclass(frozen=True, eq=False)
class LinkImage:
    """A link that has the handles of a shape, its own or those of another link.

    Attributes:
        link: index of the flexible link.
        name: its name.
        isometry: from the link with the handles to this one.
        weights: of each handle at each vertex of this link, (n, handles).
        edges: weights at the midpoints of edges that follow the design, in the place of the link with the handles.
    """

    link: int
    name: str
    isometry: Isometry
    weights: np.ndarray
    edges: EdgeWeights


@dataclass(frozen=True, eq=False)
class LinkShape:
    """The handles of one link, and all links that they move.

    Attributes:
        own: the link.
        handles: its handles.
        thickness: in the plane, where δ = 1; at the samples of the spline where it is not the same everywhere.
        centreline: points that the drawn centreline runs through, (k, 2).
        images: links that share the shape.
        follows: whether it has no parameters of its own, and follows joints alone.
    """

    own: LinkImage
    handles: LinkHandles
    thickness: float | np.ndarray
    centreline: np.ndarray
    images: tuple[LinkImage, ...] = ()
    follows: bool = False

    @property
    def every(self) -> tuple[LinkImage, ...]:
        """All links with this shape, its own first."""
        return (self.own, *self.images)


@dataclass(frozen=True, eq=False)
class LinkParameters:
    """The parameters of a link's spline as a function of those of the design, s = s₀ + S p.

    Attributes:
        place: the link's own entries of p.
        fixed: s₀, (size,).
        matrix: S, (size, parameters).
    """

    place: slice
    fixed: np.ndarray
    matrix: np.ndarray

    def of(self, p: np.ndarray) -> np.ndarray:
        """s (size,) of the design ``p``."""
        return self.fixed + self.matrix @ p


def shape_link(mesh: LinkMesh, request: ShapeRequest, others: Sequence[LinkMesh] = ()) -> LinkShape:
    """Spline, handles and weights of one link.

    Args:
        mesh: of the link.
        request: of its shape.
        others: meshes of the links that share the shape.

    Raises:
        DescriptionError: the spline does not fit the link, or elements are too large for its handles.
    """
    part, joints = f"link {request.name!r}", request.joints
    layout = lay_out(request.centreline, joints, request.reach, request.segments, part=f"design of {part}")
    moves = {"ends_move": request.ends_move, "joints_move": request.joints_move}
    fit = fit_spline(request.centreline, joints, layout, **moves, part=f"spline of {part}")
    length = request.centreline.length
    spacing = max(_mean_width(mesh, length), length / _HANDLES)
    handles = _place_handles(mesh, fit, spacing=spacing, turns=request.turns, part=part)
    weights, edges = _weights(mesh, handles, part=part)
    images = []
    for image, other in zip(request.images, others, strict=True):
        here = image_of(other, image.isometry.inverse, np.argsort(image.sites))
        same = (weights, edges) if _is_same(here, mesh) else _weights(here, handles, part=f"link {image.name!r}")
        images.append(LinkImage(image.link, image.name, image.isometry, *same))
    drawn = request.thickness
    thickness = _measured(drawn, fit.spline, part=f"design of {part}") if isinstance(drawn, LinkOutline) else drawn
    centreline = request.centreline.evaluate(request.centreline.knots)
    own = LinkImage(request.link, request.name, Isometry.identity(), weights, edges)
    return LinkShape(own, handles, thickness, centreline, tuple(images), request.follows)


def _weights(mesh: LinkMesh, handles: LinkHandles, *, part: str) -> tuple[np.ndarray, EdgeWeights]:
    """Weights at the vertices of a mesh and at midpoints of its edges."""
    weights = handle_weights(mesh, handles, part=part)
    hidden = int(np.sum(weights.max(axis=0) < 1e-6))  # between vertices that interfaces hold
    if hidden:
        raise DescriptionError(
            f"design of {part}",
            f"handles move no vertex, as its elements are too large: {hidden} of {len(handles)}",
            "Use smaller elements",
        )
    return weights, edge_weights(mesh, weights)


def _is_same(one: LinkMesh, other: LinkMesh) -> bool:
    """Whether two meshes in one place are the same, vertex by vertex."""
    if one.points.shape != other.points.shape or one.cells.shape != other.cells.shape:
        return False
    near = np.abs(one.points - other.points).max() <= 1e-9 * np.ptp(other.points, axis=0).max()
    alike = np.array_equal(np.sort(one.cells, axis=1), np.sort(other.cells, axis=1))
    return bool(near and alike and np.array_equal(one.interface, other.interface))


def _measured(outline: LinkOutline, spline: LinkSpline, *, part: str) -> np.ndarray:
    """The thickness of a link at the samples of its spline, (samples,)."""
    t = SplineSamples(spline).t
    tangents = spline.derivative(spline.initial, t)[:, :2]
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    return outline.thickness(spline.evaluate(spline.initial, t)[:, :2], tangents, part=part)


def shape_links(mesh: MechanismMesh, requests: Sequence[ShapeRequest]) -> list[LinkShape]:
    """The shapes of some links, each computed on one rank and the same on all; errors too."""
    links, comm = gather_links(mesh), mesh.mesh.comm

    def shape(request: ShapeRequest) -> LinkShape:
        return shape_link(links[request.link], request, [links[image.link] for image in request.images])

    shapes = comm.allgather(on_all(comm, lambda: list(map(shape, requests[comm.rank :: comm.size]))))
    return [shapes[k % comm.size][k // comm.size] for k in range(len(requests))]


def gather_links(mesh: MechanismMesh, rest: tuple[np.ndarray, CurvedEdges] | None = None) -> list[LinkMesh]:
    """The mesh of every flexible link with its own numbering of interfaces, on every rank.

    Args:
        mesh: the mechanism's mesh.
        rest: positions of its vertices (vertices, dim) and its curved edges; as drawn by default.
    """
    points, curved = rest or (mesh.vertices, mesh.curved)
    interface = np.full(len(mesh.cells), FREE)
    topology = mesh.mesh.topology
    owned = topology.index_map(topology.dim).size_local
    for cells, numbers in mesh.mesh.comm.allgather((original_cells(mesh.mesh)[:owned], mesh.interface[:owned])):
        interface[cells] = numbers
    links = []
    for link in range(mesh.link_of_cell.max() + 1):
        mine = mesh.link_of_cell == link
        numbers = interface[mine]
        numbers[numbers != FREE] -= numbers[numbers != FREE].min(initial=np.iinfo(int).max)
        links.append(LinkMesh.from_cells(points, mesh.cells[mine].copy(), numbers, curved))
    return links


def _place_handles(mesh: LinkMesh, fit: SplineFit, *, spacing: float, turns: Sequence[bool], part: str) -> LinkHandles:
    """The handles of one link: at its joints and free ends, and at regular arc lengths of the spline between them.

    Those between that are in or next to an interface are left out.

    Args:
        mesh: the link's mesh.
        fit: its spline; sites are the interfaces of ``mesh``.
        spacing: arc length between handles, adjusted so that it divides each span evenly.
        turns: whether each site may turn, (sites,).
        part: the link, for messages.

    Raises:
        DescriptionError: the spline leaves the link.
    """
    spline, plan = fit.spline, plan_of(mesh).mesh
    samples = np.linspace(0.0, spline.segments, 1000 * spline.segments + 1)
    curve = spline.evaluate(spline.initial, samples)[:, :2]
    arc = chord_lengths(curve)
    held = plan.points[plan.cells[plan.interface != FREE]][..., :2]
    starts, ends = (held[:, corners].reshape(-1, 2) for corners in edge_corners(held.shape[1]).T)  # of held edges

    stops = [(float(at), site) for at, site in zip(np.flatnonzero(spline.is_joint), fit.sites, strict=True)]
    inside = np.interp([1e-6 * spacing, arc[-1] - 1e-6 * spacing], arc, samples)  # of the mesh, whatever the rounding
    if not spline.is_joint[0]:
        stops.insert(0, (float(inside[0]), BETWEEN))
    if not spline.is_joint[-1]:
        stops.append((float(inside[1]), BETWEEN))
    t, sites = [stops[0][0]], [stops[0][1]]
    for (start, _), (end, end_site) in pairwise(stops):
        a, b = np.interp([start, end], samples, arc)
        parts = max(2, round((b - a) / spacing))
        between = np.interp(np.linspace(a, b, parts + 1)[1:-1], arc, samples)
        for candidate, at in zip(between, spline.evaluate(spline.initial, between)[:, :2], strict=True):
            cells, _ = pierced(plan, at)
            if len(cells) == 0:
                where = ", ".join(f"{c:g}" for c in at)
                raise DescriptionError(
                    f"spline of {part}", f"it leaves the link at ({where})", "Give a centreline inside the link"
                )
            # a quarter of the spacing away from interfaces
            clear = distance_to_edges(starts, ends, at) > 0.25 * (b - a) / parts
            if clear and np.all(plan.interface[cells] == FREE):
                t.append(candidate)
                sites.append(BETWEEN)
        t.append(end)
        sites.append(end_site)
    site = np.array(sites)
    return LinkHandles(spline, np.array(t), site, (site != BETWEEN) & np.array(turns)[site])


def _mean_width(mesh: LinkMesh, length: float) -> float:
    """Area of the link in the plane over the length of its centreline."""
    plan = plan_of(mesh).mesh
    size = np.abs(cell_measures(plan.points, plan.cells)).sum()
    return size / length if plan.dim == 2 else size / length / np.ptp(plan.points[:, 2])


@dataclass(frozen=True, eq=False)
class _Piece:
    """One link of those with a shape, on this rank.

    Attributes:
        shape: number of the shape.
        link: index of the flexible link.
        matrix: Q, (2, 2).
        vertices: of the link in the whole mesh, (n,).
        reach: r_ij there, (n, handles, 3).
        nodes: local nodes of the link.
        local_reach: r_ij there.
    """

    shape: int
    link: int
    matrix: np.ndarray
    vertices: np.ndarray
    reach: np.ndarray
    nodes: np.ndarray
    local_reach: np.ndarray


class ShapeMap:
    """The shape of some links as a function of parameters p and handle positions θ, both link after link.

    Fields are arrays (local nodes, dim), nodes as in ``design.x.array``, ghosts last. Everything else is the same on
    all ranks. Links without a shape keep d = 0.

    Args:
        mesh: the mechanism's mesh.
        design: the design field d, vector P1, or P2 to bend edges too.
        shapes: the links that change, the same on all ranks.
        parameters: of their splines as functions of p.
        initial: p of the initial design, (parameters,).

    Attributes:
        owned: number of owned nodes.
        original: vertex of the whole mesh of every local node, of an edge's midpoint its lower end, (nodes,).
        pieces: all links with these shapes.
        of_link: parameters of the spline of each shape as functions of p.
        initial, initial_theta: p and θ (handles,) of the initial design.
    """

    def __init__(
        self,
        mesh: MechanismMesh,
        design: fem.Function,
        shapes: Sequence[LinkShape],
        parameters: Sequence[LinkParameters],
        initial: np.ndarray,
    ) -> None:
        self.mesh, self.design, self.shapes = mesh, design, tuple(shapes)
        ends = node_ends(design.function_space)
        self.original = ends[:, 0]
        self.owned = design.function_space.dofmap.index_map.size_local
        self.pieces = [
            self._piece(number, image, shape.handles, ends)
            for number, shape in enumerate(shapes)
            for image in shape.every
        ]
        handles = [shape.handles for shape in shapes]
        self.of_link, self.initial = tuple(parameters), initial
        self.initial_theta = np.concatenate([np.zeros(0), *(h.initial for h in handles)])
        self._theta_ends = np.cumsum([len(h) for h in handles], dtype=int)[:-1]

    def parameters(self, p: np.ndarray) -> list[np.ndarray]:
        """Parameters (size,) of the spline of each shape at the design ``p``."""
        return [own.of(p) for own in self.of_link]

    def positions(self, theta: np.ndarray) -> list[np.ndarray]:
        """``theta`` (…, handles) link by link."""
        return np.split(theta, self._theta_ends, axis=-1)[: len(self.shapes)]

    def field(self, p: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """d, (nodes, dim)."""
        return self.spread([shape.handles.transforms(*point) for shape, *point in self._links(p, theta)])

    def apply(self, p: np.ndarray, theta: np.ndarray) -> None:
        """Makes the design field hold d(p, θ)."""
        self.design.x.array[:] = self.field(p, theta).ravel()

    def apply_transpose(self, p: np.ndarray, theta: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The transpose of the derivatives of the field: g · ∂d/∂p (…, parameters) and g · ∂d/∂θ (…, handles).

        g: (…, owned nodes, dim), or (…, nodes, dim) with this rank's parts at nodes that others own; summed over all
        ranks.
        """
        by_p, by_theta = np.zeros((*g.shape[:-2], len(self.initial))), [np.zeros((*g.shape[:-2], 0))]
        links = zip(self._links(p, theta), self.of_link, self.moments(g), strict=True)
        for (shape, *point), own, moments in links:
            slope, theta_slope = shape.handles.gradients(*point)
            by_p += np.einsum("...jak,jakp->...p", moments, slope) @ own.matrix
            by_theta.append(np.einsum("...jak,jak->...j", moments, theta_slope))
        return by_p, np.concatenate(by_theta, axis=-1)

    def spread(self, transforms: Sequence[np.ndarray]) -> np.ndarray:
        """Σ_j T_j r_ij from the maps of each link's handles, (nodes, dim)."""
        d = np.zeros((len(self.original), self.mesh.vertices.shape[1]))
        for own in self.pieces:
            moved = np.tensordot(own.local_reach, transforms[own.shape], ((1, 2), (0, 2)))
            d[own.nodes, :2] = moved @ own.matrix.T
        return d

    def moments(self, g: np.ndarray) -> list[np.ndarray]:
        """The transpose of ``spread``: Σ_i g_i ⊗ r_ij of each handle, per shape (…, handles, 2, 3), over all ranks."""
        parts: list[Any] = [0.0] * len(self.shapes)
        for own in self.pieces:
            count = np.searchsorted(own.nodes, g.shape[-2])  # nodes are sorted
            back = g[..., own.nodes[:count], :2] @ own.matrix
            moments = np.tensordot(back, own.local_reach[:count], (-2, 0))  # (…, 2, handles, 3)
            parts[own.shape] = parts[own.shape] + np.moveaxis(moments, -2, -3)
        return self.sum_over_ranks(parts)

    def sum_over_ranks(self, parts: Sequence[np.ndarray]) -> list[np.ndarray]:
        """The sums over all ranks of arrays of any shapes, in one message."""
        total = np.concatenate([np.zeros(0), *(part.ravel() for part in parts)])
        self.mesh.mesh.comm.Allreduce(MPI.IN_PLACE, total)
        ends = np.cumsum([part.size for part in parts], dtype=int)[:-1]
        return [piece.reshape(part.shape) for piece, part in zip(np.split(total, ends), parts, strict=False)]

    def _links(self, p: np.ndarray, theta: np.ndarray):
        return zip(self.shapes, self.parameters(p), self.positions(theta), strict=True)

    def _piece(self, number: int, image: LinkImage, handles: LinkHandles, ends: np.ndarray) -> _Piece:
        mesh = self.mesh
        vertices = np.unique(mesh.cells[mesh.link_of_cell == image.link])
        reach = _reach(image.isometry.inverse.points(mesh.vertices[vertices]), image.weights, handles)
        nodes = np.flatnonzero(np.isin(self.original, vertices))
        local = _at_nodes(np.searchsorted(vertices, ends[nodes]), reach, image.edges, handles)
        return _Piece(number, image.link, image.isometry.matrix, vertices, reach, nodes, local)


def _reach(points: np.ndarray, weights: np.ndarray, handles: LinkHandles) -> np.ndarray:
    """r_ij = w_ij (X_i − X_j, 1), (n, handles, 3)."""
    arms = points[:, None, :2] - handles.centre
    return weights[..., None] * np.concatenate([arms, np.ones((*arms.shape[:2], 1))], axis=2)


def _at_nodes(ends: np.ndarray, reach: np.ndarray, edges: EdgeWeights, handles: LinkHandles) -> np.ndarray:
    """r_ij at nodes between the vertices ``ends`` (n, 2) of a link, from that at its vertices, (n, handles, 3)."""
    if np.array_equal(ends[:, 0], ends[:, 1]):
        return reach[ends[:, 0]]
    found, rows = 0.5 * (reach[ends[:, 0]] + reach[ends[:, 1]]), edge_rows(edges.ends, ends)
    found[rows >= 0] = _reach(edges.middles, edges.weights, handles)[rows[rows >= 0]]
    return found
