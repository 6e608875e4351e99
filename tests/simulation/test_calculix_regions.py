"""Forces on regions of a flexible link against CalculiX, with loads on nodes of its own.

The traction is summed there over many points of the region, each by the shape functions of its cell: neither the border
of the region in the cells that it cuts nor any weight is shared with what is tested. Loads are dead in both.
"""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.laws import IsochoricNeoHookean

from ..oracles import calculix

pytestmark = [
    pytest.mark.calculix,
    pytest.mark.skipif(not calculix.available(), reason="ccx not found: apt install calculix-ccx"),
]

YOUNG, POISSON = 1000.0, 0.4
LENGTH, THICKNESS, DEPTH, CLAMP = 100.0, 8.0, 6.0, 10.0
DISC, RECTANGLE, PATCH = fm.Disc(3.0), fm.Rectangle(7.0, 3.0, 0.4), fm.Rectangle(13.0, 1.0)


def beam(region, at, size: float):
    """A clamped strip with a slanting force on a region, in space."""
    mechanism = fm.Mechanism("cantilever")
    ground = mechanism.rigid("ground", fixed=True)
    shape = fm.strip([(0.0, 0.0), (LENGTH, 0.0)], thickness=THICKNESS, depth=DEPTH)
    link = mechanism.flexible("beam", shape, fm.Material("plastic", law=IsochoricNeoHookean(YOUNG, POISSON)))
    mechanism.clamp(ground, link, end="start", length=CLAMP)
    push = mechanism.force(on=link, at=at, direction=(0.6, -0.8, 0.0), region=region, name="push")
    return fm.Simulation(fm.Scene(mechanism), space="3d", size=size, comm=MPI.COMM_SELF), push


def middles(low: float, high: float, count: int) -> np.ndarray:
    """The middles of equal parts of an interval, (count,)."""
    return low + (high - low) * (np.arange(count) + 0.5) / count


def inside_plan(region: fm.Disc | fm.Rectangle, at: tuple[float, float], count: int) -> np.ndarray:
    """Points spread evenly over a region of the plane, (n, 2)."""
    if isinstance(region, fm.Disc):
        grid = np.stack(np.meshgrid(*2 * [middles(-1.0, 1.0, count)]), axis=-1).reshape(-1, 2)
        return np.array(at) + region.radius * grid[np.linalg.norm(grid, axis=1) < 1.0]
    sides = [middles(-0.5 * side, 0.5 * side, count) for side in (region.length, region.width)]
    c, s = np.cos(region.angle), np.sin(region.angle)
    return np.array(at) + np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2) @ np.array([[c, s], [-s, c]])


def spread(name: str, at: tuple[float, float], count: int = 60) -> np.ndarray:
    """Points spread evenly over the region of a case, (n, 3)."""
    across = middles(-0.5 * DEPTH, 0.5 * DEPTH, count)
    if name == "end face":
        along = middles(-0.5 * THICKNESS, 0.5 * THICKNESS, count)
        plan = np.column_stack([np.full(count, LENGTH), along])
    elif name == "patch of a side":
        along = at[0] + middles(-0.5 * PATCH.length, 0.5 * PATCH.length, count)
        plan = np.column_stack([along, np.full(count, 0.5 * THICKNESS)])
    else:
        plan = inside_plan(CASES[name][0], at, count)
    return np.column_stack([np.repeat(plan, count, axis=0), np.tile(across, len(plan))])


def mean_shape_functions(mesh: calculix.Mesh, points: np.ndarray) -> np.ndarray:
    """The mean over ``points`` of the shape function of every node, (nodes,)."""
    total, found = np.zeros(len(mesh.points)), 0
    for cell in mesh.cells:
        corners = mesh.points[cell[:4]]
        low, high = corners.min(axis=0) - 1e-9, corners.max(axis=0) + 1e-9
        near = points[np.all((points >= low) & (points <= high), axis=1)]
        if not len(near):
            continue
        local = np.linalg.solve((corners[1:] - corners[0]).T, (near - corners[0]).T).T
        local = np.column_stack([1.0 - local.sum(axis=1), local])
        local = local[local.min(axis=1) > -1e-9]
        vertices = local * (2.0 * local - 1.0)
        edges = np.column_stack([4.0 * local[:, a] * local[:, b] for a, b in calculix.VTK_EDGES])
        total[cell] += np.sum(np.column_stack([vertices, edges]), axis=0)
        found += len(local)
    assert found >= len(points)  # those on facets are found in both cells
    return total / found


CASES = {
    "disc": (DISC, (60.0, 0.5), 60.0),
    "rectangle": (RECTANGLE, (60.0, 0.5), 60.0),
    "end face": (fm.Face(), (LENGTH, 1.0), 20.0),
    "patch of a side": (fm.Face(within=PATCH), (60.0, 0.5 * THICKNESS), 60.0),
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", CASES)
def test_regions_move_as_in_calculix(name):
    region, at, force = CASES[name]
    simulation, push = beam(region, at, 3.0)
    (displacement,) = simulation.load_displacement(push, forces=[force]).displacements
    model, space = simulation.model, simulation.model.elastic.u.function_space
    cells = np.array([space.dofmap.cell_dofs(cell) for cell in range(len(model.mesh.link))])
    mesh = calculix.Mesh(model.elastic.drawn_nodes, cells[:, list(calculix.VTK_FROM_BASIX)], model.mesh.link)
    weights, along = mean_shape_functions(mesh, spread(name, at)), np.array(push.direction)
    forces = {int(node): weights[node] * force * along for node in np.flatnonzero(weights)}
    (clamp,) = model.interfaces.nodes.values()
    materials = {0: calculix.NeoHooke(YOUNG, POISSON)}
    reference = calculix.solve(mesh, materials, [calculix.Fixed(clamp, 0.0)], forces, steps=4)
    moved = float(weights @ reference.displacement @ along)
    assert moved > 0.05 * LENGTH
    assert displacement == pytest.approx(moved, rel=1e-3)
