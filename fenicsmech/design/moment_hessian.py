"""The Hessian of a sum over cells, seen by the maps of the handles: ∂²/∂T_j∂T_k = Σ_il r_ij ⊗ H_il ⊗ r_lk.

H is the Hessian in the design field. Vertices that all handles move alike (those on one column of an extruded link)
are added up first, which leaves little to multiply.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from fenicsmech.design.shape_map import ShapeMap


class MomentHessian:
    """Reduces Hessians in the design field to the maps of the handles.

    Args:
        shape_map: the map from handles to the field.
        hessian: a matrix with the pattern of all that will be reduced (collective).
    """

    def __init__(self, shape_map: ShapeMap, hessian: PETSc.Mat) -> None:
        self._map = shape_map
        # class of each vertex of the whole mesh, −1 where no handle moves it; two unknowns (x, y) per class
        classes = np.full(len(shape_map.mesh.vertices), -1)
        self._arms, self._unknowns, first = [], [], 0
        for vertices, reach in zip(shape_map.vertices, shape_map.reach, strict=True):
            rows, inverse = np.unique(reach.reshape(len(reach), -1), axis=0, return_inverse=True)
            classes[vertices] = first + inverse.ravel()
            self._arms.append(_arms(rows.reshape(-1, *reach.shape[1:])))
            self._unknowns.append(slice(2 * first, 2 * (first + len(rows))))
            first += len(rows)
        self._find_slots(hessian, classes, 2 * first)

    def reduce(self, hessian: PETSc.Mat) -> list[np.ndarray]:
        """∂²/∂T∂T per link, (handles, 2, 3, handles, 2, 3) (collective)."""
        values = hessian.getValuesCSR()[2][self._kept]
        self._sum.data = np.bincount(self._slots, weights=values, minlength=self._sum.nnz)
        blocks = []
        for mine, arms in zip(self._unknowns, self._arms, strict=True):
            handles = arms.shape[1] // 6
            block = arms.T @ (self._sum[mine, mine] @ arms)
            blocks.append(block.reshape(handles, 2, 3, handles, 2, 3))
        return self._map.sum_over_ranks(blocks)

    def _find_slots(self, hessian: PETSc.Mat, classes: np.ndarray, size: int) -> None:
        """Where each entry of the owned rows goes in the matrix between classes."""
        dim = self._map.mesh.vertices.shape[1]
        original = self._map.original[: self._map.owned]
        starts, columns, _ = hessian.getValuesCSR()
        rows = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        # the global numbering runs through the owned nodes, rank after rank
        everywhere = np.concatenate(hessian.comm.tompi4py().allgather(original))
        row_class, column_class = classes[original[rows // dim]], classes[everywhere[columns // dim]]
        self._kept = (rows % dim < 2) & (columns % dim < 2) & (row_class >= 0) & (column_class >= 0)
        keys = (2 * row_class + rows % dim) * size + 2 * column_class + columns % dim
        used, self._slots = np.unique(keys[self._kept], return_inverse=True)
        self._sum = csr_matrix((np.zeros(len(used)), np.divmod(used, size)), shape=(size, size))


def _arms(reach: np.ndarray) -> np.ndarray:
    """∂d/∂T from r (classes, handles, 3), (2 classes, 6 handles)."""
    count, handles, _ = reach.shape
    arms = np.zeros((count, 2, handles, 2, 3))
    arms[:, 0, :, 0] = arms[:, 1, :, 1] = reach
    return arms.reshape(2 * count, 6 * handles)
