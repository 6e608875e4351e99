"""From a simple bifurcation onto the path that crosses there.

The guess lies on the null vector φ of the tangent, made orthogonal to the path, and the equilibrium is looked for in
the plane across φ: that plane meets the new path but, near the bifurcation, not the old one.

    y = y_b ± ε φ,    ⟨φ, y − y_b⟩ = ± ε

Source: Wagner & Wriggers (doi:10.1108/eb023727).
"""

from __future__ import annotations

from enum import Enum

from fenicsmech.equilibrium.arc_length import ArcLength
from fenicsmech.equilibrium.critical import CriticalPoint
from fenicsmech.equilibrium.eigen import softest_modes
from fenicsmech.equilibrium.lead import Heading
from fenicsmech.equilibrium.path_points import PathPoint, PathPoints
from fenicsmech.equilibrium.solver import NotConverged
from fenicsmech.equilibrium.state import Step

_FIRST = 0.02  # of the mechanism's length, or rad: ε
_TRIES = 8  # of half the size each


class Sense(Enum):
    """Along the null vector, or against it."""

    ALONG = 1.0
    AGAINST = -1.0


def crossing(arc: ArcLength, critical: CriticalPoint, mode: Step, sense: Sense) -> PathPoint:
    """The first point of the path that crosses at ``critical``, with the null vector ``mode`` (collective).

    Steps of ``arc`` go on from there.

    Raises:
        NotConverged: there is none near.
    """
    points, metric, point = arc.points, arc.points.metric, critical.point
    course = metric.unit(critical.course)
    across = Heading(mode, 0.0)
    across = across + course.scaled(-metric.dot(across, course))
    across = metric.unit(across).scaled(sense.value)
    size = _FIRST / points.system.size(across.step)
    for _ in range(_TRIES):
        guess = points.lead.moved(points.system, point.state, across.scaled(size))
        try:
            found = points.correct(guess, across, point)
        except NotConverged:
            size *= 0.5
            continue
        arc.length = metric.norm(points.difference(found.state, point.state))
        return found
    raise NotConverged("no path was found across the bifurcation", 0)


def null_space(points: PathPoints, critical: CriticalPoint) -> list[Step]:
    """A basis of the tangent's null space at a bifurcation, largest displacements the mechanism's length (collective).

    As many vectors as modes change their stability there.
    """
    state, count = critical.point.state, critical.modes
    return [mode.step for mode in softest_modes(points.newton, points.lead, state, count=count)]
