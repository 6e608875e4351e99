"""The keys that the summary of every demo has, and the kind of their values."""

from __future__ import annotations

from collections.abc import Callable

Schema = dict | list | Callable[[object], bool]


def number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def count(value: object) -> bool:
    return number(value) and value == int(value) >= 0


def duration(value: object) -> bool:
    return number(value) and value >= 0.0


def word(value: object) -> bool:
    return isinstance(value, str) and value != ""


def flag(value: object) -> bool:
    return isinstance(value, bool)


def span(value: object) -> bool:
    return len(value) == 2 and all(map(number, value)) and value[0] <= value[1]


def value(found: object) -> bool:
    return number(found) or (isinstance(found, list) and all(map(number, found)))


def or_none(rule: Callable[[object], bool]) -> Callable[[object], bool]:
    return lambda value: value is None or rule(value)


# a mapping holds keys, a list the schema of its items, a function the test of a value
SCHEMA: Schema = {
    "mechanism": word,
    "space": word,
    "order": count,
    "ranks": count,
    "dofs": {"rigid": count, "flexible": count},
    "parameters": or_none(count),
    "targets": [{"configuration": or_none(word), "force": or_none(number), "wanted": or_none(value), "reached": value}],
    "frames": [{"force": number, "displacement": number, "seconds": duration, "iterations": count, "stable": flag}],
    "seconds": {"setup": duration, "frame_median": or_none(duration), "optimise": or_none(duration)},
    "iterations": or_none(count),
    "evaluations": or_none(count),
    "objective": {"initial": or_none(number), "final": or_none(number)},
    "thickness": or_none(span),
    "mesh_ratio_max": or_none(number),
}


def check_summary(value: object, schema: Schema = SCHEMA, key: str = "summary") -> None:
    """Asserts that ``value`` has what ``schema`` wants; more is allowed."""
    if isinstance(schema, dict):
        for name, inner in schema.items():
            assert name in value, f"{key}.{name} is missing"
            check_summary(value[name], inner, f"{key}.{name}")
    elif isinstance(schema, list):
        for index, item in enumerate(value):
            check_summary(item, schema[0], f"{key}[{index}]")
    else:
        assert schema(value), f"{key} is {value!r}"
