"""Questions to the beam oracle and its answers: section, beam, end conditions, solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .centreline import Centreline


@dataclass(frozen=True)
class Section:
    """Stiffness of the cross-section: axial EA, shear kGA, bending EI; EA and kGA may be infinite."""

    axial: float
    shear: float
    bending: float

    @classmethod
    def rectangle(
        cls,
        *,
        young: float,
        poisson: float,
        thickness: float,
        depth: float,
        plane_strain: bool = False,
        shear_factor: float = 5.0 / 6.0,
    ) -> Section:
        """Rectangle of in-plane ``thickness``; ``plane_strain`` stiffens E to E / (1 − ν²)."""
        modulus = young / (1.0 - poisson**2) if plane_strain else young
        area = thickness * depth
        shear_modulus = young / (2.0 * (1.0 + poisson))
        return cls(modulus * area, shear_factor * shear_modulus * area, modulus * area * thickness**2 / 12.0)


@dataclass(frozen=True)
class Beam:
    """A beam and the pins it is held by.

    The ends of the elastic ``centreline`` are joined to the pins by rigid arms; a pin at None sits on the end itself.
    """

    centreline: Centreline
    section: Section
    start_pin: tuple[float, float] | None = None
    end_pin: tuple[float, float] | None = None

    def pins(self) -> tuple[np.ndarray, np.ndarray]:
        """Reference positions (2,) of both pins."""
        ends = self.centreline.position(np.array([0.0, self.centreline.length]))
        given = (self.start_pin, self.end_pin)
        start, end = (np.asarray(e if p is None else p, dtype=float) for e, p in zip(ends, given, strict=True))
        return start, end


def between_pins(centreline: Centreline, section: Section, *, rigid: tuple[float, float]) -> Beam:
    """Beam pinned at both ends of ``centreline``, of which the first and last arc lengths ``rigid`` do not deform."""
    start, end = centreline.position(np.array([0.0, centreline.length]))
    return Beam(centreline.trimmed(*rigid), section, tuple(start), tuple(end))


@dataclass(frozen=True)
class End:
    """Boundary conditions at a pin: per direction a displacement, or (where that is None) a force.

    x, y, rotation: displacement of the pin along the end's axes and rotation (rad) or None;
    force_x, force_y, moment: load on the pin where the displacement is None;
    axes: angle (rad) of the end's x axis from the global one.
    """

    x: float | None = None
    y: float | None = None
    rotation: float | None = None
    force_x: float = 0.0
    force_y: float = 0.0
    moment: float = 0.0
    axes: float = 0.0


CLAMPED = End(x=0.0, y=0.0, rotation=0.0)
PINNED = End(x=0.0, y=0.0)
FREE = End()


@dataclass(frozen=True)
class EndState:
    """Displacement (2,), rotation, and the force (2,) and moment that act on the pin, global axes."""

    displacement: np.ndarray
    rotation: float
    force: np.ndarray
    moment: float


@dataclass(frozen=True)
class BeamSolution:
    """Equilibrium of a beam: states of both pins and, at the nodes s (n,), the deformed line.

    position (n, 2), rotation (n,) of the section relative to the reference, moment (n,); energy is the strain energy;
    state is the raw unknown vector, from which another solve may continue.
    """

    start: EndState
    end: EndState
    s: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    moment: np.ndarray
    energy: float
    state: np.ndarray
