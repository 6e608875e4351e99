"""Ending a computation: equilibria, derivatives and estimates ask before each factor whether they go on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from fenicsmech.equilibrium import BySize, LinearMethod, LinearSolver


class Cancelled(Exception):
    """Another task has come."""


class TooLong(Exception):
    """The time of a task is over."""


@dataclass(frozen=True)
class Cancellable(LinearMethod):
    """The method by size, whose solvers call ``check`` before they factor.

    Every iteration of Newton's method, every adjoint and every estimate needs a factor: what they belong to ends within
    an iteration, by what ``check`` raises.

    Attributes:
        check: raises Cancelled or TooLong.
    """

    check: Callable[[], None]

    def solver(self, system):
        return _Checked(BySize().solver(system), self.check)


class _Checked(LinearSolver):
    def __init__(self, own: LinearSolver, check: Callable[[], None]) -> None:
        self._own, self._check = own, check

    def refactor(self):
        self._check()
        return self._own.refactor()

    def solve(self, right, solution, tolerance):
        return self._own.solve(right, solution, tolerance)

    def inertia(self):
        return self._own.inertia()

    def known_inertia(self):
        return self._own.known_inertia()

    def solve_and_count(self, right, solution, tolerance):
        return self._own.solve_and_count(right, solution, tolerance)
