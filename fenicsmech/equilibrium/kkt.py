"""The KKT matrix K = Gᵀ K̂ G in scaled unknowns.

K̂ is the Hessian of the Lagrangian by all degrees of freedom, those on interfaces too, the "extended matrix", E the
total energy of links and effects,

    K̂ = [[∂²E/∂u², 0    , 0   , −a_u],
         [0       , B    , −Aᵀ , −a_z],
         [0       , −A   , −ε−c, 0   ],
         [−a_uᵀ   , −a_zᵀ, 0   , 0   ]]

and G the map from the scaled unknowns. K̂ is stored by blocks of one node each, which speeds assembly up; products of
sparse matrices need a copy by entries. The product over all unknowns is formed on demand. Two-level solvers need only
its stiffness by blocks of nodes, its columns of the border, and Pᵀ K P = (G P)ᵀ K̂ (G P) for a narrow P.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from fenicsmech.compat import stored_values
from fenicsmech.elasticity import ElasticBody
from fenicsmech.equilibrium.border import REGULARISATION, Entries
from fenicsmech.equilibrium.control import Control
from fenicsmech.equilibrium.unknowns import Numbering, ScaledUnknowns
from fenicsmech.log import Clock


class KktMatrix:
    """K̂ and its products with G, whose patterns never change.

    Products are of the K̂ last linearised, with the G of ``unknowns``: take them before either changes.

    Attributes:
        version: number of linearisations and shifts so far.
        extended: K̂, to which elastic stiffness may be added between ``set_stiffness`` and ``linearise``.
    """

    def __init__(
        self, elastic: ElasticBody, numbering: Numbering, unknowns: ScaledUnknowns, extended: PETSc.Mat, *, clock: Clock
    ) -> None:
        self._elastic, self._numbering, self._unknowns = elastic, numbering, unknowns
        self._rows, self._blocks = numbering.rows, numbering.unknowns
        self.extended, self._clock, self.version = extended, clock, 0
        # the summand of shift and soften on the diagonal, and whether that is zero
        self._added, self._plain = unknowns.zeros(), True
        # K̂ by entries: its copy, whether it is up to date, its diagonal, and whether that is without the summand
        self._entries: EntryCopy | None = None
        self._converted, self._entries_plain = False, False
        self._entries_diagonal = PETSc.Vec()
        # the whole matrix, whether it is up to date, and its diagonal without the summand
        self._matrix, self._formed, self._diagonal = PETSc.Mat(), False, PETSc.Vec()
        # G of the border, K̂ G of it, Gᵀ K̂ G of it
        self._border_map, self._images, self._border_columns = PETSc.Mat(), PETSc.Mat(), PETSc.Mat()

    def set_stiffness(self) -> None:
        """Sets K̂ to ∂²E/∂u² of the present fields."""
        with self._clock.phase("assemble"):
            self.extended.zeroEntries()
            self._elastic.add_stiffness(self.extended)

    def linearise(self, entries: Entries) -> None:
        """Adds the ``entries`` of the border to the stiffness in K̂, without shift and softness."""
        with self._clock.phase("assemble"):
            self.extended.assemble()
            if self._rows.last:
                for rows, columns, block in entries:
                    # petsc4py reads transposed arrays in memory order
                    self.extended.setValues(
                        rows.astype(PETSc.IntType),
                        columns.astype(PETSc.IntType),
                        np.ascontiguousarray(block),
                        addv=PETSc.InsertMode.ADD,
                    )
            self.extended.assemble()
        self.version += 1
        self._converted = self._formed = False
        self._added.set(0.0)
        self._plain = True

    def shift(self, shift: float, *, weighted: bool = False) -> None:
        """Sets the δ = ``shift`` of the δI added to the matrix in displacements and poses, or δM, M their weights."""
        self.version += 1
        self._plain = self._plain and shift == 0.0
        parts = self._blocks.restrict(self._added.array_w)
        nodes, poses = self._unknowns.shift_weights if weighted else (1.0, 1.0)
        parts.nodes[:], parts.poses[:] = shift * nodes, shift * poses
        del parts  # gives the vector's values back
        if self._formed:
            self._add_to_diagonal()

    def soften(self, softness: float, control: Control) -> None:
        """Replaces −ε · I by −``softness`` · I in the multipliers, from the next ``shift`` on.

        The load is a multiplier under a constrained ``control``.
        """
        self._plain = False
        parts = self._blocks.restrict(self._added.array_w)
        parts.multipliers[:] = REGULARISATION - softness
        if control.constrained:
            parts.load[:] = -softness

    def matrix(self) -> PETSc.Mat:
        """The KKT matrix, the same object every time."""
        if not self._formed:
            with self._clock.phase("project"):
                self._matrix = self._by_entries(plain=True).ptap(self._unknowns.map, result=self._matrix)
                self._diagonal, self._formed = self._matrix.getDiagonal(), True
                self._add_to_diagonal()
        return self._matrix

    def restricted(self, mapped: PETSc.Mat, result: PETSc.Mat | None = None) -> PETSc.Mat:
        """Pᵀ K P from G P (``mapped``), into an earlier ``result`` if given."""
        with self._clock.phase("project"):
            return self._by_entries(plain=self._plain).ptap(mapped, result=result)

    def border_columns(self) -> PETSc.Mat:
        """The columns of (z, λ, f), (unknowns, border), the same object every time."""
        with self._clock.phase("project"):
            rows = PETSc.IS().createStride(self._rows.local, self._rows.links.first, 1, comm=self._rows.comm)
            columns = self._blocks.border.index_set()
            self._border_map = self._unknowns.map.createSubMatrix(rows, columns, self._border_map)
            self._images = self._by_entries(plain=self._plain).matMult(self._border_map, result=self._images)
            self._border_columns = self._unknowns.map.transposeMatMult(self._images, result=self._border_columns)
        return self._border_columns

    def nodal_stiffness(self) -> PETSc.Mat:
        """A new matrix of the block of nodes, stored by blocks of one node each."""
        per_node, free = self._numbering.per_node, self._numbering.free
        nodes = ((self._rows.nodes.first + free[::per_node]) // per_node).astype(PETSc.IntType)
        rows = PETSc.IS().createBlock(per_node, nodes, comm=self._rows.comm)
        stiffness = self.extended.createSubMatrix(rows, rows)
        stiffness.scale(self._unknowns.unit_u**2)
        if not self._plain:
            diagonal = stiffness.getDiagonal()
            diagonal.array_w[:] += self._blocks.restrict(self._added.array_r).nodes
            stiffness.setDiagonal(diagonal)
        return stiffness

    def _add_to_diagonal(self) -> None:
        """Adds shift and softness to the assembled diagonal."""
        if not self._plain:
            self._matrix.setDiagonal(self._diagonal + self._added)

    def _by_entries(self, *, plain: bool) -> PETSc.Mat:
        """K̂ by entries: ``plain``, or with the entries that add shift and softness to the KKT matrix."""
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
        border = self._rows.border.local
        rows = np.concatenate([self._numbering.free, np.arange(border.start, border.stop)])
        diagonal = self._entries_diagonal.array_r[rows]
        if not plain:
            diagonal = diagonal + self._added.array_r / self._unknowns.units**2
        places = (self._rows.links.first + rows).astype(PETSc.IntType)
        starts = np.arange(len(rows) + 1, dtype=PETSc.IntType)
        entries.setValuesIJV(starts, places, diagonal, rowmap=places)
        entries.assemble()
        self._entries_plain = plain
        return entries


def create_extended_matrix(
    elastic: ElasticBody, numbering: Numbering, pattern: Iterable[tuple[np.ndarray, np.ndarray]]
) -> PETSc.Mat:
    """K̂ with the finite-element pattern and that of the border: (global rows, global columns) of full blocks.

    Holds ∂²E/∂(u, p)² of the current fields.
    """
    fem = elastic.create_stiffness()
    elastic.add_stiffness(fem)
    fem.assemble()
    starts, columns, values = fem.getValuesCSR()
    lgmap = fem.getLGMap()
    fem.destroy()  # large, and not needed any more

    rows, shape = numbering.rows, (numbering.rows.local, numbering.rows.size)
    # rows of the border are empty so far
    starts = np.concatenate([starts, np.full(rows.local - rows.links.count, starts[-1])])
    places = np.hstack([np.stack(np.meshgrid(*block, indexing="ij")).reshape(2, -1) for block in pattern])
    own = places[:, (places[0] >= rows.links.first) & (places[0] < rows.links.first + rows.local)]
    own[0] -= rows.links.first
    # entries of the border count 2, those of finite elements 1: odd sums are where the values are
    structure = csr_matrix((np.ones(len(values), dtype=int), columns, starts), shape)
    structure += csr_matrix((np.full(own.shape[1], 2), own), shape)
    structure.sort_indices()
    filled = np.zeros(structure.nnz)
    filled[structure.data % 2 == 1] = values

    size = numbering.block
    blocks = csr_matrix((filled, structure.indices, structure.indptr), shape).tobsr((size, size))
    matrix = PETSc.Mat().createBAIJ(
        [(rows.local, rows.size), (rows.local, rows.size)],
        size,
        csr=(blocks.indptr.astype(PETSc.IntType), blocks.indices.astype(PETSc.IntType), blocks.data),
        comm=rows.comm,
    )
    matrix.setLGMap(*lgmap)
    matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_LOCATION_ERR, True)
    return matrix


class EntryCopy:
    """A matrix by entries that follows one ``blocked`` by nodes, whose pattern does not change any more.

    PETSc's conversion searches for the place of each entry every time, which is slow compared with the assembly. Here
    it is called once, with the numbers of the entries as values; from then on values are copied in that order.

    Attributes:
        matrix: its copy by entries, valid after an ``update``.
    """

    def __init__(self, blocked: PETSc.Mat) -> None:
        self._blocked, self.matrix = blocked, PETSc.Mat()
        kept = [values.copy() for values in stored_values(blocked)]
        for values in stored_values(blocked):
            values[:] = np.arange(len(values))
        blocked.convert(PETSc.Mat.Type.AIJ, self.matrix)
        self._order = [numbers.astype(np.int32) for numbers in stored_values(self.matrix)]
        for values, before in zip(stored_values(blocked), kept, strict=True):
            values[:] = before

    def update(self) -> None:
        """Takes the values of the matrix by blocks."""
        pairs = zip(stored_values(self._blocked), stored_values(self.matrix), self._order, strict=True)
        for values, entries, order in pairs:
            np.take(values, order, out=entries, mode="clip")  # the only mode that takes without a copy
        self.matrix.stateIncrease()
