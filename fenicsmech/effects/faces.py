"""Parts of the boundaries of flexible links: their facets, and measures to integrate over them.

Facets are tagged by the set of requested parts they belong to, so that parts may overlap; facets of no part are not
tagged and cost nothing. Where only half of the links is meshed, its facets on the mid-plane do not count.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import ufl
from dolfinx import mesh as dmesh
from mpi4py import MPI

from fenicsmech.compat import cell_nodes, original_nodes
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import FlexibleLink
from fenicsmech.meshing import on_mid_plane


@dataclass(frozen=True)
class Faces:
    """The boundary of a flexible link, or part of it.

    Attributes:
        link: the link.
        where: from positions on the boundary of the drawn link, (n, dim), whether each is on the part, (n,); a facet
            belongs to the part if all its corners do. None for the whole boundary.
    """

    link: FlexibleLink
    where: Callable[[np.ndarray], np.ndarray] | None = None


@dataclass(frozen=True)
class Boundary:
    """``Faces`` on the reference mesh.

    Attributes:
        facets: this rank's facets.
        corners: numbers of their corners in the whole mesh, the same on all ranks, (facets, dim).
        joined: whether these lie on a mid-plane, where the boundary goes on in its mirror image, (facets, dim).
        measures: ufl measures whose sum covers them.
    """

    facets: np.ndarray
    corners: np.ndarray
    joined: np.ndarray
    measures: tuple[ufl.Measure, ...]

    def is_closed(self, comm: MPI.Comm) -> bool:
        """Whether the facets of all ranks together, with their mirror images, have no rim."""
        rims: Counter[tuple[int, ...]] = Counter()
        joined: set[int] = set()
        for found, mirrored in comm.allgather((self.corners, self.joined)):
            joined.update(found[mirrored].tolist())
            for facet in np.sort(found, axis=1).tolist():
                rims.update(combinations(facet, len(facet) - 1))
        return all(count % 2 == 0 or joined.issuperset(rim) for rim, count in rims.items())


def find_boundaries(
    mesh: dmesh.Mesh,
    links: Sequence[FlexibleLink],
    link_of_cell: np.ndarray,
    faces: Sequence[Faces],
    *,
    half: bool = False,
) -> dict[Faces, Boundary]:
    """The boundary of each of ``faces``.

    Args:
        mesh: the mesh of all links.
        links: all flexible links.
        link_of_cell: index of the link of each local cell, (cells,).
        faces: the parts asked for; without any nothing is made.
        half: the mesh is the half of the links above their mid-plane z = 0.

    Raises:
        DescriptionError: a part has no facet.
    """
    faces = tuple(dict.fromkeys(faces))
    if not faces:
        return {}
    facets, cells, opposite = _exterior_facets(mesh)
    owner, dim = link_of_cell[cells], mesh.geometry.dim
    corners = _corners(mesh, cells, opposite)
    places = mesh.geometry.x[corners.ravel(), :dim]
    numbers = original_nodes(mesh)[corners]
    joined = np.zeros_like(corners, dtype=bool)
    if half:
        joined = on_mid_plane(places, mesh.comm).reshape(joined.shape)
    within = np.zeros((len(facets), len(faces)), dtype=bool)
    for k, part in enumerate(faces):
        of_link = owner == links.index(part.link)
        within[:, k] = of_link & ~joined.all(axis=1)
        if part.where is not None:
            inside = _asked_together(mesh.comm, part.where, places[np.repeat(of_link, dim)])
            within[of_link, k] &= inside.reshape(-1, dim).all(axis=1)
    kinds = sorted(set().union(*mesh.comm.allgather({tuple(row) for row in within.tolist() if any(row)})))
    tag = {kind: number for number, kind in enumerate(kinds, start=1)}
    tags = np.array([tag.get(tuple(row), 0) for row in within.tolist()], dtype=np.int32)
    known = np.flatnonzero(tags)
    facet_tags = dmesh.meshtags(mesh, mesh.topology.dim - 1, facets[known], tags[known])
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=facet_tags)
    boundaries = {}
    for k, part in enumerate(faces):
        measures = tuple(ds(tag[kind]) for kind in kinds if kind[k])
        if not measures:
            raise DescriptionError(
                f"boundary of link {part.link.name!r}",
                "no facet has all its corners where the predicate says",
                "Widen it; it is asked about the drawn link, (n, dim)",
            )
        mine = within[:, k]
        boundaries[part] = Boundary(facets[mine], numbers[mine], joined[mine], measures)
    return boundaries


def _asked_together(comm: MPI.Comm, where: Callable[[np.ndarray], np.ndarray], places: np.ndarray) -> np.ndarray:
    """``where`` at this rank's ``places``; it sees those of all ranks, as it may compare them."""
    everywhere = comm.allgather(places)
    before = sum(len(others) for others in everywhere[: comm.rank])
    return np.asarray(where(np.concatenate(everywhere)), dtype=bool)[before : before + len(places)]


def cofactor(A):
    """det(A) A⁻ᵀ in UFL, by which facet normals times areas change under the gradient A of a map."""
    if A.ufl_shape == (2, 2):
        return ufl.as_matrix([[A[1, 1], -A[1, 0]], [-A[0, 1], A[0, 0]]])
    after = [(1, 2), (2, 0), (0, 1)]
    return ufl.as_matrix([[A[a, k] * A[b, m] - A[a, m] * A[b, k] for k, m in after] for a, b in after])


def _exterior_facets(mesh: dmesh.Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """This rank's facets on the boundary, ascending, the cell of each, and the cell's corner opposite to it."""
    topology, dim = mesh.topology, mesh.topology.dim
    topology.create_connectivity(dim - 1, dim)
    topology.create_connectivity(dim, dim - 1)
    facets = np.sort(dmesh.exterior_facet_indices(topology)).astype(np.int32)
    cells_of, facets_of = topology.connectivity(dim - 1, dim), topology.connectivity(dim, dim - 1)
    cells = np.array([cells_of.links(facet)[0] for facet in facets], dtype=np.int32)
    # simplices number their facets by the corner opposite
    pairs = zip(facets, cells, strict=True)
    opposite = np.array([np.flatnonzero(facets_of.links(cell) == facet)[0] for facet, cell in pairs], dtype=int)
    return facets, cells, opposite


def _corners(mesh: dmesh.Mesh, cells: np.ndarray, opposite: np.ndarray) -> np.ndarray:
    """Geometry nodes at the corners of the facets of ``cells`` opposite to their corner ``opposite``, (facets, dim)."""
    nodes = cell_nodes(mesh)[cells]
    others = nodes[np.arange(nodes.shape[1]) != opposite[:, None]]
    return others.reshape(len(cells), nodes.shape[1] - 1)
