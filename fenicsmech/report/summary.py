"""The summary every demo leaves behind: one JSON file with the same keys everywhere."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from fenicsmech.errors import DescriptionError
from fenicsmech.report.atomic import atomic_write


def write_summary(path: str | Path, data: Mapping[str, object]) -> None:
    """Write ``data`` as JSON, keys in the order given, indented by two.

    Args:
        path: the file.
        data: mappings, sequences, arrays, numbers, words, flags, None and paths, nested at will.

    Raises:
        DescriptionError: a number is not finite, or a value has no JSON form; the message says where.
    """
    text = json.dumps(_plain("", data), indent=2, ensure_ascii=False, allow_nan=False)
    with atomic_write(path) as file:
        file.write(text + "\n")


def check_summary(data: Mapping[str, object]) -> None:
    """Check that ``data`` has what the summary of every demo must have; more is allowed.

    Required: demo, space, order, ranks, dofs {rigid, flexible}, parameters, targets [{configuration, force, wanted,
    reached}], frames [{force, displacement, seconds, iterations, stable}], seconds {setup, frame_median, optimize},
    iterations, evaluations, objective {initial, final}, thickness [min, max], mesh_ratio_max. What only an
    optimisation knows may be None.

    Raises:
        DescriptionError: a key is missing or its value is of the wrong kind; the message names the key.
    """
    _check("", _plain("", data), _SCHEMA)


def _plain(key: str, value: object) -> object:
    """``value`` in JSON's own types; ``key`` is its place, for messages."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        if not math.isfinite(value):
            raise _error(key, f"the value is {value}", "Use None for what is not known")
        return value
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        for name in value:
            if not isinstance(name, str):
                raise _error(key, f"the key {name!r} is not a word", "Use words as keys")
        return {name: _plain(f"{key}.{name}" if key else name, item) for name, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, bytes | bytearray):
        return [_plain(f"{key}[{index}]", item) for index, item in enumerate(value)]
    raise _error(key, f"{type(value).__name__} has no JSON form", "Convert it to numbers, words, lists or mappings")


Rule = Callable[[object], bool]
Schema = dict | list | tuple


def _is_count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_word(value: object) -> bool:
    return isinstance(value, str) and value != ""


def _is_quantity(value: object) -> bool:
    return _is_number(value) or (isinstance(value, list) and len(value) > 0 and all(map(_is_number, value)))


def _is_range(value: object) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_number, value)) and value[0] <= value[1]


def _or_none(name: str, rule: Rule) -> tuple[str, Rule]:
    return f"{name} or None", lambda value: value is None or rule(value)


_WORD = "a word", _is_word
_COUNT = "a count", _is_count
_POSITIVE_COUNT = "a count of at least 1", lambda value: _is_count(value) and value > 0
_NUMBER = "a number", _is_number
_DURATION = "a number that is not negative", lambda value: _is_number(value) and value >= 0
_FLAG = "true or false", lambda value: isinstance(value, bool)
_QUANTITY = "a number or a list of numbers", _is_quantity
_NAME = "a word or a count", lambda value: _is_word(value) or _is_count(value)

# mappings hold keys, a list holds the schema of its items, a tuple is (what is wanted, test)
_SCHEMA: Schema = {
    "demo": _WORD,
    "space": _WORD,
    "order": _POSITIVE_COUNT,
    "ranks": _POSITIVE_COUNT,
    "dofs": {"rigid": _COUNT, "flexible": _COUNT},
    "parameters": _or_none(*_COUNT),
    "targets": [
        {"configuration": _NAME, "force": _QUANTITY, "wanted": _QUANTITY, "reached": _or_none(*_QUANTITY)},
    ],
    "frames": [
        {"force": _QUANTITY, "displacement": _QUANTITY, "seconds": _DURATION, "iterations": _COUNT, "stable": _FLAG},
    ],
    "seconds": {"setup": _DURATION, "frame_median": _or_none(*_DURATION), "optimize": _or_none(*_DURATION)},
    "iterations": _or_none(*_COUNT),
    "evaluations": _or_none(*_COUNT),
    "objective": {"initial": _or_none(*_NUMBER), "final": _or_none(*_NUMBER)},
    "thickness": _or_none("a pair [min, max]", _is_range),
    "mesh_ratio_max": _or_none(*_NUMBER),
}


def _check(key: str, value: object, schema: Schema) -> None:
    if isinstance(schema, dict):
        if not isinstance(value, dict):
            raise _error(key, f"{value!r} is not a mapping", f"Give the keys {', '.join(schema)}")
        for name, inner in schema.items():
            place = f"{key}.{name}" if key else name
            if name not in value:
                raise _error(place, "the key is missing", "Add it; use None where there is nothing to tell")
            _check(place, value[name], inner)
    elif isinstance(schema, list):
        if not isinstance(value, list):
            raise _error(key, f"{value!r} is not a list", "Give a list; it may be empty")
        for index, item in enumerate(value):
            _check(f"{key}[{index}]", item, schema[0])
    else:
        wanted, fits = schema
        if not fits(value):
            raise _error(key, f"the value is {value!r}", f"Give {wanted}")


def _error(key: str, problem: str, remedy: str) -> DescriptionError:
    return DescriptionError(f"'{key}' of the summary" if key else "the summary", problem, remedy)
