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
region. A motion that looks flat but is not, as a minimum of fourth order, is one that the stronger loads undo: the
region shrinks until nothing is left of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from fenicsmech.errors import set_options
from fenicsmech.multibody.assembly import Assembler, free_motions
from fenicsmech.multibody.linkage import JointSystem
from fenicsmech.multibody.potentials import PosePotential


class RestEnding(Enum):
    """How a search for the pose that loads prefer ends."""

    AT_REST = "a pose was found"
    DRIVEN_ON = "loads drive the mechanism on without end"
    NOT_CONVERGED = "no pose at rest was found in the steps allowed"


@dataclass(frozen=True, eq=False)
class RestTurn:
    """The way to the pose that loads prefer.

    Attributes:
        way: poses of all bodies from the given ones to the last, each (bodies, pose_size).
        ending: of the search.
    """

    way: tuple[np.ndarray, ...]
    ending: RestEnding


@dataclass(frozen=True)
class RestSearch:
    """Search for the pose that loads prefer; steps are in lengths of the mechanism, or rad.

    Attributes:
        steps: maximum number for each level.
        radius: largest step, within which the potential is about quadratic.
        near: size of a step, or of the region in which stronger loads undo it, at which a level is at its minimum, and
            distance of a prescribed displacement that counts as reached. A pose that near to it stays as it is: dead
            centres, drawn as such, too.
        reach: distance from the given pose beyond which loads drive the mechanism on without end.
        same: largest distance between two poses that count as one.
        balanced: resultants of loads that turn with their link, over the sizes of these loads, that count as none.
        clear: distance between two poses below which their way is not examined further for obstacles.

    Raises:
        DescriptionError: a number is not positive, or that of steps not whole.
    """

    steps: int = 200
    radius: float = 0.3
    near: float = 1e-9
    reach: float = 30.0
    same: float = 1e-6
    balanced: float = 1e-9
    clear: float = 1e-3

    def __post_init__(self) -> None:
        set_options(self, "the search for a pose at rest", steps=1)

    def pose(
        self, system: JointSystem, poses: np.ndarray, motors: np.ndarray, levels: Sequence[Sequence[PosePotential]]
    ) -> RestTurn:
        """The way to the rest pose.

        Args:
            system: joints and links as rigid bodies.
            poses: a closed assembly, in which the first of ``levels`` is at its minimum.
            motors: at ``motors`` (connections,).
            levels: potentials, each level far stronger than the next.
        """
        stronger, way = tuple(levels[0]), [poses]
        for level in levels[1:]:
            if level:
                ending = self._descend(Assembler(system, stronger), way, motors, level)
                if ending is not RestEnding.AT_REST:
                    return RestTurn(tuple(way), ending)
            stronger = (*stronger, *level)
        return RestTurn(tuple(way), RestEnding.AT_REST)

    def distance(self, system: JointSystem, a: np.ndarray, b: np.ndarray) -> float:
        """The largest change of a coordinate between two poses of all bodies, (bodies, pose_size)."""
        change = (system.unknowns(b) - system.unknowns(a)) / system.pose_scale
        return float(np.max(np.abs(change), initial=0.0))

    def halfway(
        self,
        system: JointSystem,
        before: np.ndarray,
        after: np.ndarray,
        motors: np.ndarray,
        springs: Sequence[PosePotential],
    ) -> np.ndarray | None:
        """A closed assembly between two, nearer to each by a quarter than they are to each other; None if none is
        found."""
        apart, assembler = self.distance(system, before, after), Assembler(system, springs)
        middle = 0.5 * (system.unknowns(before) + system.unknowns(after))
        found, missed = assembler.relax(*assembler.close(system.with_unknowns(before, middle), motors), motors)
        strayed = max(self.distance(system, before, found), self.distance(system, found, after)) > 0.75 * apart
        return None if strayed or not assembler.is_closed(missed) else found

    def _descend(
        self, assembler: Assembler, way: list[np.ndarray], motors: np.ndarray, level: Sequence[PosePotential]
    ) -> RestEnding:
        """Goes on along ``way`` to where ``level`` is least among the poses in which the assembler's springs are.

        Steps may rise by rounding, each time from the least value so far: rises do not add up.
        """
        system, radius, undone = assembler.system, self.radius, False
        least = sum(potential.value(way[-1]) for potential in level)
        for _ in range(self.steps):
            poses = way[-1]
            step, rounding = _step(assembler, poses, motors, level)
            size = float(np.max(np.abs(step), initial=0.0))
            if min(size, radius) <= self.near:
                return RestEnding.AT_REST if size <= self.near or undone else RestEnding.NOT_CONVERGED
            moved = system.unknowns(poses) + system.pose_scale * step * min(1.0, radius / size)
            closed, missed = assembler.close(system.with_unknowns(poses, moved), motors)
            trial, missed = assembler.relax(closed, missed, motors)
            after = sum(potential.value(trial) for potential in level)
            undone = self.distance(system, closed, trial) > 0.5 * min(size, radius)
            if assembler.is_closed(missed) and not undone and after <= least + rounding:
                way.append(trial)
                least, radius = min(least, after), min(self.radius, 2.0 * radius)
                if self.distance(system, way[0], trial) > self.reach:
                    return RestEnding.DRIVEN_ON
            else:
                radius = 0.25 * min(radius, size)
        return RestEnding.NOT_CONVERGED


def _step(
    assembler: Assembler, poses: np.ndarray, motors: np.ndarray, level: Sequence[PosePotential]
) -> tuple[np.ndarray, float]:
    """The Newton step of ``level`` along flat motions, in units of ``JointSystem.pose_scale``, (size,); and the
    rounding of its potential."""
    stronger = free_motions(assembler.system, poses, motors, assembler.springs)
    own = free_motions(assembler.system, poses, motors, level)
    curvatures, modes = np.linalg.eigh(stronger.curvature)
    flat = modes[:, np.abs(curvatures) <= stronger.rounding].T
    stiffness, ways = np.linalg.eigh(flat @ own.curvature @ flat.T)
    slope = ways.T @ flat @ own.slope
    slope[np.abs(slope) <= own.rounding] = 0.0
    least = max(own.rounding, 1e-12 * float(np.max(np.abs(stiffness), initial=0.0)), 1e-300)
    return -(slope / np.maximum(np.abs(stiffness), least)) @ ways.T @ flat @ own.motions, own.rounding
