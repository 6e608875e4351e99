"""Places where stress has no limit as elements shrink, recognised from the drawn links.

At re-entrant corners and edges of the outline, and where the rim of what a joint holds meets the surface, the stress of
linear elasticity is singular: its largest value grows with every refinement, and says nothing. So it does under a force
at a point. Each such place is left out of peaks up to a distance that does not depend on the elements, a fraction of
the thickness of the link there: the diameter of the largest ball inside the link that touches the surface beside the
place. Source of the ball: Ma, Bae & Choi (doi:10.1007/s00371-011-0594-7).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from fenicsmech.errors import point_text, set_options
from fenicsmech.meshing import CurvedEdges, parts_of
from fenicsmech.stress.recovery import shape_functions, shape_slopes


@dataclass(frozen=True)
class SingularityOptions:
    """Numbers of singular places.

    Attributes:
        corner: least turn of a re-entrant corner, rad; below, the outline counts as smooth. Edges of eight segments a
            circle turn by 0.03 with curved elements.
        reach: of a place, in thicknesses of the link there.
        least_reach: the same in lengths of the elements there, in the plane.
        least_reach_in_space: likewise.
    """

    corner: float = 0.25
    reach: float = 0.25
    least_reach: float = 0.5
    least_reach_in_space: float = 1.0

    def __post_init__(self) -> None:
        set_options(self, "singular places")


@dataclass(frozen=True, eq=False)
class SingularPlace:
    """A place where stress has no limit.

    Attributes:
        name: as "re-entrant corner at (1, 2)" or "rim of 'clamp'".
        link: name of the link.
        points: drawn points of it, (n, dim).
        reach: the distance up to which stresses are left out.
    """

    name: str
    link: str
    points: np.ndarray
    reach: float

    def __repr__(self) -> str:
        return f"<SingularPlace: {self.name} on {self.link!r}, up to {self.reach:.3g} from it>"

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Mask (m,) of drawn ``points`` (m, dim) within reach."""
        return cKDTree(self.points).query(points, distance_upper_bound=self.reach * (1.0 + 1e-9))[0] <= self.reach


