"""One-sided constraints within a Newton step: gaps are linearised, the points that touch are found with the step.

A Newton step of the energy ∫ ½ ⟨−g⟩² / c dA fixes which points touch and pushes them out one by one: hundreds of
iterations where a slender link lies down on an obstacle or peels off. Here the step s solves, with b = ∇g, d = w / c,

    K₀ s + r₀ = Σ f(γ) b,     γ = g + b · s,     f(γ) = d ⟨−γ⟩,

K₀ and r₀ without contact. The factored matrix holds the points A that are expected to touch, K = K₀ + Σ_A d b bᵀ. Its
step leaves the gaps γ₀ and misses forces of contact by a,

    γ = γ₀ + S a,     a = f(γ) − f(g) + [A] d (γ − g),     S = bᵀ K⁻¹ b,

a piecewise linear equation of the points where a is not zero, found by the largest a, and doubled until none is left:
a solve with the factor for each, and small dense systems. Newton's method settles most of them in a few steps. If not,
the forces p = f(γ) ≥ 0 at these points are the least of ½ p · (S₀ + 1/d) p + γ₀₀ · p, a non-negative least-squares
problem if contact at others keeps the links stable; S₀ and γ₀₀ are S and γ₀ without the springs d. If it does not, the
step stays that of K.

Steps into a plane across a path (see ``control``) add τ x₁, so that gaps also change by τ b · x₁; forces a that lead
out of the plane change τ by t · a. Least squares are then solved for given τ, and the τ that leads into the plane is
found by Brent's method.

Points of rigid links are found in the same way, with b the rates of their gaps by the links' poses.

Iterations thus depend on how far from linear links and gaps are, not on how many points touch or come and go. The next
matrix takes the points and pressures of the linearised gaps, not those of the state, whose gaps are of second order.

Sources: Dontchev & Rockafellar, Implicit Functions and Solution Mappings (doi:10.1007/978-1-4939-1037-3), section 6C,
Newton's method for generalised equations; Lawson & Hanson, Solving Least Squares Problems
(doi:10.1137/1.9781611971217), chapter 23.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.optimize import brentq, nnls

from fenicsmech.collective import from_one
from fenicsmech.effects import OneSided, TouchingPoints
from fenicsmech.equilibrium.control import PathPlane
from fenicsmech.equilibrium.unknowns import ScaledUnknowns
from fenicsmech.errors import set_options
from fenicsmech.mechanism import Link


@dataclass(frozen=True)
class ActiveSetOptions:
    """Options of the search for the points that touch.

    Attributes:
        first: points that are corrected at first.
        most: points above which a step leaves the others to the next one: solves for more would cost more than that.
        iterations: Newton steps after which the equation of the points is taken for one that does not settle.
        rounding: missed force, over the largest, that is left to the next step.

    Raises:
        DescriptionError: a number is out of its range.
    """

    first: int = 8
    most: int = 1000
    iterations: int = 10
    rounding: float = 1e-10

    def __post_init__(self) -> None:
        set_options(self, "points that touch", below_one=("rounding",), first=1, most=1, iterations=1)


class ActiveSet:
    """Points of some surfaces, and of rigid links, that are expected to touch, and the steps in which they change.

    Args:
        surfaces: with points.
        rigid: points of rigid links, each with the numbers of its link's poses z.
        unknowns: x and G, at the poses of the last residual.
        comm: the processes.

    Attributes:
        poses: of the loaded state.
    """

    def __init__(
        self,
        surfaces: Sequence[OneSided],
        rigid: Sequence[tuple[TouchingPoints, np.ndarray]],
        unknowns: ScaledUnknowns,
        comm: MPI.Comm,
    ) -> None:
        self._surfaces, self._unknowns, self._comm, self._options = surfaces, unknowns, comm, ActiveSetOptions()
        # all know poses: the rank that holds the border counts their points
        self._rigid, self._own_rigid = rigid, rigid if unknowns.numbering.rows.last else ()
        self.poses = unknowns.poses
        self._compliances = self._joined(lambda surface: surface.compliances)
        self._sections = np.cumsum([len(parts.compliances) for parts in self._parts])[:-1]
        counts = comm.allgather(len(self._compliances))
        self._first = sum(counts[: comm.rank])  # number of this rank's first point over all ranks
        self._load_factor = 0.0
        # A and the pressures in K, and those expected after the step; None: those of the state
        self._active = np.zeros(0, bool)
        self._expected: tuple[np.ndarray, np.ndarray] | None = None
        # of the points corrected with the present factor: numbers, b · K⁻¹ b at this rank's points, and t
        self._corrected, self._columns, self._along = np.zeros(0, int), np.zeros((0, 0)), np.zeros(0)

    def start(self, load_factor: float) -> None:
        """Expects the points that touch at the state that is next linearised; ``load_factor`` is that of the energy."""
        self._load_factor, self._expected = load_factor, None

    def take_factor(self) -> None:
        """Takes the factor at hand for that of the loaded state, with the points that touch there."""
        self._hold(self.touching())

    def _hold(self, active: np.ndarray) -> None:
        """Takes A for that of a new matrix."""
        self._active = active
        self._corrected, self._columns, self._along = np.zeros(0, int), np.zeros((len(active), 0)), np.zeros(0)

    def touching(self) -> np.ndarray:
        """Whether each of this rank's points touches, at the loaded state. Local."""
        self._update()
        return self._gaps < 0.0

    @property
    def current(self) -> bool:
        """Whether the points in the matrix are those that touch at the loaded state."""
        return self._comm.allreduce(int(np.any(self.touching() != self._active))) == 0

    def touched(self, *, expected: bool) -> frozenset[Link]:
        """The links with points that touch at the loaded state, or in the matrix as ``expected`` there."""
        points = self._active if expected else self.touching()
        own = self._each(points)[: len(self._surfaces)]
        count = self._comm.allreduce(np.array([np.count_nonzero(some) for _, some in own]))
        return frozenset(surface.link for surface, some in zip(self._surfaces, count, strict=True) if some)

    def add_stiffness(self, matrix: PETSc.Mat) -> None:
        """Adds the stiffness with the points expected to touch, minus that with those that do at the loaded state, into
        ``matrix`` and leaves it unassembled. Local."""
        touching = self.touching()
        present = np.maximum(-self._gaps, 0.0) / self._compliances
        active, pressures = (touching, present) if self._expected is None else self._expected
        self._hold(active)
        stiffness = self._load_factor * (self._active * 1.0 - touching) / self._compliances
        pairs = zip(self._each(stiffness), self._each(self._load_factor * (pressures - present)), strict=True)
        columns = {id(points): own for points, own in self._own_rigid}
        for (part, own), (_, pressure) in pairs:
            if isinstance(part, OneSided):
                part.add_stiffness(matrix, self._unknowns.numbering.rows_of, own, pressure)
            else:
                rows = (self._unknowns.numbering.rows.poses.first + columns[id(part)]).astype(PETSc.IntType)
                matrix.setValues(rows, rows, part.stiffness(own, pressure), addv=PETSc.InsertMode.ADD)

    def corrected(
        self,
        x: PETSc.Vec,
        residual: PETSc.Vec,
        solve: Callable[[PETSc.Vec], PETSc.Vec | None],
        plane: PathPlane | None = None,
    ) -> PETSc.Vec | None:
        """The solution ``x`` of K x = ``residual`` with contact linearised; None if a solve fails.

        ``solve`` solves with the last factor of the matrix with ``add_stiffness``; steps lead into ``plane``, if any.
        """
        self._update()
        stiffness = self._load_factor * self._joined(lambda surface: surface.weights) / self._compliances
        fixed, ahead, forward = self._gaps - self._rates(x), 0.0, np.zeros(len(self._gaps))
        if plane is not None:
            ahead, forward = plane.missing - plane.along(x), self._rates(plane.x)
        gaps = fixed + ahead * forward
        a, solved = np.zeros(len(self._corrected)), False
        while len(new := self._missed(gaps, stiffness)) or (len(self._corrected) and not solved):
            if len(self._corrected) + len(new) > self._options.most:
                break
            for number in new:
                unit = self._force(np.array([number]), np.ones(1))
                z = solve(unit)
                unit.destroy()  # petsc4py destroys its objects late, and there may be many points
                if z is None:
                    return None
                self._columns = np.column_stack([self._columns, self._rates(z)])
                self._along = np.append(self._along, plane.along(z) if plane is not None else 0.0)
                z.destroy()
                self._corrected = np.append(self._corrected, number)
            found = self._settled(fixed, stiffness, forward, ahead)
            if found is None:
                self._expected = None
                return x
            a, solved = found, True
            gaps = fixed + self._columns @ a + (ahead + self._along @ a) * forward
        self._expected = gaps < 0.0, np.maximum(-gaps, 0.0) / self._compliances
        if not solved:
            return x
        right = residual.copy()
        right.axpy(-1.0, self._force(self._corrected, a))
        return solve(right)

    def _update(self) -> None:
        """Takes the displacements that the fields hold, and the poses. Local."""
        for surface in self._surfaces:
            surface.update()
        for points, _ in self._own_rigid:
            points.update(self.poses)
        self._gaps = self._joined(lambda surface: surface.gaps)

    def _rates(self, x: PETSc.Vec) -> np.ndarray:
        """b · x at this rank's points."""
        unknowns = self._unknowns
        motion = unknowns.apply(x)[unknowns.numbering.rows.nodes.local]
        rates = [surface.rates(motion) for surface in self._surfaces]
        if self._rigid:
            z = unknowns.step(x).z
            rates += [points.rates(z[own]) for points, own in self._own_rigid]
        return _joined(rates)

    def _force(self, points: np.ndarray, forces: np.ndarray) -> PETSc.Vec:
        """Σ a b of ``points``, numbered over all ranks, with the ``forces`` a."""
        numbering, values = self._unknowns.numbering, np.zeros(len(self._gaps))
        own = (points >= self._first) & (points < self._first + len(values))
        values[points[own] - self._first] = forces[own]
        links, border = np.zeros(numbering.rows.links.count), np.zeros(numbering.unknowns.border.size)
        found = self._each(values)
        for surface, forces_here in found[: len(self._surfaces)]:
            links[numbering.rows.nodes.local] -= surface.forces(forces_here / surface.weights)
        z = numbering.unknowns.restrict_border(border).poses
        for (_, columns), (part, forces_here) in zip(self._own_rigid, found[len(self._surfaces) :], strict=True):
            z[columns] -= part.forces(forces_here)
        return self._unknowns.apply_transpose(links, border)

    def _missed(self, gaps: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
        """Numbers of the points to correct next: those of the largest a among the others, as many as so far."""
        a = np.abs(_missing(gaps, self._gaps, stiffness, self._active))
        forces = stiffness * np.maximum(-gaps, 0.0)
        least = self._options.rounding * self._comm.allreduce(float(np.max([a, forces], initial=0.0)), op=MPI.MAX)
        own = np.flatnonzero(a > least)
        numbers, sizes = (np.concatenate(self._comm.allgather(part)) for part in (self._first + own, a[own]))
        others = ~np.isin(numbers, self._corrected)
        order = np.argsort(-sizes[others], kind="stable")
        return numbers[others][order][: max(self._options.first, len(self._corrected))]

    def _settled(
        self, fixed: np.ndarray, stiffness: np.ndarray, forward: np.ndarray, ahead: float
    ) -> np.ndarray | None:
        """a of the points corrected, None if it is not found."""
        points = self._corrected
        own = np.flatnonzero((points >= self._first) & (points < self._first + len(fixed)))
        rows = points[own] - self._first
        values = np.column_stack([fixed[rows], self._gaps[rows], stiffness[rows], self._active[rows], forward[rows]])
        parts = self._comm.allgather((own, self._columns[rows], values))

        def solution() -> np.ndarray | None:
            places, columns, known = (np.concatenate(part) for part in zip(*parts, strict=True))
            order = np.argsort(places)
            compliance, (gaps, present, d, active, rates) = columns[order], known[order].T
            S, iterations = 0.5 * (compliance + compliance.T), self._options.iterations
            return _Equation(S, gaps, present, d, active > 0.0, rates, self._along, ahead, iterations).solution()

        # of one process: which points touch is a decision that depends on rounding
        return from_one(self._comm, solution)

    @property
    def _parts(self) -> list[OneSided | TouchingPoints]:
        """Surfaces, and this rank's points of rigid links."""
        return [*self._surfaces, *(points for points, _ in self._own_rigid)]

    def _joined(self, values: Callable[[OneSided | TouchingPoints], np.ndarray]) -> np.ndarray:
        return _joined([values(part) for part in self._parts])

    def _each(self, values: np.ndarray) -> list[tuple[OneSided | TouchingPoints, np.ndarray]]:
        return list(zip(self._parts, np.split(values, self._sections), strict=True)) if self._parts else []


def _joined(values: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate(values) if values else np.zeros(0)


def _missing(gaps: np.ndarray, present: np.ndarray, d: np.ndarray, active: np.ndarray) -> np.ndarray:
    """a, the force of contact at ``gaps`` γ minus that of the step with A fixed, from the ``present`` gaps g."""
    return d * (np.maximum(-gaps, 0.0) - np.maximum(-present, 0.0) + active * (gaps - present))


@dataclass(frozen=True, eq=False)
class _Equation:
    """a = f(γ) − f(g) + [A] d (γ − g) of n points, with γ = γ₀ + S a + h γ′ and h = h₀ + t · a.

    Attributes:
        S: compliance, (n, n).
        fixed: γ₀, (n,).
        present: g, (n,).
        d: stiffness, (n,).
        active: whether a point is in A, (n,).
        forward: γ′, rate of the gaps along a path, (n,); zero under other controls.
        along: t, (n,); zero under other controls.
        ahead: h₀.
        iterations: after which an iteration is taken for one that does not settle.
    """

    S: np.ndarray
    fixed: np.ndarray
    present: np.ndarray
    d: np.ndarray
    active: np.ndarray
    forward: np.ndarray
    along: np.ndarray
    ahead: float
    iterations: int

    def solution(self) -> np.ndarray | None:
        """a; None if it is not found."""
        try:
            found = self._by_newton(np.zeros(len(self.d)))
            return self._by_newton(self._start()) if found is None else found
        except (np.linalg.LinAlgError, RuntimeError):  # not convex; too many iterations of nnls; no plane reached
            return None

    def _by_newton(self, a: np.ndarray) -> np.ndarray | None:
        """From the points that touch with ``a``.

        With σ = 1 in A, −1 elsewhere, a = d (⟨σ γ⟩ − ⟨σ g⟩), linear where σ γ > 0 and constant elsewhere.
        """
        sign, d = np.where(self.active, 1.0, -1.0), self.d
        S, fixed = self.S + np.outer(self.forward, self.along), self.fixed + self.ahead * self.forward
        before = np.maximum(sign * self.present, 0.0)
        on = sign * (fixed + S @ a) > 0.0
        for _ in range(self.iterations):
            a = -d * before
            right = fixed[on] - sign[on] * before[on] + S[np.ix_(on, ~on)] @ a[~on]
            a[on] = np.linalg.solve(np.diag(sign[on] / d[on]) - S[np.ix_(on, on)], right)
            last, on = on, sign * (fixed + S @ a) > 0.0
            if np.array_equal(last, on):
                return a
        return None

    def _start(self) -> np.ndarray:
        """a by least squares; in a plane across a path at the h that leads there."""

        def missed(h: float) -> float:
            return h - self.ahead - float(self.along @ self._by_least_squares(h))

        far = near = self.ahead
        if (first := missed(near)) != 0.0:
            for doubling in range(self.iterations):
                if missed(near - 2.0**doubling * first) * first <= 0.0:
                    break
            else:
                raise RuntimeError("contact keeps the path from reaching the plane")
            # in units of the first miss: tolerances do not depend on those of the control
            far = near - first * brentq(lambda t: missed(near - t * first) / first, 0.0, 2.0**doubling, rtol=1e-6)
        return self._by_least_squares(far)

    def _by_least_squares(self, h: float) -> np.ndarray:
        """a at a given h from the forces p, with the springs of A among these points removed."""
        S, d, fixed = self.S, self.d, self.fixed + h * self.forward
        force, springs = d * np.maximum(-self.present, 0.0), d * self.active
        known = np.column_stack([S, fixed - S @ (force + springs * self.present)])
        known = np.linalg.solve(np.eye(len(d)) - S * springs, known)
        M, free = known[:, :-1] + np.diag(1.0 / d), known[:, -1]
        unit = 1.0 / np.sqrt(np.abs(np.diag(M)))
        L = np.linalg.cholesky(0.5 * (M + M.T) * unit[:, None] * unit)
        p = unit * nnls(L.T, np.linalg.solve(L, -unit * free), maxiter=10 * len(d))[0]
        gaps = free + M @ p - p / d
        return p - force + springs * (gaps - self.present)
