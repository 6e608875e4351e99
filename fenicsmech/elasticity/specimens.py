"""Specimens of material tests: bodies of even stretch, whose free sides bear no stress.

With the stretch λ along the pull, κ of a side that is kept or pulled too, and s of the free sides, the energy per
volume and the nominal stress are

    w = W(λ, s₁, s₂)     uniaxial; s₁ = s₂ unless the law has directions,
        W(λ, κ, s)       planar, κ = 1, and equibiaxial, κ = λ,

    P = ∂w/∂λ,     ∂w/∂s = 0.

s is found by Newton's method in ln s, at the given Poisson's ratio: materials need not be incompressible. For a
parameter θ of the law

    ∂P/∂θ = w_λθ − w_λs · w_ss⁻¹ w_sθ.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from ufl import as_matrix, diff

from fenicsmech.elasticity.models import contracted
from fenicsmech.errors import DescriptionError, point_text, real_array
from fenicsmech.laws import Formulas, Law, LawForm, number

SPECIMENS = ("uniaxial", "planar", "equibiaxial")
"""Kinds of specimens."""

_STEPS = 40
"""Of Newton's method at most; rubber takes 3 to 8."""

_ENOUGH = 1e-9
"""Step of Newton's method in ln s that is the last: convergence is quadratic."""


def check_kind(kind: str) -> str:
    """``kind`` if it is one of a specimen."""
    if kind not in SPECIMENS:
        raise DescriptionError("kind of a specimen", f"there is no {kind!r}", f"Give one of {', '.join(SPECIMENS)}")
    return kind


def specimen_stress(law: Law, kind: str, stretches: ArrayLike) -> NDArray[np.float64]:
    """Nominal stresses (n,) of a specimen of ``law``, force per undeformed area.

    The pull is along x, the side that is pulled or kept along y, z across the sheet; directions of the law are along
    these axes. Local.

    Args:
        law: with its Poisson's ratio.
        kind: "uniaxial" (free sides), "planar" (one side kept, pure shear) or "equibiaxial" (free across the sheet).
        stretches: (n,) along the pull, positive.

    Returns:
        NaN where the law has no equilibrium.

    Raises:
        DescriptionError: another kind, stretches that are not positive numbers, or inclined directions of the law.
    """
    values = real_array("stretches of a specimen", stretches, None)
    if np.any(values <= 0.0):
        raise DescriptionError("stretches of a specimen", f"one is {values.min():g}", "Give positive numbers")
    return Specimen(law, kind).response(law, values)[0]


