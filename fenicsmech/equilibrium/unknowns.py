"""The unknowns of the equilibrium system: their blocks, numbers and scales, and the change of state they stand for.

Nodes of links, poses of bodies, multipliers of joints and the controlled load are unknowns of one symmetric matrix:

                 nodes  pressures │ poses  multipliers  load
    nodes       ⎡ K_uu   Kᵀ_pu    │  Kᵀ_zu      0       −a_u ⎤      K_uu  elastic block: links at their free nodes
    pressures   ⎢ K_pu    −M      │  K_pz       0        0   ⎥      K_pu, M  volume and compliance of links in u–p form
                ⎢─────────────────┼──────────────────────────⎥
    poses       ⎢ K_zu   Kᵀ_pz    │   B        −Aᵀ      −a_z ⎥      B     curvature of rigid motions, A = ∂C/∂z
    multipliers ⎢  0       0      │  −A       −ε − c     0   ⎥      c, ε  compliance of joints, regularisation
    load        ⎣ −a_uᵀ    0      │ −a_zᵀ       0        0   ⎦      a     direction of the load at its point

It is 2 × 2 blocks: links (thousands of unknowns, sparse, distributed) and the border (dozens, on the last rank). Nodes
on interfaces are functions of the poses of their bodies, which couples both: K_zu, K_pz and a part of B come from the
links. Where the load is given instead of the displacement of its point, the load's row is −f alone.

All blocks are parts of one matrix, factored as LDLᵀ: by Sylvester's law its pivots have the signs of the eigenvalues,
and at a stable equilibrium as many of these are negative as there are pressures, multipliers and the load (Gould,
doi:10.1007/BF02592103). The factor that solves for a step decides on stability at no extra cost. Elimination of the
nodes would leave a Schur complement of the border, in which small stiffnesses are differences of large ones.

Every block is a named index set, enough for PETSc's fieldsplit preconditioners:

    pc.setFieldSplitIS(("links", blocks.links.index_set()), ("border", blocks.border.index_set()))

Two vectors have these blocks: the scaled unknowns x, and the rows of the extended matrix K̂ (see ``kkt``), which holds
nodes on interfaces too. They are related by the map G from x to the change of state it stands for,

    x ↦ (u, z, λ, f) = G x,     G = diag(∂u/∂s, 1) · D,     D = (ℓ, ℓ or 1, …) / (ℓ √k),

with the mechanism's length ℓ and the mean diagonal k of the stiffness; D makes the KKT matrix dimensionless.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from fenicsmech.elasticity import ElasticBody, PressureField
from fenicsmech.equilibrium.state import Step
from fenicsmech.multibody import InterfaceMap, JointSystem

_SOFT = 0.1  # stiffness over the mean one, below which nodes are of soft links: in one material they vary by less


@dataclass(frozen=True)
class Block:
    """Unknowns of one kind.

    Attributes:
        local: this rank's unknowns among its values of a vector.
        first: global number of this rank's first unknown; of the block's first one on ranks without the border.
        size: number on all ranks.
        comm: the processes.
    """

    local: slice
    first: int
    size: int
    comm: MPI.Comm

    @property
    def count(self) -> int:
        """Number on this rank. Local."""
        return self.local.stop - self.local.start

    def index_set(self) -> PETSc.IS:
        """Global numbers of those of each rank."""
        return PETSc.IS().createStride(self.count, self.first, 1, comm=self.comm)


class BlockValues(NamedTuple):
    """The values of each block."""

    nodes: np.ndarray
    pressures: np.ndarray
    poses: np.ndarray
    multipliers: np.ndarray
    load: np.ndarray


class Border(NamedTuple):
    """The values of each block of the border."""

    poses: np.ndarray
    multipliers: np.ndarray
    load: np.ndarray


class Blocks:
    """Named index sets of a distributed vector: links, rank by rank, then the border on the last rank.

    Numbers of ``nodes`` and ``pressures`` are those on this rank; ``padding`` values after the border belong to no
    block. ``links`` are nodes and pressures, ``border`` poses, multipliers and load.

    Attributes:
        local, size: lengths of the vector, on this rank and on all.
        last: whether this rank holds the border.
    """

    def __init__(
        self, comm: MPI.Comm, *, nodes: int, pressures: int, poses: int, multipliers: int, padding: int = 0
    ) -> None:
        self.comm, self.last = comm, comm.rank == comm.size - 1
        counts = np.array(comm.allgather((nodes, pressures)))  # by rank
        here, first = nodes + pressures, int(counts[: comm.rank].sum())
        totals = counts.sum(axis=0)
        start, border = int(totals.sum()), poses + multipliers + 1

        def on_last(begin: int, size: int) -> Block:
            held = slice(here + begin, here + begin + size) if self.last else slice(here, here)
            return Block(held, start + begin, size, comm)

        self.nodes = Block(slice(0, nodes), first, int(totals[0]), comm)
        self.pressures = Block(slice(nodes, here), first + nodes, int(totals[1]), comm)
        self.links = Block(slice(0, here), first, start, comm)
        self.poses, self.multipliers = on_last(0, poses), on_last(poses, multipliers)
        self.load, self.border = on_last(border - 1, 1), on_last(0, border)
        self.local = here + (border + padding if self.last else 0)
        self.size = start + border + padding

    def restrict(self, values: np.ndarray) -> BlockValues:
        """Views of this rank's ``values`` by block. Local."""
        blocks = (self.nodes, self.pressures, self.poses, self.multipliers, self.load)
        return BlockValues(*(values[block.local] for block in blocks))

    def restrict_border(self, border: np.ndarray) -> Border:
        """Views of the values of a whole ``border``, (border,), by block. Local."""
        return Border(*np.split(border, [self.poses.size, self.poses.size + self.multipliers.size]))

    def join(self, links: np.ndarray, border: np.ndarray) -> np.ndarray:
        """This rank's values from those of its ``links`` and of the whole ``border``, known to all ranks. Local."""
        values = np.zeros(self.local)
        values[self.links.local] = links
        values[self.border.local] = border[: self.border.count]
        return values

    def gather_border(self, values: np.ndarray) -> np.ndarray:
        """The values of the border on every rank, (border,), from those of each rank."""
        return self.comm.bcast(values[self.border.local] if self.last else None, root=self.comm.size - 1)


