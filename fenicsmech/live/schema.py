"""Schemas of plain data that come from a file or a page: what is not as they say is refused, with the place of it."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

LONGEST_NAME = 160
"""Characters of a part's name: joints are named by kind, links and place where a script gives no name."""


class Refused(Exception):
    """Data that do not fit their schema.

    Attributes:
        place: of the offending value, as ``targets[2].force``; empty for the whole.
        problem: what is wrong with it.
    """

    def __init__(self, place: str, problem: str) -> None:
        self.place, self.problem = place, problem
        super().__init__(f"{place or 'data'}: {problem}")


class Schema(ABC):
    """What a value may be."""

    @abstractmethod
    def check(self, value: Any, place: str = "") -> None:
        """Raises Refused if ``value`` is something else."""


@dataclass(frozen=True)
class Number(Schema):
    """A finite number between two bounds, a whole one if ``whole``."""

    least: float = -1e9
    most: float = 1e9
    whole: bool = False

    def check(self, value, place=""):
        if isinstance(value, bool) or not isinstance(value, int if self.whole else int | float):
            raise Refused(place, f"not a {'whole ' if self.whole else ''}number")
        if not (self.least <= value <= self.most and math.isfinite(value)):
            raise Refused(place, f"not between {self.least:g} and {self.most:g}")


@dataclass(frozen=True)
class Text(Schema):
    """A text without control characters, of limited length."""

    most: int = 80
    least: int = 1

    def check(self, value, place=""):
        if not isinstance(value, str):
            raise Refused(place, "not a text")
        if not self.least <= len(value) <= self.most:
            raise Refused(place, f"a text of {len(value)} characters, not {self.least} to {self.most}")
        if re.search(r"[\x00-\x1f\x7f\u2028\u2029\ud800-\udfff]", value):
            raise Refused(place, "a text with control characters")


@dataclass(frozen=True)
class Choice(Schema):
    """One of several texts or flags."""

    values: tuple[str | bool, ...]

    def check(self, value, place=""):
        if not any(type(value) is type(own) and value == own for own in self.values):
            raise Refused(place, f"not one of {', '.join(map(str, self.values))}")


FLAG = Choice((False, True))


@dataclass(frozen=True)
class Many(Schema):
    """A list of limited length."""

    of: Schema
    least: int = 0
    most: int = 100

    def check(self, value, place=""):
        if not isinstance(value, list):
            raise Refused(place, "not a list")
        if not self.least <= len(value) <= self.most:
            raise Refused(place, f"a list of {len(value)}, not {self.least} to {self.most}")
        for k, own in enumerate(value):
            self.of.check(own, f"{place}[{k}]")


@dataclass(frozen=True)
class Optional(Schema):
    """None, or what ``of`` says."""

    of: Schema

    def check(self, value, place=""):
        if value is not None:
            self.of.check(value, place)


@dataclass(frozen=True)
class Record(Schema):
    """A mapping with all of ``fields``, perhaps some of ``more``, and nothing else."""

    fields: Mapping[str, Schema]
    more: Mapping[str, Schema] = field(default_factory=dict)

    def check(self, value, place=""):
        if not isinstance(value, dict):
            raise Refused(place, "not a record")
        for name, own in self.fields.items():
            if name not in value:
                raise Refused(place, f"{name} is missing")
            own.check(value[name], f"{place}.{name}".lstrip("."))
        for name in value.keys() - self.fields.keys():
            if name not in self.more:
                raise Refused(place, f"{str(name)[:40]!r} is unknown")
            self.more[name].check(value[name], f"{place}.{name}".lstrip("."))


@dataclass(frozen=True)
class ByKind(Schema):
    """Records of several kinds, told apart by their entry ``key``."""

    kinds: Mapping[str, Record]
    key: str = "kind"

    def check(self, value, place=""):
        if not isinstance(value, dict):
            raise Refused(place, "not a record")
        kind = value.get(self.key)
        if not isinstance(kind, str) or kind not in self.kinds:
            raise Refused(place, f"its {self.key} is not one of {', '.join(self.kinds)}")
        self.kinds[kind].check({name: own for name, own in value.items() if name != self.key}, place)


@dataclass(frozen=True)
class ByEntry(Schema):
    """Records of several kinds, told apart by an entry that each has alone; the first one where there is none."""

    kinds: Mapping[str, Record]

    def check(self, value, place=""):
        if not isinstance(value, dict):
            raise Refused(place, "not a record")
        own = next((kind for entry, kind in self.kinds.items() if entry in value), next(iter(self.kinds.values())))
        own.check(value, place)


@dataclass(frozen=True)
class TextOr(Schema):
    """A text of one schema, or something else of another."""

    text: Schema
    other: Schema

    def check(self, value, place=""):
        (self.text if isinstance(value, str) else self.other).check(value, place)


@dataclass(frozen=True)
class Mapped(Schema):
    """A mapping from texts, of limited size."""

    of: Schema
    most: int = 40

    def check(self, value, place=""):
        if not isinstance(value, dict) or len(value) > self.most:
            raise Refused(place, f"not a mapping of at most {self.most}")
        for name, own in value.items():
            Text(LONGEST_NAME).check(name, place)
            self.of.check(own, f"{place}.{name}".lstrip("."))


@dataclass(frozen=True)
class Anything(Schema):
    """Plain data of limited depth, whose meaning another schema checks later; the message limits how much it is."""

    depth: int = 18

    def check(self, value, place=""):
        self._check(value, self.depth, place)

    def _check(self, value: Any, depth: int, place: str) -> None:
        if depth == 0:
            raise Refused(place, f"nested deeper than {self.depth}")
        if isinstance(value, dict | list):
            for own in value.values() if isinstance(value, dict) else value:
                self._check(own, depth - 1, place)
        if isinstance(value, float) and not math.isfinite(value):
            raise Refused(place, "a number that is not finite")
