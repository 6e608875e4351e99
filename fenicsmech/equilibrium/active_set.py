"""One-sided constraints within a Newton step: the step with contact linearised, not fixed.

With the forces of contact f = d ⟨−g⟩, d = w / c, a Newton step fixes which points touch; here it does not. The step δu is
that of the energy with the gap linearised, its minimum where that is convex,

    K₀ δu + r₀ = Σ f(γ) b,     γ = g + b · δu,     b = ∇g,     f(γ) = d ⟨−γ⟩.

K is factored with the points A that are expected to touch, K = K₀ + Σ_A d b bᵀ; its own step s₀ leads to gaps γ₀. What
others do is a correction a of their forces,

    γ = γ₀ + S a,     a = f(γ) − f(g) + [A] d (γ − g),     S = bᵀ K⁻¹ b,

a piecewise linear equation in the points alone that change, one solve with the factor for each. It is itself solved by
Newton's method, its steps in full as long as they settle, then shortened to the least energy

    ½ aᵀ S a − Σ ∫ a(γ) dγ.

Iterations so depend on how far from linear gaps and links are, not on how many points change: those that come to touch
when a link lies down on an obstacle, or peels off, cost a solve and no iteration.

Source: Robinson's generalised equations, Josephy–Newton method; Dontchev & Rockafellar, Implicit Functions and Solution
Mappings (doi:10.1007/978-1-4939-1037-3), section 6C.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.optimize import nnls

from fenicsmech.collective import from_one
from fenicsmech.effects import OneSided
from fenicsmech.equilibrium.unknowns import Numbering, ScaledUnknowns

Solve = Callable[[PETSc.Vec], "PETSc.Vec | None"]
_DEBUG = __import__("os").environ.get("LOG")


class ActiveSet:
    def __init__(self, surfaces: Sequence[OneSided], numbering: Numbering, comm: MPI.Comm) -> None:
        self._surfaces, self._numbering, self._comm = surfaces, numbering, comm

    def start(self, factor: float) -> None:
        self._factor = factor
        self._sections = np.cumsum([len(surface.weights0) for surface in self._surfaces])[:-1]
        self.update()
        self.active, self.pressures = self._gaps < 0.0, self._penalties
        self._columns = np.zeros((len(self._gaps), 0))
        self.new_factor()

    def new_factor(self) -> None:
        self._places = np.zeros(0, int)
        self._columns = np.zeros((len(self._gaps), 0))

    def update(self) -> None:
        for surface in self._surfaces:
            surface.update()
        self._gaps = self._joined(lambda surface: surface.gaps)
        self._stiffness = self._factor * self._joined(lambda s: s.weights / s.compliances)
        self._c = self._joined(lambda s: s.compliances)

    @property
    def changed(self) -> bool:
        """Whether the points of the matrix last linearised are not those that touch at the loaded state."""
        self.update()
        return self._comm.allreduce(int(np.any((self._gaps < 0.0) != self.active))) > 0

    def add_stiffness(self, matrix: PETSc.Mat) -> None:
        self.update()
        excess = self._factor * (self.active * 1.0 - (self._gaps < 0.0)) / self._c
        pressures = self._factor * (self.pressures - self._penalties)
        for (surface, own), (_, pressure) in zip(self._each(excess), self._each(pressures), strict=True):
            surface.add_stiffness(matrix, self._numbering.rows_of, own, pressure)

    def corrected(self, x: PETSc.Vec, right: PETSc.Vec, unknowns: ScaledUnknowns, solve: Solve) -> PETSc.Vec | None:
        """x with K x the residual (``right``), after the changes of contact."""
        self.update()
        nodes = self._numbering.rows.nodes.local
        start = self._gaps - self._rates(unknowns.apply(x)[nodes])
        gaps = start
        a = np.zeros(len(self._places))
        for _ in range(30):
            inside = np.zeros(len(self._first_numbers()), bool)
            a_all = self._change(gaps)
            numbers = self._first + np.flatnonzero(np.abs(a_all) > 0)
            new = np.setdiff1d(np.concatenate(self._comm.allgather(numbers)), self._places)
            if not len(new) and _ > 0:
                break
            if not self._add(new, unknowns, solve):
                return None
            a = self._solved(start, a)
            gaps = start + self._columns @ a
        if _DEBUG:
            print(f"      columns {len(self._places)} of {len(gaps)}, rounds {_}, active {self.active.sum()} -> {(gaps < 0).sum()}, inner {self._inner}")
        self.next_active, self.next_pressures = gaps < 0.0, np.maximum(-gaps, 0.0) / self._c
        if not len(a):
            return x
        b = right.duplicate()
        forces = np.zeros(len(gaps))
        own = (self._places >= self._first) & (self._places < self._first + len(gaps))
        forces[self._places[own] - self._first] = a[own]
        b.axpby(1.0, 0.0, right)
        b.axpy(-1.0, self._right(forces, unknowns))
        return solve(b)

    def _rates(self, motion: np.ndarray) -> np.ndarray:
        return self._joined(lambda surface: surface.rates(motion))

    @property
    def _penalties(self) -> np.ndarray:
        """⟨−g⟩ / c."""
        return np.maximum(-self._gaps, 0.0) / self._c

    def _joined(self, values) -> np.ndarray:
        return np.concatenate([values(surface) for surface in self._surfaces])

    def _each(self, values: np.ndarray) -> list[tuple[OneSided, np.ndarray]]:
        return list(zip(self._surfaces, np.split(values, self._sections), strict=True))

    def take(self):
        self.active, self.pressures = self.next_active, self.next_pressures

    def _first_numbers(self):
        counts = self._comm.allgather(len(self._gaps))
        self._first = sum(counts[: self._comm.rank])
        return self._gaps

    def _right(self, forces: np.ndarray, unknowns: ScaledUnknowns) -> PETSc.Vec:
        """Gᵀ of Σ a b."""
        links = np.zeros(self._numbering.rows.links.count)
        values = forces / self._joined(lambda s: s.weights)
        links[self._numbering.rows.nodes.local] = -np.sum([s.forces(own) for s, own in self._each(values)], axis=0)
        return unknowns.apply_transpose(links, np.zeros(self._numbering.unknowns.border.size))

    def _add(self, new: np.ndarray, unknowns, solve) -> bool:
        columns = []
        for number in new:
            forces = np.zeros(len(self._gaps))
            if 0 <= number - self._first < len(forces):
                forces[number - self._first] = 1.0
            z = solve(self._right(forces, unknowns))
            if z is None:
                return False
            columns.append(self._rates(unknowns.apply(z)[self._numbering.rows.nodes.local]))
        if columns:
            self._columns = np.column_stack([self._columns, *columns])
            self._places = np.concatenate([self._places, new])
        return True

    def _change(self, gaps):
        """a by γ."""
        now, d = self._gaps, self._stiffness
        return d * (np.maximum(-gaps, 0) - np.maximum(-now, 0) + self.active * (gaps - now))

    def _solved(self, start, a):
        own = (self._places >= self._first) & (self._places < self._first + len(start))
        rows = self._places[own] - self._first
        local = (np.flatnonzero(own), self._columns[rows], start[rows], self._gaps[rows], self._stiffness[rows], self.active[rows])
        parts = self._comm.allgather(local)
        n = len(self._places)
        S, g0, g, d, act = np.zeros((n, n)), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n, bool)
        for where, columns, s0, now, stiff, active in parts:
            S[where], g0[where], g[where], d[where], act[where] = columns, s0, now, stiff, active
        first = np.concatenate([a, np.zeros(n - len(a))])
        a, self._inner = from_one(self._comm, lambda: _settled(0.5 * (S + S.T), g0, g, d, act, first))
        return a


def _settled(compliance, start, now, d, active, a):
    """a of the points, and whether it was found."""
    found = _by_newton(compliance, start, now, d, active, a, 10)
    if found[1] > 0:
        return found
    guess = _by_pressures(compliance, start, now, d, active)
    if guess is None:
        return found[0], -2
    found = _by_newton(compliance, start, now, d, active, guess, 10)
    return found if found[1] > 0 else (guess, -1)


def _by_newton(S, start, now, d, active, a, limit):
    sign = np.where(active, 1.0, -1.0)
    const = np.maximum(sign * now, 0)
    on = sign * (start + S @ a) > 0
    for k in range(limit):
        target = np.where(on, 0.0, -d * const)
        rhs = start[on] - sign[on] * const[on] + S[np.ix_(on, ~on)] @ target[~on]
        target[on] = np.linalg.solve(np.diag(sign[on] / d[on]) - S[np.ix_(on, on)], rhs)
        a, before = target, on
        on = sign * (start + S @ a) > 0
        if (on == before).all():
            return a, k + 1
    return a, -1


def _by_pressures(S, start, now, d, active):
    """The least of ½ p · M p + γ₀ · p for p ≥ 0."""
    force = d * np.maximum(-now, 0.0)
    springs = d * active
    known = np.linalg.solve(np.eye(len(d)) - S * springs, np.column_stack([S, start - S @ (force + springs * now)]))
    M, free = known[:, :-1] + np.diag(1.0 / d), known[:, -1]
    unit = 1.0 / np.sqrt(np.abs(np.diag(M)))
    try:
        L = np.linalg.cholesky(0.5 * (M + M.T) * unit[:, None] * unit)
    except np.linalg.LinAlgError:
        return None
    p = unit * nnls(L.T, np.linalg.solve(L, -unit * free), maxiter=10 * len(d))[0]
    gaps = free + M @ p - p / d
    return p - force + springs * (gaps - now)
