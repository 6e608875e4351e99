"""The KKT matrix Gᵀ K̂ G in scaled unknowns.

The product over all unknowns is formed for those who ask for it. Others need no more than its stiffness by blocks of
nodes, its columns of poses, multipliers and force, and Pᵀ KKT P = (G P)ᵀ K̂ (G P) for a narrow P.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from petsc4py import PETSc

from fenicsmech.clock import Clock
from fenicsmech.elasticity import ElasticBody
from fenicsmech.equilibrium.control import Control
from fenicsmech.equilibrium.entry_copy import EntryCopy
from fenicsmech.equilibrium.extras import REGULARISATION
from fenicsmech.equilibrium.layout import Layout
from fenicsmech.equilibrium.unknowns import ScaledUnknowns


class KktMatrix:
    """K̂ and its products with G, whose patterns never change; all methods are collective.

    Products are of the K̂ last linearised, with the G of ``unknowns``: take them before either changes.

    Args:
        elastic: the flexible links.
        layout: numbering of rows and unknowns.
        unknowns: what rows and columns stand for.
        extended: K̂, with the pattern of all its entries.
        clock: where time is counted.

    Attributes:
        linearised: number of linearisations so far.
        extended: K̂, to which elastic stiffness may be added between ``tangent`` and ``linearise``.
    """

    def __init__(
        self, elastic: ElasticBody, layout: Layout, unknowns: ScaledUnknowns, extended: PETSc.Mat, *, clock: Clock
    ) -> None:
        self._elastic, self._layout, self._unknowns = elastic, layout, unknowns
        self.extended, self._clock = extended, clock
        # what shift and soften add to the diagonal
        self._added, self._shift, self._plain = unknowns.zeros(), 0.0, True
        self._entries: EntryCopy | None = None
        self._entries_diagonal: PETSc.Vec | None = None
        self._matrix: PETSc.Mat | None = None
        self._diagonal: PETSc.Vec | None = None
        self._extra_map: PETSc.Mat | None = None
        self._images: PETSc.Mat | None = None
        self._extra_columns: PETSc.Mat | None = None
        self._converted = self._entries_plain = self._formed = False
        self.linearised = 0

    def tangent(self) -> None:
        """Makes K̂ hold ∂²E/∂u² of the present fields, and nothing else."""
        with self._clock.phase("assemble"):
            self.extended.zeroEntries()
            self._elastic.tangent(self.extended)

    def linearise(self, entries: Iterable[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> None:
        """Takes the tangent that K̂ holds and the ``entries`` of its extras, without shift and softness."""
        with self._clock.phase("assemble"):
            self.extended.assemble()
            if self._layout.last:
                for rows, columns, block in entries:
                    # petsc4py reads transposed arrays in memory order
                    self.extended.setValues(
                        rows.astype(PETSc.IntType),
                        columns.astype(PETSc.IntType),
                        np.ascontiguousarray(block),
                        addv=PETSc.InsertMode.ADD,
                    )
            self.extended.assemble()
        self.linearised += 1
        self._converted = self._formed = False
        self._added.set(0.0)
        self._shift, self._plain = 0.0, True

    def matrix(self) -> PETSc.Mat:
        """The KKT matrix, the same object every time."""
        if not self._formed:
            with self._clock.phase("project"):
                self._matrix = self._by_entries(plain=True).ptap(self._unknowns.map, result=self._matrix)
                self._diagonal, self._formed = self._matrix.getDiagonal(), True
                self._raise_diagonal()
        return self._matrix

    def restricted(self, mapped: PETSc.Mat, result: PETSc.Mat | None = None) -> PETSc.Mat:
        """Pᵀ KKT P for G P, ``mapped``; into an earlier ``result``, if there is one."""
        with self._clock.phase("project"):
            return self._by_entries(plain=self._plain).ptap(mapped, result=result)

    def extra_columns(self) -> PETSc.Mat:
        """The columns of (z, λ, f), (unknowns, extras), the same object every time."""
        layout = self._layout
        with self._clock.phase("project"):
            rows = PETSc.IS().createStride(layout.local_rows, layout.first_row, 1, comm=layout.comm)
            extras = layout.extras if layout.last else 0
            columns = PETSc.IS().createStride(extras, layout.first_extra, 1, comm=layout.comm)
            self._extra_map = self._unknowns.map.createSubMatrix(rows, columns, self._extra_map)
            self._images = self._by_entries(plain=self._plain).matMult(self._extra_map, result=self._images)
            self._extra_columns = self._unknowns.map.transposeMatMult(self._images, result=self._extra_columns)
        return self._extra_columns

    def nodal_stiffness(self) -> PETSc.Mat:
        """A new matrix of the KKT matrix's rows and columns of free displacements, by blocks of nodes."""
        dim, free = self._layout.per_node, self._layout.free
        nodes = ((self._layout.first_row + free[::dim]) // dim).astype(PETSc.IntType)
        rows = PETSc.IS().createBlock(dim, nodes, comm=self._layout.comm)
        stiffness = self.extended.createSubMatrix(rows, rows)
        stiffness.scale(self._unknowns.unit_u**2)
        stiffness.shift(self._shift)
        return stiffness

    def shift(self, shift: float) -> None:
        """Makes the matrix hold ``shift`` · I more than it was assembled with, in the block of s."""
        layout, self._shift, self._plain = self._layout, shift, self._plain and shift == 0.0
        added = self._added.array_w
        added[: layout.free_displacements] = shift
        if layout.last:
            added[len(layout.free) :][layout.z] = shift
        if self._formed:
            self._raise_diagonal()

    def soften(self, softness: float, control: Control) -> None:
        """Makes the matrix hold −``softness`` · I instead of −ε · I in the block of multipliers.

        The force is one of them under a ``control`` that constrains. Before ``shift``, which makes it take effect.
        """
        self._plain = False
        if self._layout.last:
            extras = self._added.array_w[len(self._layout.free) :]
            extras[self._layout.multipliers] = REGULARISATION - softness
            if control.constrained:
                extras[self._layout.force] = -softness

    def _raise_diagonal(self) -> None:
        """Makes the whole matrix hold what was assembled and what is added to its diagonal."""
        if not self._plain:
            self._matrix.setDiagonal(self._diagonal + self._added)

    def _by_entries(self, *, plain: bool) -> PETSc.Mat:
        """K̂ by entries: ``plain``, or with what gives the KKT matrix the addition to its diagonal."""
        if self._entries is None:
            self._entries = EntryCopy(self.extended)
        entries = self._entries.matrix
        if not self._converted:
            self._entries.update()
            self._converted = self._entries_plain = True
        if plain and self._entries_plain:
            return entries
        if self._entries_plain:
            self._entries_diagonal = entries.getDiagonal()
        # where G holds one entry per row; rows of nodes inside interfaces have no diagonal
        layout, units = self._layout, self._unknowns.units
        rows = layout.free
        if layout.last:
            rows = np.concatenate([rows, layout.owned + np.arange(layout.extras)])
            units = np.concatenate([units, self._unknowns.scale])
        diagonal = self._entries_diagonal.array_r[rows]
        if not plain:
            diagonal = diagonal + self._added.array_r / units**2
        places = (layout.first_row + rows).astype(PETSc.IntType)
        starts = np.arange(len(rows) + 1, dtype=PETSc.IntType)
        entries.setValuesIJV(starts, places, diagonal, rowmap=places)
        entries.assemble()
        self._entries_plain = plain
        return entries