class Numbering:
    """Numbers of the rows of K̂ and of the unknowns.

    Attributes:
        rows: blocks of the rows of K̂: all finite-element degrees of freedom of each rank, and the border.
        unknowns: blocks of the scaled unknowns x: the free ones, and the border.
        free: rows of this rank's links that are unknowns, (unknowns.links.count,).
        per_node: displacements per node.
        block: rows of K̂ come in blocks of this size.
        whole_nodes: whether all components of every node with an unknown are unknowns, and there are no pressures.
        first_node: global number of this rank's first node.
    """

    def __init__(
        self, comm: MPI.Comm, interfaces: InterfaceMap, joints: JointSystem, pressure: PressureField | None = None
    ) -> None:
        self.per_node = self.block = interfaces.block
        nodes, pressures = interfaces.owned * interfaces.block, 0
        self.free = np.flatnonzero(interfaces.unknown)
        displacements = len(self.free)
        if pressure is not None:
            pressures, self.block = len(pressure.unknown), 1
            self.free = np.concatenate([self.free, nodes + np.flatnonzero(pressure.unknown)])
        whole = pressure is None and np.all(interfaces.unknown.all(axis=1) == interfaces.unknown.any(axis=1))
        self.whole_nodes = comm.allreduce(int(not whole)) == 0
        border = {"poses": joints.size, "multipliers": joints.rows}
        padding = -(sum(border.values()) + 1) % self.block
        self.rows = Blocks(comm, nodes=nodes, pressures=pressures, **border, padding=padding)
        self.unknowns = Blocks(comm, nodes=displacements, pressures=len(self.free) - displacements, **border)
        # first node of every rank, and the pressures that precede its displacements
        ends = np.cumsum(comm.allgather(interfaces.owned))
        self.first_node, self._starts = int(ends[comm.rank] - interfaces.owned), ends[:-1]
        self._before = np.concatenate([[0], np.cumsum(comm.allgather(pressures))[:-1]])

    def rows_of(self, nodes: np.ndarray) -> np.ndarray:
        """Rows of K̂ of the displacements of ``nodes``, numbered over all ranks, (nodes · per_node,). Local."""
        rank = np.searchsorted(self._starts, nodes, side="right")
        return (self.per_node * nodes[:, None] + self._before[rank][:, None] + np.arange(self.per_node)).ravel()


