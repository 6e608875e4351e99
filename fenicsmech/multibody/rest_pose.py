"""The pose that dead loads prefer: where nothing else holds a mechanism, equilibria under small loads start from it.

Along a zero-energy mode the stiffness is that of the loads alone, f w″ for the load f and minus its travel, w: zero
without load, where any pose is an equilibrium. As f grows from zero, links become straight and rigid in comparison,
and equilibria tend to the rigid pose in which w is least, however far that is from the pose as drawn:

    min w(z)  s.t.  C(z, φ) = 0.

A displacement w = −d that is prescribed in place of the force is reached by a motion without force, or else it pulls
from the same pose, where ½ (w + d)² is least.

Some loads are far stronger than others: springs hold the assembly, constant loads turn what springs leave free, and
the force, which starts from zero, turns what is free then. Each level is minimised along the motions N in which all
stronger ones are flat, by Newton steps with the absolute eigenvalues of the curvature, which descend, within a trust
region.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.multibody.assembly import Assembler, free_motions
from fenicsmech.multibody.linkage import JointSystem
from fenicsmech.multibody.potentials import PosePotential


@dataclass(frozen=True)
class RestSearch:
    """Search for the pose that loads prefer; steps are in lengths of the mechanism, or rad.

    Attributes:
        steps: maximum number for each level.
        radius: largest step, within which the potential is about quadratic.
        near: size of a step at which a level is at its minimum. A pose that near to it stays as it is: dead centres,
            drawn as such, too.
    """

    steps: int = 200
    radius: float = 0.3
    near: float = 1e-9

    def pose(
        self, system: JointSystem, poses: np.ndarray, motors: np.ndarray, levels: Sequence[Sequence[PosePotential]]
    ) -> np.ndarray | None:
        """The rest pose, (bodies, pose_size), or None if loads drive the mechanism on without end.

        Args:
            system: joints and links as rigid bodies.
            poses: a closed assembly, in which the first of ``levels`` is at its minimum.
            motors: at ``motors`` (connections,).
            levels: potentials, each level far stronger than the next.
        """
        stronger: tuple[PosePotential, ...] = tuple(levels[0])
        for level in levels[1:]:
            found = self._minimum(Assembler(system, stronger), poses, motors, level) if level else poses
            if found is None:
                return None
            poses, stronger = found, (*stronger, *level)
        return poses

    def _minimum(
        self, assembler: Assembler, poses: np.ndarray, motors: np.ndarray, level: Sequence[PosePotential]
    ) -> np.ndarray | None:
        """The pose where ``level`` is least among those in which the assembler's springs are; None if there is none."""
        system, radius = assembler.system, self.radius
        value = sum(potential.value(poses) for potential in level)
        for _ in range(self.steps):
            step, rounding = _step(assembler, poses, motors, level)
            size = float(np.max(np.abs(step), initial=0.0))
            if size <= self.near:
                return poses
            moved = system.unknowns(poses) + system.pose_scale * step * min(1.0, radius / size)
            trial, missed = assembler.close(system.with_unknowns(poses, moved), motors)
            trial, missed = assembler.relax(trial, missed, motors)
            after = sum(potential.value(trial) for potential in level)
            if assembler.is_closed(missed) and after <= value + rounding:
                poses, value, radius = trial, after, min(self.radius, 2.0 * radius)
            else:
                radius = 0.25 * min(radius, size)
        return None


def _step(
    assembler: Assembler, poses: np.ndarray, motors: np.ndarray, level: Sequence[PosePotential]
) -> tuple[np.ndarray, float]:
    """The Newton step of ``level`` along flat motions, in units of ``JointSystem.pose_scale``, (size,); and the
    rounding of its potential."""
    held = free_motions(assembler.system, poses, motors, assembler.springs)
    own = free_motions(assembler.system, poses, motors, level)
    curvatures, modes = np.linalg.eigh(held.curvature)
    flat = modes[:, np.abs(curvatures) <= held.rounding].T
    stiffness, ways = np.linalg.eigh(flat @ own.curvature @ flat.T)
    slope = ways.T @ flat @ own.slope
    slope[np.abs(slope) <= own.rounding] = 0.0
    least = max(own.rounding, 1e-12 * float(np.max(np.abs(stiffness), initial=0.0)), 1e-300)
    return -(slope / np.maximum(np.abs(stiffness), least)) @ ways.T @ flat @ own.motions, own.rounding
