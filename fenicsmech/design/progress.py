"""Progress of an optimisation: iteration, objective, worst target error, and how long still."""

from __future__ import annotations

from collections import deque
from math import inf, log
from time import perf_counter

import numpy as np

from fenicsmech.design.optimisers import Iterate, Optimiser
from fenicsmech.report import Progress, Silent

_WINDOW = 6  # iterations whose trend is drawn on


class DesignProgress:
    """Shows iterates on standard error; a context manager.

    Time left is what the trend of the promised reduction over the last iterations says, at most what the optimiser's
    limit of iterations leaves.

    Args:
        optimiser: says when it ends.
        leads: whether this process shows anything.
    """

    def __init__(self, optimiser: Optimiser, *, leads: bool) -> None:
        self._minimiser = optimiser
        self._progress = Progress(None, "design") if leads else Silent()
        self._recent: deque[tuple[float, float]] = deque(maxlen=_WINDOW)

    def update(self, iterate: Iterate, errors: np.ndarray) -> None:
        """Shows an iterate; ``errors`` (targets,) are relative."""
        self._recent.append((perf_counter(), max(iterate.promise, 1e-300)))
        note = f"objective {iterate.evaluation.value:.3g}, worst target error {np.abs(errors).max():.2%}"
        left = self._left(iterate)
        self._progress.update(iterate.number, note if left is None else f"{note}, about {left:.0f} s left")

    def __enter__(self) -> DesignProgress:
        self._progress.__enter__()
        return self

    def __exit__(self, *error) -> None:
        self._progress.__exit__(*error)

    def _left(self, iterate: Iterate) -> float | None:
        if len(self._recent) < 2 or iterate.reason is not None:
            return None
        (start, first), (now, last) = self._recent[0], self._recent[-1]
        each = (now - start) / (len(self._recent) - 1)
        falling = (log(first) - log(last)) / (len(self._recent) - 1)
        wanted = log(last / self._minimiser.least_promise) / falling if falling > 0.0 else inf
        return each * max(1.0, min(wanted, self._minimiser.iterations - iterate.number))
