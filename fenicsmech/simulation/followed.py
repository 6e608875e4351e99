"""A curve that was followed wherever it led, with its limit points and bifurcations."""

from __future__ import annotations

from dataclasses import dataclass, replace

from fenicsmech.equilibrium import Critical, CriticalPoint
from fenicsmech.plot import CurveMark, CurveSeries
from fenicsmech.simulation.buckling import ModeShape
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.frame import Frame


@dataclass(frozen=True, eq=False)
class PathEvent:
    """A critical point of a followed curve.

    Attributes:
        kind: limit point of the force, turning point of the displacement or of a motor, or bifurcation.
        frame: the equilibrium; also one of the curve's frames.
        index: which.
        null_space: how the mechanism gives way: at a bifurcation a basis of the tangent's null space, one direction for
            each of the modes that change, else the direction of the path.
        critical: the point of the path that branches start from.
    """

    kind: Critical
    frame: Frame
    index: int
    null_space: tuple[ModeShape, ...]
    critical: CriticalPoint

    @property
    def mode(self) -> ModeShape:
        """The first of the null space, which is the only one unless several modes become unstable at once."""
        return self.null_space[0]

    @property
    def value(self) -> float:
        """Of what leads, where the tangent is singular; the frame is the nearest equilibrium that was found."""
        return self.critical.value

    @property
    def modes(self) -> int:
        """By how many the unstable modes change there."""
        return self.critical.modes


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FollowedCurve(Curve):
    """Frames in the order of the path, however often it turns back.

    Attributes:
        events: limit points, turning points and bifurcations, in the order of the path.
    """

    events: tuple[PathEvent, ...] = ()

    @property
    def limit_points(self) -> tuple[PathEvent, ...]:
        """Where a dead load would snap."""
        return self._of(Critical.LIMIT)

    @property
    def turning_points(self) -> tuple[PathEvent, ...]:
        """Where a held displacement would snap."""
        return self._of(Critical.TURNING)

    @property
    def bifurcations(self) -> tuple[PathEvent, ...]:
        """Where other curves cross this one."""
        return self._of(Critical.BIFURCATION)

    def series(self, label: str = "", *, colour: str | None = None, faint: bool = False) -> CurveSeries:
        """The curve as a plot draws it, with its events marked; arguments as those of ``CurveSeries``."""
        marks = tuple(CurveMark(event.frame.displacement, event.frame.force, event.kind.value) for event in self.events)
        return replace(super().series(label, colour=colour, faint=faint), marks=marks)

    def _of(self, kind: Critical) -> tuple[PathEvent, ...]:
        return tuple(event for event in self.events if event.kind is kind)
