"""Recovery of smooth stresses: polynomials fitted to the stresses of the elements in patches around vertices.

The stress of elements jumps between them, and is most accurate at the points of Gauss quadrature, without the estimated
error of interpolation (``interpolation``). Around each vertex v a polynomial of the degree k of the displacement is
fitted to the values at these points in the patch of v,

    Σ_s g_s |T(X_s) − T_v(X_s)|² + w² Σ_b g_b |T_v(X_b) N_b|² → min,     T = J σ F⁻ᵀ,     g = exp(−a |X − X_v|² / R²),

R the radius of the patch, with X_b and N_b points and normals of the free boundary at rest, where σ n = 0 is T N = 0 at
any deformation. Each row of T is fitted by itself, all with one matrix. F − I is fitted in the same way without
boundary terms. Between vertices

    T*(X) = Σ_v λ_v(X) T_v(X),     σ* = T* F*ᵀ / det F*,

λ_v the barycentric coordinates. Patches are the cells at v and those that touch these: enough for a polynomial at a
boundary, where the weights g leave the far ones little say.

Sources: Zienkiewicz & Zhu (doi:10.1002/nme.1620330702) for patches, Wiberg, Abdulwahab & Ziukas
(doi:10.1002/nme.1620372003) for boundary conditions in them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from scipy.sparse import csr_matrix

from fenicsmech.errors import set_options
from fenicsmech.meshing import edge_corners


@dataclass(frozen=True)
class RecoveryOptions:
    """Numbers of the recovery of stresses.

    Attributes:
        decay: a. With 8 peaks at notches are 0.5 % lower, with 16 noise of the elements shows (benchmarks/stress.py).
        traction: w, weight of the free boundary over that of samples.
        ridge: relative to the mean diagonal of the normal matrix; decides coefficients that no sample does.
        chunk: numbers held at once in the work arrays of patches.
        kept: most numbers of factors that are kept from one equilibrium to the next, as they depend on the mesh alone.
    """

    decay: float = 13.0
    traction: float = 3.0
    ridge: float = 1e-10
    chunk: int = 2_000_000
    kept: int = 40_000_000

    def __post_init__(self) -> None:
        set_options(self, "the recovery of stresses", chunk=1, kept=0)


@dataclass(frozen=True, eq=False)
class Samples:
    """Places of samples and of the free boundary.

    Attributes:
        cells: vertices of the cells, (cells, dim + 1).
        points: of the samples in each, (cells, q, dim).
        facet_cells: cell of each free facet, (facets,).
        facet_points: of the conditions on each, (facets, b, dim).
        normals: unit vectors out of the body there, (facets, b, dim).
    """

    cells: np.ndarray
    points: np.ndarray
    facet_cells: np.ndarray
    facet_points: np.ndarray
    normals: np.ndarray


@dataclass(frozen=True, eq=False)
class _Factors:
    """What the fits of some vertices depend on but for the values of samples.

    Attributes:
        cells: of the patches, filled up with zeros, (n, c).
        moments: weighted monomials at the samples, zero at those filled up, (n, m, c q).
        whole: inverse of the matrix of a row of T, (n, dim m, dim m).
        own: that of values that are free at boundaries, (n, m, m).
    """

    cells: np.ndarray
    moments: np.ndarray
    whole: np.ndarray
    own: np.ndarray

    @property
    def size(self) -> int:
        """Count of numbers."""
        return sum(part.size for part in vars(self).values())


class PatchRecovery:
    """Fits in the patches of some vertices.

    Args:
        samples: the places.
        vertices: numbers of the vertices, (n,).
        centres: their places at rest, (n, dim).
        degree: of the polynomials.
        options: of the fits.
    """

    def __init__(
        self,
        samples: Samples,
        vertices: np.ndarray,
        centres: np.ndarray,
        degree: int,
        options: RecoveryOptions | None = None,
    ) -> None:
        self._samples, self._centres = samples, centres
        self._options = options or RecoveryOptions()
        self._exponents = monomials(centres.shape[1], degree)
        count = int(samples.cells.max()) + 1
        own = np.arange(len(samples.cells))
        cells_of = csr_matrix(
            (np.ones(samples.cells.size, np.int8), (samples.cells.ravel(), np.repeat(own, samples.cells.shape[1]))),
            shape=(count, len(own)),
        )
        near = cells_of[vertices]
        self._cells = ((near @ cells_of.T) @ cells_of).tocsr()
        facets = np.arange(len(samples.facet_cells))
        facets_of = csr_matrix((np.ones(len(facets)), (samples.facet_cells, facets)), shape=(len(own), len(facets)))
        self._facets = (self._cells @ facets_of).tocsr()
        # patches of about one size are fitted together
        self._order = np.argsort(np.diff(self._cells.indptr), kind="stable")
        self._kept: list[_Factors] | None = None
        self._scales = np.array(
            [np.linalg.norm(x - c, axis=-1).max() for x, c in zip(self._of_patches(), centres, strict=True)]
        )

    def _of_patches(self) -> Iterator[np.ndarray]:
        for start, stop in zip(self._cells.indptr, self._cells.indptr[1:], strict=False):
            yield self._samples.points[self._cells.indices[start:stop]]

    def fit(self, tensors: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients of the polynomials of each vertex.

        Args:
            tensors: T at the samples, (cells, q, dim, dim).
            others: values that are free at boundaries, (cells, q, r).

        Returns:
            Of T, (n, m, dim, dim), and of the others, (n, m, r), m monomials.
        """
        dim, m = self._centres.shape[1], len(self._exponents)
        fits, free_fits = [], []
        for factors in self._factors():
            n = len(factors.cells)
            right = factors.moments @ tensors[factors.cells].reshape(n, -1, dim * dim)
            # unknowns (j, k), one right-hand side per row i of T
            right = right.reshape(n, m, dim, dim).transpose(0, 3, 1, 2).reshape(n, dim * m, dim)
            fits.append((factors.whole @ right).reshape(n, dim, m, dim).transpose(0, 2, 3, 1))
            right = factors.moments @ others[factors.cells].reshape(n, -1, others.shape[-1])
            free_fits.append(factors.own @ right)
        place = np.argsort(self._order)
        return np.concatenate(fits)[place], np.concatenate(free_fits)[place]

    def fit_transposed(self, tensors: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives by what ``fit`` takes, (cells, q, dim, dim) and (cells, q, r), from those by what it returns."""
        own, dim, m, r = self._samples, self._centres.shape[1], len(self._exponents), others.shape[-1]
        q = own.points.shape[1]
        found = np.zeros((len(own.cells), q, dim * dim + r))
        for rows, factors in zip(self._chunks(), self._factors(), strict=True):
            n = len(rows)
            right = tensors[rows].transpose(0, 3, 1, 2).reshape(n, dim * m, dim)
            fitted = (factors.whole @ right).reshape(n, dim, m, dim).transpose(0, 2, 3, 1)
            both = np.concatenate([fitted.reshape(n, m, dim * dim), factors.own @ others[rows]], axis=2)
            np.add.at(
                found, factors.cells, (factors.moments.transpose(0, 2, 1) @ both).reshape(n, -1, q, dim * dim + r)
            )
        return found[..., : dim * dim].reshape(-1, q, dim, dim), found[..., dim * dim :]

    def _factors(self) -> Iterator[_Factors]:
        """Those of all vertices, small patches first."""
        if self._kept is not None:
            yield from self._kept
            return
        kept: list[_Factors] = []
        room = self._options.kept
        for rows in self._chunks():
            factors = self._factored(rows)
            yield factors
            room -= factors.size
            kept = [*kept, factors] if room > 0 else []
        if room > 0:
            self._kept = kept

    def _factored(self, rows: np.ndarray) -> _Factors:
        own, options, dim, m = self._samples, self._options, self._centres.shape[1], len(self._exponents)
        cells, held = padded(self._cells, rows)
        facets, bound = padded(self._facets, rows)
        n, q, b = len(cells), own.points.shape[1], own.facet_points.shape[1]
        M = self._monomials_at(rows, own.points[cells].reshape(n, -1, dim))
        weight = self._weights(rows, own.points[cells].reshape(n, -1, dim)) * np.repeat(held, q, axis=1)
        B = self._monomials_at(rows, own.facet_points[facets].reshape(n, -1, dim))
        share = self._weights(rows, own.facet_points[facets].reshape(n, -1, dim)) * np.repeat(bound, b, axis=1)
        normals = own.normals[facets].reshape(n, -1, dim) * np.sqrt(share)[..., None]
        moments = (M * weight[..., None]).transpose(0, 2, 1)
        G = moments @ M
        # (m dim)² of Σ_b (N ⊗ m)(N ⊗ m)ᵀ
        rims = options.traction * (normals[..., :, None] * B[..., None, :]).reshape(n, -1, dim * m)
        whole = rims.transpose(0, 2, 1) @ rims
        for j in range(dim):
            whole[:, j * m : (j + 1) * m, j * m : (j + 1) * m] += G
        return _Factors(cells, moments, self._inverse(whole), self._inverse(G))

    def shares(self, rows: np.ndarray, corners: np.ndarray, points: np.ndarray) -> np.ndarray:
        """λ_v times the monomials about v, of which values at points are products with coefficients, (k, c, p, m).

        Args:
            rows: of the vertices of each cell or facet, (k, c).
            corners: λ of its points at these, (k, p, c).
            points: the points, (k, p, dim).
        """
        own = [corners[..., c, None] * self._monomials_at(rows[:, c], points) for c in range(rows.shape[1])]
        return np.stack(own, axis=1)

    def _inverse(self, matrices: np.ndarray) -> np.ndarray:
        mean = np.trace(matrices, axis1=1, axis2=2) / matrices.shape[1]
        return np.linalg.inv(matrices + (self._options.ridge * mean)[:, None, None] * np.eye(matrices.shape[1]))

    def _weights(self, rows: np.ndarray, points: np.ndarray) -> np.ndarray:
        """g of ``points`` (k, p, dim) in the patches of the vertices ``rows`` (k,), (k, p)."""
        squares = ((points - self._centres[rows, None]) ** 2).sum(axis=2)
        return np.exp(-self._options.decay * squares / self._scales[rows, None] ** 2)

    def _monomials_at(self, rows: np.ndarray, points: np.ndarray) -> np.ndarray:
        """All monomials about the vertices ``rows`` (k,) at ``points`` (k, p, dim), (k, p, m)."""
        scaled = (points - self._centres[rows, None]) / self._scales[rows, None, None]
        values = np.ones((*scaled.shape[:2], len(self._exponents)))
        for axis in range(scaled.shape[2]):
            for power in range(1, self._exponents.max(initial=0) + 1):
                values[..., self._exponents[:, axis] >= power] *= scaled[..., axis, None]
        return values

    def _chunks(self) -> Iterator[np.ndarray]:
        """Vertices that are fitted together."""
        dim, m = self._centres.shape[1], len(self._exponents)
        cells, facets = (np.diff(patch.indptr).max(initial=0) for patch in (self._cells, self._facets))
        own = self._samples
        each = m * (cells * own.points.shape[1] + facets * own.facet_points.shape[1] * dim) + (dim * m) ** 2
        parts = -(-len(self._centres) * each // self._options.chunk)
        yield from np.array_split(self._order, max(min(parts, len(self._order)), 1))


def monomials(dim: int, degree: int) -> np.ndarray:
    """Exponents of all monomials of at most ``degree``, the constant first, (m, dim)."""
    found = [np.bincount(chosen, minlength=dim) for d in range(degree + 1)
             for chosen in combinations_with_replacement(range(dim), d)]  # fmt: skip
    return np.array([np.zeros(dim, int) if not len(own) else own for own in found], dtype=int)


def padded(patches: csr_matrix, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Columns of the entries of some rows, filled up with zeros, and the mask of true ones, (rows, most) each."""
    starts, counts = patches.indptr[rows], np.diff(patches.indptr)[rows]
    places = np.arange(counts.max(initial=0))
    held = places < counts[:, None]
    if not len(patches.indices):
        return np.zeros((len(rows), 0), dtype=int), held
    return patches.indices[np.where(held, starts[:, None] + places, 0)], held


def shape_functions(corners: np.ndarray, count: int) -> np.ndarray:
    """Values of the ``count`` linear or quadratic shape functions at barycentric coordinates, (…, dim + 1)."""
    if count == corners.shape[-1]:
        return corners
    i, j = edge_corners(corners.shape[-1]).T
    return np.concatenate([corners * (2.0 * corners - 1.0), 4.0 * corners[..., i] * corners[..., j]], axis=-1)


def shape_slopes(corners: np.ndarray, count: int) -> np.ndarray:
    """Their derivatives by each barycentric coordinate, (…, count, dim + 1)."""
    size = corners.shape[-1]
    unit = np.eye(size)
    if count == size:
        return np.broadcast_to(unit, (*corners.shape[:-1], size, size))
    i, j = edge_corners(size).T
    own = (4.0 * corners - 1.0)[..., :, None] * unit
    between = 4.0 * (corners[..., i, None] * unit[j] + corners[..., j, None] * unit[i])
    return np.concatenate([own, between], axis=-2)


def with_image(values: np.ndarray) -> np.ndarray:
    """Vectors in space, or rows of k tensors, (m, …, 3) or (m, …, 9 k), followed by their mirror images at z = 0."""
    sign = np.array([1.0, 1.0, -1.0])
    if values.shape[-1] != 3:
        sign = np.tile(np.outer(sign, sign).ravel(), values.shape[-1] // 9)
    return np.concatenate([values, values * sign])
