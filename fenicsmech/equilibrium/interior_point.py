"""Pressures of one-sided constraints as unknowns of their own, by a primal–dual interior-point method.

At every point of a surface that obstacles may touch, with the gap g(u), the compliance c and the slack s,

    p s = μ,     s = g + c p,     p > 0,     s > 0,

and μ falls to zero. Newton's method in (u, p, s), with p and s eliminated,

    D = p / (s + c p),     δp = q − D ∇g · δu,     q = (μ − p s − e + p r_s) / (s + c p),     r_s = s − g − c p,

adds ∫ D ∇g ⊗ ∇g − p ∇²g dA to the stiffness and has the residual of the pressures p + q. A step goes as far as s stays
positive, and in p as far as p does. A first solve, with μ = 0 and e = 0, shows how far that is; the second one, with
the same factor, aims at μ₁³ / μ² with the mean product μ₁ after the first step, and has its second-order term
e = δp δs.

Newton's method on p = ⟨−g⟩ / c itself adds or drops a few points in an iteration: as a slender link peels off an
obstacle, the reaction stands in a layer whose width is that of the elements, and moves by as much. The augmented
Lagrangian of Alart and Curnier, whose pressures are unknowns too, changes the same points: a cantilever that wraps
round a cylinder takes ten times as many of its iterations. The steps of an interior-point method move the whole border
of contact; their number hardly depends on the elements or on c.

Source: Mehrotra, On the implementation of a primal–dual interior point method (SIAM Journal on Optimization 2, 1992,
doi:10.1137/0802028); Nocedal & Wright, Numerical Optimization (doi:10.1007/978-0-387-40065-5), chapters 14 and 19.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from fenicsmech.effects import OneSided
from fenicsmech.equilibrium.unknowns import Numbering

_TO_BOUNDARY = 0.99
"""Least share of the way to where a pressure or slack vanishes that a step may go."""


class InteriorPressures:
    """p and s at all points of some surfaces.

    Args:
        surfaces: with the points; the displacements that fields hold are those of the first iterate.
        factor: of their energies.
        force: scale of the forces between surfaces and obstacles.
        comm: the processes.
    """

    def __init__(self, surfaces: Sequence[OneSided], factor: float, force: float, comm: MPI.Comm) -> None:
        self._surfaces, self._comm, self._factor = surfaces, comm, factor
        self.update()
        self._sections = np.cumsum([len(surface.weights) for surface in surfaces])[:-1]
        self._weights = self._joined(lambda surface: surface.weights)
        self._compliances = self._joined(lambda surface: surface.compliances)
        self._area, depth = self._sum(self._weights), self._largest(-self._gaps)
        self.pressures = np.full(len(self._gaps), force / (factor * self._area))
        self.slacks = np.maximum(self._gaps + self._compliances * self.pressures, depth)
        self._shares = _TO_BOUNDARY
        self.aim(0.0)

    def update(self) -> None:
        """Takes the displacements that the fields hold. Local."""
        for surface in self._surfaces:
            surface.update()
        self._gaps = self._joined(lambda surface: surface.gaps)

    @property
    def mean_product(self) -> float:
        """The mean of p s, by area."""
        return self._sum(self._weights * self.pressures * self.slacks) / self._area

    @property
    def settled(self) -> bool:
        """Whether the same points touch by their gaps and by their pressures."""
        return self._sum((self._gaps < 0.0) != (self._compliances * self.pressures > self.slacks)) == 0.0

    def aim(self, target: float, second_order: np.ndarray | float = 0.0) -> None:
        """Sets q for the ``target`` μ and a ``second_order`` term e. Local."""
        p, s, c = self.pressures, self.slacks, self._compliances
        self._aimed = (target - p * s - second_order + p * (s - self._gaps - c * p)) / (s + c * p)

    def aim_again(self, change: tuple[np.ndarray, np.ndarray]) -> None:
        """Sets q for the second solve, from (δp, δs) of the first one."""
        pairs = zip((self.pressures, self.slacks), change, strict=True)
        p, s = (value + self._longest(value, step, self._shares) * step for value, step in pairs)
        now = self.mean_product
        centring = min(self._sum(self._weights * p * s) / self._area / now, 1.0) ** 3
        # close to the solution steps may go nearly to the boundary: p s then falls faster than linearly
        self._shares = max(_TO_BOUNDARY, 1.0 - centring)
        self.aim(centring * now, change[0] * change[1])

    def forces(self) -> np.ndarray:
        """The gradient of the energy with p + q, minus that with ⟨−g⟩ / c, this rank's owned values, flat."""
        excess = self._factor * (self.pressures + self._aimed - self._penalties)
        return np.sum([surface.forces(own) for surface, own in self._each(excess)], axis=0)

    def add_stiffness(self, matrix: PETSc.Mat, numbering: Numbering) -> None:
        """Adds the stiffness with p and D, minus that with ⟨−g⟩ / c, into ``matrix`` and leaves it unassembled."""
        p, s, c = self.pressures, self.slacks, self._compliances
        excess = self._factor * (p / (s + c * p) - (self._gaps < 0.0) / c)
        pressures = self._factor * (p - self._penalties)
        for (surface, own), (_, pressure) in zip(self._each(excess), self._each(pressures), strict=True):
            surface.add_stiffness(matrix, numbering.rows_of, own, pressure)

    def solved(self, motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """δp and δs with δu of this rank's owned nodes, flat."""
        p, s, c = self.pressures, self.slacks, self._compliances
        rates = self._joined(lambda surface: surface.rates(motion))
        change = self._aimed - p / (s + c * p) * rates
        return change, self._gaps + rates + c * (p + change) - s

    def longest(self, change: tuple[np.ndarray, np.ndarray]) -> float:
        """The longest step of displacements, at most one, after which slacks are positive."""
        return self._longest(self.slacks, change[1], self._shares)

    def advance(self, change: tuple[np.ndarray, np.ndarray], length: float, share: float) -> None:
        """Takes a step, of ``length`` in displacements, which the fields hold, and slacks, and a ``share`` of the
        longest one in p."""
        self.pressures = self.pressures + share * self._longest(self.pressures, change[0], self._shares) * change[0]
        self.slacks = self.slacks + length * change[1]
        self.update()

    @property
    def _penalties(self) -> np.ndarray:
        """⟨−g⟩ / c."""
        return np.maximum(-self._gaps, 0.0) / self._compliances

    def _joined(self, values) -> np.ndarray:
        return np.concatenate([values(surface) for surface in self._surfaces])

    def _each(self, values: np.ndarray) -> list[tuple[OneSided, np.ndarray]]:
        return list(zip(self._surfaces, np.split(values, self._sections), strict=True))

    def _longest(self, values: np.ndarray, step: np.ndarray, share: float) -> float:
        """The longest step, at most one, that goes no farther than a ``share`` of the way to zero."""
        falling = step < 0.0
        own = float(np.min(-share * values[falling] / step[falling], initial=1.0))
        return self._comm.allreduce(own, op=MPI.MIN)

    def _sum(self, values: np.ndarray) -> float:
        return self._comm.allreduce(float(values.sum()))

    def _largest(self, values: np.ndarray) -> float:
        return self._comm.allreduce(float(values.max(initial=-np.inf)), op=MPI.MAX)
