"""Small structured meshes of known size."""

import itertools

import numpy as np


def rectangle(nx: int, ny: int, length: float, width: float):
    """(n, 2) points and (2·nx·ny, 3) triangles of [0, length] × [0, width]."""
    x, y = np.meshgrid(np.linspace(0.0, length, nx + 1), np.linspace(0.0, width, ny + 1), indexing="ij")
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (index[i : nx + i, j : ny + j].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return np.column_stack((x.ravel(), y.ravel())), np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1)))


def box(nx: int, ny: int, nz: int, size: tuple[float, float, float]):
    """(n, 3) points and (6·nx·ny·nz, 4) tetrahedra of a box at the origin; orientations are mixed."""
    axes = [np.linspace(0.0, s, n + 1) for s, n in zip(size, (nx, ny, nz), strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    index = np.arange(len(points)).reshape(nx + 1, ny + 1, nz + 1)
    tets = []
    for order in itertools.permutations(range(3)):  # Kuhn: one tetrahedron per path along the edges
        corner = np.zeros(3, dtype=int)
        path = [corner.copy()]
        for axis in order:
            corner[axis] += 1
            path.append(corner.copy())
        tets.append(np.stack([index[i : nx + i, j : ny + j, k : nz + k].ravel() for i, j, k in path], axis=1))
    return points, np.concatenate(tets)
