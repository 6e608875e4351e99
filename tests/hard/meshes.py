"""Meshes of slivers, and rest shapes at the edge of inversion."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from itertools import permutations
from pathlib import Path

import numpy as np
from mpi4py import MPI

import fenicsmech as fm

from .case import PLANE, Check, Fact, HardCase, deviation
from .requests import truss

LENGTH, WIDTH, CELL = 24.0, 4.0, 2.0


def _grid(space: str) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) and simplices of a block in cells of size CELL, each cut into 2 triangles or 6 tetrahedra."""
    dim = 2 if space == PLANE else 3
    counts = (round(LENGTH / CELL), *[round(WIDTH / CELL)] * (dim - 1))
    ticks = [np.linspace(0.0, CELL * n, n + 1) for n in counts]
    points = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, dim)
    points[:, 1:] -= 0.5 * WIDTH
    strides = np.array([int(np.prod([n + 1 for n in counts[k + 1 :]])) for k in range(dim)])
    corners = np.stack(np.meshgrid(*[np.arange(n) for n in counts], indexing="ij"), axis=-1).reshape(-1, dim) @ strides
    # Kuhn: along each order of the axes from the lowest corner to the highest one
    paths = [np.concatenate([[0], np.cumsum(strides[list(order)])]) for order in permutations(range(dim))]
    cells = np.concatenate([corners[:, None] + path for path in paths])
    return np.column_stack([points, np.zeros((len(points), 3 - dim))]), cells


def _distorted(points: np.ndarray, space: str, closeness: float) -> np.ndarray:
    """Every other inner node pushed towards its neighbour along x until ``closeness`` of their distance is left."""
    dim = 2 if space == PLANE else 3
    column = np.round(points[:, 0] / CELL).astype(int)
    inner = np.all(np.abs(points[:, 1:dim]) < 0.5 * WIDTH - 1e-9, axis=1)
    moved = points.copy()
    chosen = inner & (column % 2 == 0) & (column > 2) & (column < round(LENGTH / CELL) - 2)
    moved[chosen, 0] += (1.0 - closeness) * CELL
    return moved


def _write(path: Path, points: np.ndarray, cells: np.ndarray) -> None:
    kind = {3: 2, 4: 4}[cells.shape[1]]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(points))]
    lines += [f"{k} {x!r} {y!r} {z!r}" for k, (x, y, z) in enumerate(points.tolist(), 1)]
    lines += ["$EndNodes", "$Elements", str(len(cells))]
    lines += [f"{k} {kind} 2 1 1 {' '.join(map(str, cell + 1))}" for k, cell in enumerate(cells, 1)]
    path.write_text("\n".join([*lines, "$EndElements", ""]))


def _block(
    space: str, comm: MPI.Comm, closeness: float, direction, poisson: float
) -> tuple[fm.Simulation, fm.Mechanism]:
    """The block clamped between base and carriage, which is free, or slides along x if pulled that way."""
    points, cells = _grid(space)
    points = _distorted(points, space, closeness)
    folder = comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None)
    path = Path(folder) / "block.msh"
    if comm.rank == 0:
        _write(path, points, cells)
    comm.barrier()
    mechanism = fm.Mechanism("block")
    base, carriage = mechanism.rigid("base", fixed=True), mechanism.rigid("carriage")
    block = mechanism.flexible("block", fm.gmsh_mesh(path, depth=WIDTH), fm.Material("cork", 2.0, poisson))
    clamp = fm.Rectangle(CELL, 1.5 * WIDTH)
    mechanism.weld(base, block, at=(0.5 * CELL, 0), region=clamp)
    mechanism.weld(block, carriage, at=(LENGTH - 0.5 * CELL, 0), region=clamp)
    if direction == (1, 0):
        mechanism.prismatic(base, carriage, at=(LENGTH, 0), axis=(1, 0))
    mechanism.force(on=carriage, at=(LENGTH - CELL, 0), direction=direction)
    return fm.Simulation(fm.Scene(mechanism), space=space, size=CELL, comm=comm), mechanism


def _slivers(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """Even stretch (without lateral contraction) is exact in any cells; bending is not, but must stay near."""
    elastic, stretch = LENGTH - 2.0 * CELL, 2.0
    bent = {}
    for closeness in (1.0, 0.004):
        simulation, mechanism = _block(space, comm, closeness, (1, 0), 0.0)
        curve = simulation.load_displacement(mechanism.forces[0], displacements=[(stretch - 1.0) * elastic])
        if closeness < 1.0:
            dim = simulation.linkage.dim
            yield Fact("radius ratio ρ above 100", simulation.mesh_ratio_max / dim > 100.0)
            force = WIDTH**2 * (stretch - 1.0 / stretch)
            yield deviation("force at stretch 2", curve.forces, force, 1e-8)
        simulation, mechanism = _block(space, comm, closeness, (0, 1), 0.3)
        bent[closeness] = simulation.load_displacement(mechanism.forces[0], forces=[0.02, 0.08])
    good, ill = bent[1.0], bent[0.004]
    yield deviation("bending beside that of even cells", ill.displacements / good.displacements, 1.0, 2e-2)
    yield Fact(
        "at most half as many iterations more",
        sum(frame.iterations for frame in ill.frames) <= 1.5 * sum(frame.iterations for frame in good.frames),
    )


def _edge(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """A rest shape that leaves 1e-4 of a cell, and a design that turns cells inside out: no number may come of it."""
    elastic, stretch = LENGTH - 2.0 * CELL, 2.0
    simulation, mechanism = _block(space, comm, 1.0, (1, 0), 0.0)
    field, push = simulation.model.elastic.shape, mechanism.forces[0]
    dim = simulation.linkage.dim
    x = field.function_space.tabulate_dof_coordinates()[:, :dim]
    middle = np.zeros(dim)
    middle[0] = 6.0 * CELL
    # Kuhn's cells: the hat function of a vertex at the origin is 1 − (largest minus smallest of (0, ξ)), ξ = x/h
    ticks = np.column_stack([np.zeros(len(x)), (x - middle) / CELL])
    hat = np.maximum(1.0 - (ticks.max(axis=1) - ticks.min(axis=1)), 0.0)

    def shifted(share: float) -> np.ndarray:
        """The vertex in the middle of the block moved along x by a share of a cell, edges staying straight."""
        change = np.zeros_like(x)
        change[:, 0] = share * CELL * hat
        return change.ravel()

    with simulation.model.shaped(shifted(1.0 - 1e-4)):
        curve = simulation.load_displacement(push, displacements=[(stretch - 1.0) * elastic])
    yield deviation("force with 1e-4 of a cell left", curve.forces, WIDTH**2 * (stretch - 1.0 / stretch), 1e-7)
    finger, bend = truss(space, comm)
    target = fm.Target(bend, force=0.5, displacement=1.0)
    problem = fm.DesignProblem(
        finger, [fm.SplineDesign(finger.scene.mechanism.flexible_links[0], segments=2)], targets=[target]
    )
    said = ""
    try:
        problem.rest_shape(-3.0 * problem.initial)
    except fm.FenicsmechError as error:
        said = str(error)
    yield Fact("a design inside out is an error", "inverted" in said)


CASES = (
    HardCase("slivers", "radius ratio ρ of 100 and more in the middle of a link", _slivers),
    HardCase("edge of inversion", "a rest shape that leaves 1e-4 of a cell, and one that turns it inside out", _edge),
)
