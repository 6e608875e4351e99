"""The scaled unknowns x of the KKT system, and the map G between these and the change of state they stand for.

    x ↦ (u, z, λ, f) = G x,     G = diag(∂u/∂s, 1) · D,     D = (ℓ, ℓ or 1, …) / (ℓ √k),

with the mechanism's length ℓ and the mean diagonal k of the stiffness; D makes the KKT matrix dimensionless.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from fenicsmech.elasticity import ElasticBody
from fenicsmech.equilibrium.layout import Layout
from fenicsmech.equilibrium.matrices import create_map_matrix, update_map_matrix
from fenicsmech.equilibrium.state import Step
from fenicsmech.multibody import InterfaceMap, JointSystem


class ScaledUnknowns:
    """D and G, whose pattern never changes.

    Args:
        elastic: the flexible links.
        layout: numbering of rows and unknowns.
        interfaces: interface nodes as functions of poses.
        joints: the constraints.
        diagonal: of K̂ at rest, (local rows,).

    Attributes:
        unit: a residual of this norm is a displacement of the mechanism's length against the mean stiffness.
        unit_u, units, scale: what a unit of each scaled unknown stands for: displacements; all free finite-element
            DOFs; (z, λ, f).
        map: G.
        poses: those that G is at.
    """

    def __init__(
        self, elastic: ElasticBody, layout: Layout, interfaces: InterfaceMap, joints: JointSystem, diagonal: np.ndarray
    ) -> None:
        self._layout, self._interfaces, self._joints = layout, interfaces, joints
        free = layout.free_displacements
        own = float(diagonal[layout.free[:free]].sum())
        mean = layout.comm.allreduce(own) / layout.comm.allreduce(free)
        self.unit = float(np.sqrt(mean)) * joints.length
        self.unit_u = joints.length / self.unit
        self.units = np.full(len(layout.free), self.unit_u)
        if elastic.pressure is not None:
            self.units[free:] = elastic.pressure_unit
        self.scale = np.concatenate(
            [joints.pose_scale / self.unit, joints.row_scale * self.unit, [self.unit / joints.length]]
        )
        self.map = create_map_matrix(layout, interfaces, joints, self.units, self.scale)
        self.poses = joints.drawn
        self._rows = self.map.createVecLeft()

    def turn(self, poses: np.ndarray) -> None:
        """Brings G to ``poses`` (collective)."""
        update_map_matrix(self.map, self._layout, self._interfaces, self._joints, poses, self.scale)
        self.poses = poses

    def apply_transpose(self, nodal: np.ndarray, extras: np.ndarray) -> PETSc.Vec:
        """Gᵀ of a gradient by u, (owned dofs,), and by the last rank's (z, λ, f), (extras,) (collective)."""
        rows, owned = self._rows.array_w, self._layout.owned
        rows[:owned] = nodal
        if self._layout.last:
            rows[owned : owned + self._layout.extras] = extras
        vector = self.zeros()
        self.map.multTranspose(self._rows, vector)
        return vector

    def apply(self, x: PETSc.Vec) -> np.ndarray:
        """∂u/∂x · x as in ``State.u``, interface nodes too, (owned dofs,) (collective)."""
        self.map.mult(x, self._rows)
        return self._rows.array_r[: self._layout.owned].copy()

    def step(self, x: PETSc.Vec) -> Step:
        """The change of state D x that ``x`` stands for, without the displacements of interface nodes (collective)."""
        local, layout = x.array_r, self._layout
        free = len(layout.free)
        u = np.zeros(layout.owned)
        u[layout.free] = self.units * local[:free]
        extras = self.scale * local[free:] if layout.last else None
        extras = layout.comm.bcast(extras, root=layout.comm.size - 1)
        return Step(u, extras[layout.z], extras[layout.multipliers], float(extras[layout.force]))

    def zeros(self) -> PETSc.Vec:
        """A vector of scaled unknowns (collective)."""
        return self.map.createVecRight()

    def control_row(self) -> PETSc.Vec:
        """The unit vector of the unknown f (collective)."""
        vector = self.zeros()
        if self._layout.last:
            vector.array_w[-1] = 1.0
        return vector

    def coordinates_mask(self) -> PETSc.Vec:
        """One for each of the coordinates s, zero for multipliers and the controlled force (collective)."""
        vector, layout = self.zeros(), self._layout
        vector.array_w[: layout.free_displacements] = 1.0
        if layout.last:
            vector.array_w[len(layout.free) :][layout.z] = 1.0
        return vector
