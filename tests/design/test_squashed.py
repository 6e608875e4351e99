"""Derivatives of displacements stay exact where a cell is nearly inverted."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenicsmech.simulation import rest_vertices

from ..quantities.test_sensitivity import Bench, assert_slopes


class Squashed:
    """A four-bar with one vertex moved towards the opposite side of one of its cells until that is a sliver."""

    def __init__(self, space: str, ratio: float) -> None:
        self.bench = Bench(space, MPI.COMM_SELF)
        self.bench.quantities = self.bench.quantities[:3]  # displacements
        self.bench.observables = self.bench.observables[:3]
        model, smooth = self.bench.model, self.bench.field(1)
        model.reshape(smooth)
        mesh, vertices = model.mesh, rest_vertices(model)
        cells = mesh.cells[mesh.link == 0]
        inside = np.abs(mesh.vertices[cells].mean(axis=1)[:, 1] - 15.0)  # far from the pins
        cell = cells[np.argmin(inside)]
        corner, side = vertices[cell[0]], vertices[cell[1:]]
        way = side.mean(axis=0) - corner
        positions = self.bench.space.tabulate_dof_coordinates()[:, : len(corner)]
        self.inwards = np.outer(self._hat(positions, mesh.cells, mesh.vertices, cell[0]), way).ravel()
        low, high = 0.0, 1.0
        for _ in range(60):
            fraction = 0.5 * (low + high)
            model.reshape(smooth + fraction * self.inwards)
            low, high = (fraction, high) if self.bench.simulation.mesh_ratio_max < ratio else (low, fraction)
        self.design, self.left = smooth + low * self.inwards, 1.0 - low
        model.reshape(self.design)

    @staticmethod
    def _hat(positions: np.ndarray, cells: np.ndarray, vertices: np.ndarray, vertex: int) -> np.ndarray:
        """Values at ``positions`` of the linear function that is 1 at a vertex and 0 at the others."""
        around = np.setdiff1d(cells[(cells == vertex).any(axis=1)], [vertex])
        places = np.vstack([vertices[vertex], 0.5 * (vertices[vertex] + vertices[around])])
        near = np.linalg.norm(positions[:, None] - places, axis=2) < 1e-9
        return near @ np.array([1.0, *[0.5] * len(around)])


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["plane-stress", "3d"])
@pytest.mark.parametrize("ratio", [60.0, 100.0])
def test_derivatives_by_the_design_hold_at_slivers(space, ratio):
    squashed = Squashed(space, ratio)
    bench, base = squashed.bench, squashed.design
    assert bench.simulation.mesh_ratio_max == pytest.approx(ratio, rel=1e-3)
    gradients = bench.gradients(base)
    smooth = bench.field(2)
    for direction, steps in (
        (squashed.inwards, squashed.left * np.array([0.0125, 0.00625, 0.003125])),
        (smooth, [0.05, 0.025, 0.0125]),
    ):
        slopes = [float(gradient.design @ direction) for gradient in gradients]
        assert_slopes(bench, lambda t, by=direction: bench.values(base + t * by), slopes, steps)
