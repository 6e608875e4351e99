"""The frames of one configuration under a changing force or moving motor, and the values of all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.equilibrium import EquilibriumSolver, State, Unknown
from fenicsmech.estimates import Equilibrium
from fenicsmech.mechanism import Configuration, Force, PrescribedPart, Units
from fenicsmech.multibody import Freedom
from fenicsmech.simulation.discretisation import Discretisation
from fenicsmech.simulation.frame import Frame


@dataclass(frozen=True, eq=False, repr=False)
class FrameSeries:
    """Frames of one configuration.

    Attributes:
        part: the force that changes, or the motor or drive that moves.
        configuration: motor positions.
        freedom: mobility and redundancy of the assembled configuration.
        frames: one per prescribed value, in their order.
        discretisation: of the scene, with which they were computed.
        unloaded: the equilibrium without forces, effects at load factor 0, from which displacements count.
        others: constant magnitudes of other forces.
        unknown: of the curve: displacements, or forces where displacements were prescribed or the curve was followed.
    """

    part: PrescribedPart
    configuration: Configuration
    freedom: Freedom
    frames: tuple[Frame, ...]
    discretisation: Discretisation
    unloaded: State
    others: tuple[tuple[Force, float], ...] = ()
    unknown: Unknown = Unknown.DISPLACEMENT

    @property
    def units(self) -> Units:
        """Units of the scene."""
        return self.discretisation.scene.units

    @property
    def forces(self) -> np.ndarray:
        """Forces or torques of the frames, (frames,)."""
        return np.array([frame.force for frame in self.frames])

    @property
    def displacements(self) -> np.ndarray:
        """Displacements or positions of the frames, (frames,)."""
        return np.array([frame.displacement for frame in self.frames])

    @property
    def values(self) -> np.ndarray:
        """``displacements`` or ``forces``, whichever is ``unknown``, (frames,)."""
        return self.forces if self.unknown is Unknown.FORCE else self.displacements

    @property
    def stable(self) -> np.ndarray:
        """Stability of the frames under dead loads, (frames,)."""
        return np.array([frame.stable for frame in self.frames])

    @property
    def snapped_through(self) -> np.ndarray:
        """Whether the mechanism snapped on the way to each frame, (frames,)."""
        return np.array([frame.snapped_through for frame in self.frames])

    def equilibrium(self, frame: Frame) -> Equilibrium:
        """The equilibrium of one of the frames, with the unknown of the curve. Local."""
        return Equilibrium(frame.state, frame.design, self.unknown)

    @property
    def solver(self) -> EquilibriumSolver:
        """The solver of the frames' equilibria. Local."""
        return self.discretisation.solver(self.part, [other for other, _ in self.others])
