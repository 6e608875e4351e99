"""The handle positions that make the mesh best: min over θ of S(θ, p) = Σ_e ρ(e), and how they follow p.

Links do not share cells, so S is a sum of functions of the θ of one link each. Newton's method with exact Hessians
minimises them together, with a line search for each that refuses inverted cells. By the implicit function theorem

    dθ/dp = −S_θθ⁻¹ S_θp     (0 for handles held at a kink of the spline).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from fenicsmech.design.handle_step import (
    LinkDerivatives,
    LinkStep,
    choose_sides,
    follow_spline,
    in_order,
    link_step,
    second_derivatives,
)
from fenicsmech.design.moment_hessian import MomentHessian
from fenicsmech.design.quality import QualitySum
from fenicsmech.design.shape_map import ShapeMap
from fenicsmech.errors import FenicsmechError
from fenicsmech.log import logger

_log = logger(__name__)

_ITERATIONS = 60
_SETTLED = 1e-10  # predicted decrease of S, relative; one more step follows, after which it is rounding
_ARMIJO = 1e-4
_SHORTEST = 1e-8  # fraction of a step
_HALVINGS = 4  # of a change of p that inverts cells


class ShapeError(FenicsmechError):
    """A design has no rest shape without inverted cells."""


@dataclass(frozen=True, eq=False)
class Placement:
    """The best handle positions of a design.

    Attributes:
        p: the design, (parameters,).
        theta: its handle positions, (handles,).
        quality: Σ_e ρ(e) of the links that change.
        iterations: Newton iterations.
    """

    p: np.ndarray
    theta: np.ndarray
    quality: float
    iterations: int


@dataclass(frozen=True, eq=False)
class _Response:
    """How the handles of one link follow its parameters: θ_free = −(factor of S_θθ)⁻¹ S_θp p."""

    free: np.ndarray
    factor: tuple[np.ndarray, bool]
    mixed: np.ndarray


class HandleOptimum:
    """Best handle positions as a function of the design; all methods are collective.

    They leave the design field at the placement that they return or were given.

    Args:
        shape_map: from design and handle positions to the field.
        quality: Σρ in this field.
    """

    def __init__(self, shape_map: ShapeMap, quality: QualitySum) -> None:
        self._map, self._quality = shape_map, quality
        self._handles = [shape.handles for shape in shape_map.shapes]
        self._reducer: MomentHessian | None = None
        self._known: tuple[Placement | None, list[_Response]] = (None, [])

    def solve(self, p: np.ndarray, start: Placement | None = None) -> Placement:
        """The best handle positions for design ``p``.

        Args:
            p: the design, (parameters,).
            start: placement of a design near by; that of the initial mesh by default.

        Raises:
            ShapeError: cells stay inverted however the handles are placed.
        """
        start = start or Placement(self._map.initial, self._map.initial_theta, np.inf, 0)
        return self._solve(np.array(p, dtype=float), start, _HALVINGS)

    def total_gradient(self, placement: Placement, by_p: np.ndarray, by_theta: np.ndarray) -> np.ndarray:
        """dO/dp = ∂O/∂p + ∂O/∂θ dθ/dp, (…, parameters).

        Args:
            placement: from ``solve``.
            by_p, by_theta: ∂O/∂p (…, parameters) and ∂O/∂θ (…, handles), as from ``ShapeMap.pull``.
        """
        slopes = self._map.positions(by_theta)
        responses = self._responses(placement)
        followed = [cho_solve(r.factor, s[..., r.free].T).T @ r.mixed for r, s in zip(responses, slopes, strict=True)]
        return by_p - np.concatenate(followed, axis=-1)

    def drift(self, placement: Placement, dp: np.ndarray) -> np.ndarray:
        """dθ/dp dp, (handles,)."""
        drift = np.zeros(len(placement.theta))
        links = zip(self._map.positions(drift), self._responses(placement), self._map.parameters(dp), strict=True)
        for theta, response, change in links:
            theta[response.free] = -cho_solve(response.factor, response.mixed @ change)  # a view of drift
        return drift

    def _solve(self, p: np.ndarray, start: Placement, halvings: int) -> Placement:
        theta = self._first_guess(p, start)
        if theta is not None:
            return self._minimise(p, theta)
        if halvings == 0:
            raise ShapeError("rest shape", "cells are inverted however the handles are placed", "Change it by less")
        halfway = self._solve(0.5 * (start.p + p), start, halvings - 1)
        return self._solve(p, halfway, halvings - 1)

    def _first_guess(self, p: np.ndarray, start: Placement) -> np.ndarray | None:
        """The best of a few positions for each link; None if all of them invert cells of a link."""
        following = [follow_spline(h, q) for h, q in zip(self._handles, self._map.parameters(p), strict=True)]
        guesses = [start.theta, np.concatenate(following)]
        if self._known[0] is start:
            guesses.append(start.theta + self.drift(start, p - start.p))
        links = [self._map.positions(guess) for guess in guesses]
        sums = np.array([self._sums(p, guess) for guess in links])
        best = np.argmin(sums, axis=0)
        if not np.all(np.isfinite(sums.min(axis=0))):
            return None
        return np.concatenate([links[choice][link] for link, choice in enumerate(best)])

    def _minimise(self, p: np.ndarray, theta: np.ndarray) -> Placement:
        parts, positions = self._map.parameters(p), self._map.positions(theta.copy())
        sums = self._sums(p, positions)
        moving = set(range(len(positions)))
        iterations = 0
        while moving and iterations < _ITERATIONS:
            iterations += 1
            steps = {}
            derivatives = self._derivatives(p, positions)
            for link in sorted(moving):
                step = link_step(self._handles[link], parts[link], positions[link], derivatives[link])
                if step.predicted > _SETTLED * sums[link]:
                    steps[link] = step
                else:
                    # the decrease drowns in rounding, the improvement of θ does not
                    positions[link] = step.position(positions[link], 1.0)
                    moving.remove(link)
            if steps:
                positions, sums, stuck = self._search(p, positions, sums, steps)
                moving -= stuck
        if moving:
            _log.warning("handle positions did not settle in %d iterations", _ITERATIONS)
        placed = Placement(p, np.concatenate(positions), float(sums.sum()), iterations)
        self._map.apply(p, placed.theta)
        return placed

    def _search(
        self, p: np.ndarray, positions: list[np.ndarray], sums: np.ndarray, steps: dict[int, LinkStep]
    ) -> tuple[list[np.ndarray], np.ndarray, set[int]]:
        """Positions and sums after a step of each link in ``steps``, and the links that found no lower sum."""
        lengths = {link: step.longest(positions[link]) for link, step in steps.items()}
        pending, stuck = set(steps), set()
        trial = list(positions)
        while pending:
            for link in pending:
                trial[link] = steps[link].position(positions[link], lengths[link])
            new = self._sums(p, trial)
            for link in sorted(pending):
                wanted = _ARMIJO * steps[link].slope @ (trial[link] - positions[link])
                if new[link] <= sums[link] + wanted:
                    pending.remove(link)
                elif lengths[link] < _SHORTEST:
                    trial[link] = positions[link]
                    pending.remove(link)
                    stuck.add(link)
                lengths[link] *= 0.5
        return trial, np.where([link in stuck for link in range(len(trial))], sums, new), stuck

    def _sums(self, p: np.ndarray, positions: Sequence[np.ndarray]) -> np.ndarray:
        """Σρ of each link that changes, inf if cells are inverted or handles out of order, (links,)."""
        mesh = self._map.mesh
        self._map.apply(p, np.concatenate(positions))
        topology = mesh.mesh.topology
        owned = topology.index_map(topology.dim).size_local
        per_link = np.bincount(
            mesh.link[:owned], self._quality.cell_values()[:owned], minlength=mesh.link_of_cell.max() + 1
        )
        (per_link,) = self._map.sum_over_ranks([per_link])
        sums = per_link[[shape.link for shape in self._map.shapes]]
        ordered = [in_order(handles, theta) for handles, theta in zip(self._handles, positions, strict=True)]
        return np.where(np.isnan(sums) | ~np.array(ordered), np.inf, sums)

    def _derivatives(self, p: np.ndarray, positions: Sequence[np.ndarray]) -> list[LinkDerivatives]:
        """Derivatives of S by the maps of the handles, per link."""
        self._map.apply(p, np.concatenate(positions))
        hessian = self._quality.hessian()
        if self._reducer is None:
            self._reducer = MomentHessian(self._map, hessian)
        moments = self._map.moments(self._quality.gradient())
        return [LinkDerivatives(g, H) for g, H in zip(moments, self._reducer.reduce(hessian), strict=True)]

    def _responses(self, placement: Placement) -> list[_Response]:
        """How the handles of each link follow its parameters."""
        if self._known[0] is not placement:
            positions = self._map.positions(placement.theta)
            responses = []
            for handles, p, theta, by_T in zip(
                self._handles,
                self._map.parameters(placement.p),
                positions,
                self._derivatives(placement.p, positions),
                strict=True,
            ):
                sides = choose_sides(handles, p, theta, by_T)
                _, bend, mixed = second_derivatives(handles, p, theta, sides, by_T)
                responses.append(_Response(sides.free, cho_factor(bend), mixed))
            self._known = placement, responses
        return self._known[1]
