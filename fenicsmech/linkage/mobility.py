"""Mobility and redundancy of a configuration, from the rank of its constraint gradient.

    mobility = unknowns − rank A,     redundancy = rows − rank A,

motors locked, flexible links taken as rigid. Idle freedoms (a two-ball link spinning about itself) count as
mobility, dependent equations (a planar loop of spatial hinges) as redundancy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.linkage.system import JointSystem

_RANK = 1e-9  # singular values below this are zero: rows and unknowns are scaled to one
_PART = 1e-6  # share in a null vector from which a part is named


@dataclass(frozen=True)
class Freedom:
    """Mobility and redundancy of one configuration.

    Attributes:
        mobility: number of free directions left.
        mobile: names of the links that can move.
        redundancy: number of dependent constraint equations.
        redundant: names of the joints whose equations depend on each other.
    """

    mobility: int
    mobile: tuple[str, ...]
    redundancy: int
    redundant: tuple[str, ...]


def count_freedom(system: JointSystem, poses: np.ndarray, motors: np.ndarray) -> Freedom:
    """Mobility and redundancy of ``system`` at ``poses`` (bodies, pose_size) and motor values (connections,)."""
    scaled = system.row_scale[:, None] * system.gradient(poses, motors) * system.pose_scale
    left, values, right = np.linalg.svd(scaled, full_matrices=True)
    rank = int(np.sum(values > _RANK))
    free, dependent = right[rank:], left[:, rank:]
    mobile = [
        system.bodies[body].link.name
        for body in system.free_bodies
        if np.max(np.abs(free[:, system.columns[body]]), initial=0.0) > _PART
    ]
    redundant = [
        name
        for name, weight in zip(system.row_names, np.max(np.abs(dependent), axis=1, initial=0.0), strict=True)
        if weight > _PART
    ]
    return Freedom(
        mobility=system.size - rank,
        mobile=tuple(dict.fromkeys(mobile)),
        redundancy=system.rows - rank,
        redundant=tuple(dict.fromkeys(redundant)),
    )


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
    left = wanted - scaled.T @ np.linalg.lstsq(scaled.T, wanted, rcond=_RANK)[0]
    return bool(np.linalg.norm(left) <= _RANK * np.linalg.norm(wanted))
