"""The KKT matrix Gᵀ K̂ G in scaled unknowns, and the map G between these and the change of state they stand for."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from petsc4py import PETSc

from fenicsmech.bodies import InterfaceMap
from fenicsmech.clock import Clock
from fenicsmech.elasticity import ElasticBody
from fenicsmech.equilibrium.control import Control
from fenicsmech.equilibrium.extras import REGULARISATION, ExtraEntries
from fenicsmech.equilibrium.layout import Layout
from fenicsmech.equilibrium.matrices import create_extended_matrix, create_map_matrix, update_map_matrix
from fenicsmech.linkage import JointSystem


class KktMatrix:
    """K̂, G and their product, whose patterns never change; all methods are collective.

    Args:
        elastic: the flexible links, at rest.
        layout: numbering of rows and unknowns.
        interfaces: interface nodes as functions of poses.
        joints: the constraints.
        extras: entries of K̂ beside those of the links; takes the scales of its rows from here.
        clock: where time is counted.

    Attributes:
        unit: a residual of this norm is a displacement of the mechanism's length against the mean stiffness.
        unit_u, units, scale: what a unit of each scaled unknown stands for: displacements; all free finite-element
            DOFs; (z, λ, f).
        hat: K̂, to which elastic stiffness may be added between ``tangent`` and ``assembled``.
        matrix: the KKT matrix last assembled, the same object every time.
        poses: those that G is at.
    """

    def __init__(
        self,
        elastic: ElasticBody,
        layout: Layout,
        interfaces: InterfaceMap,
        joints: JointSystem,
        extras: ExtraEntries,
        *,
        clock: Clock,
    ) -> None:
        self._elastic, self._layout, self._interfaces, self._joints = elastic, layout, interfaces, joints
        self._clock, self.poses = clock, joints.drawn
        self.hat = create_extended_matrix(elastic, layout, extras.pattern())
        # mean diagonal of the stiffness k: D = (ℓ, 1, …) / (ℓ √k) makes the KKT matrix dimensionless
        free = layout.free_displacements
        diagonal = self.hat.getDiagonal().array_r[layout.free[:free]]
        mean = layout.comm.allreduce(float(diagonal.sum())) / layout.comm.allreduce(free)
        self.unit = float(np.sqrt(mean)) * joints.length
        self.unit_u = joints.length / self.unit
        self.units = np.full(len(layout.free), self.unit_u)
        if elastic.pressure is not None:
            self.units[free:] = elastic.pressure_unit
        self.scale = np.concatenate(
            [joints.pose_scale / self.unit, joints.row_scale * self.unit, [self.unit / joints.length]]
        )
        extras.set_regularisation(self.scale[layout.multipliers], self.scale[layout.force])
        self._map = create_map_matrix(layout, interfaces, joints, self.units, self.scale)
        self._entries = PETSc.Mat()  # of K̂ one by one
        self._rows = self.hat.createVecLeft()
        self.matrix: PETSc.Mat | None = None
        self._diagonal: PETSc.Vec | None = None
        self._shift = 0.0

    def turn(self, poses: np.ndarray) -> None:
        """Brings G to ``poses``."""
        update_map_matrix(self._map, self._layout, self._interfaces, self._joints, poses, self.scale)
        self.poses = poses

    def tangent(self) -> None:
        """Makes K̂ hold ∂²E/∂u² of the present fields, and nothing else."""
        self.hat.zeroEntries()
        self._elastic.tangent(self.hat)

    def assembled(self, entries: Iterable[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> PETSc.Mat:
        """The KKT matrix from the tangent that K̂ holds and the ``entries`` of its extras."""
        with self._clock.phase("assemble"):
            self.hat.assemble()
            if self._layout.last:
                for rows, columns, block in entries:
                    # petsc4py reads transposed arrays in memory order
                    self.hat.setValues(
                        rows.astype(PETSc.IntType),
                        columns.astype(PETSc.IntType),
                        np.ascontiguousarray(block),
                        addv=PETSc.InsertMode.ADD,
                    )
            self.hat.assemble()
        with self._clock.phase("project"):
            self.hat.convert(PETSc.Mat.Type.AIJ, self._entries)
            self.matrix = self._entries.ptap(self._map, result=self.matrix)
            self._diagonal, self._shift = self.matrix.getDiagonal(), 0.0
        return self.matrix

    def nodal_stiffness(self) -> PETSc.Mat:
        """A new matrix of its rows and columns of free displacements, by blocks of nodes."""
        dim, free = self._layout.per_node, self._layout.free
        nodes = ((self._layout.first_row + free[::dim]) // dim).astype(PETSc.IntType)
        rows = PETSc.IS().createBlock(dim, nodes, comm=self._layout.comm)
        stiffness = self.hat.createSubMatrix(rows, rows)
        stiffness.scale(self.unit_u**2)
        stiffness.shift(self._shift)
        return stiffness

    def shift(self, shift: float) -> None:
        """Makes the matrix hold ``shift`` · I more than it was assembled with, in the block of s."""
        shifted, layout, self._shift = self._diagonal.copy(), self._layout, shift
        shifted.array_w[: layout.free_displacements] += shift
        if layout.last:
            shifted.array_w[len(layout.free) :][layout.z] += shift
        self.matrix.setDiagonal(shifted)

    def soften(self, softness: float, control: Control) -> None:
        """Makes the matrix hold −``softness`` · I instead of −ε · I in the block of multipliers.

        The force is one of them under a ``control`` that constrains. Before ``shift``, which makes it take effect.
        """
        if self._layout.last:
            extras = self._diagonal.array_w[len(self._layout.free) :]
            extras[self._layout.multipliers] += REGULARISATION - softness
            if control.constrained:
                extras[self._layout.force] -= softness

    def zeros(self) -> PETSc.Vec:
        """A vector of scaled unknowns."""
        return self._map.createVecRight()

    def pull(self, nodal: np.ndarray, extras: np.ndarray) -> PETSc.Vec:
        """Gᵀ of a gradient by u, (owned dofs,), and by (z, λ, f), (extras,), the latter of the last rank."""
        rows, owned = self._rows.array_w, self._layout.owned
        rows[:owned] = nodal
        if self._layout.last:
            rows[owned : owned + self._layout.extras] = extras
        vector = self.zeros()
        self._map.multTranspose(self._rows, vector)
        return vector

    def push(self, x: PETSc.Vec) -> np.ndarray:
        """The part u of G x, interface nodes too, (owned dofs,)."""
        rows = self.hat.createVecLeft()
        self._map.mult(x, rows)
        return rows.array_r[: self._layout.owned].copy()
