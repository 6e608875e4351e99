"""Points made vertices of a mesh: the cells that hold a point are split there."""

from __future__ import annotations

import numpy as np

from fenicsmech.meshing import FREE, LinkMesh, cell_measures

_SNAP = 0.05  # below this barycentric coordinate a point is close to the opposite face
_INSIDE = 1e-9  # barycentric coordinates above minus this are inside


def pierced(mesh: LinkMesh, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the line along z through ``at`` (2,) runs in the mesh.

    Returns:
        The cells that it pierces, (k,), and a point of it inside each, (k, dim); a triangle holds the point itself.
    """
    if mesh.dim == 2:
        coordinates = _barycentric(mesh, at)
        inside = coordinates.min(axis=1) >= -_INSIDE
        cell = np.flatnonzero(inside)[:1]
        return cell, np.tile(at, (len(cell), 1))
    # λ(z) = λ(0) + z (λ(1) − λ(0)) ≥ 0 holds between the latest entry and the first exit
    start = _barycentric(mesh, np.append(at, 0.0))
    rise = _barycentric(mesh, np.append(at, 1.0)) - start
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = -start / rise
    enter = np.where(rise > 0.0, crossing, np.where((rise < 0.0) | (start >= -_INSIDE), -np.inf, np.inf)).max(axis=1)
    leave = np.where(rise < 0.0, crossing, np.inf).min(axis=1)
    height = np.ptp(mesh.points[mesh.cells, 2], axis=1)
    cells = np.flatnonzero(leave - enter > _SNAP * height)
    return cells, np.column_stack([np.tile(at, (len(cells), 1)), 0.5 * (enter + leave)[cells]])


def insert(mesh: LinkMesh, at: np.ndarray) -> tuple[LinkMesh, int]:
    """``mesh`` with a vertex at the point ``at`` (dim,), which must be in a free cell, and the number of that vertex.

    The vertex splits the cell, or an edge or face that it is close to with all cells around it; or a vertex close to
    it moves there. Of these, the way that leaves the largest smallest cell is taken. Interfaces are not touched.
    """
    cells = mesh.cells
    coordinates = _barycentric(mesh, at)
    home = int(np.argmax(coordinates.min(axis=1)))
    nearest = np.argsort(coordinates[home])[::-1]
    least = np.count_nonzero(coordinates[home] > _SNAP)
    ways = []
    for count in range(least, len(nearest) + 1):
        near = cells[home][nearest[:count]]
        around = np.isin(cells, near).sum(axis=1) == count
        if np.all(mesh.interface[around] == FREE):
            ways.append(_move(mesh, near[0], at) if count == 1 else _split(mesh, near, around, at))
    return max(ways, key=_smallest_cell)


def _smallest_cell(way: tuple[LinkMesh, int]) -> float:
    """The least volume among the cells at the new vertex."""
    mesh, vertex = way
    return float(cell_measures(mesh.points, mesh.cells[np.any(mesh.cells == vertex, axis=1)]).min())


def _move(mesh: LinkMesh, vertex: int, at: np.ndarray) -> tuple[LinkMesh, int]:
    points = mesh.points.copy()
    points[vertex] = at
    return LinkMesh(points, mesh.cells, mesh.interface), int(vertex)


def _split(mesh: LinkMesh, near: np.ndarray, around: np.ndarray, at: np.ndarray) -> tuple[LinkMesh, int]:
    """Each cell ``around`` the vertices ``near`` becomes one cell per such vertex, with the new vertex in its place."""
    vertex = len(mesh.points)
    parts = [np.where(mesh.cells[around] == old, vertex, mesh.cells[around]) for old in near]
    cells = np.concatenate([mesh.cells[~around], *parts])
    interface = np.concatenate([mesh.interface[~around], np.full(len(cells) - np.sum(~around), FREE)])
    return LinkMesh(np.vstack([mesh.points, at]), cells, interface), vertex


def _barycentric(mesh: LinkMesh, at: np.ndarray) -> np.ndarray:
    """Barycentric coordinates of a point (dim,) in every cell, (m, dim + 1)."""
    corners = mesh.points[mesh.cells]
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    inner = np.linalg.solve(edges, (at - corners[:, 0])[..., None])[..., 0]
    return np.column_stack([1.0 - inner.sum(axis=1), inner])
