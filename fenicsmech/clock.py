"""Wall-clock seconds per named phase."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter


class Clock:
    """A stopwatch with named phases.

    Attributes:
        seconds: phase → seconds so far.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._inner = 0.0  # s, of phases inside the present one

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Adds the time inside the block to phase ``name``, less that of the phases inside it."""
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
