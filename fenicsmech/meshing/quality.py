"""Shape quality of simplices: 1 for the equilateral cell, towards 0 for a sliver."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from fenicsmech.meshing.link_mesh import cell_measures


def radius_ratios(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Inradius over circumradius times dim, for each cell.

    Args:
        points: (n, dim) coordinates.
        cells: (m, dim + 1) vertex numbers.

    Returns:
        (m,) values in [0, 1]; 1 is the equilateral cell.
    """
    dim = points.shape[1]
    corners = points[cells]
    facets = sum(_facet_measures(corners[:, list(kept)]) for kept in combinations(range(dim + 1), dim))
    inradius = dim * np.abs(cell_measures(points, cells)) / facets
    # circumcentre c (relative to the first corner): 2 e_k · c = e_k · e_k for every edge e_k from that corner
    edges = corners[:, 1:] - corners[:, :1]
    squares = np.einsum("mkd,mkd->mk", edges, edges)
    circumcentre = np.linalg.solve(2.0 * edges, squares[..., None])[..., 0]
    return dim * inradius / np.linalg.norm(circumcentre, axis=1)


def _facet_measures(corners: np.ndarray) -> np.ndarray:
    """Lengths of edges (m, 2, 2) or areas of triangles (m, 3, 3) from the Gram determinant."""
    edges = corners[:, 1:] - corners[:, :1]
    gram = edges @ edges.transpose(0, 2, 1)
    return np.sqrt(np.linalg.det(gram)) / (corners.shape[1] - 1)
