"""Functions given by formulae, differentiated symbolically and compiled to Python.

    f(x; c) ∈ Rᵐ,     ∂f_k/∂x_i,     Σ_k w_k ∂²f_k/∂x_i∂x_j

with variables x ∈ Rⁿ and constants c.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
import sympy
from sympy import Symbol


class SmoothFunction:
    """A function f of n variables with m components; each of its derivatives is compiled when it is first used.

    Every function takes the variables (n,) and the constants (k,). With ``many`` points at once every array has a
    leading axis, of the points; without it is for one point, and fastest there.

    Args:
        formulae: one per component.
        variables: x; the names x0, x1, … are reserved for common subexpressions.
        constants: c.
        many: whether for many points at once.
    """

    def __init__(
        self,
        formulae: Sequence[sympy.Expr],
        variables: Sequence[Symbol],
        constants: Sequence[Symbol],
        *,
        many: bool = False,
    ) -> None:
        self.size = len(formulae)  # m
        self._formulae, self._variables, self._constants = list(formulae), variables, constants
        self._compiled = _at_many_points if many else _at_one_point

    @cached_property
    def value(self) -> Callable[..., np.ndarray]:
        """f, (m,)."""
        return self._compiled(self._formulae, (self._variables, self._constants), (self.size,))

    @cached_property
    def gradient(self) -> Callable[..., np.ndarray]:
        """∂f/∂x, (m, n)."""
        entries = [entry for row in self._rows for entry in row]
        return self._compiled(entries, (self._variables, self._constants), (self.size, len(self._variables)))

    @cached_property
    def hessian(self) -> Callable[..., np.ndarray]:
        """Σ_k w_k ∂²f_k/∂x², (n, n); weights w, (m,), are the last argument."""
        n, weights = len(self._variables), sympy.symbols(f"w0:{self.size}", real=True)
        weighted = [
            sum((w * row[i] for w, row in zip(weights, self._rows, strict=True)), sympy.S.Zero) for i in range(n)
        ]
        rows, columns = np.tril_indices(n)
        lower = [sympy.diff(weighted[i], self._variables[j]) for i, j in zip(rows, columns, strict=True)]
        place = np.empty((n, n), dtype=int)
        place[rows, columns] = place[columns, rows] = np.arange(len(rows))
        triangle = self._compiled(lower, (self._variables, self._constants, weights), (len(rows),))
        return lambda *point: triangle(*point)[..., place]

    @cached_property
    def _rows(self) -> list[list[sympy.Expr]]:
        """∂f/∂x, symbolic."""
        return [[sympy.diff(f, x) for x in self._variables] for f in self._formulae]


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
