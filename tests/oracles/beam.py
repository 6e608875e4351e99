"""Equilibrium of a planar geometrically exact beam of any reference shape, to about 1e-9: the oracle for thin links.

The equations stand in beam_equations; here they are followed to the wanted end conditions by adaptive load steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .beam_description import CLAMPED, FREE, PINNED, Beam, BeamSolution, End, EndState, Section, between_pins
from .beam_equations import Collocation

__all__ = [
    "CLAMPED",
    "FREE",
    "PINNED",
    "Beam",
    "BeamSolution",
    "End",
    "EndState",
    "PinnedLink",
    "Section",
    "between_pins",
    "pinned_pinned",
    "solve",
]


@dataclass(frozen=True)
class PinnedLink:
    """A link between two pins: growth of the pin distance, force along the chord (tension positive), and the rest."""

    extension: float
    force: float
    solution: BeamSolution


def solve(beam: Beam, start: End, end: End, *, elements: int = 32, initial: BeamSolution | None = None) -> BeamSolution:
    """Equilibrium of ``beam`` with the given end conditions, reached by load steps from rest or from ``initial``.

    Raises RuntimeError when the load steps shrink to nothing (a limit point, or a beam that is not held).
    """
    problem = Collocation(beam, elements)
    x = np.zeros(problem.size) if initial is None else initial.state
    if x.size != problem.size:
        raise ValueError("the initial solution belongs to another mesh of the beam")
    targets = problem.targets(start, end)
    measured = problem.boundary(x, start, end)[0]
    reached, step, previous = 0.0, 1.0, None
    while reached < 1.0:
        step = min(step, 1.0 - reached)
        guess = x if previous is None else x + (x - previous[0]) * step / (reached - previous[1])
        wanted = measured + (reached + step) * (targets - measured)
        solved = problem.newton(guess, start, end, wanted)
        if solved is None:
            step *= 0.5
            if step < 1e-4:
                raise RuntimeError(f"the beam finds no equilibrium beyond {reached:.4f} of the load")
            continue
        previous, x, reached, step = (x, reached), solved, reached + step, 1.5 * step
    return problem.solution(x)


def pinned_pinned(
    beam: Beam,
    *,
    extension: float | None = None,
    force: float | None = None,
    elements: int = 32,
    initial: BeamSolution | None = None,
) -> PinnedLink:
    """Link free to turn about both pins: its force at a given ``extension`` of the pin distance, or the reverse."""
    if (extension is None) == (force is None):
        raise ValueError("give either the extension or the force")
    start_pin, end_pin = beam.pins()
    chord = end_pin - start_pin
    axes = float(np.arctan2(chord[1], chord[0]))
    end = End(x=extension, y=0.0, force_x=0.0 if force is None else force, axes=axes)
    solution = solve(beam, PINNED, end, elements=elements, initial=initial)
    along = chord / np.hypot(*chord)
    return PinnedLink(float(solution.end.displacement @ along), float(solution.end.force @ along), solution)
