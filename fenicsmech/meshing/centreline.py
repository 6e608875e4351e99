"""Centreline and thickness of a link that is known by its outline, measured on the curves of the outline itself.

The centreline halves its chords. At a station x, with the unit tangent τ and normal n of the centreline, the chord

    from x − r₋ n to x + r₊ n,     with its ends on the outline,

has r₋ = r₊, and the link is t = r₋ + r₊ thick. The search begins at the medial axis, the edges inside the link of the
Voronoi diagram of points on its outline; the path on them from joint to joint, or on to a free end, is moved to the
middles of its chords until it lies there. Chords end at roots of (C(u) − x) · τ on the curves C of the outline: neither
thickness nor centreline depend on a mesh. Holes count as filled.

Some chords do not measure a width that could change, and take the thickness of those next to them: chords in
interfaces, in the eyes of pins (the largest discs about joints inside the link), and those that end where the outline
runs across the link rather than along it, as at the rounding of an end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.interpolate import BSpline
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import Voronoi, cKDTree

from fenicsmech.errors import DescriptionError, MeshingError, point_text
from fenicsmech.mechanism import Centreline, MeshPart, Shape, Strip
from fenicsmech.meshing.link_mesher import InterfaceSite
from fenicsmech.meshing.outline import Curve, link_outline, points_on, sample_parameters, sampled
from fenicsmech.polygons import are_inside, chord_lengths, distance_to, divided, strip_width


@dataclass(frozen=True)
class CentrelineSearch:
    """Options of the search.

    Attributes:
        sampled: largest distance of the polygon that brackets roots from the outline, over the link's width.
        seeds: distance of the points of the Voronoi diagram, over the width.
        across: least outline between the two feet of a medial disc over their distance. In corners and round ends,
            into which the medial axis runs off, it is less than 1.6; at the tip of a wedge of 60° it is 2.
        spacings: of the stations over the width, one after the other: the path from the diagram is rough, and where a
            link tapers, roughness on less than a width grows from move to move.
        moves: maximum number of moves to the middles of chords at each spacing.
        settled: last move over the width.
        halved: largest distance of the centreline from the middles of its chords, over the width.
    """

    sampled: float = 2e-3
    seeds: float = 0.15
    across: float = 2.0
    spacings: tuple[float, ...] = (2.0, 1.0, 0.5)
    moves: int = 60
    settled: float = 1e-11
    halved: float = 1e-3


SEARCH = CentrelineSearch()


@dataclass(frozen=True, eq=False)
class Chords:
    """Chords of an outline through some points; NaN where there is none.

    Attributes:
        left, right: distances of the ends to the left and the right of the chord's normal, (n,).
        fixed: whether the chord does not measure a width that could change, (n,).
    """

    left: np.ndarray
    right: np.ndarray
    fixed: np.ndarray


class LinkOutline:
    """The outline of a link.

    Args:
        loop: the curves around it.
        sites: its interfaces.

    Attributes:
        polygon: with its vertices on the outline, (m, 2).
        width: that of a long strip of the same area and perimeter.
    """

    def __init__(self, loop: Sequence[Curve], sites: Sequence[InterfaceSite]) -> None:
        self._loop, self.sites = tuple(loop), tuple(sites)
        self.width = strip_width(sampled(loop, math.inf))
        parameters = [sample_parameters(curve, SEARCH.sampled * self.width) for curve in loop]
        self._curve = np.repeat(np.arange(len(loop)), [len(own) - 1 for own in parameters])
        self._bent = np.array([not isinstance(curve, BSpline) or curve.k > 1 for curve in loop])[self._curve]
        self._from, self._to = (
            np.concatenate([own[part] for own in parameters]) for part in (slice(None, -1), slice(1, None))
        )
        self.polygon = self._points(np.arange(len(self._curve)), self._from)

    def eye(self, at: np.ndarray) -> float:
        """Radius of the largest disc about a point (2,) inside the link."""
        return distance_to(self.polygon, at)

    def chords(self, points: np.ndarray, tangents: np.ndarray) -> Chords:
        """The chords through ``points`` (n, 2) across unit ``tangents`` (n, 2)."""
        normals = np.column_stack([-tangents[:, 1], tangents[:, 0]])
        (left, edge, foot), (right, other, opposite) = (self._ray(points, side * normals) for side in (1.0, -1.0))
        edges = np.roll(self.polygon, -1, axis=0) - self.polygon
        edges /= np.linalg.norm(edges, axis=1, keepdims=True)
        fixed = np.isnan(left + right)
        for site in self.sites:
            centre = site.centre[:2]
            fixed |= site.contains(points, 0.0)
            for feet in (foot, opposite):
                # a hundredth more: the polygon, and outlines that are polygons themselves
                fixed |= np.linalg.norm(feet - centre, axis=1) <= 1.01 * self.eye(centre)
        for ends in (edge, other):
            fixed |= np.abs(np.sum(edges[ends] * tangents, axis=1)) < math.sqrt(0.5)
        return Chords(left, right, fixed)

    def end_along(self, point: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """The point (2,) where a ray leaves the link."""
        return point + self._ray(point[None], direction[None])[0] * direction

    def thickness(self, points: np.ndarray, tangents: np.ndarray, *, part: str) -> np.ndarray:
        """t at ``points`` (n, 2), which follow each other along the link, with unit ``tangents`` (n, 2), (n,).

        Raises:
            DescriptionError: no chord measures a free width.
        """
        chords = self.chords(points, tangents)
        free = ~chords.fixed
        if not free.any():
            raise DescriptionError(part, "interfaces and eyes cover its centreline", "Make its interfaces smaller")
        arc = chord_lengths(points)
        return np.interp(arc, arc[free], (chords.left + chords.right)[free])

    def _ray(self, points: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Distance to the first crossing of each ray with the outline, NaN if there is none, its edge and its place."""
        across = np.column_stack([directions[:, 1], -directions[:, 0]])
        from_points = self.polygon[None] - points[:, None]  # (rays, vertices, 2)
        side, reach = (np.einsum("nmc,nc->nm", from_points, axis) for axis in (across, directions))
        next_side, next_reach = (np.roll(values, -1, axis=1) for values in (side, reach))
        with np.errstate(divide="ignore", invalid="ignore"):
            fraction = side / (side - next_side)
        reach = reach + fraction * (next_reach - reach)
        crosses = (np.sign(side) != np.sign(next_side)) & (reach > 1e-9 * self.width)
        edge = np.argmin(np.where(crosses, reach, np.inf), axis=1)
        rows = np.arange(len(points))
        at = self._from[edge] + fraction[rows, edge] * (self._to - self._from)[edge]
        bent = np.flatnonzero(self._bent[edge] & crosses[rows, edge])
        at[bent] = self._roots(edge[bent], points[bent], across[bent], side[rows, edge][bent] < 0.0)
        feet = self._points(edge, at)
        found = np.sum((feet - points) * directions, axis=1)
        return np.where(crosses.any(axis=1), found, np.nan), edge, feet

    def _roots(self, edges: np.ndarray, points: np.ndarray, across: np.ndarray, rises: np.ndarray) -> np.ndarray:
        """Parameters of the curves between the ends of ``edges`` (k,) where (C − x) · τ changes its sign, (k,)."""
        low, high = self._from[edges], self._to[edges]
        for _ in range(52):  # bisection to the last digit
            middle = 0.5 * (low + high)
            before = (np.sum((self._points(edges, middle) - points) * across, axis=1) < 0.0) == rises
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        return 0.5 * (low + high)

    def _points(self, edges: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Points (k, 2) of the curves that ``edges`` (k,) of the polygon follow."""
        places = np.empty((len(edges), 2))
        for number in np.unique(self._curve[edges]):
            own = self._curve[edges] == number
            places[own] = points_on(self._loop[number], parameters[own])
        return places


def find_centreline(
    outline: LinkOutline, reach: Sequence[float], ends: Sequence[Sequence[float]] | None = None, *, part: str = "link"
) -> np.ndarray:
    """Points of the centreline of a link, in order, (n, 2); the interpolating spline is the centreline.

    It runs from joint to joint. Where the link runs on beyond the last joint by more than twice its width there, and
    twice as far as the joint's interface reaches, the centreline runs on to a free end.

    Args:
        outline: of the link.
        reach: how far the interface of each joint extends from it, (joints,).
        ends: points where it begins and ends instead.
        part: the link, for messages.

    Raises:
        DescriptionError: the link branches off between its joints, is no longer than it is wide, has a neck too narrow
            for the search, or no line halves its chords.
    """
    path, open_ends = _medial_path(outline, reach, ends, part=part)
    for spacing in SEARCH.spacings:
        points = _halve_chords(outline, path, open_ends, spacing, part=part)
        curve = Centreline(points)
        path = curve.evaluate(curve.samples(64))
    return points


def thinnest_stretch(name: str, shape: Shape, sites: Sequence[InterfaceSite], *, dim: int, length: float) -> float:
    """Thickness in the plane of the thinnest stretch of a link that is as long as ``length`` and in no interface.

    That is the largest thickness along it; infinite if there is no such stretch, if a solid has no section or no
    centreline in the plane, or if the link is a mesh, whose elements are given. Local.
    """
    if isinstance(shape, Strip):
        return shape.thickness
    if isinstance(shape, MeshPart):
        return math.inf
    try:
        outline = LinkOutline(link_outline(name, shape, dim=dim), sites)
        curve = Centreline(find_centreline(outline, [site.reach for site in sites], part=f"link {name!r}"))
    except (DescriptionError, MeshingError):
        return math.inf
    stations = np.linspace(0.0, curve.end, 401)
    points = curve.evaluate(stations)
    chords = outline.chords(points, curve.tangent(stations))
    thickness = np.where(chords.fixed, np.inf, chords.left + chords.right)
    step = chord_lengths(points)[-1] / (len(points) - 1)
    window = min(max(1, round(length / step)), len(points))
    return float(sliding_window_view(thickness, window).max(axis=1).min())


def _halve_chords(
    outline: LinkOutline, path: np.ndarray, open_ends: tuple[bool, bool], spacing: float, *, part: str
) -> np.ndarray:
    """Points of the line near ``path`` (n, 2) that halves its chords; ends that are not free stay."""
    width, far = outline.width, np.inf
    points = divided(path, spacing * width, least=3)
    for _ in range(SEARCH.moves):
        curve = Centreline(points, part=f"centreline of {part}")
        tangents = curve.tangent(curve.knots)
        inset = np.zeros((len(points), 1))  # a chord through the very end of a link may miss its sides
        inset[0], inset[-1] = 1e-3 * width * open_ends[0], -1e-3 * width * open_ends[1]
        chords = outline.chords(points + inset * tangents, tangents)
        normals = np.column_stack([-tangents[:, 1], tangents[:, 0]])
        moved = points + np.where(chords.fixed, 0.0, 0.5 * (chords.left - chords.right))[:, None] * normals
        kept = ~chords.fixed
        kept[[0, -1]] = True
        free = np.flatnonzero(~chords.fixed)
        for end, outward in ((0, -1.0), (-1, 1.0)):
            if open_ends[end] and len(free):
                last = free[end]
                start = moved[last] - outward * 1e-3 * width * tangents[last] * (not chords.fixed[end])
                moved[end] = outline.end_along(start, outward * tangents[last])
        far = float(np.linalg.norm(moved - points, axis=1).max()) if kept.all() else np.inf
        points = moved[kept]
        if len(points) < 3:
            raise DescriptionError(part, "eyes and interfaces cover all of its length", "Give centreline=…")
        if far <= SEARCH.settled * width:
            break
    if not far <= SEARCH.halved * width:
        raise DescriptionError(part, "no line halves the chords of its outline", "Give centreline=…, points along it")
    return points


def _medial_path(
    outline: LinkOutline, reach: Sequence[float], ends: Sequence[Sequence[float]] | None, *, part: str
) -> tuple[np.ndarray, tuple[bool, bool]]:
    """The path (n, 2) on the medial axis from end to end of a link, and whether each is a free end."""
    axis, joints = MedialAxis.of(outline, part=part), np.array([site.centre[:2] for site in outline.sites])
    if ends is not None:
        given = np.array(ends, dtype=float)
        first, last = axis.nearest(given)
        return np.vstack([given[:1], axis.path(first, last, part=part), given[1:]]), (False, False)
    at = axis.nearest(joints)
    distance = axis.distances(at)
    outer = divmod(int(np.argmax(np.triu(distance[:, at]))), len(at))  # the joints farthest apart
    if len(at) > 1:
        terminals, free, seen = [int(at[joint]) for joint in outer], [False, False], distance[list(outer)]
    else:  # from the joint to the farthest end
        tip = int(axis.central[np.argmax(distance[0, axis.central])])
        terminals, free = [int(at[0]), tip], [False, True]
        seen = axis.distances(np.array(terminals))
    for end in (0, 1):
        if free[end]:
            continue
        eye, own, other = outline.eye(joints[outer[end]]), seen[end], seen[1 - end]
        # beyond the joint, as seen from the other end; the joint may be off the axis
        beyond = axis.central[other[axis.central] >= other[terminals[end]] + own[axis.central] - eye]
        tip = int(beyond[np.argmax(own[beyond])]) if len(beyond) else terminals[end]
        if own[tip] + axis.radius[tip] > 2.0 * max(2.0 * eye, reach[outer[end]]):
            terminals[end], free[end] = tip, True
    path = axis.path(*terminals, part=part)
    for end in (0, 1):
        if not free[end]:
            path[-end] = joints[outer[end]]
            continue
        inner = min(3, len(path) - 1)
        out = path[-end] - path[-1 - inner if end else inner]
        tip_point = outline.end_along(path[-end], out / np.linalg.norm(out))
        path = np.insert(path, len(path) * end, tip_point, axis=0)
    for site in outline.sites:
        away = np.linalg.norm(path - site.centre[:2], axis=1)
        if away.min() > outline.width + outline.eye(path[np.argmin(away)]):
            raise DescriptionError(
                part,
                f"the joint {site.name!r} at {point_text(site.centre[:2])} is on a branch off its longest part",
                "Give centreline=…, points along the link",
            )
    return path, (free[0], free[1])


@dataclass(frozen=True, eq=False)
class MedialAxis:
    """Centres of the discs inside a link that touch its outline twice.

    Attributes:
        nodes: the centres, (n, 2).
        radius: of the discs, (n,).
        central: numbers of those between sides of the link, not in its corners.
        graph: lengths of the edges between nodes, (n, n).
    """

    nodes: np.ndarray
    radius: np.ndarray
    central: np.ndarray
    graph: csr_matrix

    @staticmethod
    def of(outline: LinkOutline, *, part: str) -> MedialAxis:
        """The medial axis of a link."""
        seeds, place, around = _seeds(outline.polygon, SEARCH.seeds * outline.width)
        diagram = Voronoi(seeds)
        inside = are_inside(outline.polygon, diagram.vertices)
        edges = np.array(diagram.ridge_vertices)
        kept = np.all(edges >= 0, axis=1) & np.all(inside[edges], axis=1)
        edges, feet = edges[kept], diagram.ridge_points[kept]
        along = np.abs(np.diff(place[feet], axis=1)[:, 0])
        along = np.minimum(along, around - along)
        apart = np.linalg.norm(np.diff(seeds[feet], axis=1)[:, 0], axis=1)
        nodes = diagram.vertices
        central = np.unique(edges[along > SEARCH.across * apart])
        if not len(central):
            raise DescriptionError(part, "it is no longer than it is wide", "Give centreline=…, points along the link")
        radius = np.zeros(len(nodes))
        radius[edges] = np.linalg.norm(nodes[edges] - seeds[feet[:, :1]], axis=2)
        # vertices of a disc that touches in many points lie on each other
        near = cKDTree(nodes).query_pairs(0.1 * SEARCH.seeds * outline.width, output_type="ndarray")
        near = near[np.all(inside[near], axis=1)]
        pairs = np.concatenate([edges, near])
        lengths = np.maximum(np.linalg.norm(np.diff(nodes[pairs], axis=1)[:, 0], axis=1), 1e-12 * around)
        graph = csr_matrix((lengths, pairs.T), shape=(len(nodes),) * 2)
        return MedialAxis(nodes, radius, central, graph.maximum(graph.T))

    def nearest(self, points: np.ndarray) -> np.ndarray:
        """Numbers of the nodes between sides next to ``points`` (k, 2), (k,)."""
        return self.central[cKDTree(self.nodes[self.central]).query(points)[1]]

    def distances(self, starts: np.ndarray) -> np.ndarray:
        """Distances along the axis from the nodes ``starts`` (k,) to all nodes, (k, n)."""
        return dijkstra(self.graph, directed=False, indices=starts)

    def path(self, start: int, end: int, *, part: str) -> np.ndarray:
        """The nodes on the path from one to another, (k, 2).

        Raises:
            DescriptionError: there is no path: in a narrow neck the points on the outline are too far apart.
        """
        _, before = dijkstra(self.graph, directed=False, indices=start, return_predecessors=True)
        way = [end]
        while way[-1] != start:
            way.append(int(before[way[-1]]))
            if way[-1] < 0:
                raise DescriptionError(part, "its medial axis is cut at a narrow neck", "Give centreline=…, through it")
        return self.nodes[way[::-1]].copy()


def _seeds(polygon: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Points (n, 2) on a polygon, its corners among them, their places along it (n,), and its perimeter."""
    ends = np.roll(polygon, -1, axis=0)
    lengths = np.linalg.norm(ends - polygon, axis=1)
    counts = np.maximum(1, np.ceil(lengths / spacing)).astype(int)
    parts = [np.arange(count)[:, None] / count for count in counts]
    points = np.concatenate([a + part * (b - a) for a, b, part in zip(polygon, ends, parts, strict=True)])
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    places = np.concatenate(
        [start + part[:, 0] * own for start, own, part in zip(starts, lengths, parts, strict=False)]
    )
    return points, places, float(starts[-1])