class UnknownMap:
    """G as a sparse matrix, whose pattern never changes: the identity times units, and ∂u/∂z.

    ``units`` are those of the free degrees of freedom of links, ``scale`` those of the border.

    Attributes:
        map: G, with zeros for ∂u/∂z until the first ``turn``.
        poses: at which G is taken.
    """

    def __init__(
        self, numbering: Numbering, interfaces: InterfaceMap, joints: JointSystem, units: np.ndarray, scale: np.ndarray
    ) -> None:
        self.numbering, self.scale, self.poses = numbering, scale, joints.drawn
        self._interfaces, self._joints = interfaces, joints
        rows, unknowns, free = numbering.rows, numbering.unknowns, numbering.free
        counts = np.zeros(rows.local, dtype=int)
        counts[free] = counts[rows.border.local] = 1
        moved: dict[int, np.ndarray] = {}  # rows of interface nodes
        for body, nodes in interfaces.nodes.items():
            moved[body] = self._rows_of(nodes[nodes < interfaces.owned])
            counts[moved[body]] = len(joints.columns[body])
        starts = np.concatenate([[0], np.cumsum(counts)])
        columns, values = np.zeros(starts[-1], dtype=PETSc.IntType), np.zeros(starts[-1])
        columns[starts[free]] = unknowns.links.first + np.arange(len(free))
        values[starts[free]] = units
        for body, body_rows in moved.items():
            own = joints.columns[body]
            columns[starts[body_rows][:, None] + np.arange(len(own))] = unknowns.poses.first + own
        border = starts[:-1][rows.border.local]
        columns[border] = unknowns.border.first + np.arange(len(border))
        values[border] = scale[: len(border)]
        # ∂u/∂z by rows, of all bodies: starts, columns, units of the columns, rows
        turned = np.concatenate([np.zeros(0, int), *(np.tile(joints.columns[b], len(own)) for b, own in moved.items())])
        turned_rows = rows.links.first + np.concatenate([np.zeros(0, int), *moved.values()])
        self._turning = (
            np.arange(0, len(turned) + 1, joints.space.pose_size, dtype=PETSc.IntType),
            (unknowns.poses.first + turned).astype(PETSc.IntType),
            scale[turned],
            turned_rows.astype(PETSc.IntType),
        )
        size = [(rows.local, rows.size), (unknowns.local, unknowns.size)]
        self.map = PETSc.Mat().createAIJ(size, csr=(starts.astype(PETSc.IntType), columns, values), comm=rows.comm)

    def turn(self, poses: np.ndarray) -> None:
        """Brings ∂u/∂z to ``poses``."""
        self.poses = poses
        values = [self._interfaces.gradient_rows(poses, body)[1].ravel() for body in self._interfaces.nodes]
        starts, columns, units, rows = self._turning
        if len(rows):
            self.map.setValuesIJV(starts, columns, np.concatenate(values) * units, rowmap=rows)
        self.map.assemble()

    def _rows_of(self, nodes: np.ndarray) -> np.ndarray:
        """Local rows of the displacements of owned ``nodes`` that bodies move, (nodes · dim,)."""
        return (self.numbering.per_node * nodes[:, None] + np.arange(self._joints.space.dim)).ravel()


