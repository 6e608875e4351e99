"""The meshes of all flexible links as one distributed dolfinx mesh of disconnected components."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from fenicsmech.collective import from_one
from fenicsmech.compat import cell_dofs, cell_nodes, create_mesh, original_cells, original_nodes, vector_space
from fenicsmech.meshing.link_mesh import CurvedEdges, LinkMesh


@dataclass(frozen=True)
class MechanismMesh:
    """The reference mesh of all flexible links.

    Attributes:
        mesh: the distributed mesh; its coordinates change only while a file of the links at rest is written.
        link: index of the flexible link of each cell on this rank (ghosts last), (cells,).
        interface: index among all interfaces of the mechanism, −1 in free cells, (cells,).
        vertices, cells: the whole mesh as one array each, on every rank: (n, dim), (m, dim + 1).
        link_of_cell: index of the flexible link of each of ``cells``, (m,).
        curved: edges of the whole mesh that follow curves, on every rank.
        comm: the communicator; the mesh itself keeps a duplicate.
    """

    mesh: dmesh.Mesh
    link: np.ndarray
    interface: np.ndarray
    vertices: np.ndarray
    cells: np.ndarray
    link_of_cell: np.ndarray
    curved: CurvedEdges
    comm: MPI.Comm

    def corners(self, cells: np.ndarray) -> np.ndarray:
        """Corner coordinates of local ``cells``, (cells, dim + 1, dim)."""
        return self.mesh.geometry.x[cell_nodes(self.mesh)[cells]][..., : self.vertices.shape[1]]


def distribute(comm: MPI.Comm, link_meshes: Sequence[LinkMesh] | None, *, root: int = 0) -> MechanismMesh:
    """Distributes ``link_meshes`` (given on ``root`` only) over ``comm``; interfaces are numbered link after link."""
    vertices, cells, link, interface, curved = from_one(comm, lambda: _join(link_meshes or ()), root=root)
    dim = vertices.shape[1]
    if comm.rank == root:
        mesh = create_mesh(comm, cells, vertices)
    else:
        mesh = create_mesh(comm, np.zeros((0, dim + 1), np.int64), np.zeros((0, dim)))
    here = original_cells(mesh)
    return MechanismMesh(mesh, link[here], interface[here], vertices, cells, link, curved, comm)


def _join(link_meshes: Sequence[LinkMesh]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, CurvedEdges]:
    vertices, cells, links, interfaces, ends, bulges = [], [], [], [], [], []
    nodes = sites = 0
    for index, part in enumerate(link_meshes):
        vertices.append(part.points)
        cells.append(part.cells + nodes)
        links.append(np.full(len(part.cells), index))
        interfaces.append(np.where(part.interface >= 0, part.interface + sites, -1))
        ends.append(part.curved.ends + nodes)
        bulges.append(part.curved.bulges)
        nodes += len(part.points)
        sites += int(part.interface.max(initial=-1)) + 1
    return (
        np.concatenate(vertices),
        np.concatenate(cells).astype(np.int64),
        np.concatenate(links),
        np.concatenate(interfaces),
        CurvedEdges(np.concatenate(ends), np.concatenate(bulges)),
    )


def bulge_field(mesh: MechanismMesh) -> fem.Function | None:
    """c of curved cells (see ``link_mesh``) as a quadratic vector field; None if all edges are straight."""
    if not len(mesh.curved.ends):
        return None
    bulge = fem.Function(vector_space(mesh.mesh, 2), name="bulge")
    dim = mesh.vertices.shape[1]
    values, nodes = bulge.x.array.reshape(-1, dim), cell_dofs(bulge.function_space)
    found = mesh.curved.of_cells(original_nodes(mesh.mesh)[cell_nodes(mesh.mesh)])
    # edges of the reference simplex are numbered by the corners that they do not touch, from the last pair to the first
    order = len(list(combinations(range(dim + 1), 2))) - 1 - np.arange(found.shape[1])
    curved = np.flatnonzero(np.any(found != 0.0, axis=(1, 2)))
    values[nodes[curved, dim + 1 :]] = found[curved][:, order]
    return bulge


def on_mid_plane(points: np.ndarray, comm: MPI.Comm) -> np.ndarray:
    """Mask (n,) of this rank's ``points`` (n, 3) of half links that lie on their mid-plane."""
    height = comm.allreduce(float(points[:, 2].max(initial=0.0)), op=MPI.MAX)
    return points[:, 2] <= 1e-9 * height  # but for rounding
