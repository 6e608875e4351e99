"""Where each unknown stands in the distributed KKT system.

    rows of K, G:   all finite-element DOFs, rank by rank; then, on the last rank, the extras (padded)
    unknowns:       the free finite-element DOFs, rank by rank; then, on the last rank, the extras

The finite-element DOFs of a rank are its displacements, then the pressures of links that have some of their own.
The extras are the poses z of the free bodies, the multipliers λ and the controlled force f.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fenicsmech.elasticity import PressureField
from fenicsmech.multibody import InterfaceMap, JointSystem


class Layout:
    """Numbering of rows and unknowns.

    Attributes:
        comm: the processes that share them.
        last: whether this rank holds the extras.
        per_node: displacements per node.
        displacements, owned: number of owned displacements; of all owned finite-element DOFs.
        free: owned finite-element DOFs that are unknowns, (owned free dofs,).
        free_displacements: how many of them, the first ones, are displacements.
        pressures: number of unknown pressures on all ranks.
        block: rows come in blocks of this size.
        whole_nodes: whether all components of every node with an unknown are unknowns, on all ranks.
        local_rows, local_unknowns: sizes on this rank.
        unknowns: on all ranks.
        first_node, first_row, first_unknown: global numbers of this rank's first ones.
        first_extra_row, first_extra: global numbers of the first extra row and unknown.
        z, multipliers, force: slices of the extras.
        extras: number of extras.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        interfaces: InterfaceMap,
        joints: JointSystem,
        pressure: PressureField | None = None,
    ) -> None:
        self.comm, self.last = comm, comm.rank == comm.size - 1
        self.per_node = block = interfaces.block
        owned = self.displacements = interfaces.owned * block
        self.free = np.flatnonzero(interfaces.unknown)
        self.free_displacements, self.pressures, here = len(self.free), 0, 0
        if pressure is not None:
            here, block = len(pressure.unknown), 1
            self.free = np.concatenate([self.free, owned + np.flatnonzero(pressure.unknown)])
            self.pressures = pressure.count
            owned += here
        self.block = block
        whole = pressure is None and np.all(interfaces.unknown.all(axis=1) == interfaces.unknown.any(axis=1))
        self.whole_nodes = comm.allreduce(int(not whole)) == 0
        # first node of every rank, and what other DOFs stand before its displacements
        nodes = np.concatenate([[0], np.cumsum(comm.allgather(interfaces.owned))])
        self.first_node, self._starts = int(nodes[comm.rank]), nodes[1:-1]
        self._before = np.concatenate([[0], np.cumsum(comm.allgather(here))[:-1]])
        self.z = slice(0, joints.size)
        self.multipliers = slice(joints.size, joints.size + joints.rows)
        self.force = joints.size + joints.rows
        self.extras = self.force + 1
        padded = -(-self.extras // block) * block
        self.owned = owned
        self.local_rows = owned + (padded if self.last else 0)
        self.local_unknowns = len(self.free) + (self.extras if self.last else 0)
        self.unknowns = comm.allreduce(self.local_unknowns)
        self.first_row = comm.exscan(self.local_rows) or 0
        self.first_unknown = comm.exscan(self.local_unknowns) or 0
        self.first_extra_row = comm.allreduce(owned)
        self.first_extra = comm.allreduce(len(self.free))

    def rows_of(self, nodes: np.ndarray) -> np.ndarray:
        """Global rows of the displacements of ``nodes``, numbered over all ranks, (nodes · dim,)."""
        rank = np.searchsorted(self._starts, nodes, side="right")
        return (self.per_node * nodes[:, None] + self._before[rank][:, None] + np.arange(self.per_node)).ravel()