class ScaledUnknowns(UnknownMap):
    """x, with D from the ``diagonal`` of K̂ at rest, (local rows,).

    Attributes:
        unit: a residual of this norm is a displacement of the mechanism's length against the mean stiffness.
        unit_u: the displacement that a unit of a scaled unknown stands for.
        units: D of this rank's unknowns, (local unknowns,).
        scale: D of the border, (border,).
        shift_weights: of this rank's displacements, one, or less where they are of soft links, by their stiffness at
            rest, (local displacements,); of poses, the geometric mean of the least of these and one.
    """

    def __init__(
        self,
        elastic: ElasticBody,
        numbering: Numbering,
        interfaces: InterfaceMap,
        joints: JointSystem,
        diagonal: np.ndarray,
    ) -> None:
        self._blocks = blocks = numbering.unknowns
        # prestrain that compresses can make diagonal terms negative
        stiffness = np.abs(diagonal[numbering.free[blocks.nodes.local]])
        own = float(stiffness.sum())
        mean = blocks.comm.allreduce(own) / blocks.nodes.size
        self.unit = float(np.sqrt(mean)) * joints.length
        self.unit_u = joints.length / self.unit
        weights = np.minimum(stiffness / (_SOFT * mean), 1.0)
        softest = blocks.comm.allreduce(float(weights.min(initial=1.0)), op=MPI.MIN)
        self.shift_weights = weights, float(np.sqrt(softest))
        links = np.full(len(numbering.free), self.unit_u)
        if elastic.pressure is not None:
            links[blocks.pressures.local] = elastic.pressure_unit
        load = np.array([self.unit / joints.length])
        scale = np.concatenate([joints.pose_scale / self.unit, joints.row_scale * self.unit, load])
        super().__init__(numbering, interfaces, joints, links, scale)
        self.units = blocks.join(links, self.scale)
        self._rows = self.map.createVecLeft()

    def apply_transpose(self, links: np.ndarray, border: np.ndarray) -> PETSc.Vec:
        """Gᵀ of a gradient with respect to this rank's (u, p), (owned dofs,), and to (z, λ, f), (border,)."""
        self._rows.array_w[:] = self.numbering.rows.join(links, border)
        vector = self.zeros()
        self.map.multTranspose(self._rows, vector)
        return vector

    def apply(self, x: PETSc.Vec) -> np.ndarray:
        """∂u/∂x · x as in ``State.u``, interface nodes too, (owned dofs,)."""
        self.map.mult(x, self._rows)
        return self._rows.array_r[self.numbering.rows.links.local].copy()

    def step(self, x: PETSc.Vec) -> Step:
        """The change of state D x that ``x`` stands for, without the displacements of interface nodes."""
        local = self.units * x.array_r
        u = np.zeros(self.numbering.rows.links.count)
        u[self.numbering.free] = local[self._blocks.links.local]
        poses, multipliers, load = self._blocks.restrict_border(self._blocks.gather_border(local))
        return Step(u, poses, multipliers, float(load[0]))

    def zeros(self) -> PETSc.Vec:
        """A vector of scaled unknowns."""
        return self.map.createVecRight()

    def control_row(self) -> PETSc.Vec:
        """The unit vector of the unknown f."""
        vector = self.zeros()
        self._blocks.restrict(vector.array_w).load[:] = 1.0
        return vector

    def coordinates_mask(self) -> PETSc.Vec:
        """One for displacements and poses, zero for pressures, multipliers and the load."""
        vector = self.zeros()
        parts = self._blocks.restrict(vector.array_w)
        parts.nodes[:] = parts.poses[:] = 1.0
        return vector
