"""Creation of the two sparse matrices whose triple product is the KKT matrix; their patterns never change.

K̂ is stored by the blocks of its nodes, into which element matrices go in half the time; products of sparse matrices
want it by entries.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from fenicsmech.elasticity import ElasticBody
from fenicsmech.equilibrium.layout import Layout
from fenicsmech.multibody import InterfaceMap, JointSystem


def create_extended_matrix(
    elastic: ElasticBody, layout: Layout, pattern: Iterable[tuple[np.ndarray, np.ndarray]]
) -> PETSc.Mat:
    """K̂ with the finite-element pattern and the extra ``pattern``: (global rows, global columns) of full blocks.

    Holds ∂²E/∂(u, p)² of the current fields (collective).
    """
    fem = elastic.create_tangent()
    elastic.tangent(fem)
    fem.assemble()
    starts, columns, values = fem.getValuesCSR()
    numbering = fem.getLGMap()
    fem.destroy()  # large, and not needed any more
    first, size = layout.first_row, layout.local_rows

    wanted: dict[int, list[np.ndarray]] = {}
    for block_rows, block_columns in pattern:
        for row in block_rows[(block_rows >= first) & (block_rows < first + size)] - first:
            wanted.setdefault(int(row), []).append(block_columns)
    # rows of the extras are empty so far
    starts = np.concatenate([starts, np.full(size - layout.owned, starts[-1])]).astype(int)
    places, added, counts = [], [], np.zeros(size, dtype=int)
    for row in sorted(wanted):
        there = columns[starts[row] : starts[row + 1]]
        new = np.setdiff1d(np.concatenate(wanted[row]), there)
        places.append(starts[row] + np.searchsorted(there, new))
        added.append(new)
        counts[row] = len(new)
    if wanted:
        columns = np.insert(columns, np.concatenate(places), np.concatenate(added))
        values = np.insert(values, np.concatenate(places), 0.0)
    starts += np.concatenate([[0], np.cumsum(counts)])

    total, block = layout.comm.allreduce(size), layout.block
    blocks = csr_matrix((values, columns, starts), shape=(size, total)).tobsr((block, block))
    matrix = PETSc.Mat().createBAIJ(
        [(size, total), (size, total)],
        block,
        csr=(blocks.indptr.astype(PETSc.IntType), blocks.indices.astype(PETSc.IntType), blocks.data),
        comm=layout.comm,
    )
    matrix.setLGMap(*numbering)
    matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_LOCATION_ERR, True)
    return matrix


def create_map_matrix(
    layout: Layout, interfaces: InterfaceMap, joints: JointSystem, units: np.ndarray, scale: np.ndarray
) -> PETSc.Mat:
    """G with its constant entries: the scaled identity on free DOFs and extras, zeros for ∂u/∂z (collective)."""
    dim = joints.space.dim
    counts = np.zeros(layout.local_rows, dtype=int)
    counts[layout.free] = 1
    node_columns = {body: layout.first_extra + joints.columns[body] for body in interfaces.nodes}
    entries: dict[int, np.ndarray] = {}
    for body, nodes in interfaces.nodes.items():
        for node in nodes[nodes < interfaces.owned]:
            for row in range(layout.per_node * node, layout.per_node * node + dim):
                entries[row] = node_columns[body]
                counts[row] = len(node_columns[body])
    if layout.last:
        counts[layout.owned : layout.owned + layout.extras] = 1
    starts = np.concatenate([[0], np.cumsum(counts)])
    columns = np.zeros(starts[-1], dtype=PETSc.IntType)
    values = np.zeros(starts[-1])
    columns[starts[layout.free]] = layout.first_unknown + np.arange(len(layout.free))
    values[starts[layout.free]] = units
    for row, cols in entries.items():
        columns[starts[row] : starts[row + 1]] = cols
    if layout.last:
        at = starts[layout.owned : layout.owned + layout.extras]
        columns[at] = layout.first_extra + np.arange(layout.extras)
        values[at] = scale
    total_rows = layout.comm.allreduce(layout.local_rows)
    total = layout.comm.allreduce(layout.local_unknowns)
    return PETSc.Mat().createAIJ(
        [(layout.local_rows, total_rows), (layout.local_unknowns, total)],
        csr=(starts.astype(PETSc.IntType), columns, values),
        comm=layout.comm,
    )


def update_map_matrix(
    matrix: PETSc.Mat,
    layout: Layout,
    interfaces: InterfaceMap,
    joints: JointSystem,
    poses: np.ndarray,
    scale: np.ndarray,
) -> None:
    """Brings ∂u/∂z in G to ``poses`` (collective)."""
    dim = joints.space.dim
    for body in interfaces.nodes:
        nodes, gradient = interfaces.gradient_rows(poses, body)
        if not len(nodes):
            continue
        columns = joints.columns[body]
        rows = (layout.per_node * nodes[:, None] + np.arange(dim)).ravel()
        matrix.setValuesIJV(
            np.arange(0, len(columns) * len(rows) + 1, len(columns), dtype=PETSc.IntType),
            np.tile(layout.first_extra + columns, len(rows)).astype(PETSc.IntType),
            (gradient * scale[columns]).ravel(),
            rowmap=(layout.first_row + rows).astype(PETSc.IntType),
        )
    matrix.assemble()
