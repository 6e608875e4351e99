"""Whether an error about a scene that makes sense is true, told without the solver."""

from __future__ import annotations

import fenicsmech as fm

from .blueprint import Blueprint, Built


def true_reason(blueprint: Blueprint, built: Built | None, failure: fm.FenicsmechError) -> str:
    """Why the error is right, empty if it is not."""
    return ""
