"""Compiled UFL expressions evaluated for many values of their arguments at once: one value per cell of a mesh."""

from collections.abc import Callable

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import cellwise_space, compile_expression, create_mesh, evaluate_expression
from fenicsmech.elasticity import ElasticModel
from fenicsmech.laws import Law

from ..plot.grids import rectangle


def pointwise(build: Callable, arguments: np.ndarray) -> np.ndarray:
    """The UFL expression ``build(*a)`` for each row a of ``arguments`` (n, k), as (n, components)."""
    points, cells = rectangle(len(arguments), 1, 1.0, 1.0)
    mesh = create_mesh(MPI.COMM_SELF, cells, points)
    space = cellwise_space(mesh)
    functions = [fem.Function(space) for _ in range(arguments.shape[1])]
    for function, column in zip(functions, arguments.T, strict=True):
        function.x.array[: len(column)] = column
    expression = compile_expression(build(*functions), np.full((1, 2), 1.0 / 3.0), MPI.COMM_SELF)
    return evaluate_expression(expression, mesh, np.arange(len(arguments), dtype=np.int32))


def energies(model: ElasticModel, law: type[Law], H: np.ndarray, young, poisson) -> np.ndarray:
    """W of each H (n, dim, dim), (n,); one or n values of Young's modulus and Poisson's ratio."""

    def build(E, nu, *entries):
        material = of_constants(law, E, nu)
        return material.energy(model.strain(material, tensor(entries)))

    return pointwise(build, arguments(H, young, poisson))[:, 0]


def of_constants(law: type[Law], E, nu) -> Law:
    """A law of two constants, which may be UFL expressions."""
    return law(1.0, 0.0).with_parameters({"E": E, "nu": nu})


def arguments(H: np.ndarray, young, poisson) -> np.ndarray:
    """One row (E, ν, entries of H) per H (n, dim, dim)."""
    constants = [np.broadcast_to(value, len(H)) for value in (young, poisson)]
    return np.column_stack([*constants, H.reshape(len(H), -1)])


def tensor(entries):
    """A square tensor of 4 or 9 entries, row by row."""
    dim = {4: 2, 9: 3}[len(entries)]
    return ufl.as_matrix([entries[dim * i : dim * (i + 1)] for i in range(dim)])
