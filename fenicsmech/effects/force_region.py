"""Regions of flexible links that forces act on and displacements are averaged over.

A force F along a on a region R is a dead traction F a / |R|, or as much force per volume, of the drawn link. Its work,
in UFL,

    W = F a · ū,     ū = (1/|R|) ∫_R u dA,

is linear in u: ū = Σ w_i u_i with the weights w_i = ∂ū/∂u_i. They belong to the drawn link, so that the region moves
with the link's design and the resultant stays F: no weight depends on the design.

R may cut elements. There its indicator is replaced by its L² projection 1_R to the polynomials on the element, or the
facet, of the degree of u: for all v of that degree

    ∫ 1_R v dA = ∫_R v dA,

whatever the elements' size. A disc counts as the regular polygon of the same area. The part of a simplex in a
half-plane is divided into simplices: edges that cross its border are split there until none does. In curved elements
the border of R is drawn as if they were straight.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import basix
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from scipy.spatial import cKDTree

from fenicsmech.compat import cell_dofs, cellwise_space, compile_form
from fenicsmech.effects.link_fields import Boundary, Faces, LinkFields, exterior_facets, find_boundaries
from fenicsmech.elasticity import ElasticBody
from fenicsmech.errors import DescriptionError, point_text
from fenicsmech.mechanism import Face, FlexibleLink, Force, Output, Rectangle, Region
from fenicsmech.meshing import MechanismMesh, parts_of
from fenicsmech.multibody import LinkPoint

_CELLS = {2: basix.CellType.interval, 3: basix.CellType.triangle, 4: basix.CellType.tetrahedron}
_SECTORS = 48  # triangles of the polygon that a disc counts as; its chords are right to 0.15 %


def region_average(
    part: Force | Output, at: np.ndarray, mesh: MechanismMesh, body: ElasticBody, links: Sequence[FlexibleLink]
) -> LinkPoint:
    """ū of the region of a force or output at the drawn point ``at``, (dim,).

    Raises:
        DescriptionError: the region holds no part of its link, or the point is not on a flat face.
    """
    number, region, half = links.index(part.on), part.region, body.model.half
    if isinstance(region, Face):
        where, within = region.where, region.within
        if where is None:
            every = exterior_facets(mesh.mesh, half=half)
            where = _face_at(part, at, every.only(mesh.link[every.cells] == number), mesh.comm)
        faces = Faces(links[number], where)
        try:
            boundaries = find_boundaries(mesh.mesh, links, mesh.link, [faces], half=half)
        except DescriptionError as error:
            raise DescriptionError(f"{part.name!r}", error.problem, error.remedy) from None
        cells, corners = boundaries[faces].cells, boundaries[faces].sides
        area = LinkFields(tuple(links), body, boundaries).area_vector(body.drawn_gradient)
        density, measures = ufl.sqrt(ufl.dot(area, area)), boundaries[faces].measures
    else:
        within, measures = region, (body.dx,)
        cells = np.flatnonzero(mesh.link == number)
        corners = np.tile(np.arange(body.model.dim + 1), (len(cells), 1))
        density = ufl.det(body.drawn_gradient)
    if within is not None:
        places = mesh.corners(cells)[..., :2] - at[:2]
        density = density * _indicator(within, cells, corners, places, body)
    degree = 2 * body.order + (0 if body.bulge is None else body.model.dim)
    terms = [density * body.u[0] * measure(metadata={"quadrature_degree": degree}) for measure in measures]
    form = compile_form(ufl.derivative(sum(terms[1:], start=terms[0]), body.u))
    index, block = body.u.function_space.dofmap.index_map, body.u.function_space.dofmap.index_map_bs
    own = body.assembled(form)[::block]
    whole = mesh.comm.allreduce(float(own.sum()))
    if whole <= 0.0:
        problem = f"its region {region} at {point_text(at)} holds no part of link {part.on.name!r}"
        raise DescriptionError(f"{part.name!r}", problem, "Move or widen it")
    held = np.flatnonzero(np.abs(own) > 1e-14 * mesh.comm.allreduce(float(np.abs(own).max(initial=0.0)), op=MPI.MAX))
    found = mesh.comm.allgather((held + index.local_range[0], own[held] / whole))
    nodes, weights = (np.concatenate(values) for values in zip(*found, strict=True))
    return LinkPoint(nodes, weights)


def _face_at(
    part: Force | Output, at: np.ndarray, boundary: Boundary, comm: MPI.Comm
) -> Callable[[np.ndarray], np.ndarray]:
    """Predicate of the vertices of the flat face that ``at`` lies on: of the facets in its plane that join there."""
    places = boundary.places
    edges, arm = places[:, 1:] - places[:, :1], at - places[:, 0]
    along = np.linalg.solve(edges @ edges.transpose(0, 2, 1), (edges @ arm[..., None]))[..., 0]
    size = np.linalg.norm(edges, axis=2).max(axis=1)
    distance = np.linalg.norm(arm - np.einsum("fe,fed->fd", along, edges), axis=1)
    inside = np.minimum(along.min(axis=1), 1.0 - along.sum(axis=1)) >= -1e-6
    hit = np.flatnonzero(inside & (distance <= 1e-6 * size))
    across = edges[hit, 0, ::-1] * (1.0, -1.0) if len(at) == 2 else np.cross(edges[hit, 0], edges[hit, 1])
    normals = across / np.linalg.norm(across, axis=1)[:, None]
    found = comm.allgather((normals, size[hit]))
    normals, sizes = (np.concatenate(values) for values in zip(*found, strict=True))
    name, where = f"{part.name!r}", f"the point {point_text(at)}"
    remedy = "Move it into a flat face, or give Face(where=…)"
    if not len(normals):
        raise DescriptionError(name, f"{where} is not on a flat face of link {part.on.name!r}", remedy)
    if np.any(np.abs(normals @ normals[0]) < 1.0 - 1e-8):
        raise DescriptionError(name, f"{where} is where two faces of link {part.on.name!r} meet", remedy)
    near, there = 1e-6 * sizes[0], np.isin(np.arange(len(places)), hit)
    flat = (np.abs((places - at) @ normals[0]) <= near).all(axis=1)
    gathered = comm.allgather((boundary.corners[flat], places[flat], there[flat]))
    corners, places, there = (np.concatenate(values) for values in zip(*gathered, strict=True))
    parts = parts_of(corners)
    face = cKDTree(places[parts == parts[np.argmax(there)]].reshape(-1, len(at)))
    return lambda points: face.query(points, distance_upper_bound=2.0 * near)[0] <= near


def _indicator(
    region: Region, cells: np.ndarray, corners: np.ndarray, places: np.ndarray, body: ElasticBody
) -> fem.Function:
    """1_R on ``cells`` as a whole, or on their facets, which have some of their ``corners``, (cells, n).

    ``places`` are those of all corners of cells in the plane, from the centre of the region, (cells, dim + 1, 2).
    """
    space = cellwise_space(body.mesh, body.order)
    found, dofs = fem.Function(space, name="indicator"), cell_dofs(space)
    places, parts = np.take_along_axis(places, corners[..., None], axis=1), _convex_parts(region)
    normals, distances = (np.concatenate(values) for values in zip(*parts, strict=True))
    reach = 2.0 * distances.max()  # beyond all of the region
    near = np.flatnonzero(((places.min(axis=1) < reach) & (places.max(axis=1) > -reach)).all(axis=1))
    cells, corners = cells[near], corners[near]
    heights = distances - places[near] @ normals.T  # of corners over all sides, (cells, n, sides)
    heights[np.abs(heights) < 1e-12 * reach] = 0.0
    held = (heights[..., distances > 0.0] >= 0.0).all(axis=(1, 2))
    found.x.array[dofs[cells[held]]] = 1.0
    heights = heights.reshape(*corners.shape, *np.shape([sides for _, sides in parts]))
    reached = (heights > 0.0).any(axis=1).all(axis=2) & ~held[:, None]  # not beyond one side, (cells, parts)
    projections: dict[tuple[int, ...], _Projection] = {}
    for entity in np.flatnonzero(reached.any(axis=1)):
        own = tuple(corners[entity].tolist())
        if own not in projections:
            projections[own] = _Projection(own, body.model.dim, body.order)
        pieces = [_cut(heights[entity, :, part].T) for part in np.flatnonzero(reached[entity])]
        found.x.array[dofs[cells[entity]]] = projections[own].of_indicator(np.concatenate(pieces))
    return found


def _convex_parts(region: Region) -> list[tuple[np.ndarray, np.ndarray]]:
    """Outward normals (k, 2) and distances from the centre (k,) of the sides of convex parts: sectors of a disc."""
    if isinstance(region, Rectangle):
        turns = region.angle + 0.5 * math.pi * np.arange(4)
        return [(_directions(turns), 0.5 * np.array([region.length, region.width] * 2))]
    half = math.pi / _SECTORS
    inner = region.radius * math.sqrt(half / math.tan(half))
    turns = 2.0 * half * np.arange(_SECTORS)[:, None] + (0.0, half + 0.5 * math.pi, -half - 0.5 * math.pi)
    return [(_directions(three), np.array([inner, 0.0, 0.0])) for three in turns]


def _directions(angles: np.ndarray) -> np.ndarray:
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _cut(heights: np.ndarray) -> np.ndarray:
    """Simplices that make up the part of a simplex where no height is negative, (pieces, n, n) in barycentric
    coordinates, from the ``heights`` of its n corners over each side, (sides, n)."""
    pieces = np.eye(heights.shape[1])[None]
    for side in heights[heights.min(axis=1) < 0.0]:
        over = pieces @ side
        over[np.abs(over) < 1e-12 * np.abs(side).max()] = 0.0
        crossed = (over.min(axis=1) < 0.0) & (over.max(axis=1) > 0.0)
        while crossed.any():
            cut, heights_of = pieces[crossed], over[crossed]
            k, low, high = np.arange(len(cut)), heights_of.argmin(axis=1), heights_of.argmax(axis=1)
            share = heights_of[k, low] / (heights_of[k, low] - heights_of[k, high])
            middle = cut[k, low] + share[:, None] * (cut[k, high] - cut[k, low])
            parts, parts_over = [pieces[~crossed]], [over[~crossed]]
            for replaced in (low, high):
                part, part_over = cut.copy(), heights_of.copy()
                part[k, replaced], part_over[k, replaced] = middle, 0.0
                parts.append(part)
                parts_over.append(part_over)
            pieces, over = np.concatenate(parts), np.concatenate(parts_over)
            crossed = (over.min(axis=1) < 0.0) & (over.max(axis=1) > 0.0)
        pieces = pieces[over.max(axis=1) > 0.0]
    return pieces


class _Projection:
    """L² projection on a cell, or on the facet with some of its ``corners``, to the polynomials of a degree."""

    def __init__(self, corners: tuple[int, ...], dim: int, degree: int) -> None:
        self._corners = np.eye(dim + 1)[list(corners)]
        shape, family = _CELLS[dim + 1], basix.ElementFamily.P
        self._element = basix.create_element(family, shape, degree, basix.LagrangeVariant.gll_warped)
        points, weights = basix.make_quadrature(_CELLS[len(corners)], 2 * degree)
        self._points, self._weights = np.column_stack([1.0 - points.sum(axis=1), points]), weights / weights.sum()
        values = self._values(self._points)
        # on a facet the functions of all other nodes vanish, and their coefficients stay zero
        self._inverse = np.linalg.pinv(values.T * self._weights @ values, rcond=1e-10, hermitian=True)

    def of_indicator(self, pieces: np.ndarray) -> np.ndarray:
        """Coefficients of 1_R where R are ``pieces`` of the simplex, (pieces, n, n)."""
        values = self._values((self._points @ pieces).reshape(-1, pieces.shape[-1]))
        weights = np.outer(np.abs(np.linalg.det(pieces)), self._weights).ravel()
        return self._inverse @ (weights @ values)

    def _values(self, points: np.ndarray) -> np.ndarray:
        """All basis functions at points of the simplex, (points, functions)."""
        return self._element.tabulate(0, (points @ self._corners)[:, 1:])[0, :, :, 0]
