"""Hard cases: scenes on which simulations of flexible mechanisms are known to fail, each with a known answer.

Each is defined once (``case.HardCase``) and used twice: as a test (``test_hard_cases``), and as a line of the table
that ``make hard-cases`` prints (``__main__``). Here they stand in the order of the table.
"""

from __future__ import annotations

from . import (
    buckling,
    eigenvalues,
    linkages,
    meshes,
    numbers,
    requests,
    rubber,
    scaling,
    slender,
    snapping,
    straining,
    turned_ends,
)
from .case import HardCase

CASES: tuple[HardCase, ...] = (
    *slender.CASES,
    *straining.CASES,
    *rubber.CASES,
    *buckling.CASES,
    *eigenvalues.CASES,
    *snapping.CASES,
    *turned_ends.CASES,
    *linkages.CASES,
    *meshes.CASES,
    *requests.CASES,
    *scaling.CASES,
    *numbers.CASES,
)
