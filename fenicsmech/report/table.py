"""Tables that read well on a console and are Markdown at the same time."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral, Real

import numpy as np

from fenicsmech.errors import DescriptionError


def format_table(headers: Sequence[str], rows: Sequence[Sequence[object]], *, digits: int = 4) -> str:
    """Lay out ``rows`` under ``headers``; numbers stand right, words left.

    Args:
        headers: (k,) column names.
        rows: each of k cells: numbers, words, flags, or None for "not known".
        digits: significant digits of floats.

    Returns:
        the lines, joined, without a newline at the end.

    Raises:
        DescriptionError: a row has another number of cells.
    """
    for index, row in enumerate(rows):
        if len(row) != len(headers):
            raise DescriptionError(
                f"row {index} of the table", f"{len(row)} cells for {len(headers)} columns", "Give one cell per column"
            )
    cells = [[_text(cell, digits) for cell in line] for line in (headers, *rows)]
    widths = [max(3, *(len(line[k]) for line in cells)) for k in range(len(headers))]
    right = [bool(rows) and all(_stands_right(row[k]) for row in rows) for k in range(len(headers))]
    rule = ["-" * (w - 1) + ":" if r else "-" * w for w, r in zip(widths, right, strict=True)]
    return "\n".join(_line(line, widths, right) for line in (cells[0], rule, *cells[1:]))


def _line(cells: Sequence[str], widths: Sequence[int], right: Sequence[bool]) -> str:
    padded = [c.rjust(w) if r else c.ljust(w) for c, w, r in zip(cells, widths, right, strict=True)]
    return "| " + " | ".join(padded) + " |"


def _stands_right(cell: object) -> bool:
    return cell is None or (isinstance(cell, Real) and not isinstance(cell, bool))


def _text(cell: object, digits: int) -> str:
    if cell is None:
        return "–"
    if isinstance(cell, bool | np.bool_):
        return "yes" if cell else "no"
    if isinstance(cell, Integral):
        return str(int(cell))
    if isinstance(cell, Real):
        return f"{float(cell):.{digits}g}"
    return str(cell).replace("|", "\\|").replace("\n", " ")
