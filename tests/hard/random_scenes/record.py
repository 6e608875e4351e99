"""Verdicts on disk, one per line, so that a run that was stopped goes on where it was, of the same code.

The first line has the commit that they are of, and whether the code was changed since.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, TypeVar

CODE = ("fenicsmech", "benchmarks", "tests")
"""Folders whose changes since a commit make verdicts those of other code."""


class Judged(Protocol):
    """The verdict on a scene."""

    @property
    def seed(self) -> int:
        """Of the scene."""
        ...


T = TypeVar("T", bound=Judged)


class OtherCode(Exception):
    """Verdicts of another commit, which the present code does not go on with."""


def read(path: Path, commit: str, make: Callable[[dict[str, Any]], T]) -> dict[int, T]:
    """Verdicts by seed; a line that is cut, or has other entries than now, is left out.

    Args:
        path: of the file; there are none if it does not exist or is empty.
        commit: of the present code.
        make: a verdict from its entries.

    Raises:
        OtherCode: the verdicts are of another commit, or of an unknown one.
    """
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    if not lines:
        return {}
    if (of := _entries(lines[0]).get("commit", "an unknown commit")) != commit:
        raise OtherCode(f"{path} has verdicts of {of}, and the code is {commit}: remove it, or choose another folder")
    results = {}
    for line in lines[1:]:
        try:
            result = make(_entries(line))
        except (KeyError, TypeError):
            continue
        results[result.seed] = result
    return results


def append(path: Path, entries: dict[str, Any], commit: str) -> None:
    """Adds the line of a verdict, after that of the commit if it is the first."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("ab+") as file:
        if not file.tell():
            file.write(json.dumps({"commit": commit}).encode() + b"\n")
        else:
            file.seek(-1, os.SEEK_END)
            if file.read(1) != b"\n":  # the last line was cut
                file.write(b"\n")
        file.write(json.dumps(entries).encode() + b"\n")


def _entries(line: str) -> dict[str, Any]:
    try:
        found = json.loads(line)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}
