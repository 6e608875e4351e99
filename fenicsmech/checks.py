"""Checks of a user's numbers: each returns plain, finite data or raises an error that names the part."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fenicsmech.errors import DescriptionError


def finite(part: str, value: Any) -> float:
    """``value`` as a float.

    Raises:
        DescriptionError: it is not a finite number.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise DescriptionError(part, f"{value!r} is not a number", "Give a finite number") from None
    if not math.isfinite(number):
        raise DescriptionError(part, f"the value is {number}", "Give a finite number")
    return number


def positive(part: str, value: Any) -> float:
    """``value`` as a float greater than zero.

    Raises:
        DescriptionError: it is not finite or not positive.
    """
    number = finite(part, value)
    if number <= 0.0:
        raise DescriptionError(part, f"{number:g} is not positive", "Give a number greater than zero")
    return number


def point(part: str, values: Sequence[float], *, dimensions: tuple[int, ...] = (2, 3)) -> tuple[float, ...]:
    """``values`` as a tuple of finite coordinates.

    Raises:
        DescriptionError: wrong number of coordinates, or one of them is not finite.
    """
    try:
        coordinates = tuple(values)
    except TypeError:
        coordinates = ()
    if len(coordinates) not in dimensions:
        wanted = " or ".join(str(d) for d in dimensions)
        raise DescriptionError(part, f"{values!r} has not {wanted} coordinates", f"Give {wanted} numbers")
    return tuple(finite(part, c) for c in coordinates)


def point_text(point: Iterable[float]) -> str:
    """A point as messages show it: ``(1, 2.5)``."""
    return f"({', '.join(f'{c:g}' for c in point)})"


def points(
    part: str, values: Sequence[Sequence[float]], *, least: int, dimensions: tuple[int, ...]
) -> tuple[tuple[float, ...], ...]:
    """``values`` as a tuple of at least ``least`` points.

    Raises:
        DescriptionError: too few points, or one is not a point.
    """
    try:
        values = tuple(values)
    except TypeError:
        raise DescriptionError(part, f"{values!r} is not a list of points", "Give a list of points") from None
    checked = tuple(point(part, p, dimensions=dimensions) for p in values)
    if len(checked) < least:
        raise DescriptionError(part, f"{len(checked)} point(s) given", f"Give at least {least} points")
    return checked


def direction(part: str, values: Sequence[float]) -> tuple[float, ...]:
    """``values`` scaled to unit length.

    Raises:
        DescriptionError: it is not a vector or has no length.
    """
    vector = point(part, values)
    length = math.hypot(*vector)
    if length == 0.0:
        raise DescriptionError(part, "the direction has zero length", "Give a vector that points somewhere")
    return tuple(c / length for c in vector)


def real_array(part: str, values: ArrayLike, *shape: int | None) -> NDArray[np.float64]:
    """``values`` as a read-only copy of finite floats.

    Args:
        part: what the numbers are, for the message.
        values: anything numpy can convert.
        shape: wanted length of every axis, None where any length will do.

    Raises:
        DescriptionError: not numbers, another shape, or not finite.
    """
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise DescriptionError(part, "the values are not an array of numbers", "Give an array of numbers") from None
    _check_shape(part, array, shape)
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise DescriptionError(part, f"entry {list(where)} is {array[where]}", "Give finite numbers")
    array.setflags(write=False)
    return array


def index_array(part: str, values: ArrayLike, *shape: int | None, below: int) -> NDArray[np.int64]:
    """``values`` as a read-only copy of indices in 0, ..., ``below`` − 1.

    Raises:
        DescriptionError: not integers, another shape, or out of range.
    """
    array = np.array(values)
    if array.size and not np.issubdtype(array.dtype, np.integer):
        raise DescriptionError(part, f"the indices are {array.dtype}", "Give integers")
    array = array.astype(np.int64)
    _check_shape(part, array, shape)
    if array.size and (array.min() < 0 or array.max() >= below):
        found = f"indices run from {array.min()} to {array.max()}"
        raise DescriptionError(part, found, f"Only 0 to {below - 1} exist; check the numbering")
    array.setflags(write=False)
    return array


def _check_shape(part: str, array: NDArray, shape: tuple[int | None, ...]) -> None:
    fits = array.ndim == len(shape) and all(
        want is None or have == want for have, want in zip(array.shape, shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("any" if n is None else str(n) for n in shape)
        raise DescriptionError(part, f"the array has shape {array.shape}", f"Give shape ({wanted})")
