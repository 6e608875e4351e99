"""The affine maps that handles apply to their surroundings, with derivatives derived symbolically once per kind.

A handle at X moves a point v around it by T (v_x − X_x, v_y − X_y, 1), with T of shape (2, 3):

    turning by α about a joint:       T = [R(α) − I | 0]
    riding at x, unit tangent e, δ:   T = [δ R(e) R(eᵢₙᵢₜ)ᵀ − I | x − X]

The out-of-plane coordinate is not changed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import sympy


@dataclass(frozen=True)
class Transform:
    """A compiled map, for n handles at once.

    Every function takes the variables (n, m) and the constants of the handles, (n, k).

    Attributes:
        value: T, (n, 2, 3).
        gradient: ∂T/∂q of the variables q, (n, 2, 3, m).
        hessian: takes G (n, 2, 3) last; Σ G ∂²T/∂q², (n, m, m).
    """

    value: Callable[..., np.ndarray]
    gradient: Callable[..., np.ndarray]
    hessian: Callable[..., np.ndarray]


@cache
def turning() -> Transform:
    """The map of a joint handle; variable: α; no constants."""
    angle = sympy.Symbol("alpha", real=True)
    return _derive(_turn_and_scale(sympy.S.One, sympy.cos(angle), sympy.sin(angle), sympy.zeros(2, 1)), [angle], [])


@cache
def riding() -> Transform:
    """The map of an intermediary handle.

    Variables: position (2), δ, tangent of any length (2). Constants: initial position (2) and unit tangent (2).
    """
    x, y, delta, u, v = variables = sympy.symbols("x y delta u v", real=True)
    X, Y, U, V = constants = sympy.symbols("X Y U V", real=True)
    scale = delta / sympy.sqrt(u * u + v * v)
    turn = _turn_and_scale(scale, u * U + v * V, v * U - u * V, sympy.Matrix([x - X, y - Y]))
    return _derive(turn, variables, constants)


def _turn_and_scale(scale: sympy.Expr, cosine: sympy.Expr, sine: sympy.Expr, shift: sympy.Matrix) -> sympy.Matrix:
    """[scale R − I | shift]."""
    return (scale * sympy.Matrix([[cosine, -sine], [sine, cosine]]) - sympy.eye(2)).row_join(shift)


def _derive(transform: sympy.Matrix, variables: Sequence[sympy.Symbol], constants: Sequence[sympy.Symbol]) -> Transform:
    entries, m = list(transform), len(variables)
    weights = sympy.symbols("g0:6", real=True)
    pull = sum((g * entry for g, entry in zip(weights, entries, strict=True)), sympy.S.Zero)

    def compile_(expressions, shape, *more):
        flat = sympy.lambdify((variables, constants, *more), expressions, "numpy", cse=True)

        def evaluate(q, c, *weight):
            numbers = flat(q.T, c.T, *(w.reshape(-1, 6).T for w in weight))
            rows = np.empty((len(numbers), len(q)))
            for row, number in zip(rows, numbers, strict=True):
                row[:] = number
            return rows.T.reshape(len(q), *shape)

        return evaluate

    slopes = [sympy.diff(pull, q) for q in variables]
    lower = compile_(
        [sympy.diff(slopes[i], variables[j]) for i in range(m) for j in range(i + 1)], (m * (m + 1) // 2,), weights
    )
    return Transform(
        value=compile_(entries, (2, 3)),
        gradient=compile_([sympy.diff(entry, q) for entry in entries for q in variables], (2, 3, m)),
        hessian=lambda *point: _symmetric(lower(*point), m),
    )


def _symmetric(lower: np.ndarray, m: int) -> np.ndarray:
    """The symmetric matrices (n, m, m) with the given lower triangles, row by row."""
    full = np.empty((len(lower), m, m))
    rows, columns = np.tril_indices(m)
    full[:, rows, columns] = full[:, columns, rows] = lower
    return full
