"""Where the time goes: seconds per named phase."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter


class Clock:
    """Adds up wall-clock seconds per phase.

    Attributes:
        seconds: phase → seconds so far.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._inner = 0.0  # of phases inside the present one

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Counts the time inside the block for phase ``name``, but that of phases inside it, which count their own."""
        outer, self._inner = self._inner, 0.0
        start = perf_counter()
        try:
            yield
        finally:
            spent = perf_counter() - start
            self.seconds[name] = self.seconds.get(name, 0.0) + spent - self._inner
            self._inner = outer + spent

    def since(self, before: dict[str, float]) -> dict[str, float]:
        """Seconds per phase since ``before``, an earlier copy of ``seconds``."""
        return {name: total - before.get(name, 0.0) for name, total in self.seconds.items()}
