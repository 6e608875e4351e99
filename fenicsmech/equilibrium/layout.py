"""Where each unknown stands in the distributed KKT system.

    rows of K, G:   all finite-element DOFs, rank by rank; then, on the last rank, the extras (padded)
    unknowns:       the free finite-element DOFs, rank by rank; then, on the last rank, the extras

The extras are the poses z of the free bodies, the multipliers λ and the controlled force f.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fenicsmech.bodies import InterfaceMap
from fenicsmech.linkage import JointSystem


class Layout:
    """Numbering of rows and unknowns.

    Attributes:
        last: whether this rank holds the extras.
        free: owned finite-element DOFs that are unknowns, (owned free dofs,).
        whole_nodes: whether all components of every node with an unknown are unknowns, on all ranks.
        local_rows, local_unknowns: sizes on this rank.
        first_extra_row, first_extra: global numbers of the first extra row and unknown.
        z, multipliers, force: slices of the extras.
        extras: number of extras.
    """

    def __init__(self, comm: MPI.Comm, interfaces: InterfaceMap, joints: JointSystem) -> None:
        self.comm, self.last = comm, comm.rank == comm.size - 1
        block = interfaces.block
        owned = interfaces.owned * block
        self.free = np.flatnonzero(np.repeat(interfaces.body[: interfaces.owned] < 0, block))
        starts = self.free[::block]
        whole = len(self.free) == block * len(starts) and bool(np.all(starts % block == 0))
        whole = whole and bool(np.all(self.free.reshape(-1, block) == starts[:, None] + np.arange(block)))
        self.whole_nodes = bool(comm.allreduce(int(not whole)) == 0)
        self.z = slice(0, joints.size)
        self.multipliers = slice(joints.size, joints.size + joints.rows)
        self.force = joints.size + joints.rows
        self.extras = self.force + 1
        padded = -(-self.extras // block) * block
        self.owned = owned
        self.local_rows = owned + (padded if self.last else 0)
        self.local_unknowns = len(self.free) + (self.extras if self.last else 0)
        self.first_row = comm.exscan(self.local_rows) or 0
        self.first_unknown = comm.exscan(self.local_unknowns) or 0
        self.first_extra_row = comm.allreduce(owned)
        self.first_extra = comm.allreduce(len(self.free))
