"""What elements leave out of strains, estimated: the error of interpolation of a smooth displacement.

The displacement u_h of elements is closer to the interpolant I u of the exact one than this is to u. So what ∇u_h lacks
is ∇u − ∇I u, one sign and size in like cells: means over patches keep it. Around each vertex v a polynomial of degree
k + 2, elements having degree k, is fitted to u_h at the nodes in the patch of v,

    Σ_a |u_v(X_a) − u_h(X_a)|² exp(−a |X_a − X_v|² / R²) → min,     u* = Σ_v λ_v u_v,

R the radius of the patch, and at the samples ∇u_h − ∇u ≈ Σ_v λ_v (∇I u_v − ∇u_v). Penalties decide coefficients that no
node does, larger ones for higher degrees: where nodes lie on three lines, x⁴ and x² are one.

Source: Z. Zhang, A. Naga, A new finite element gradient recovery method: superconvergence property
(doi:10.1137/S1064827503402837).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from fenicsmech.compat import lagrange_element
from fenicsmech.errors import set_options
from fenicsmech.stress.recovery import monomials, padded, shape_functions, shape_slopes


@dataclass(frozen=True)
class InterpolationOptions:
    """Numbers of the estimated errors of interpolation.

    Attributes:
        decay: a.
        ridge: penalty of degrees up to that of the elements, relative to the mean diagonal of the normal matrix.
        growth: of it per degree above that of the elements.
        chunk: numbers held at once in the work arrays.
        most: |F⁻¹ e| of an error e of F = I + ∇u_h; larger ones count as none.
    """

    decay: float = 8.0
    ridge: float = 1e-10
    growth: float = 100.0
    chunk: int = 2_000_000
    most: float = 0.5

    def __post_init__(self) -> None:
        set_options(self, "errors of interpolation", chunk=1)


class InterpolationError:
    """Errors of interpolation in some cells at rest.

    Args:
        cells: vertices, (cells, dim + 1).
        shape: nodes of the cells at rest, linear or quadratic, (cells, n, dim).
        numbers: of the nodes of u, (cells, a).
        smooth: mask of cells where u is smooth; in others errors count as none.
        at: barycentric coordinates of the samples, (q, dim + 1).
        options: of the fits.
    """

    def __init__(
        self,
        cells: np.ndarray,
        shape: np.ndarray,
        numbers: np.ndarray,
        smooth: np.ndarray,
        at: np.ndarray,
        options: InterpolationOptions,
    ) -> None:
        dim = shape.shape[2]
        element = lagrange_element(dim, numbers.shape[1])
        degree = element.degree
        self._options, self._degree, self._smooth = options, degree, smooth
        self._exponents = monomials(dim, degree + 2)
        places = node_places(numbers.shape[1], shape)
        _, first, inverse = np.unique(numbers, return_index=True, return_inverse=True)
        self._numbers, self._first = inverse.reshape(numbers.shape), first
        self._places = places.reshape(-1, dim)[first]
        vertices, corners = np.unique(cells, return_inverse=True)
        self._corners = corners.reshape(cells.shape)
        self._centres = np.zeros((len(vertices), dim))
        self._centres[self._corners] = shape[:, : dim + 1]
        cells_of = _incidence(self._corners, len(vertices))
        near = (cells_of @ cells_of.T) @ cells_of
        self._nodes = (near @ _incidence(self._numbers, len(first)).T).tocsr()
        self._scales = np.zeros(len(vertices))
        for rows in self._chunks():
            nodes, held = padded(self._nodes, rows)
            distances = np.linalg.norm(self._places[nodes] - self._centres[rows, None], axis=2)
            self._scales[rows] = (distances * held).max(axis=1)
        # samples of the cells, gradients of shape functions there on the drawn simplex of each
        slopes = shape_slopes(at, shape.shape[1])
        inverse = np.linalg.inv(np.einsum("cnd,qnr->cqdr", shape, slopes[..., 1:] - slopes[..., :1]))
        tabulated = element.tabulate(1, at[:, 1:])[1:].reshape(dim, len(at), -1)
        self._samples, self._shares = shape_functions(at, shape.shape[1]) @ shape, at
        self._gradients = np.einsum("rqa,cqrd->cqad", tabulated, inverse)

    def of(self, u: np.ndarray) -> np.ndarray:
        """∇u_h − ∇u at the samples, (cells, q, dim, dim), from u_h at the nodes of the cells, (cells, a, dim)."""
        dim = self._places.shape[1]
        values = u.reshape(-1, dim)[self._first]
        coefficients = np.zeros((len(self._centres), len(self._exponents), dim))
        for rows in self._chunks():
            coefficients[rows] = self._fitted(rows, values)
        found = np.zeros((*self._samples.shape[:2], dim, dim))
        concerned = np.flatnonzero(self._smooth)
        each = len(self._exponents) * max(self._numbers.shape[1], dim * len(self._shares))
        for cells in np.array_split(concerned, -(-len(concerned) * each // self._options.chunk) or 1):
            for corner, share in enumerate(self._shares.T):
                rows = self._corners[cells, corner]
                centres, scales = self._centres[rows, None], self._scales[rows, None, None]
                own = _monomials((self._places[self._numbers[cells]] - centres) / scales, self._exponents)
                interpolated = np.einsum("cam,cmi->cai", own, coefficients[rows], optimize=True)
                whole = np.einsum("cai,cqad->cqid", interpolated, self._gradients[cells], optimize=True)
                slopes = _slopes((self._samples[cells] - centres) / scales, self._exponents)
                slopes = np.einsum("cqmd,cmi->cqid", slopes, coefficients[rows], optimize=True) / scales[..., None]
                found[cells] += share[:, None, None] * (whole - slopes)
        # where the estimate is no small part of F it is no estimate
        F = np.eye(dim) + np.einsum("cai,cqad->cqid", u, self._gradients, optimize=True)
        found[np.linalg.norm(np.linalg.solve(F, found), axis=(2, 3)) > self._options.most] = 0.0
        return found

    def _fitted(self, rows: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Coefficients of the polynomials around the vertices ``rows``, (rows, m, dim)."""
        options = self._options
        nodes, held = padded(self._nodes, rows)
        local = (self._places[nodes] - self._centres[rows, None]) / self._scales[rows, None, None]
        weights = held * np.exp(-options.decay * (local**2).sum(axis=2))
        M = _monomials(local, self._exponents)
        moments = np.swapaxes(M * weights[..., None], 1, 2)
        G = moments @ M
        degrees = self._exponents.sum(axis=1)
        mean = np.trace(G, axis1=1, axis2=2) / len(degrees)
        # none of what rotations have
        penalties = options.ridge * options.growth ** np.maximum(degrees - self._degree, 0) * (degrees > 1)
        penalised = G + mean[:, None, None] * np.diag(penalties)
        return np.linalg.solve(penalised, moments @ values[nodes])

    def _chunks(self) -> Iterator[np.ndarray]:
        """Vertices that are fitted together, those with patches of about one size."""
        counts = np.diff(self._nodes.indptr)
        each = len(self._exponents) * int(counts.max(initial=1))
        order = np.argsort(counts, kind="stable")
        yield from np.array_split(order, -(-len(order) * each // self._options.chunk) or 1)


def node_places(count: int, shape: np.ndarray) -> np.ndarray:
    """Places of the ``count`` nodes of u in cells with nodes ``shape`` (cells, n, dim), (cells, count, dim)."""
    points = lagrange_element(shape.shape[2], count).points
    return shape_functions(np.column_stack([1.0 - points.sum(axis=1), points]), shape.shape[1]) @ shape


def _incidence(rows: np.ndarray, count: int) -> csr_matrix:
    """Of ``count`` things with the cells that have them, from those of each cell, (cells, k)."""
    columns = np.repeat(np.arange(len(rows)), rows.shape[1])
    return csr_matrix((np.ones(rows.size, np.int32), (rows.ravel(), columns)), shape=(count, len(rows)))


def _monomials(points: np.ndarray, exponents: np.ndarray) -> np.ndarray:
    """All monomials at points (…, dim), (…, m)."""
    powers = np.stack([points**power for power in range(int(exponents.max()) + 1)], axis=-1)
    values = np.ones((*points.shape[:-1], len(exponents)))
    for axis in range(points.shape[-1]):
        values *= powers[..., axis, exponents[:, axis]]
    return values


def _slopes(points: np.ndarray, exponents: np.ndarray) -> np.ndarray:
    """Their derivatives by each coordinate, (…, m, dim)."""
    found = []
    for axis, own in enumerate(np.eye(exponents.shape[1], dtype=int)):
        lower = np.maximum(exponents - own, 0)
        found.append(exponents[:, axis] * _monomials(points, lower))
    return np.stack(found, axis=-1)
