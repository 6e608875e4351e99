"""Optimal handle positions, min over θ of S(θ, p) = Σ_e ρ(e) + ε B(θ), and their derivatives with respect to p.

B keeps handles apart that follow each other along the spline, by the gaps g_k between them over those as drawn, g⁰_k,

    B = Σ_k log³ max(a g⁰_k / g_k, 1),     a = 0.2.

Cells alone may not: where no vertex lies between two handles, Σρ may fall until they meet, and no step leads on.

Links do not have cells in common, so S is a sum of functions of the θ of one shape each; the cells of links that share
a shape depend on the same θ. Newton's method with exact Hessians minimises them together, with a line search for each
that refuses inverted cells. By the implicit function theorem

    dθ/dp = −S_θθ⁻¹ S_θp     (0 for handles held at a kink of the spline).

The spline's tangent has a kink at interior control points, and so has S as a function of t where a handle slides over
one. A handle there moves to the side on which S falls, and is held if S rises to both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from petsc4py import PETSc
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import coo_matrix, csr_matrix

from fenicsmech.design.shape.handles import LinkHandles
from fenicsmech.design.shape.quality import QualitySum
from fenicsmech.design.shape.shape_map import ShapeMap
from fenicsmech.errors import FenicsmechError, set_options
from fenicsmech.log import logger

_log = logger(__name__)


class ShapeError(FenicsmechError):
    """A design has no rest shape without inverted cells."""


@dataclass(frozen=True)
class HandleOptions:
    """Options of the search for optimal handle positions.

    Attributes:
        iterations: maximum number of Newton iterations; nearby designs take two or three.
        settled: predicted decrease of S, relative, after which one last step is taken: smaller ones are rounding.
        armijo: fraction of the decrease predicted by the slope that a step must reach.
        shortest: fraction of a step at which the search of a link ends without one.
        halvings: of a change of p that inverts cells.
        turn: largest turn of a joint in one step, rad.
        kept: part of the gap to the next handle that one step must leave.
        flattest: least eigenvalue of the Hessian in a step, relative to the largest.
        apart: ε, in cells.
        close: a, the gap between handles over that as drawn below which they are kept apart.

    Raises:
        DescriptionError: a number is out of its range.
    """

    iterations: int = 60
    settled: float = 1e-10
    armijo: float = 1e-4
    shortest: float = 1e-8
    halvings: int = 4
    turn: float = 0.5
    kept: float = 0.2
    flattest: float = 1e-8
    apart: float = 1e-3
    close: float = 0.2

    def __post_init__(self) -> None:
        parts = ("armijo", "shortest", "kept", "flattest", "close")
        set_options(self, "optimal handle positions", below_one=parts, iterations=1, halvings=0)


@dataclass(frozen=True, eq=False)
class HandlePlacement:
    """The best handle positions of a design.

    Attributes:
        p: the design, (parameters,).
        theta: its handle positions, (handles,).
        quality: Σ_e ρ(e) of the links that change.
        iterations: Newton iterations.
    """

    p: np.ndarray
    theta: np.ndarray
    quality: float = np.inf
    iterations: int = 0


class HandleOptimum:
    """Best handle positions as a function of the design.

    All methods leave the design field at the placement that they return or were given.

    Args:
        shape_map: from design and handle positions to the field.
        quality: Σρ in this field.
    """

    def __init__(self, shape_map: ShapeMap, quality: QualitySum) -> None:
        self._map, self._quality, self._options = shape_map, quality, HandleOptions()
        self._handles = [shape.handles for shape in shape_map.shapes]
        self._reducer: _MomentHessian | None = None
        self._known: tuple[HandlePlacement | None, list[PositionDerivatives]] = (None, [])

    def solve(self, p: np.ndarray, start: HandlePlacement | None = None) -> HandlePlacement:
        """The best handle positions for design ``p``.

        Args:
            p: the design, (parameters,).
            start: placement of a nearby design; that of the initial mesh by default.

        Raises:
            ShapeError: cells stay inverted however the handles are placed.
        """
        p = np.array(p, dtype=float)
        if not self._handles:
            return HandlePlacement(p, np.zeros(0))
        start = start or HandlePlacement(self._map.initial, self._map.initial_theta)
        return self._solve(p, start, self._options.halvings)

    def total_gradient(self, placement: HandlePlacement, by_p: np.ndarray, by_theta: np.ndarray) -> np.ndarray:
        """dO/dp = ∂O/∂p + ∂O/∂θ dθ/dp, (…, parameters).

        Args:
            placement: from ``solve``.
            by_p, by_theta: ∂O/∂p (…, parameters) and ∂O/∂θ (…, handles), as from ``ShapeMap.apply_transpose``.

        Raises:
            ShapeError: S_θθ is not positive definite.
        """
        if not self._handles:
            return by_p
        total, links = by_p.copy(), self._second_derivatives(placement)
        each = zip(self._map.shapes, self._map.of_link, links, self._map.positions(by_theta), strict=True)
        for shape, own, link, slope in each:
            try:
                total -= cho_solve(link.factor, slope[..., link.motion.free].T).T @ (link.cross @ own.matrix)
            except np.linalg.LinAlgError:
                self._known = None, []  # nor do they lead to the positions of a nearby design
                raise ShapeError(
                    f"shape of link {shape.own.name!r}",
                    "its mesh does not determine the positions of all handles",
                    "Use smaller elements",
                ) from None
        return total

    def _solve(self, p: np.ndarray, start: HandlePlacement, halvings: int) -> HandlePlacement:
        positions, sums = self._first_guess(p, start)
        if np.all(np.isfinite(sums)):
            return self._minimise(p, positions, sums)
        if halvings == 0:
            raise ShapeError("rest shape", "cells are inverted however the handles are placed", "Change it by less")
        halfway = self._solve(0.5 * (start.p + p), start, halvings - 1)
        return self._solve(p, halfway, halvings - 1)

    def _first_guess(self, p: np.ndarray, start: HandlePlacement) -> tuple[list[np.ndarray], np.ndarray]:
        """The best of a few positions for each link, and its sum, inf if all of them invert cells of the link."""
        following = [follow_spline(h, q) for h, q in zip(self._handles, self._map.parameters(p), strict=True)]
        guesses = [self._map.positions(start.theta), following]
        if self._known[0] is start:  # θ + dθ/dp Δp
            tangent = self._map.positions(start.theta.copy())
            before, after = self._map.parameters(start.p), self._map.parameters(p)
            for theta, link, old, new in zip(tangent, self._known[1], before, after, strict=True):
                theta[link.motion.free] -= cho_solve(link.factor, link.cross @ (new - old))
            guesses.append(tangent)
        sums = np.array([self._sums(p, guess) for guess in guesses])
        return [guesses[best][link] for link, best in enumerate(np.argmin(sums, axis=0))], sums.min(axis=0)

    def _minimise(self, p: np.ndarray, positions: list[np.ndarray], sums: np.ndarray) -> HandlePlacement:
        moving, iterations = set(range(len(positions))), 0
        while moving and iterations < self._options.iterations:
            iterations += 1
            steps = {}
            for link, by_theta in enumerate(self._by_positions(p, positions)):
                if link not in moving:
                    continue
                step = by_theta.newton_step(self._options.flattest)
                if -0.5 * by_theta.slope @ step[by_theta.motion.free] > self._options.settled * sums[link]:
                    steps[link] = by_theta, step
                else:
                    # the decrease is below rounding, the improvement of θ is not
                    positions[link] = by_theta.motion.moved(step)
                    moving.remove(link)
            if steps:
                positions, sums, stuck = self._search(p, positions, sums, steps)
                moving -= stuck
        if moving:
            _log.warning("handle positions did not settle in %d iterations", iterations)
        placed = HandlePlacement(p, np.concatenate(positions), float(sums.sum()), iterations)
        self._map.apply(p, placed.theta)
        return placed

    def _search(
        self,
        p: np.ndarray,
        positions: list[np.ndarray],
        sums: np.ndarray,
        steps: dict[int, tuple[PositionDerivatives, np.ndarray]],
    ) -> tuple[list[np.ndarray], np.ndarray, set[int]]:
        """Positions and sums after a step of each link in ``steps``, and the links that found no lower sum."""
        lengths = {link: by.motion.longest(step, self._options) for link, (by, step) in steps.items()}
        pending, stuck, trial = set(steps), set(), list(positions)
        while pending:
            for link in pending:
                by_theta, step = steps[link]
                trial[link] = by_theta.motion.moved(lengths[link] * step)
            new = self._sums(p, trial)
            for link in sorted(pending):
                by_theta, _ = steps[link]
                moved = (trial[link] - positions[link])[by_theta.motion.free]
                if new[link] <= sums[link] + self._options.armijo * by_theta.slope @ moved:
                    pending.remove(link)
                elif lengths[link] < self._options.shortest:
                    trial[link] = positions[link]
                    pending.remove(link)
                    stuck.add(link)
                lengths[link] *= 0.5
        return trial, np.where([link in stuck for link in range(len(trial))], sums, new), stuck

    def _sums(self, p: np.ndarray, positions: Sequence[np.ndarray]) -> np.ndarray:
        """Σρ of the links of each shape, inf if cells are inverted or handles out of order, (shapes,)."""
        mesh = self._map.mesh
        self._map.apply(p, np.concatenate(positions))
        topology = mesh.mesh.topology
        owned = topology.index_map(topology.dim).size_local
        per_link = np.bincount(
            mesh.link[:owned], self._quality.cell_values()[:owned], minlength=mesh.link_of_cell.max() + 1
        )
        (per_link,) = self._map.sum_over_ranks([per_link])
        sums = np.zeros(len(self._map.shapes))
        for piece in self._map.pieces:
            sums[piece.shape] += per_link[piece.link]
        pairs = zip(self._handles, positions, strict=True)
        sums += np.array([crowding(*own, self._options)[0] for own in pairs])
        return np.where(np.isnan(sums), np.inf, sums)

    def _by_positions(self, p: np.ndarray, positions: Sequence[np.ndarray]) -> list[PositionDerivatives]:
        """Derivatives of S by the positions of the handles, per link."""
        self._map.apply(p, np.concatenate(positions))
        hessian = self._quality.hessian()
        if self._reducer is None:
            self._reducer = _MomentHessian(self._map, hessian)
        moments = self._map.moments(self._quality.gradient())
        links = zip(self._handles, self._map.parameters(p), positions, moments, strict=True)
        motions = [motion(*link, self._options) for link in links]
        return list(map(PositionDerivatives, motions, self._reducer.reduce(hessian, [own.by_theta for own in motions])))

    def _second_derivatives(self, placement: HandlePlacement) -> list[PositionDerivatives]:
        """S_θθ and S_θp of each link at ``placement``; those of the last one are kept."""
        if self._known[0] is not placement:
            self._known = placement, self._by_positions(placement.p, self._map.positions(placement.theta))
        return self._known[1]


# -- derivatives of S for one link, and steps ------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class HandleMotion:
    """How the handles of a link move, each to the side to which S falls.

    Attributes:
        handles: all handles of the link.
        p, theta: parameters of its spline, (size,), and positions of the handles, (n,).
        gradient: Σρ by T, (n, 2, 3).
        crowding: ε ∂B/∂θ, (n,), and ε ∂²B/∂θ², (n, n).
        segments: the segment of the spline each of them stays in, (n,).
        free: which of them move, (n,).
    """

    handles: LinkHandles
    p: np.ndarray
    theta: np.ndarray
    gradient: np.ndarray
    crowding: tuple[np.ndarray, np.ndarray]
    segments: np.ndarray
    free: np.ndarray

    @cached_property
    def by_theta(self) -> np.ndarray:
        """∂T_j/∂θ_j, (n, 2, 3)."""
        return self.handles.by_theta(self.p, self.theta, self.segments)

    def moved(self, step: np.ndarray) -> np.ndarray:
        """θ after a step; a handle that would leave its segment stops at the control point."""
        slides, after = self.handles.slides, self.theta + step
        return np.where(slides, np.clip(after, self.segments, self.segments + 1), after)

    def longest(self, step: np.ndarray, options: HandleOptions) -> float:
        """The largest fraction of a step, up to 1, that keeps handles in order and turns joints moderately."""
        slides = self.handles.slides
        turn = np.abs(step[~slides]).max(initial=0.0)
        gaps, closing = np.diff(_along(self.handles, self.theta)), -np.diff(np.where(slides, step, 0.0))
        limits = (1.0 - options.kept) * gaps[closing > 0.0] / closing[closing > 0.0]
        return min(1.0, options.turn / max(turn, options.turn), limits.min(initial=1.0))


def motion(
    handles: LinkHandles, p: np.ndarray, theta: np.ndarray, gradient: np.ndarray, options: HandleOptions
) -> HandleMotion:
    """The motion of handles, from Σρ by T; at a control point to the side to which S falls."""
    _, slope, curvature = crowding(handles, theta, options)
    segments = after = handles.segments(theta)
    free = handles.slides | handles.turns
    at_kink = handles.slides & (theta == after)
    if np.any(at_kink):
        before = np.where(at_kink, after - 1, after)
        forward, backward = (
            np.sum(gradient * handles.by_theta(p, theta, side), axis=(1, 2)) + slope for side in (after, before)
        )
        segments = np.where(at_kink & (forward >= 0.0), before, after)
        free &= ~(at_kink & (forward >= 0.0) & (backward <= 0.0))
    return HandleMotion(handles, p, theta, gradient, (slope, curvature), segments, free)


def crowding(handles: LinkHandles, theta: np.ndarray, options: HandleOptions) -> tuple[float, np.ndarray, np.ndarray]:
    """ε B, infinite if handles are out of order, ε ∂B/∂θ, (n,), and ε ∂²B/∂θ², (n, n)."""
    drawn, gaps = np.diff(_along(handles, handles.initial)), np.diff(_along(handles, theta))
    x = gaps / drawn
    if np.any(x <= 0.0):
        return np.inf, np.zeros_like(theta), np.zeros((len(theta), len(theta)))
    rates = np.diff(np.diag(handles.rides.astype(float)), axis=0) / gaps[:, None]
    small = np.log(np.maximum(options.close / x, 1.0))
    slope, curvature = -3.0 * small**2 @ rates, rates.T @ ((6.0 * small + 3.0 * small**2)[:, None] * rates)
    return options.apart * float(np.sum(small**3)), options.apart * slope, options.apart * curvature


@dataclass(frozen=True, eq=False)
class PositionDerivatives:
    """Derivatives of S by the positions of a link's free handles.

    S_θ = S_T · T_θ + ε B_θ,     S_θθ = T_θ · S_TT · T_θ + S_T · T_θθ + ε B_θθ,     S_θp alike, without B.

    Attributes:
        motion: of the handles.
        rows: T_θ · S_TT, (n, n, 2, 3).
    """

    motion: HandleMotion
    rows: np.ndarray

    @cached_property
    def slope(self) -> np.ndarray:
        """S_θ, (f,)."""
        own = self.motion
        return (np.sum(own.gradient * own.by_theta, axis=(1, 2)) + own.crowding[0])[own.free]

    @cached_property
    def hessian(self) -> np.ndarray:
        """S_θθ, (f, f)."""
        own = self.motion
        twice = own.handles.twice_by_theta(own.p, own.theta, own.gradient, own.segments)[own.free]
        hessian = np.einsum("jmbl,mbl->jm", self.rows[own.free][:, own.free], own.by_theta[own.free]) + np.diag(twice)
        hessian += own.crowding[1][own.free][:, own.free]
        return 0.5 * (hessian + hessian.T)

    @cached_property
    def cross(self) -> np.ndarray:
        """S_θp, (f, size)."""
        own = self.motion
        by_p = own.handles.by_p(own.p, own.theta, own.segments)
        cross = own.handles.by_theta_and_p(own.p, own.theta, own.gradient, own.segments)
        return np.tensordot(self.rows[own.free], by_p, 3) + cross[own.free]

    @cached_property
    def factor(self) -> tuple[np.ndarray, bool]:
        """The Cholesky factor of S_θθ at a minimum."""
        return cho_factor(self.hessian)

    def newton_step(self, flattest: float) -> np.ndarray:
        """−|S_θθ|⁻¹ S_θ, with the eigenvalues of the Hessian made positive, (n,)."""
        values, vectors = np.linalg.eigh(self.hessian)
        values = np.maximum(np.abs(values), flattest * np.abs(values).max(initial=0.0))
        step = np.zeros(len(self.motion.free))
        step[self.motion.free] = -vectors @ (vectors.T @ self.slope / values)
        return step


def follow_spline(handles: LinkHandles, p: np.ndarray) -> np.ndarray:
    """θ with joints turned like the tangent of the spline there, and all other handles as they were."""
    tangents = (handles.spline.derivative(q, handles.t)[:, :2] for q in (handles.spline.initial, p))
    before, now = (np.arctan2(tangent[:, 1], tangent[:, 0]) for tangent in tangents)
    turn = np.remainder(now - before + np.pi, 2.0 * np.pi) - np.pi
    return np.where(handles.turns, turn, handles.initial)


def _along(handles: LinkHandles, theta: np.ndarray) -> np.ndarray:
    """Spline parameters of all handles, joints too."""
    return np.where(handles.rides, theta, handles.t)


class _MomentHessian:
    """The Hessian H of a sum over cells, reduced to the maps of the handles: ∂²/∂T_j∂T_k = Σ_il r_ij ⊗ H_il ⊗ r_lk.

    Vertices that all handles move alike (those on one column of an extruded link) are added up first, which leaves
    little to multiply.

    Args:
        shape_map: the map from handles to the field.
        hessian: a matrix with the pattern of all that will be reduced.
    """

    def __init__(self, shape_map: ShapeMap, hessian: PETSc.Mat) -> None:
        self._map = shape_map
        self._sizes = [len(shape.handles) for shape in shape_map.shapes]
        before, count = np.cumsum([0, *self._sizes[:-1]]), sum(self._sizes)
        # class of each vertex of the whole mesh, −1 where no handle moves it; two unknowns (x, y) per class
        classes, first, arms = np.full(len(shape_map.mesh.vertices), -1), 0, []
        for piece in shape_map.pieces:
            reach = piece.reach
            unique, inverse = np.unique(reach.reshape(len(reach), -1), axis=0, return_inverse=True)
            classes[piece.vertices] = first + inverse.ravel()
            # ∂d/∂T of every class from its r, (2 classes, 6 handles)
            own = np.einsum("ab,njk->najbk", piece.matrix, unique.reshape(-1, *reach.shape[1:]))
            own = coo_matrix(own.reshape(2 * len(unique), -1))
            arms.append((own.data, own.row + 2 * first, own.col + 6 * before[piece.shape]))
            first += len(unique)
        data, rows, columns = (np.concatenate(part) for part in zip(*arms, strict=True))
        self._arms = csr_matrix((data, (rows, columns)), shape=(2 * first, 6 * count))
        self._back = self._arms.T.tocsr()
        along = np.zeros(6 * count), np.repeat(np.arange(count), 6), np.arange(6 * count + 1)
        self._along = csr_matrix(along)  # ∂T_j/∂θ_j, in 6 rows each
        # place of (j, 0) among the results, one shape after another
        self._ends = np.cumsum([6 * size * size for size in self._sizes])
        places = zip(self._ends, self._sizes, before, strict=True)
        self._places = np.concatenate([end - 6 * (size * np.arange(size, 0, -1) + own) for end, size, own in places])
        self._find_slots(hessian, classes, 2 * first)

    def reduce(self, hessian: PETSc.Mat, by_theta: Sequence[np.ndarray]) -> list[np.ndarray]:
        """∂T_j/∂θ_j · ∂²/∂T_j∂T per shape, (handles, handles, 2, 3), from ∂T_j/∂θ_j (handles, 2, 3)."""
        values = hessian.getValuesCSR()[2][self._kept]
        self._sum.data = np.bincount(self._slots, weights=values, minlength=self._sum.nnz)
        self._along.data = np.concatenate(by_theta).ravel()
        found = (self._back @ (self._sum @ (self._arms @ self._along))).tocoo()
        blocks = np.zeros(self._ends[-1])
        blocks[self._places[found.col] + found.row] = found.data
        parts = zip(np.split(blocks, self._ends[:-1]), self._sizes, strict=True)
        return self._map.sum_over_ranks([part.reshape(size, size, 2, 3) for part, size in parts])

    def _find_slots(self, hessian: PETSc.Mat, classes: np.ndarray, size: int) -> None:
        """Place of each entry of the owned rows in the matrix between classes."""
        dim = self._map.mesh.vertices.shape[1]
        original = self._map.original[: self._map.owned]
        starts, columns, _ = hessian.getValuesCSR()
        rows = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        # the global numbering runs through the owned nodes, rank after rank
        everywhere = np.concatenate(hessian.comm.tompi4py().allgather(original))
        row_class, column_class = classes[original[rows // dim]], classes[everywhere[columns // dim]]
        self._kept = (rows % dim < 2) & (columns % dim < 2) & (row_class >= 0) & (column_class >= 0)
        keys = (2 * row_class + rows % dim) * size + 2 * column_class + columns % dim
        used, self._slots = np.unique(keys[self._kept], return_inverse=True)
        self._sum = csr_matrix((np.zeros(len(used)), np.divmod(used, size)), shape=(size, size))
