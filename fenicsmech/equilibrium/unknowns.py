"""The scaled unknowns x of the KKT system, and the map G from these to the change of state they stand for.

    x ↦ (u, z, λ, f) = G x,     G = diag(∂u/∂s, 1) · D,     D = (ℓ, ℓ or 1, …) / (ℓ √k),

with the mechanism's length ℓ and the mean diagonal k of the stiffness; D makes the KKT matrix dimensionless.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from fenicsmech.elasticity import ElasticBody
from fenicsmech.equilibrium.blocks import Numbering
from fenicsmech.equilibrium.state import Step
from fenicsmech.multibody import InterfaceMap, JointSystem


class UnknownMap:
    """G as a sparse matrix, whose pattern never changes: the identity times ``units`` and ``scale``, and ∂u/∂z.

    Args:
        numbering: of rows and unknowns.
        interfaces: interface nodes as functions of poses.
        joints: the constraints.
        units: of the free degrees of freedom of links, (unknowns.links.count,).
        scale: of the border, (border,).

    Attributes:
        matrix: G, with zeros for ∂u/∂z until the first ``turn``.
    """

    def __init__(
        self,
        numbering: Numbering,
        interfaces: InterfaceMap,
        joints: JointSystem,
        units: np.ndarray,
        scale: np.ndarray,
    ) -> None:
        self._numbering, self._interfaces, self._joints, self._scale = numbering, interfaces, joints, scale
        rows, unknowns, free = numbering.rows, numbering.unknowns, numbering.free
        counts = np.zeros(rows.local, dtype=int)
        counts[free] = counts[rows.border.local] = 1
        moved = {}  # rows of interface nodes
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
        self.matrix = PETSc.Mat().createAIJ(
            [(rows.local, rows.size), (unknowns.local, unknowns.size)],
            csr=(starts.astype(PETSc.IntType), columns, values),
            comm=rows.comm,
        )

    def turn(self, poses: np.ndarray) -> None:
        """Brings ∂u/∂z to ``poses``."""
        numbering, joints = self._numbering, self._joints
        for body in self._interfaces.nodes:
            nodes, gradient = self._interfaces.gradient_rows(poses, body)
            if not len(nodes):
                continue
            columns, rows = joints.columns[body], self._rows_of(nodes)
            self.matrix.setValuesIJV(
                np.arange(0, len(columns) * len(rows) + 1, len(columns), dtype=PETSc.IntType),
                np.tile(numbering.unknowns.poses.first + columns, len(rows)).astype(PETSc.IntType),
                (gradient * self._scale[columns]).ravel(),
                rowmap=(numbering.rows.links.first + rows).astype(PETSc.IntType),
            )
        self.matrix.assemble()

    def _rows_of(self, nodes: np.ndarray) -> np.ndarray:
        """Local rows of the displacements of owned ``nodes`` that bodies move, (nodes · dim,)."""
        return (self._numbering.per_node * nodes[:, None] + np.arange(self._joints.space.dim)).ravel()


class ScaledUnknowns:
    """D and G.

    Args:
        elastic: the flexible links.
        numbering: of rows and unknowns.
        interfaces: interface nodes as functions of poses.
        joints: the constraints.
        diagonal: of K̂ at rest, (local rows,).

    Attributes:
        unit: a residual of this norm is a displacement of the mechanism's length against the mean stiffness.
        unit_u: the displacement that a unit of a scaled unknown stands for.
        units: D of this rank's unknowns, (local unknowns,).
        scale: D of the border, (border,).
        map: G.
        poses: at which G is taken.
    """

    def __init__(
        self,
        elastic: ElasticBody,
        numbering: Numbering,
        interfaces: InterfaceMap,
        joints: JointSystem,
        diagonal: np.ndarray,
    ) -> None:
        self._numbering, self._blocks = numbering, numbering.unknowns
        displacements = self._blocks.nodes
        own = float(diagonal[numbering.free[displacements.local]].sum())
        mean = self._blocks.comm.allreduce(own) / displacements.size
        self.unit = float(np.sqrt(mean)) * joints.length
        self.unit_u = joints.length / self.unit
        links = np.full(len(numbering.free), self.unit_u)
        if elastic.pressure is not None:
            links[self._blocks.pressures.local] = elastic.pressure_unit
        self.scale = np.concatenate(
            [joints.pose_scale / self.unit, joints.row_scale * self.unit, [self.unit / joints.length]]
        )
        self.units = self._blocks.join(links, self.scale)
        self._map = UnknownMap(numbering, interfaces, joints, links, self.scale)
        self.map, self.poses = self._map.matrix, joints.drawn
        self._rows = self.map.createVecLeft()

    def turn(self, poses: np.ndarray) -> None:
        """Brings G to ``poses``."""
        self._map.turn(poses)
        self.poses = poses

    def apply_transpose(self, links: np.ndarray, border: np.ndarray) -> PETSc.Vec:
        """Gᵀ of a gradient by this rank's (u, p), (owned dofs,), and by (z, λ, f), (border,)."""
        self._rows.array_w[:] = self._numbering.rows.join(links, border)
        vector = self.zeros()
        self.map.multTranspose(self._rows, vector)
        return vector

    def apply(self, x: PETSc.Vec) -> np.ndarray:
        """∂u/∂x · x as in ``State.u``, interface nodes too, (owned dofs,)."""
        self.map.mult(x, self._rows)
        return self._rows.array_r[self._numbering.rows.links.local].copy()

    def step(self, x: PETSc.Vec) -> Step:
        """The change of state D x that ``x`` stands for, without the displacements of interface nodes."""
        local = self.units * x.array_r
        u = np.zeros(self._numbering.rows.links.count)
        u[self._numbering.free] = local[self._blocks.links.local]
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
