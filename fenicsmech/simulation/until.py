"""Where a path that is followed ends."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism.checks import finite


@dataclass(frozen=True)
class Until:
    """A path ends as soon as it passes one of these values, exactly there, or after so many frames.

    Args:
        displacement: of the force's point along it, counted as on curves; one value or several.
        force: its magnitude; one value or several.
        frames: most frames, critical points aside; the path ends there without complaint.

    Raises:
        DescriptionError: neither a displacement nor a force, or numbers that make no sense.
    """

    displacement: float | tuple[float, ...] = ()
    force: float | tuple[float, ...] = ()
    frames: int = 500

    def __post_init__(self) -> None:
        for name in ("displacement", "force"):
            given = getattr(self, name)
            values = tuple(given) if isinstance(given, Iterable) and not isinstance(given, str) else (given,)
            object.__setattr__(self, name, tuple(finite(f"{name} where a path ends", value) for value in values))
        if not self.displacement and not self.force:
            raise DescriptionError("end of a path", "neither displacement nor force is given", "Give one of them")
        if isinstance(self.frames, bool) or not isinstance(self.frames, int) or self.frames < 2:
            raise DescriptionError("end of a path", f"{self.frames!r} frames", "Give a whole number of at least 2")


def check_until(until: object) -> None:
    """Refuses what is no end of a path.

    Raises:
        DescriptionError: it is none.
    """
    if not isinstance(until, Until):
        raise DescriptionError("end of a path", f"{until!r} does not say where", "Give until=Until(displacement=…)")
