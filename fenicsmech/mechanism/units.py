"""Names of the units a description is in, for labels only: nothing computed depends on them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Units:
    """A consistent set of units: stress is force over length squared."""

    length: str = "mm"
    force: str = "N"
    stress: str = "MPa"
