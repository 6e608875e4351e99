"""Small meshes on all ranks of a communicator, every cell and node known by its position."""

from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import create_mesh, original_cells, vector_space

from ..plot.grids import box, rectangle


@dataclass(frozen=True)
class SharedMesh:
    """A mesh and a field on it.

    Attributes:
        u: a displacement field.
        corners: corner coordinates of all cells of the mesh, on every rank, (cells, dim + 1, dim).
        here: positions in ``corners`` of the cells on this rank, (local cells,).
    """

    u: fem.Function
    corners: np.ndarray
    here: np.ndarray

    @property
    def dim(self) -> int:
        return self.corners.shape[2]

    @property
    def nodes(self) -> np.ndarray:
        """Positions of the nodes of u on this rank, ghosts last, (n, dim)."""
        return self.u.function_space.tabulate_dof_coordinates()[:, : self.dim]

    @property
    def values(self) -> np.ndarray:
        """Nodal values of u on this rank, a view, (n, dim)."""
        return self.u.x.array.reshape(-1, self.dim)


def shared_mesh(dim: int, *, order: int, comm: MPI.Comm = MPI.COMM_WORLD) -> SharedMesh:
    """Cells without any regularity in a box of sides 3, 2 (and 1), with a field of ``order`` on it."""
    points, cells = rectangle(6, 4, 3.0, 2.0) if dim == 2 else box(4, 3, 2, (3.0, 2.0, 1.0))
    sides = np.array([3.0, 2.0, 1.0])[:dim]
    shift = np.random.default_rng(3).uniform(-0.1, 0.1, points.shape)
    points = points + np.where((points < 1e-9) | (points > sides - 1e-9), 0.0, shift)
    given = (cells, points) if comm.rank == 0 else (cells[:0], points[:0])
    mesh = create_mesh(comm, given[0].astype(np.int64), given[1])
    return SharedMesh(fem.Function(vector_space(mesh, order)), points[cells], original_cells(mesh))


def barycentric(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Barycentric coordinates of points (n, dim) in one cell (dim + 1, dim), (n, dim + 1)."""
    rest = np.linalg.solve((corners[1:] - corners[0]).T, (points - corners[0]).T).T
    return np.column_stack([1.0 - rest.sum(axis=1), rest])
