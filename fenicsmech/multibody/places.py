"""Places of joints in the drawn configuration, which designs change: shifted, and turned about an axis.

    c = (P + δ − c_a, P + δ − c_b, E Qᵀ(ω)),     Q = exp [ω]×

are the constants of a joint's equations, with its drawn place P, the centres c_a and c_b of its bodies and the rows E
of its triad. Both bodies attach at the same point, along the same axes. So at any δ and ω the poses of the drawn
configuration close all joints: they stay the unloaded, assembled ones. The derivative Q′ of Q as ω changes by a is
given by

    Q′ Qᵀ = [J a]×,     J = ∫₀¹ exp(s [ω]×) ds,

with the left Jacobian J of SO(3) (T. D. Barfoot, State Estimation for Robotics, doi:10.1017/9781316671528, ch. 7).
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from fenicsmech.joints import cross_matrix


@dataclass(frozen=True, eq=False)
class JointChange:
    """The change of the place of one joint by a number, or by a unit of it. Changes add up and scale as vectors.

    Attributes:
        shift: δ of its point, in units of length, (dim,).
        turn: rotation vector ω of its axes, rad, (1,) about z in the plane, (3,) in space.
    """

    shift: np.ndarray
    turn: np.ndarray

    def __mul__(self, factor: float) -> JointChange:
        return JointChange(factor * self.shift, factor * self.turn)

    __rmul__ = __mul__

    def place(self, at: np.ndarray, triad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The changed places (…, d) and triad (d, d) of a joint, unit vectors as rows, from the drawn ones.

        The change may be given in space or in the plane, whichever d is.
        """
        d = len(triad)
        moved = at + np.append(self.shift, 0.0)[:d]
        if not np.any(self.turn):
            return moved, triad
        vector = self.turn if len(self.turn) == 3 else np.array([0.0, 0.0, *self.turn])
        return moved, triad @ Rotation.from_rotvec(vector).as_matrix()[:d, :d].T

    def __add__(self, other: JointChange) -> JointChange:
        return JointChange(self.shift + other.shift, self.turn + other.turn)


class JointPlaces:
    """The constants of the equations of all joints, shared by all that refer to them.

    Args:
        drawn: constants of each connection, as ``Connection.drawn`` gives them.
        dim: 2 or 3.
    """

    def __init__(self, drawn: Sequence[np.ndarray], dim: int) -> None:
        self._drawn, self.dim = tuple(drawn), dim
        self._present = list(self._drawn)
        self._changes: dict[Hashable, dict[int, JointChange]] = {}

    def __getitem__(self, k: int) -> np.ndarray:
        """The present constants of connection ``k``."""
        return self._present[k]

    @property
    def key(self) -> Hashable:
        """Equal where all constants are."""
        return b"".join(own.tobytes() for own in self._present)

    @property
    def nothing(self) -> JointChange:
        """No change."""
        return JointChange(np.zeros(self.dim), np.zeros(1 if self.dim == 2 else 3))

    def change(self, by: Hashable, changes: Mapping[int, JointChange]) -> None:
        """Changes some connections. The changes replace those of the same owner ``by``; those of others add up."""
        before = self._changes.get(by, {})
        self._changes[by] = dict(changes)
        for k in {*before, *changes}:
            self._present[k] = self._changed(k)

    def total(self, k: int) -> JointChange:
        """All changes of connection ``k`` together; turns add up as vectors."""
        return sum((own[k] for own in self._changes.values() if k in own), start=self.nothing)

    def rate(self, k: int, direction: JointChange) -> np.ndarray:
        """Derivative of the present constants of connection ``k`` along a change."""
        shift, triad = direction.shift, self._triad(self._present[k])
        if self.dim == 2:
            return np.concatenate([shift, shift, (direction.turn * triad @ [[0.0, 1.0], [-1.0, 0.0]]).ravel()])
        spin = _mean_turn(self.total(k).turn) @ direction.turn
        return np.concatenate([shift, shift, np.cross(spin, triad).ravel()])

    def _changed(self, k: int) -> np.ndarray:
        total, drawn = self.total(k), self._drawn[k]
        anchors, triad = total.place(drawn[: 2 * self.dim].reshape(2, -1), self._triad(drawn))
        return np.concatenate([anchors.ravel(), triad.ravel()])

    def _triad(self, constants: np.ndarray) -> np.ndarray:
        return constants[2 * self.dim :].reshape(self.dim, self.dim)


def _mean_turn(vector: np.ndarray) -> np.ndarray:
    """J, the mean of exp(s [ω]×) over 0 ≤ s ≤ 1, (3, 3)."""
    cross = np.array(cross_matrix(vector))
    angle = float(np.linalg.norm(vector))
    # (1 − cos |ω|) / |ω|² and (|ω| − sin |ω|) / |ω|³, of which the limit is good to rounding where the second cancels
    first = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    second = (angle - np.sin(angle)) / angle**3 if angle > 1e-4 else 1.0 / 6.0
    return np.eye(3) + first * cross + second * cross @ cross
