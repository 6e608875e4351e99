"""Spins: bodies between two ball joints turn about the line through these; in idle spins nothing resists.

In kinematics this is a passive degree of freedom (L.-W. Tsai, Robot Analysis, Wiley 1999). Where two ball joints alone
connect a set of bodies to the others, and nothing else acts on it, the Lagrangian L is invariant while the set turns as
a rigid body about the line through the joints. With the spin n, the rate of the unknowns y in that turn,

    n · ∇L = 0 at every y,      ∇²L n = 0 at equilibria.

The matrix is singular, the equations are consistent, and rounding decides the sign of the computed zero eigenvalue.
Fixing the gauge,

    ∇²L + e eᵀ,     e · n ≠ 0,

makes the matrix regular. Its solutions are those of ∇²L x = r with e · x = 0, and the spin counts as stable. The gauge
e turns one body of the set about the line. No gauge is added where the turn may change L: where a spring acts on a body
of the set, a force away from the centres of the two joints, or an effect on a link, unless its energy turns with the
link, as that of prestrain and of the pressure around it does. Obstacles resist the spin where the link touches them,
and only there is its gauge left out (``EquilibriumSystem.linearise``).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from fenicsmech.mechanism import Link
from fenicsmech.multibody.linkage import JointSystem, Linkage

_ROUNDING = 1e-9  # distance of one place, over the mechanism's length


@dataclass(frozen=True)
class Spin:
    """Bodies that turn about the line through two ball joints.

    Attributes:
        system: joints and links as rigid bodies.
        bodies: indices of the bodies.
        balls: of one ball joint at either place the index of the connection, and that of its body in ``bodies``.
    """

    system: JointSystem
    bodies: tuple[int, ...]
    balls: tuple[tuple[int, int], tuple[int, int]]

    @property
    def links(self) -> frozenset[Link]:
        """The links of the bodies."""
        return frozenset(self.system.bodies[body].link for body in self.bodies)

    def line(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A point on the line at ``poses`` (bodies, pose_size), and the unit vector along it, (3,) each."""
        first, second = (self.system.place(k, body, poses) for k, body in self.balls)
        return first, (second - first) / np.linalg.norm(second - first)

    def gauge(self, joints: JointSystem, poses: np.ndarray) -> tuple[int, np.ndarray]:
        """e: a body, and the rate of its pose as it turns about the parallel to the line through its centre,
        (pose_size,)."""
        body = self.bodies[0]
        rates = joints.space.rotation_rates(poses[body]) @ self.line(poses)[1]
        return body, np.concatenate([np.zeros(joints.space.dim), rates])

    def rates(self, joints: JointSystem, poses: np.ndarray) -> dict[int, np.ndarray]:
        """n: the rate of the pose of each body, (pose_size,)."""
        (point, axis), dim = self.line(poses), joints.space.dim
        centres = {body: np.array(joints.bodies[body].centre) + poses[body, :dim] for body in self.bodies}
        turns = {body: joints.space.rotation_rates(poses[body]) @ axis for body in self.bodies}
        return {body: np.concatenate([np.cross(axis, centres[body] - point), turns[body]]) for body in self.bodies}

    def angle(self, joints: JointSystem, poses: np.ndarray, z: np.ndarray) -> float:
        """The mean turn about the line in a step ``z`` of the pose unknowns from ``poses``.

        dq = B ω with Bᵀ B = ¼ I, so ω = 4 Bᵀ dq.
        """
        axis, dim, space = self.line(poses)[1], joints.space.dim, joints.space
        own = [4.0 * (space.rotation_rates(poses[b]) @ axis) @ z[joints.columns[b]][dim:] for b in self.bodies]
        return float(np.mean(own))

    def turned(
        self, joints: JointSystem, poses: np.ndarray, angle: float, points: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """``poses`` and ``points`` (n, 3) of the bodies after a turn about the line by ``angle``.

        x ← p + R (x − p),     q ← (cos ½φ, sin ½φ n) ∘ q
        """
        (point, axis), space, poses = self.line(poses), joints.space, poses.copy()
        turn = np.concatenate([np.zeros(3), [np.cos(0.5 * angle)], np.sin(0.5 * angle) * axis])
        for body in self.bodies:
            t, q = poses[body, :3], poses[body, 3:]
            rate = space.rotation_rates(poses[body]) @ axis
            t += space.rotation_increment(turn) @ (np.array(joints.bodies[body].centre) + t - point)
            q[:] = turn[3] * q + 2.0 * np.sin(0.5 * angle) * rate
        return poses, points + (points - point) @ space.rotation_increment(turn).T

    def motion(self, joints: JointSystem, poses: np.ndarray) -> np.ndarray:
        """n by the pose unknowns, in units of ``JointSystem.pose_scale`` and of norm one, (size,)."""
        z = np.zeros(joints.size)
        for body, rate in self.rates(joints, poses).items():
            z[joints.columns[body]] = rate
        z /= joints.pose_scale
        return z / np.linalg.norm(z)

    def is_idle(self, acted_on: Collection[int] = (), forces: Sequence[tuple[int, np.ndarray]] = ()) -> bool:
        """Whether nothing resists.

        Args:
            acted_on: indices of bodies on which, or on whose link, potentials or effects act that turns change; these
                do not spin idly.
            forces: on each of some bodies, or its link, a force acts at a place as drawn, (dim,); unless that is the
                centre of one of the two ball joints the body does not spin idly.
        """
        places = np.array([self.system.place(k, body, self.system.drawn) for k, body in self.balls])
        loaded = [at for body, at in forces if body in self.bodies]
        off = [np.min(np.linalg.norm(places - at, axis=1)) > _ROUNDING * self.system.length for at in loaded]
        return not any(off) and set(self.bodies).isdisjoint(acted_on)


def spins(linkage: Linkage) -> tuple[Spin, ...]:
    """The spins of a linkage in space, idle or not."""
    system, found = linkage.rigid, []
    balls = {k: c for k, c in enumerate(system.connections) if system.is_ball(k)}
    pairs = np.array([(c.a, c.b) for k, c in enumerate(system.connections) if k not in balls], dtype=int).reshape(-1, 2)
    graph = csr_matrix((np.ones(len(pairs)), pairs.T), shape=(len(system.bodies),) * 2)
    _, group = connected_components(graph, directed=False)
    for label in np.unique(group):
        bodies = tuple(int(body) for body in np.flatnonzero(group == label))
        if any(system.bodies[body].fixed for body in bodies):
            continue
        held = [(k, c) for k, c in balls.items() if group[c.a] != group[c.b]]
        ends = [(k, body) for k, c in held for body in (c.a, c.b) if group[body] == label]
        if not ends:
            continue
        # balls of several links may share a place
        places = np.array([system.place(k, body, system.drawn) for k, body in ends])
        from_first = np.linalg.norm(places - places[0], axis=1)
        last = int(np.argmax(from_first))
        from_last, rounding = np.linalg.norm(places - places[last], axis=1), _ROUNDING * linkage.length
        if from_first[last] > rounding and np.all(np.minimum(from_first, from_last) <= rounding):
            found.append(Spin(system, bodies, (ends[0], ends[last])))
    return tuple(found)
