"""Quality of the cells of the rest shape: ρ = circumradius / inradius, as a form on the reference mesh.

With the edges e_k = (I + ∇d) J_k of a cell that meet at one vertex, J its Jacobian and D = det(e_1, …, e_dim),

    triangles:   ρ = ½ |e₁| |e₂| |e₁ − e₂| (|e₁| + |e₂| + |e₁ − e₂|) / D²,                     2 if equilateral,
    tetrahedra:  ρ = ½ ||e₁|² e₂×e₃ + |e₂|² e₃×e₁ + |e₃|² e₁×e₂| Σ_faces |e×e′| / D²,          3 if equilateral.

ρ is undefined (NaN) in cells that d turns inside out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import factorial, inf, isnan
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc
from mpi4py import MPI
from petsc4py import PETSc

from fenicsmech.compat import (
    assemble_matrix,
    assemble_vector,
    cellwise_space,
    compile_expression,
    compile_form,
    evaluate_expression,
)


def aspect_ratio(design: fem.Function):
    """ρ of each cell in the field ``design`` (vector P1), symbolic."""
    mesh = design.function_space.mesh
    gradient = ufl.Identity(mesh.geometry.dim) + ufl.grad(design)
    stretch = ufl.det(gradient)
    edges = gradient * ufl.Jacobian(mesh)
    # the root makes it NaN where a cell is turned inside out
    square = stretch * ufl.sqrt(stretch) ** 2 * ufl.JacobianDeterminant(mesh) ** 2
    product = _planar if mesh.geometry.dim == 2 else _spatial
    return 0.5 * product(*(edges[:, k] for k in range(mesh.geometry.dim))) / square


def _length(v):
    return ufl.sqrt(ufl.dot(v, v))


def _planar(a, b):
    sides = [_length(a), _length(b), _length(a - b)]
    return sides[0] * sides[1] * sides[2] * sum(sides)


def _spatial(a, b, c):
    bc, ca, ab = ufl.cross(b, c), ufl.cross(c, a), ufl.cross(a, b)
    radius = _length(ufl.dot(a, a) * bc + ufl.dot(b, b) * ca + ufl.dot(c, c) * ab)
    return radius * sum(map(_length, (bc, ca, ab, bc + ca + ab)))


class QualitySum:
    """Σ φ(ρ) over cells, with its derivatives with respect to the design field.

    Args:
        design: the design field d, vector P1.
        penalty: φ, in UFL; ρ itself by default.
        comm: the processes that share the mesh; the mesh's own communicator by default.
        counts: mask of the local cells that count, or their weights, ghosts last, (cells,); all by default.
    """

    def __init__(
        self,
        design: fem.Function,
        penalty: Callable = lambda rho: rho,
        *,
        comm: MPI.Comm | None = None,
        counts: np.ndarray | None = None,
    ) -> None:
        self.design, self._mesh = design, design.function_space.mesh
        self._comm = comm or self._mesh.comm
        dim = self._mesh.geometry.dim
        volume = abs(ufl.JacobianDeterminant(self._mesh)) / factorial(dim)
        self._penalty = penalty(aspect_ratio(design))
        measure = ufl.Measure("dx", domain=self._mesh, metadata={"quadrature_degree": 0})
        share = 1.0
        if counts is not None:
            share = fem.Function(cellwise_space(self._mesh))
            share.x.array[: len(counts)] = counts
        self._sum = share * self._penalty / volume * measure

    def value(self) -> float:
        """The sum over all processes, inf if a cell is inside out."""
        total = float(self._mesh.comm.allreduce(fem.assemble_scalar(self._form)))
        return inf if isnan(total) else total

    def cell_values(self) -> np.ndarray:
        """φ(ρ) of every local cell, ghosts last, NaN if it is inside out, (cells,)."""
        topology = self._mesh.topology
        index = topology.index_map(topology.dim)
        cells = np.arange(index.size_local + index.num_ghosts, dtype=np.int32)
        return evaluate_expression(self._expression, self._mesh, cells)[:, 0]

    def gradient(self) -> np.ndarray:
        """∂/∂d at the owned nodes, (owned nodes, dim)."""
        return assemble_vector(*self._gradient).reshape(-1, self._mesh.geometry.dim).copy()

    def hessian(self) -> PETSc.Mat:
        """∂²/∂d²; overwritten by the next call."""
        matrix = self._matrix
        matrix.zeroEntries()
        petsc.assemble_matrix(matrix, self._hessian_form)
        matrix.assemble()
        return matrix

    @cached_property
    def _expression(self) -> fem.Expression:
        dim = self._mesh.geometry.dim
        midpoint = np.full((1, dim), 1.0 / (dim + 1))
        return compile_expression(self._penalty, midpoint, self._mesh.comm)

    @cached_property
    def _form(self):
        return compile_form(self._sum)

    @cached_property
    def _gradient(self) -> tuple[Any, fem.Function]:
        """The form of the gradient, and where it is assembled: functions are costly to make on several ranks."""
        return compile_form(ufl.derivative(self._sum, self.design)), fem.Function(self.design.function_space)

    @cached_property
    def _hessian_form(self):
        return compile_form(ufl.derivative(ufl.derivative(self._sum, self.design), self.design))

    @cached_property
    def _matrix(self) -> PETSc.Mat:
        return assemble_matrix(self._hessian_form, self._comm)


@dataclass(frozen=True)
class Barrier:
    """The C² barrier β(x) = m ((x − x_max) / ε)³ beyond x_max, zero before (the paper's equation 15).

    For a lower bound, give −x the limit −x_min.

    Attributes:
        limit: x_max.
        width, strength: ε and m, which control how fast it grows.
    """

    limit: float
    width: float
    strength: float = 1.0

    def value(self, x: np.ndarray) -> np.ndarray:
        """β."""
        return self.strength * self._excess(x) ** 3

    def slope(self, x: np.ndarray) -> np.ndarray:
        """dβ/dx."""
        return 3.0 * self.strength / self.width * self._excess(x) ** 2

    def curvature(self, x: np.ndarray) -> np.ndarray:
        """d²β/dx²."""
        return 6.0 * self.strength / self.width**2 * self._excess(x)

    def symbolic(self, x):
        """β in UFL."""
        return self.strength * ufl.max_value((x - self.limit) / self.width, 0.0) ** 3

    def _excess(self, x: np.ndarray) -> np.ndarray:
        return np.maximum(np.asarray(x, dtype=float) - self.limit, 0.0) / self.width
