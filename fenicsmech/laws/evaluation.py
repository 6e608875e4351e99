"""Formulas of numbers in UFL, evaluated by NumPy at many points at once: no mesh, nothing compiled.

Numbers are UFL variables; derivatives by them, ``ufl.diff``, are taken before evaluation, so that a law's ``energy`` is
the only place where its formula stands.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import ufl.classes as node
from numpy.typing import ArrayLike, NDArray
from ufl import as_ufl, variable
from ufl.algorithms import expand_derivatives
from ufl.core.expr import Expr
from ufl.corealg.traversal import unique_post_traversal

from fenicsmech.laws.law import Law

_UFUNCS: dict[type, Callable[..., NDArray]] = {
    node.Sum: np.add,
    node.Product: np.multiply,
    node.Division: np.divide,
    node.Power: np.power,
    node.Abs: np.abs,
    node.Conj: np.conj,
    node.Real: np.real,
    node.Sqrt: np.sqrt,
    node.Exp: np.exp,
    node.Ln: np.log,
    node.Cos: np.cos,
    node.Sin: np.sin,
    node.Tan: np.tan,
    node.Cosh: np.cosh,
    node.Sinh: np.sinh,
    node.Tanh: np.tanh,
    node.Acos: np.arccos,
    node.Asin: np.arcsin,
    node.Atan: np.arctan,
    node.MinValue: np.minimum,
    node.MaxValue: np.maximum,
    node.Conditional: np.where,
    node.LT: np.less,
    node.GT: np.greater,
    node.LE: np.less_equal,
    node.GE: np.greater_equal,
    node.EQ: np.equal,
    node.NE: np.not_equal,
    node.AndCondition: np.logical_and,
    node.OrCondition: np.logical_or,
    node.NotCondition: np.logical_not,
    node.Variable: lambda value: value,
    node.ListTensor: lambda *values: np.stack(np.broadcast_arrays(*values)),
}


def number() -> Expr:
    """A number as formulas see it, whose value evaluation gives."""
    return variable(as_ufl(1.0))


class LawForm:
    """A law as the key of its formulas: of its class and the number of its terms, not of its numbers."""

    def __init__(self, law: Law) -> None:
        self.law, self._key = law, (type(law), tuple(law.parameters))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, LawForm) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


class Formulas:
    """Scalar formulas of ``numbers``, (m,), as one function of arrays.

    Args:
        formulas: of ``number``s; derivatives by them included.
        numbers: all that occur, in the order of the values.
    """

    def __init__(self, formulas: Sequence[Expr], numbers: Sequence[Expr]) -> None:
        places: dict[Expr, int] = {}
        steps: list[tuple[Callable[..., NDArray], tuple[int, ...]]] = []
        results = []
        for formula in formulas:
            expanded = expand_derivatives(as_ufl(formula))
            for each in unique_post_traversal(expanded):
                if each not in places and not isinstance(each, node.MultiIndex | node.Label):
                    places[each] = len(steps)
                    operands = () if each in numbers else (places[k] for k in each.ufl_operands if k in places)
                    steps.append((_function(each), tuple(operands)))
            results.append(places[expanded])
        self._steps, self._results = steps, results
        self._given = [places.get(each) for each in numbers]

    def __call__(self, *values: ArrayLike) -> NDArray[np.float64]:
        """(m, n) at n points, from one or n values of each number; NaN or infinite where a formula has no value."""
        arrays = [np.atleast_1d(value) for value in values]
        given = dict(zip(self._given, arrays, strict=True))
        found: list[Any] = []
        # branches of conditions that do not count are evaluated as well
        with np.errstate(all="ignore"):
            for place, (function, operands) in enumerate(self._steps):
                known = given.get(place)
                found.append(function(*[found[k] for k in operands]) if known is None else known)
        count = max(map(len, arrays))
        return np.array([np.broadcast_to(found[k], count) for k in self._results], dtype=float)


def _function(each: Expr) -> Callable[..., NDArray]:
    """Of the values of a node's operands; axes of values are those of its shape, its free indices, and the points."""
    if isinstance(each, node.Zero):
        zero = np.zeros((*each.ufl_shape, *each.ufl_index_dimensions, 1))
        return lambda: zero
    if isinstance(each, node.Identity):
        identity = np.eye(*each.ufl_shape)[..., None]
        return lambda: identity
    if isinstance(each, node.ScalarValue):
        scalar = np.array([float(each)])
        return lambda: scalar
    if isinstance(each, node.Indexed | node.ComponentTensor | node.IndexSum):
        return partial(_reindexed, each)
    function = _UFUNCS[type(each)]
    if isinstance(each, node.Product | node.Division | node.Power) and each.ufl_free_indices:
        return lambda *values: function(*(_aligned(v, k, each) for v, k in zip(values, each.ufl_operands, strict=True)))
    return function


def _aligned(value: NDArray, part: Expr, whole: Expr) -> NDArray:
    """The value of a scalar ``part`` with an axis for each free index of the ``whole``."""
    own = dict(zip(part.ufl_free_indices, part.ufl_index_dimensions, strict=True))
    return value.reshape(*(own.get(index, 1) for index in whole.ufl_free_indices), -1)


def _reindexed(each: Expr, value: NDArray) -> NDArray:
    """A_ij of A, A of A_ij, Σ_i A_i."""
    part, indices = each.ufl_operands
    labels: dict[Any, int] = {}

    def label(index: Any) -> int:
        return labels.setdefault(index, len(labels))

    axes = [label(("axis", k)) for k in range(len(part.ufl_shape))]
    free = [label(index) for index in part.ufl_free_indices]
    if isinstance(each, node.Indexed):
        fixed = [isinstance(index, node.FixedIndex) for index in indices]
        value = value[tuple(int(i) if f else slice(None) for i, f in zip(indices, fixed, strict=True))]
        axes = [label(index.count()) for index, f in zip(indices, fixed, strict=True) if not f]
    result = axes if isinstance(each, node.IndexSum) else []
    if isinstance(each, node.ComponentTensor):
        result = [label(index.count()) for index in indices] + axes
    kept = [label(index) for index in each.ufl_free_indices]
    points: Any = ...
    return np.einsum(value, [*axes, *free, points], [*result, *kept, points])
