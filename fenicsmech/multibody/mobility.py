"""Mobility and redundancy of a configuration, from the rank of its constraint gradient.

    mobility = unknowns − rank A,     redundancy = rows − rank A,

motors locked, flexible links taken as rigid. Idle freedoms (a two-ball link spinning about itself) count as
mobility, dependent equations (a planar loop of spatial hinges) as redundancy. Springs hold what they curve the
potential along, however soft they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.multibody.holding import RANK, FreeMotions, Holding, free_motions
from fenicsmech.multibody.system import JointSystem

_CURVED = 1e-12  # of the curvature along the stiffest free motion: what is less counts as none
_PART = 1e-6  # share in a null vector from which a part is named


@dataclass(frozen=True)
class Freedom:
    """Mobility and redundancy of one configuration.

    Attributes:
        mobility: number of free directions left.
        mobile: names of the links that can move.
        idle: names of the links that can move without winding up any spring; empty if springs hold all.
        redundancy: number of dependent constraint equations.
        redundant: names of the joints whose equations depend on each other.
    """

    mobility: int
    mobile: tuple[str, ...]
    idle: tuple[str, ...]
    redundancy: int
    redundant: tuple[str, ...]


def count_freedom(
    system: JointSystem, poses: np.ndarray, motors: np.ndarray, holding: Sequence[Holding] = ()
) -> Freedom:
    """Mobility and redundancy of ``system``.

    Args:
        system: the constraints.
        poses: (bodies, pose_size).
        motors: motor values, (connections,).
        holding: potentials that hold freedoms.
    """
    scaled = system.row_scale[:, None] * system.gradient(poses, motors) * system.pose_scale
    left, values, right = np.linalg.svd(scaled, full_matrices=True)
    rank = int(np.sum(values > RANK))
    free, dependent = right[rank:], left[:, rank:]
    redundant = [
        name
        for name, weight in zip(system.row_names, np.max(np.abs(dependent), axis=1, initial=0.0), strict=True)
        if weight > _PART
    ]
    return Freedom(
        mobility=system.size - rank,
        mobile=_moving(system, free),
        idle=_moving(system, _unheld(free_motions(system, poses, motors, holding))),
        redundancy=system.rows - rank,
        redundant=tuple(dict.fromkeys(redundant)),
    )


def _moving(system: JointSystem, motions: np.ndarray) -> tuple[str, ...]:
    """Names of the links that move in any of ``motions`` (n, size)."""
    names = [
        system.bodies[body].link.name
        for body in system.free_bodies
        if np.max(np.abs(motions[:, system.columns[body]]), initial=0.0) > _PART
    ]
    return tuple(dict.fromkeys(names))


def _unheld(free: FreeMotions) -> np.ndarray:
    """The motions along which potentials are not curved, (m, size)."""
    values, vectors = np.linalg.eigh(free.curvature)
    return vectors[:, np.abs(values) <= _CURVED * np.max(np.abs(values), initial=0.0)].T @ free.motions


def is_held(system: JointSystem, poses: np.ndarray, motors: np.ndarray, rate: np.ndarray, rows: np.ndarray) -> bool:
    """Whether something that changes with the poses at ``rate`` (size,) stays as it is in every motion that is left.

    Args:
        system: the constraints.
        poses: (bodies, pose_size).
        motors: motor values, (connections,).
        rate: derivative by the pose unknowns, (size,).
        rows: constraints that count.
    """
    scaled = (system.row_scale[:, None] * system.gradient(poses, motors) * system.pose_scale)[rows]
    wanted = rate * system.pose_scale
    left = wanted - scaled.T @ np.linalg.lstsq(scaled.T, wanted, rcond=RANK)[0]
    return bool(np.linalg.norm(left) <= RANK * np.linalg.norm(wanted))