@dataclass(frozen=True, eq=False)
class Facets:
    """Facets of some cells on the boundary of a part of the mesh.

    Attributes:
        cells: of each, (facets,).
        opposite: the corner of the cell that is not on it, (facets,).
        corners: numbers of its vertices, ascending, (facets, dim).
    """

    cells: np.ndarray
    opposite: np.ndarray
    corners: np.ndarray

    @classmethod
    def around(cls, cells: np.ndarray, chosen: np.ndarray) -> Facets:
        """The boundary of the cells in a mask (m,) of ``cells`` (m, dim + 1)."""
        own, size = np.flatnonzero(chosen), cells.shape[1]
        corners = np.concatenate([np.sort(np.delete(cells[own], k, axis=1), axis=1) for k in range(size)])
        _, first, counts = np.unique(corners, axis=0, return_index=True, return_counts=True)
        single = np.sort(first[counts == 1])
        return cls(np.tile(own, size)[single], np.repeat(np.arange(size), len(own))[single], corners[single])

    def only(self, kept: np.ndarray) -> Facets:
        """Those in a mask."""
        return Facets(self.cells[kept], self.opposite[kept], self.corners[kept])

    def shared(self, others: Facets) -> np.ndarray:
        """Mask (facets,) of those that are among ``others``, of other cells too."""
        both = np.concatenate([others.corners, self.corners])
        _, number = np.unique(both, axis=0, return_inverse=True)
        number = number.reshape(-1)
        return np.isin(number[len(others.corners) :], number[: len(others.corners)])

    def values_of(self, values: np.ndarray, others: Facets) -> np.ndarray:
        """Of ``values`` of these, one each, those of ``others``, which are among these, of other cells too."""
        both = np.concatenate([self.corners, others.corners])
        _, first = np.unique(both, axis=0, return_inverse=True)
        row = np.zeros(int(first.max(initial=0)) + 1, dtype=int)
        first = first.reshape(-1)
        row[first[: len(self.corners)]] = np.arange(len(self.corners))
        return values[row[first[len(self.corners) :]]]

    def barycentric(self, places: np.ndarray) -> np.ndarray:
        """Barycentric coordinates in the cells of points with those on facets, (facets, p, dim + 1)."""
        size = places.shape[1] + 1
        table = np.stack([np.insert(places, k, 0.0, axis=1) for k in range(size)])
        return table[self.opposite]

    def geometry(self, nodes: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points and outward unit normals at barycentric coordinates (facets, p, dim + 1), (facets, p, dim) each.

        Args:
            nodes: of all cells, linear or quadratic, (m, nodes per cell, dim).
            corners: the coordinates.
        """
        own = nodes[self.cells]
        points = shape_functions(corners, own.shape[1]) @ own
        slopes = own[:, None].transpose(0, 1, 3, 2) @ shape_slopes(corners, own.shape[1])
        size = corners.shape[-1]
        on_facet = np.array([np.delete(np.arange(size), k) for k in range(size)])[self.opposite]
        along = np.take_along_axis(slopes, on_facet[:, None, None, :], axis=3)
        tangents = along[..., 1:] - along[..., :1]
        if size == 3:
            normals = np.stack([tangents[..., 1, 0], -tangents[..., 0, 0]], axis=-1)
        else:
            normals = np.cross(tangents[..., 0], tangents[..., 1])
        inward = np.take_along_axis(slopes, self.opposite[:, None, None, None], axis=3)[..., 0] - along[..., 0]
        normals *= -np.sign(np.einsum("fpd,fpd->fp", normals, inward))[..., None]
        return points, normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def curved_nodes(points: np.ndarray, cells: np.ndarray, curved: CurvedEdges) -> np.ndarray:
    """Quadratic nodes of ``cells`` with curved edges, corners first, (m, nodes, dim)."""
    corners = points[cells]
    i, j = np.transpose(list(combinations(range(cells.shape[1]), 2)))
    middles = 0.5 * (corners[:, i] + corners[:, j]) + curved.of_cells(cells)
    return np.concatenate([corners, middles[:, ::-1]], axis=1)


def thicknesses(points: np.ndarray, normals: np.ndarray, surface: np.ndarray) -> np.ndarray:
    """Diameters of the largest balls inside ``surface`` that touch it at ``points`` with outward ``normals``, (n,).

    Args:
        points: on the surface, (n, dim).
        normals: unit vectors there, (n, dim).
        surface: points all over it, (m, dim).
    """
    tree, radius = cKDTree(surface), np.full(len(points), np.linalg.norm(np.ptp(surface, axis=0)))
    for _ in range(30):
        # the ball shrinks until its centre p − r n is as near to no other point as to p
        _, nearest = tree.query(points - radius[:, None] * normals)
        arm = points - surface[nearest]
        height, square = np.einsum("nd,nd->n", arm, normals), np.einsum("nd,nd->n", arm, arm)
        smaller = (height > 1e-9 * radius) & (square < 2.0 * radius * height * (1.0 - 1e-9))
        if not smaller.any():
            break
        radius[smaller] = square[smaller] / (2.0 * height[smaller])
    return 2.0 * radius


class PlaceFinder:
    """Finds the singular places of links.

    Args:
        nodes: quadratic nodes of all cells, (m, nodes, dim).
        cells: vertices of all cells, (m, dim + 1).
        link: number of the link of each cell, (m,).
        surface: facets of cells that can deform, on the boundary of the links.
        outside: all facets on the boundary of the links, where nothing is cut by symmetry.
        rims: facets between cells that can deform and those that joints hold.
        options: of the places.
    """

    def __init__(
        self,
        nodes: np.ndarray,
        cells: np.ndarray,
        link: np.ndarray,
        surface: Facets,
        outside: Facets,
        rims: Facets,
        options: SingularityOptions,
    ) -> None:
        self._nodes, self._cells, self._link, self._options = nodes, cells, link, options
        self._surface, self._rims = surface, rims
        self._dim = cells.shape[1] - 1
        middle = np.full((1, self._dim), 1.0 / self._dim)
        self._middles, self._normals = (own[:, 0] for own in surface.geometry(nodes, surface.barycentric(middle)))
        fine = lattice(self._dim, 4)
        self._outside, self._outer = outside.geometry(nodes, outside.barycentric(fine))[0], link[outside.cells]
        ends = nodes[surface.cells][:, : self._dim + 1]
        self._sizes = np.linalg.norm(ends[:, 1:] - ends[:, :1], axis=2).max(axis=1)

    def corners(self, names: Sequence[str]) -> Iterator[SingularPlace]:
        """Re-entrant corners, in space edges, of links with ``names``."""
        ridges, pairs = self._ridges()
        turned = self._turns(ridges, pairs) > self._options.corner
        ridges, pairs = ridges[turned], pairs[turned]
        parts = parts_of(ridges)
        for chosen in (np.flatnonzero(parts == part) for part in np.unique(parts)):
            facets = np.unique(pairs[chosen])
            points = self._spread(self._vertices(ridges[chosen]))
            at = points[np.argmin(np.abs(points - points.mean(axis=0)).sum(axis=1))]
            name = f"re-entrant {'corner' if self._dim == 2 else 'edge'} at {point_text(at)}"
            yield self._place(name, names[self._link[self._surface.cells[facets[0]]]], points, facets)

    def rims(self, names: Sequence[str], joints: Sequence[str], holders: np.ndarray) -> Iterator[SingularPlace]:
        """Rims of interfaces; ``joints`` are their names, ``holders`` the interface at each facet of the rims."""
        for holder in np.unique(holders):
            rim = self._rims.only(holders == holder)
            ends = np.flatnonzero(np.isin(self._surface.corners, rim.corners).any(axis=1))
            if not len(ends):
                continue  # inside the link
            fine = lattice(self._dim, 4)
            points = rim.geometry(self._nodes, rim.barycentric(fine))[0].reshape(-1, self._dim)
            yield self._place(f"rim of {joints[holder]!r}", names[self._link[rim.cells[0]]], points, ends)

    def point(self, name: str, link: int, names: Sequence[str], at: np.ndarray) -> SingularPlace:
        """The point of a force on a link."""
        own = np.flatnonzero(self._link[self._surface.cells] == link)
        near = own[np.argsort(np.linalg.norm(self._middles[own] - at, axis=1))[:2]]
        return self._place(name, names[link], at[None], near)

    def _place(self, name: str, link: str, points: np.ndarray, facets: np.ndarray) -> SingularPlace:
        """The place with the thickness of the link at some facets of its surface."""
        options, sizes = self._options, self._sizes[facets]
        own = self._outside[self._outer == self._link[self._surface.cells[facets[0]]]]
        inside = thicknesses(self._middles[facets], self._normals[facets], own.reshape(-1, self._dim))
        least = options.least_reach if self._dim == 2 else options.least_reach_in_space
        reach = max(options.reach * float(np.median(inside)), least * float(np.median(sizes)))
        return SingularPlace(name, link, points, reach)

    def _ridges(self) -> tuple[np.ndarray, np.ndarray]:
        """Entities in which two facets of the surface meet: vertex numbers (k, dim − 1), and both facets, (k, 2)."""
        corners, dim = self._surface.corners, self._dim
        every = np.concatenate([np.delete(corners, k, axis=1) for k in range(dim)])
        owner = np.tile(np.arange(len(corners)), dim)
        order = np.lexsort(every.T[::-1])
        every, owner = every[order], owner[order]
        same = np.flatnonzero((every[1:] == every[:-1]).all(axis=1))
        return every[same], np.column_stack([owner[same], owner[same + 1]])

    def _turns(self, ridges: np.ndarray, pairs: np.ndarray) -> np.ndarray:
        """Angles by which the surface turns at ridges, positive where it is re-entrant, (k,)."""
        normals, inward = [], []
        for side in (0, 1):
            facets = Facets(*(own[pairs[:, side]] for own in vars(self._surface).values()))
            vertices = self._cells[facets.cells]
            on_ridge = (vertices[:, :, None] == ridges[:, None, :]).any(axis=2)
            weights = on_ridge / on_ridge.sum(axis=1, keepdims=True)
            own = self._nodes[facets.cells]
            slopes = own.transpose(0, 2, 1) @ shape_slopes(weights, own.shape[1])
            _, normal = facets.geometry(self._nodes, weights[:, None])
            # from the ridge to the third corner of the facet, in the facet
            apex = ~on_ridge
            apex[np.arange(len(apex)), facets.opposite] = False
            arm = np.einsum("kdc,kc->kd", slopes, apex - weights)
            if self._dim == 3:
                first, last = np.argmax(on_ridge, axis=1), 3 - np.argmax(on_ridge[:, ::-1], axis=1)
                k = np.arange(len(first))
                along = slopes[k, :, last] - slopes[k, :, first]
                along /= np.linalg.norm(along, axis=1, keepdims=True)
                arm -= np.einsum("kd,kd->k", arm, along)[:, None] * along
            normals.append(normal[:, 0])
            inward.append(arm / np.linalg.norm(arm, axis=1, keepdims=True))
        one, other = inward
        return np.arctan2(np.einsum("kd,kd->k", normals[0], other), -np.einsum("kd,kd->k", one, other))

    def _vertices(self, numbers: np.ndarray) -> np.ndarray:
        """Places of vertices of the surface, (*numbers.shape, dim)."""
        cells = self._surface.cells
        table = dict(zip(self._cells[cells].ravel().tolist(), np.repeat(cells, self._dim + 1).tolist(), strict=True))
        flat = numbers.ravel()
        owners = np.array([table[vertex] for vertex in flat.tolist()], dtype=int)
        corner = np.argmax(self._cells[owners] == flat[:, None], axis=1)
        return self._nodes[owners, corner].reshape(*numbers.shape, self._dim)

    def _spread(self, ridges: np.ndarray) -> np.ndarray:
        """Points along ridges, (k, dim − 1, dim)."""
        return np.unique((lattice(self._dim - 1, 4) @ ridges).reshape(-1, self._dim), axis=0)


def lattice(corners: int, parts: int) -> np.ndarray:
    """Barycentric coordinates of the lattice with so many parts a side on a simplex, (p, corners)."""
    found = [(*own, parts - sum(own)) for own in np.ndindex(*(parts + 1,) * (corners - 1)) if sum(own) <= parts]
    return np.array(found, dtype=float).reshape(-1, corners) / parts