class Specimen:
    """A specimen of laws of one form, whose parameters vary.

    Args:
        law: its class, and the number of its terms.
        kind: of ``SPECIMENS``.
        by: parameters by which the stress is differentiated.
    """

    def __init__(self, law: Law, kind: str, by: tuple[str, ...] = ()) -> None:
        _check_axes(law)
        self._by, self._kind = by, check_kind(kind)
        self._count = 2 if _sides_differ(law, kind) else 1
        self._free, self._formulas = _formulas(LawForm(law), kind == "uniaxial", self._count, by)

    def response(self, law: Law, stretches: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """P (n,) and ∂P/∂θ (n, k) at ``stretches`` (n,); NaN where there is no equilibrium."""
        return self._response(law, stretches)[1:]

    def sides(self, law: Law, stretches: NDArray[np.float64]) -> NDArray[np.float64]:
        """Stretches along x, y and z, (n, 3), at those of the pull."""
        free = 1.0 + self._response(law, stretches)[0]
        return np.column_stack([stretches, free[0] if self._kind == "uniaxial" else self._kept(stretches), free[-1]])

    def _kept(self, stretches: NDArray[np.float64]) -> NDArray[np.float64]:
        """κ, where it counts."""
        return stretches if self._kind == "equibiaxial" else np.ones_like(stretches)

    def _response(
        self, law: Law, stretches: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """s − 1, (1 or 2, n), P and ∂P/∂θ."""
        parameters, count, points = tuple(law.parameters.values()), self._count, len(stretches)
        nu = float(law.nu)  # type: ignore[arg-type]  # a number here
        pull, kept = stretches - 1.0, self._kept(stretches) - 1.0
        # of constant E and ν in logarithmic strain
        exponent = {"uniaxial": nu, "planar": nu / (1.0 - nu), "equibiaxial": 2.0 * nu / (1.0 - nu)}[self._kind]
        free = np.tile(np.expm1(-exponent * np.log(stretches)), (count, 1))
        for _ in range(_STEPS):
            slopes, curvatures = np.split(self._free(pull, kept, *free, *parameters), [count])
            step = _downhill((1.0 + free) * slopes, curvatures.reshape(count, count, points), 1.0 + free)
            free = free + (1.0 + free) * np.expm1(step)
            if not np.any(np.abs(step) > _ENOUGH):
                break
        energy, stress, *rest = self._formulas(pull, kept, *free, *parameters)
        sizes = np.cumsum([count, count**2, len(self._by)])
        mixed, curvatures, along, across = np.split(np.array(rest), sizes)
        across = across.reshape(count, len(self._by), points)
        with np.errstate(all="ignore"):
            change = _solved(curvatures.reshape(count, count, points), mixed)
            slopes = along - np.einsum("in,ikn->kn", change, across)
        # derivatives may go on where the energy ends
        known = np.all(np.abs(step) <= _ENOUGH, axis=0) & np.isfinite(energy)
        return free, np.where(known, stress, np.nan), slopes.T


def _check_axes(law: Law) -> None:
    """Raises a DescriptionError if a specimen of a law with directions would shear."""
    if law.directions and any(max(map(abs, axis)) < 1.0 - 1e-9 for axis in law.axes):
        given = ", ".join(point_text(axis) for axis in law.axes)
        raise DescriptionError(
            f"specimen of {type(law).__name__}",
            f"its axes {given} are inclined to the pull along x, under which it would shear",
            "Turn the directions of the law to x, y and z",
        )


def _sides_differ(law: Law, kind: str) -> bool:
    """Whether two free sides may contract differently."""
    return kind == "uniaxial" and bool(law.directions)


def _downhill(slopes: NDArray, curvatures: NDArray, stretches: NDArray) -> NDArray:
    """Newton's step in logarithms of k stretches, (k, n), at most 1; downhill where the energy is not convex.

    Args:
        slopes: by the logarithms, (k, n).
        curvatures: by the stretches, (k, k, n).
        stretches: (k, n).
    """
    matrix = curvatures * stretches * stretches[:, None] + slopes * np.eye(len(slopes))[:, :, None]
    matrix, known = np.moveaxis(matrix, -1, 0), np.all(np.isfinite(matrix), axis=(0, 1)) & np.isfinite(slopes).all(0)
    values, modes = np.linalg.eigh(np.where(known[:, None, None], matrix, np.eye(len(slopes))))
    with np.errstate(all="ignore"):
        step = -np.einsum("nij,nj,nkj,kn->in", modes, 1.0 / np.abs(values), modes, slopes)
    return np.clip(np.where(known, step, np.nan), -1.0, 1.0)


def _solved(matrices: NDArray, right: NDArray) -> NDArray:
    """Solutions of symmetric systems of one or two equations, (k, n), by their cofactors."""
    if len(right) == 1:
        return right / matrices[0]
    (a, b), (_, c) = matrices
    first, second = right
    return np.array([c * first - b * second, a * second - b * first]) / (a * c - b * b)


@lru_cache(maxsize=64)
def _formulas(form: LawForm, sides_free: bool, count: int, by: tuple[str, ...]) -> tuple[Formulas, Formulas]:
    """(w_s, w_ss) and (w, w_λ, w_λs, w_ss, w_λθ, w_sθ) of λ − 1, κ − 1, s − 1 and the law's parameters."""
    numbers = {name: number() for name in form.law.parameters}
    pull, kept, free = number(), number(), [number() for _ in range(count)]
    in_plane = as_matrix([[pull, 0.0], [0.0, free[0] if sides_free else kept]])
    energy = form.law.with_parameters(numbers).energy(contracted(in_plane, free[-1]))
    along, across = diff(energy, pull), [diff(energy, side) for side in free]
    derivatives = [diff(first, numbers[name]) for first in (along, *across) for name in by]
    curvatures = [diff(slope, side) for slope in across for side in free]
    given = [pull, kept, *free, *numbers.values()]
    return (
        Formulas([*across, *curvatures], given),
        Formulas([energy, along, *(diff(along, side) for side in free), *curvatures, *derivatives], given),
    )
