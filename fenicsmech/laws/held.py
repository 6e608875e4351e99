"""Long scalar formulas in forms, of which no form holds the derivatives of inner steps.

UFL differentiates step by step, and forms of the second derivatives with respect to fields have a hundred times the
operations of a formula of a few numbers q, such as invariants. In place of f(q) they get

    f(q₀) + f′(q₀) (q − q₀) + ½ f″(q₀) (q − q₀)²,     q₀ = q as a value, of which no derivatives are taken.

Value and derivatives up to the second are those of f. Where no derivatives by fields are taken, f(q) itself stands.
"""

from __future__ import annotations

from collections.abc import Callable
from weakref import WeakSet

from ufl import Coefficient, diff, variable
from ufl.algorithms import expand_derivatives
from ufl.core.expr import Expr
from ufl.corealg.map_dag import map_expr_dag
from ufl.corealg.multifunction import MultiFunction


def undifferentiated(value: Expr | float) -> Expr | float:
    """``value`` as forms see it that take no derivatives of it: its functions are others that share their values."""
    return map_expr_dag(_Undifferentiated(), expand_derivatives(value)) if isinstance(value, Expr) else value


def second_order(f: Callable[..., Expr], *q: Expr) -> Expr:
    """f(q) with its first and second derivatives with respect to the numbers ``q``; it has no others."""
    if not any(map(_is_differentiated, q)):
        return f(*q)
    held = [variable(undifferentiated(each)) for each in q]
    change = [each - value.ufl_operands[0] for each, value in zip(q, held, strict=True)]
    found = value = f(*held)
    for i, (first, step) in enumerate(zip(held, change, strict=True)):
        slope = diff(value, first)
        found += slope * step
        for k in range(i + 1):
            found += (0.5 if k == i else 1.0) * diff(slope, held[k]) * step * change[k]
    return found


def _is_differentiated(value: Expr) -> bool:
    """Whether a field is in it, but for those held."""
    # by identity: UFL compares long expressions term by term
    rest, known = [value], {id(value)}
    while rest:
        each = rest.pop()
        if isinstance(each, Coefficient) and each not in _HELD:
            return True
        new = [part for part in each.ufl_operands if id(part) not in known]
        known.update(map(id, new))
        rest += new
    return False


class _Undifferentiated(MultiFunction):
    expr = MultiFunction.reuse_if_untouched

    def variable(self, o, operand, label):
        return operand

    def coefficient(self, o):
        if o in _HELD:
            return o
        other = type(o)(o.function_space, o.x)
        _HELD.add(other)
        return other


_HELD: WeakSet = WeakSet()
"""Functions of which no derivatives are taken."""
