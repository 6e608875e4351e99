"""Arrays that are checked once, when a record takes them in."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fenicsmech.errors import DescriptionError


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
