"""Functions given by formulae, differentiated symbolically and compiled to Python once.

    f(x; c) ∈ Rᵐ,     ∂f_k/∂x_i,     Σ_k w_k ∂²f_k/∂x_i∂x_j

with variables x ∈ Rⁿ and constants c.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import sympy
from sympy import Symbol


@dataclass(frozen=True)
class SmoothFunction:
    """A compiled function f of n variables with m components.

    Every function takes the variables (n,) and the constants (k,). With ``many`` points at once every array has
    a leading axis, of the points.
    """

    size: int  # m
    value: Callable[..., np.ndarray]  # f, (m,)
    gradient: Callable[..., np.ndarray]  # ∂f/∂x, (m, n)
    hessian: Callable[..., np.ndarray]  # takes weights w (m,) last; Σ_k w_k ∂²f_k/∂x², (n, n)


def derive(
    formulae: Sequence[sympy.Expr], variables: Sequence[Symbol], constants: Sequence[Symbol], *, many: bool = False
) -> SmoothFunction:
    """Compiles f(x; c), one formula per component, with its gradients and Hessians.

    The names x0, x1, … are reserved for common subexpressions. Without ``many`` it is for one point, and fastest there.
    """
    n, m = len(variables), len(formulae)
    weights = sympy.symbols(f"w0:{m}", real=True)
    gradient = [[sympy.diff(f, x) for x in variables] for f in formulae]
    weighted = [sum((w * row[i] for w, row in zip(weights, gradient, strict=True)), sympy.S.Zero) for i in range(n)]
    rows, columns = np.tril_indices(n)
    lower = [sympy.diff(weighted[i], variables[j]) for i, j in zip(rows, columns, strict=True)]
    place = np.empty((n, n), dtype=int)
    place[rows, columns] = place[columns, rows] = np.arange(len(rows))

    compiled = _at_many_points if many else _at_one_point
    triangle = compiled(lower, (variables, constants, weights), (len(rows),))
    return SmoothFunction(
        size=m,
        value=compiled(list(formulae), (variables, constants), (m,)),
        gradient=compiled([entry for row in gradient for entry in row], (variables, constants), (m, n)),
        hessian=lambda *point: triangle(*point)[..., place],
    )


def _at_one_point(expressions: list[sympy.Expr], arguments: tuple, shape: tuple) -> Callable[..., np.ndarray]:
    # plain floats are several times faster than arrays of no dimension
    formula = _lambdify(arguments, expressions, "math")
    return lambda *point: np.array(formula(*[numbers.tolist() for numbers in point]), dtype=float).reshape(shape)


def _at_many_points(expressions: list[sympy.Expr], arguments: tuple, shape: tuple) -> Callable[..., np.ndarray]:
    formula = _lambdify(arguments, expressions, "numpy")

    def evaluate(*points: np.ndarray) -> np.ndarray:
        values = np.empty((len(expressions), len(points[0])))
        for row, value in zip(values, formula(*(numbers.T for numbers in points)), strict=True):
            row[:] = value
        return values.T.reshape(-1, *shape)

    return evaluate


def _lambdify(arguments: tuple, expressions: list[sympy.Expr], module: str) -> Callable[..., list]:
    # lambdify prints its input into a docstring: half of its time unless subexpressions are eliminated before
    common, reduced = sympy.cse(expressions, list=False)
    return sympy.lambdify(arguments, reduced, module, cse=lambda _: (common, reduced))
