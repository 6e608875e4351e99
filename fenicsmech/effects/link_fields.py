"""Fields and boundaries of flexible links, in which the energies of effects are written.

Facets of boundaries are tagged by the set of requested parts they belong to, so that parts may overlap; facets of no
part are not tagged and cost nothing. Where only half of the links is meshed, its facets on the mid-plane do not count.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from fenicsmech.compat import cell_nodes, original_nodes
from fenicsmech.elasticity import ElasticBody
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import FlexibleLink
from fenicsmech.meshing import on_mid_plane

_TILTED = 0.25  # sine of an angle that facets with their corners on a cylinder stay below


@dataclass(frozen=True)
class Faces:
    """The boundary of a flexible link, or part of it.

    Attributes:
        link: the link.
        where: predicate of points on the drawn boundary, (n, dim) → (n,) bool; a facet belongs to the part if it holds
            at all its corners. None for the whole boundary.
    """

    link: FlexibleLink
    where: Callable[[np.ndarray], np.ndarray] | None = None


@dataclass(frozen=True)
class Boundary:
    """``Faces`` on the reference mesh.

    Attributes:
        facets: this rank's facets.
        cells: the cell of each.
        sides: which corners of their cells are theirs, (facets, dim).
        corners: numbers of these in the whole mesh, the same on all ranks, (facets, dim).
        places: of these, (facets, dim, dim).
        joined: whether these lie on a mid-plane, where the boundary continues in its mirror image, (facets, dim).
        measures: ufl measures whose sum covers them.
    """

    facets: np.ndarray
    cells: np.ndarray
    sides: np.ndarray
    corners: np.ndarray
    places: np.ndarray
    joined: np.ndarray
    measures: tuple[ufl.Measure, ...] = ()

    def only(self, kept: np.ndarray, measures: tuple[ufl.Measure, ...] = ()) -> Boundary:
        """The facets in a mask, with the measures of these."""
        facets, cells, sides, corners, places, joined = (
            values[kept] for values in (self.facets, self.cells, self.sides, self.corners, self.places, self.joined)
        )
        return Boundary(facets, cells, sides, corners, places, joined, measures)

    def is_closed(self, comm: MPI.Comm) -> bool:
        """True if the facets of all ranks together, with their mirror images, have no rim."""
        rims: Counter[tuple[int, ...]] = Counter()
        joined: set[int] = set()
        for found, mirrored in comm.allgather((self.corners, self.joined)):
            joined.update(found[mirrored].tolist())
            for facet in np.sort(found, axis=1).tolist():
                rims.update(combinations(facet, len(facet) - 1))
        return all(count % 2 == 0 or joined.issuperset(rim) for rim, count in rims.items())

    def is_extruded(self, comm: MPI.Comm) -> bool:
        """True if the facets of all ranks, in space, are parallel to z or across it, up to the tilt on curved sides."""
        a, b, c = np.moveaxis(self.places, 1, 0)
        areas = np.cross(b - a, c - a)
        sizes = np.linalg.norm(areas, axis=1)
        aslant = np.minimum(np.abs(areas[:, 2]), np.linalg.norm(areas[:, :2], axis=1)) > _TILTED * sizes
        return not comm.allreduce(bool(aslant.any()), op=MPI.LOR)


@dataclass(frozen=True, eq=False)
class LinkFields:
    """Fields that the link energy of one effect is written in.

    Attributes:
        links: all flexible links.
        body: the links as one body.
        boundaries: the parts of links' boundaries that effects list.
        numbers: that designs may change, by name: the name in ``ElasticBody.numbers``, which links have it, (links,),
            and its drawn value.
    """

    links: tuple[FlexibleLink, ...]
    body: ElasticBody
    boundaries: Mapping[Faces, Boundary]
    numbers: dict[str, tuple[str, np.ndarray, float]] = field(default_factory=dict)

    @property
    def u(self) -> fem.Function:
        """Displacement field."""
        return self.body.u

    @property
    def order(self) -> int:
        """Degree of u."""
        return self.body.order

    @property
    def dim(self) -> int:
        """Dimension of the mesh."""
        return self.body.model.dim

    @property
    def mesh(self) -> dmesh.Mesh:
        """The reference mesh."""
        return self.body.mesh

    @property
    def position(self):
        """x = X + u, the positions of material points."""
        return self.body.rest + self.u

    def cellwise(self, per_link: Sequence[float] | np.ndarray) -> fem.Function:
        """A field with one value per cell from one value per link, (links,)."""
        return self.body.cellwise(per_link)

    def number(self, name: str, value: float, links: Sequence[FlexibleLink] | None = None) -> fem.Function:
        """A field with a value on some links, all by default, and zero elsewhere, which designs may change by name.

        Args:
            name: of the effect's attribute.
            value: of that attribute; factors belong outside the field.
            links: that have it.

        Raises:
            DescriptionError: the energy has such a field already.
        """
        if name in self.numbers:
            raise DescriptionError(
                f"number {name!r} of an effect",
                "its energy makes this field twice",
                "Make it once, for all links that have it, and use the field again",
            )
        chosen = np.array([links is None or link in links for link in self.links])
        known = f"{name}, number {len(self.body.numbers)}"  # other effects may use the same name
        self.numbers[name] = known, chosen, value
        self.body.numbers[known] = self.cellwise(value * chosen)
        return self.body.numbers[known]

    def integral(self, density, *, degree: int) -> ufl.Form:
        """∫ density dV over the links at rest, their depth included; ``degree`` of ``density``.

        In curved cells det(∇X) is a polynomial too, of degree dim.
        """
        whole = degree if self.order == 1 else degree + self.dim
        volume = ufl.det(self.body.rest_gradient) * self._depth
        return density * volume * self.body.dx(metadata={"quadrature_degree": whole})

    def boundary_integral(self, density, faces: Faces, *, degree: int) -> ufl.Form:
        """∫ density dA over ``faces`` of the links at rest, their depth included.

        By Nanson's formula dA = |det(∇X) (∇X)⁻ᵀ N| dA₀.
        """
        area = self.area_vector(self.body.rest_gradient)
        return self._reference_integral(density * ufl.sqrt(ufl.dot(area, area)), faces, degree)

    def flux(self, vector, faces: Faces, *, degree: int, within_plane: bool = False) -> ufl.Form:
        """∫ vector · n da over ``faces`` of the links as deformed, their depth at rest included.

        n points out of the link. By Nanson's formula n da = cof(∇X + ∇u) N dA₀. ``within_plane`` leaves out what
        moves along z, u = (u_x, u_y, 0).
        """
        rest, moved = self.body.rest_gradient, self.body.rest_gradient + ufl.grad(self.u)
        rows = [rest if within_plane and k == 2 else moved for k in range(self.dim)]
        area = self.area_vector(ufl.as_matrix([[rows[k][k, m] for m in range(self.dim)] for k in range(self.dim)]))
        return self._reference_integral(ufl.dot(vector, area), faces, degree)

    @property
    def _depth(self):
        """Factor from integrals over the mesh to those over the links: their depth, or 2 for half models."""
        return self.body.model.multiplier(self.body.depth)

    def area_vector(self, A):
        """det(A) A⁻ᵀ N in UFL: the facet normal times area after a map of the reference mesh with the gradient A."""
        if self.dim == 2:
            cofactor = ufl.as_matrix([[A[1, 1], -A[1, 0]], [-A[0, 1], A[0, 0]]])
        else:
            after = [(1, 2), (2, 0), (0, 1)]
            minors = [[A[a, k] * A[b, m] - A[a, m] * A[b, k] for k, m in after] for a, b in after]
            cofactor = ufl.as_matrix(minors)
        return ufl.dot(cofactor, ufl.FacetNormal(self.mesh))

    def _reference_integral(self, density, faces: Faces, degree: int) -> ufl.Form:
        """∫ density dA₀ over ``faces`` of the reference mesh, times the depth."""
        measures = self.boundaries[faces].measures
        terms = [density * self._depth * ds(metadata={"quadrature_degree": degree}) for ds in measures]
        return sum(terms[1:], start=terms[0])


def find_boundaries(
    mesh: dmesh.Mesh,
    links: Sequence[FlexibleLink],
    link_of_cell: np.ndarray,
    faces: Sequence[Faces],
    *,
    half: bool = False,
) -> dict[Faces, Boundary]:
    """The boundary of each of ``faces`` of ``links``, from the index of the link of each local cell, (cells,).

    Where the mesh is ``half`` of the links, it is the one above their mid-plane z = 0. No faces cost nothing.

    Raises:
        DescriptionError: a part has no facet.
    """
    faces = tuple(dict.fromkeys(faces))
    if not faces:
        return {}
    every, dim = exterior_facets(mesh, half=half), mesh.geometry.dim
    owner = link_of_cell[every.cells]
    within = np.zeros((len(every.facets), len(faces)), dtype=bool)
    for k, part in enumerate(faces):
        of_link = owner == links.index(part.link)
        within[:, k] = of_link
        if part.where is not None:
            inside = _on_all_ranks(mesh.comm, part, every.places[of_link].reshape(-1, dim))
            within[of_link, k] &= inside.reshape(-1, dim).all(axis=1)
    kinds = sorted(set().union(*mesh.comm.allgather({tuple(row) for row in within.tolist() if any(row)})))
    tag = {kind: number for number, kind in enumerate(kinds, start=1)}
    tags = np.array([tag.get(tuple(row), 0) for row in within.tolist()], dtype=np.int32)
    known = np.flatnonzero(tags)
    facet_tags = dmesh.meshtags(mesh, mesh.topology.dim - 1, every.facets[known], tags[known])
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=facet_tags)
    boundaries = {}
    for k, part in enumerate(faces):
        measures = tuple(ds(tag[kind]) for kind in kinds if kind[k])
        if not measures:
            raise DescriptionError(
                f"boundary of link {part.link.name!r}",
                "no facet has all its corners where the predicate says",
                "Widen it; it receives points of the drawn link, (n, dim)",
            )
        boundaries[part] = every.only(within[:, k], measures)
    return boundaries


def _on_all_ranks(comm: MPI.Comm, faces: Faces, places: np.ndarray) -> np.ndarray:
    """The predicate of ``faces`` at this rank's ``places``, called with those of all ranks, as it may compare them.

    All ranks refuse it alike where it is not one of rows.
    """
    assert faces.where is not None
    everywhere = comm.allgather(places)
    points = np.concatenate(everywhere)
    inside = np.asarray(faces.where(points))
    if inside.shape != points.shape[:1] or inside.dtype != bool:
        raise DescriptionError(
            f"boundary of link {faces.link.name!r}",
            f"the predicate gives {inside.dtype} of shape {inside.shape} for points of shape {points.shape}",
            "Points are rows, unlike those of dolfinx, and a boolean is wanted for each: lambda x: x[:, 0] > 5",
        )
    before = sum(len(others) for others in everywhere[: comm.rank])
    return inside[before : before + len(places)]


def exterior_facets(mesh: dmesh.Mesh, *, half: bool) -> Boundary:
    """This rank's facets on the boundary of the links, ascending, without measures; those on a mid-plane are inside."""
    topology, dim = mesh.topology, mesh.topology.dim
    topology.create_connectivity(dim - 1, dim)
    topology.create_connectivity(dim, dim - 1)
    facets = np.sort(dmesh.exterior_facet_indices(topology)).astype(np.int32)
    cells_of, facets_of = topology.connectivity(dim - 1, dim), topology.connectivity(dim, dim - 1)
    cells = cells_of.array[cells_of.offsets[facets]]
    # simplices number their facets by the corner opposite
    others = facets_of.array.reshape(-1, dim + 1)[cells] != facets[:, None]
    sides = np.nonzero(others)[1].reshape(-1, dim)
    nodes = np.take_along_axis(cell_nodes(mesh)[cells], sides, axis=1)
    places = mesh.geometry.x[nodes][..., :dim]
    joined = np.zeros_like(nodes, dtype=bool)
    if half:
        joined = on_mid_plane(places.reshape(-1, dim), mesh.comm).reshape(joined.shape)
    every = Boundary(facets, cells, sides, original_nodes(mesh)[nodes], places, joined)
    return every.only(~joined.all(axis=1))
