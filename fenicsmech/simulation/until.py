"""Where a path that is followed ends."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from fenicsmech.checks import finite
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import Force, Leader


@dataclass(frozen=True)
class Until:
    """A path ends as soon as it passes one of these values, exactly there, or after so many frames.

    Args:
        displacement: of the point of the force that leads, along it, counted as on curves; one value or several.
        position: of the motors that lead, rad or length, counted from the drawing; one value or several.
        force: magnitude of the force that leads, or torque or force of the motors; one value or several.
        frames: most frames, critical points aside; the path ends there without complaint.

    Raises:
        DescriptionError: nothing to end at, displacement and position at once, or numbers that make no sense.
    """

    displacement: float | tuple[float, ...] = ()
    force: float | tuple[float, ...] = ()
    position: float | tuple[float, ...] = ()
    frames: int = 500

    def __post_init__(self) -> None:
        for name in ("displacement", "force", "position"):
            given = getattr(self, name)
            values = tuple(given) if isinstance(given, Iterable) and not isinstance(given, str) else (given,)
            object.__setattr__(self, name, tuple(finite(f"{name} where a path ends", value) for value in values))
        if not (self.displacement or self.force or self.position):
            raise DescriptionError("end of a path", "no displacement, position or force is given", "Give one of them")
        if self.displacement and self.position:
            raise DescriptionError(
                "end of a path",
                "it has displacement and position",
                "Give displacement for a force, position for a motor",
            )
        if isinstance(self.frames, bool) or not isinstance(self.frames, int) or self.frames < 2:
            raise DescriptionError("end of a path", f"{self.frames!r} frames", "Give a whole number of at least 2")

    @property
    def travel(self) -> tuple[float, ...]:
        """Displacements or positions, whichever are given."""
        return self.displacement or self.position


def check_until(until: object, part: Leader) -> None:
    """Refuses what is no end of a path that ``part`` leads.

    Raises:
        DescriptionError: it is none.
    """
    where = "displacement" if isinstance(part, Force) else "position"
    if not isinstance(until, Until):
        raise DescriptionError("end of a path", f"{until!r} does not say where", f"Give until=Until({where}=…)")
    if until.displacement and not isinstance(part, Force):
        raise DescriptionError(
            "end of a path", f"{part.name!r} leads, which has no displacement", "Give its position=…"
        )
    if until.position and isinstance(part, Force):
        raise DescriptionError(
            "end of a path", f"{part.name!r} leads, which has no position", "Give the displacement=… of its point"
        )
