"""The linear displacements among those of higher order: the coarse level of the KKT system.

    P = D⁻¹ N G₁,     KKT₁ = Pᵀ KKT P,

with G₁ the map ∂u/∂(s, λ, f) of linear elements, interfaces included, N their values at the nodes of the displacement,
D the units of the unknowns. Poses, multipliers and force are the same on both levels. KKT₁ has an eighth of the
unknowns or less, and a factor is cheap.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from fenicsmech.compat import interpolation_matrix
from fenicsmech.equilibrium.factor import Factor, Inertia
from fenicsmech.equilibrium.layout import Layout
from fenicsmech.equilibrium.matrices import create_map_matrix, update_map_matrix
from fenicsmech.equilibrium.system import EquilibriumSystem


class CoarseLevel:
    """P and the factor of KKT₁ (collective).

    Args:
        system: whose KKT matrix it is.
    """

    def __init__(self, system: EquilibriumSystem) -> None:
        self._system = system
        linear = fem.Function(system.elastic.d.function_space)
        self._interfaces = system.interfaces.on(linear)
        self._layout = Layout(system.layout.comm, self._interfaces, system.joints)
        units, scale = np.full(len(self._layout.free), system.unknowns.unit_u), system.unknowns.scale
        self._map = create_map_matrix(self._layout, self._interfaces, system.joints, units, scale)
        self._values = _values_at_nodes(system, self._layout)
        self._prolongation: PETSc.Mat | None = None
        self._mapped: PETSc.Mat | None = None
        self._matrix: PETSc.Mat | None = None
        self._factor: Factor | None = None

    def update(self) -> bool:
        """Takes the values of the KKT matrix; whether KKT₁ could be factored (collective)."""
        system, unknowns = self._system, self._system.unknowns
        self._interfaces.reshape(system.elastic.d.x.array.reshape(-1, system.joints.space.dim))
        update_map_matrix(self._map, self._layout, self._interfaces, system.joints, unknowns.poses, unknowns.scale)
        self._prolongation = self._values.matMult(self._map, result=self._prolongation)
        self._mapped = unknowns.map.matMult(self._prolongation, result=self._mapped)
        self._matrix = system.kkt.restricted(self._mapped, self._matrix)
        if self._factor is None:
            self._factor = Factor(self._matrix)
            self._right, self._solution = self._matrix.createVecs()
        return self._factor.refactor()

    def inertia(self) -> Inertia:
        """Of KKT₁."""
        return self._factor.inertia()

    @property
    def memory(self) -> float:
        """Bytes the factorisation took, on all ranks."""
        return self._factor.memory

    def correction(self, r: PETSc.Vec, x: PETSc.Vec) -> None:
        """x = P KKT₁⁻¹ Pᵀ r (collective)."""
        self._prolongation.multTranspose(r, self._right)
        self._factor.solve(self._right, self._solution)
        self._prolongation.mult(self._solution, x)


def _values_at_nodes(system: EquilibriumSystem, coarse: Layout) -> PETSc.Mat:
    """D⁻¹ N: unknowns from displacements at vertices and the extras."""
    fine, d = system.layout, system.elastic.d
    entries = interpolation_matrix(d.function_space, system.elastic.u.function_space)[fine.free].tocoo()
    rows, columns, values = [entries.row], [entries.col], [entries.data / system.unknowns.unit_u]
    if fine.last:
        extras = np.arange(fine.extras)
        rows.append(len(fine.free) + extras)
        columns.append(coarse.first_extra_row + extras)
        values.append(1.0 / system.unknowns.scale)
    total_rows, total_columns = fine.comm.allreduce(fine.local_unknowns), fine.comm.allreduce(coarse.local_rows)
    local = csr_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))),
        shape=(fine.local_unknowns, total_columns),
    )
    local.sort_indices()
    return PETSc.Mat().createAIJ(
        [(fine.local_unknowns, total_rows), (coarse.local_rows, total_columns)],
        csr=(local.indptr.astype(PETSc.IntType), local.indices.astype(PETSc.IntType), local.data),
        comm=fine.comm,
    )
