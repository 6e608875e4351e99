"""Exceptions and the checks of a user's numbers that raise them.

An exception names the part, shows the offending value and gives the remedy. A check returns plain, finite data, or
raises a ``DescriptionError`` that starts with ``part``.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import fields
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


class FenicsmechError(Exception):
    """Base of the errors of this package.

    Args:
        part: the part concerned, in the user's words ("strip of link 'diagonal'").
        problem: the problem, with the offending value.
        remedy: how to correct it.
    """

    def __init__(self, part: str, problem: str, remedy: str) -> None:
        self.part, self.problem, self.remedy = part, problem, remedy
        super().__init__(f"{part}: {problem}. {remedy}.")

    def __reduce__(self):
        # errors travel between MPI ranks
        return type(self), (self.part, self.problem, self.remedy)


class DescriptionError(FenicsmechError, ValueError):
    """The description of a mechanism, scene or request contradicts itself or is incomplete."""


class AssemblyError(FenicsmechError):
    """No rigid assembly satisfies the joints at the requested motor positions."""


class MeshingError(FenicsmechError):
    """A link cannot be meshed as described."""


class OutOfMemoryError(FenicsmechError, MemoryError):
    """A matrix and its factor do not fit into memory."""


class EquilibriumError(FenicsmechError):
    """No equilibrium was found at the requested load.

    Attributes:
        last: the last converged frame (None if there was none).
        frames: every frame converged before the failure.
    """

    def __init__(self, part: str, problem: str, remedy: str, *, last=None, frames=()) -> None:
        super().__init__(part, problem, remedy)
        self.last, self.frames = last, tuple(frames)


def expect(part: str, value: Any, kinds: Any, noun: str, remedy: str = "Give one from this mechanism") -> None:
    """Checks that ``value`` is an instance of ``kinds``, which messages call ``noun``."""
    # a class has the attributes of a protocol without being an instance
    if isinstance(value, type) or not isinstance(value, kinds):
        raise DescriptionError(part, f"{value!r} is not {noun}", remedy)


def finite(part: str, value: Any) -> float:
    """``value`` as a float."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise DescriptionError(part, f"{value!r} is not a number", "Give a finite number") from None
    if not math.isfinite(number):
        raise DescriptionError(part, f"the value is {number}", "Give a finite number")
    return number


def positive(part: str, value: Any) -> float:
    """``value`` as a float greater than zero."""
    number = finite(part, value)
    if number <= 0.0:
        raise DescriptionError(part, f"{number:g} is not positive", "Give a number greater than zero")
    return number


def not_negative(part: str, value: Any) -> float:
    """``value`` as a float of at least zero."""
    number = finite(part, value)
    if number < 0.0:
        raise DescriptionError(part, f"{number:g} is negative", "Give zero or a greater number")
    return number


def whole(part: str, value: Any, *, least: int) -> int:
    """``value`` as an int of at least ``least``."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise DescriptionError(part, f"the value is {value!r}", f"Give a whole number of at least {least}")
    return int(value)


def point(part: str, values: Sequence[float], *, dimensions: tuple[int, ...] = (2, 3)) -> tuple[float, ...]:
    """``values`` as a tuple of finite coordinates."""
    try:
        coordinates = tuple(values)
    except TypeError:
        coordinates = ()
    if len(coordinates) not in dimensions:
        wanted = " or ".join(str(d) for d in dimensions)
        raise DescriptionError(part, f"{values!r} does not have {wanted} coordinates", f"Give {wanted} numbers")
    return tuple(finite(part, c) for c in coordinates)


def point_text(point: Iterable[float]) -> str:
    """A point as messages show it: ``(1, 2.5)``."""
    return f"({', '.join(f'{c:g}' for c in point)})"


def with_error(value: float, error: float) -> str:
    """A value to the first digit of its error, and this: ``13.02 ± 0.08``."""
    if not (value and error > 0.0):
        return f"{value:.3g}"
    place = math.floor(math.log10(error))
    if not -4 <= place <= 3:
        return f"{value:.4g} ± {error:.1g}"
    return f"{round(value, -place):.{max(-place, 0)}f} ± {round(error, -place):g}"


def counted(number: int, noun: str, plural: str = "") -> str:
    """A number of things as messages show it: ``1 point``, ``2 points``."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def points(
    part: str, values: Sequence[Sequence[float]], *, least: int, dimensions: tuple[int, ...]
) -> tuple[tuple[float, ...], ...]:
    """``values`` as a tuple of at least ``least`` points."""
    try:
        values = tuple(values)
    except TypeError:
        raise DescriptionError(part, f"{values!r} is not a list of points", "Give a list of points") from None
    checked = tuple(point(part, p, dimensions=dimensions) for p in values)
    if len(checked) < least:
        raise DescriptionError(part, f"{counted(len(checked), 'point')} given", f"Give at least {least} points")
    return checked


def direction(part: str, values: Sequence[float]) -> tuple[float, ...]:
    """``values`` scaled to unit length."""
    vector = point(part, values)
    length = math.hypot(*vector)
    if length == 0.0:
        raise DescriptionError(part, "the direction has zero length", "Give a vector that points somewhere")
    return tuple(c / length for c in vector)


def in_plane(part: str, vector: Sequence[float], dim: int) -> None:
    """Checks that a vector of two or three coordinates stays in the plane, where ``dim`` is 2."""
    if dim == 2 and any(vector[2:]):
        raise DescriptionError(part, f"{vector} leaves the plane", "Use space='3d', or give two coordinates")


def real_array(part: str, values: ArrayLike, *shape: int | None) -> NDArray[np.float64]:
    """``values`` as a read-only copy of finite floats; ``shape`` has None where an axis may have any length."""
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
    """``values`` as a read-only copy of indices in 0, ..., ``below`` − 1."""
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


def set_fields(frozen: object, **values: Any) -> None:
    """Sets fields of a frozen dataclass to their checked values, for its ``__post_init__``."""
    for name, value in values.items():
        object.__setattr__(frozen, name, value)


def set_options(
    options: Any, of: str, *, free: Collection[str] = (), below_one: Collection[str] = (), **least: int
) -> None:
    """Sets the numbers of an options record, a frozen dataclass, to their checked values, for its ``__post_init__``.

    Args:
        options: its fields with a float as default are positive numbers.
        of: what they are options of.
        free: those of these fields that may be any finite number.
        below_one: those that are below one.
        least: of the fields that are whole numbers.
    """
    for field in fields(options):
        name, part, value = field.name, f"{field.name} of {of}", getattr(options, field.name)
        if name in least:
            set_fields(options, **{name: whole(part, value, least=least[name])})
        elif isinstance(field.default, float):
            number = (finite if name in free else positive)(part, value)
            if name in below_one and number >= 1.0:
                raise DescriptionError(part, f"{number:g} is not below 1", "Give a number between 0 and 1")
            set_fields(options, **{name: number})
