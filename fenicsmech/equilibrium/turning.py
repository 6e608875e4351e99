"""Steps that turn flexible links instead of straining them: corotational increments.

A step d added to the places x of a link strains it by ½ φ² where it turns it by φ: in stiff links that outweighs all
else, and steps of a mechanism that hardly anything holds become short. Here the mean turn of a link about its mean
place c is a rotation, as that of rigid links is,

    x ← c + d̄ + R(φ) (x − c + d − d̄ − φ × (x − c)),      Σ (x − c) × (d − d̄ − φ × (x − c)) = 0,

sums and means over the link's free nodes. The bodies of its interfaces turn with it. To first order this is the step.

Turns by φ leave gaps of the order of φ² in joints, which in a stiff mechanism would outweigh the residual of all soft
motions as well. They close, as far as the step itself closes them, by the least motions y of all links as rigid bodies,

    y = −(A T)⁺ (C(s ⊕ d) − C(s) − A d − ∂C/∂φ dφ),      T y the motions of poses, φ those of motors,

which are of second order in d. Where y is no smaller than d, as in singular positions, the gaps stay.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from fenicsmech.collective import agreed, from_one
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.joints import across
from fenicsmech.multibody import InterfaceMap, JointSystem

_SINGULAR = 1e-3  # gaps over motions, both scaled to one, below which motions close none


@dataclass(frozen=True, eq=False)
class TurningLink:
    """A link: the indices of the ``bodies`` of its interfaces, and its owned ``nodes``."""

    bodies: tuple[int, ...]
    nodes: np.ndarray


class TurningLinks:
    """The turns of flexible links in steps.

    Args:
        links: the flexible ones, to which all nodes belong.
        interfaces: of these links.
        joints: the bodies and constraints.
        comm: the processes that share the links.
    """

    def __init__(
        self, links: Sequence[TurningLink], interfaces: InterfaceMap, joints: JointSystem, comm: MPI.Comm
    ) -> None:
        self._interfaces, self._joints, self._comm = interfaces, joints, comm
        rigid = set(joints.free_bodies).difference(*(link.bodies for link in links))
        none = np.zeros(0, int)
        self._movable = [*links, *(TurningLink((body,), none) for body in sorted(rigid))]
        self._bodies = np.array([body for link in links for body in link.bodies], dtype=int)
        self._centres = np.array([body.centre for body in joints.bodies])
        # links of owned nodes, then of bodies
        of_node = np.zeros(interfaces.owned, int)
        of_body = np.repeat(np.arange(len(links)), [len(link.bodies) for link in links])
        for k, link in enumerate(links):
            of_node[link.nodes] = k
        self._link = np.concatenate([of_node, of_body])
        self._free = np.flatnonzero(interfaces.body[: interfaces.owned] < 0)
        ones, columns = np.ones(len(self._free)), np.arange(len(self._free))
        self._sum = csr_matrix((ones, (of_node[self._free], columns)), shape=(len(links), len(self._free)))
        self._counts = comm.allreduce(np.array(self._sum.sum(axis=1)).ravel())
        self._turns = self._counts > joints.space.dim  # fewer nodes have no turn

    def turned(self, state: State, step: Step) -> tuple[np.ndarray, np.ndarray]:
        """Displacements and poses of ``state`` after ``step``, joints closed as far as it closes them."""
        u, poses = self._rotated(state.u, state.poses, step.u, step.z)
        closing = self._closing(state, step, u, poses)
        return (u, poses) if closing is None else self._rotated(u, poses, *closing)

    def _rotated(
        self, u: np.ndarray, poses: np.ndarray, du: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Displacements and poses after the step (``du``, ``z``), the turns of links as rotations."""
        joints, space, dim, interfaces = self._joints, self._joints.space, self._joints.space.dim, self._interfaces
        own, owned, z = self._link, interfaces.owned, z.copy()
        places = self._places(poses)[self._bodies]
        motions = np.array([z[joints.columns[body]][:dim] for body in self._bodies]).reshape(-1, dim)
        x = np.concatenate([interfaces.places(u), places])
        d = np.concatenate([interfaces.nodal(du), motions])
        (centres, means), (inertia, moment) = self._moments(x, x, d)
        vectors = self._spins(inertia, moment)
        still, turn = np.zeros(dim), space.identity[dim:]
        turns = [np.concatenate([still, space.turned(vector, turn)]) for vector in vectors]
        increments = np.array([space.rotation_increment(pose) for pose in turns]).reshape(-1, dim, dim)
        spun = across(vectors[own], x - centres[own])
        rest = x - centres[own] + d - means[own] - spun
        bent = np.einsum("nij,nj->ni", increments[own], rest) - spun  # what turns add to x + d
        for body, link in self._own():
            z[joints.columns[body][dim:]] -= space.rotation_rates(poses[body]) @ vectors[link]
        u, poses = u + du, joints.with_unknowns(poses, joints.unknowns(poses) + z)
        interfaces.nodal(u)[:] += bent[:owned]
        poses[self._bodies, :dim] += bent[owned:]
        for body, link in self._own():
            poses[body, dim:] = space.turned(vectors[link], poses[body, dim:])
        return u, poses

    def _own(self) -> Iterator[tuple[int, int]]:
        """Each body of a link and its link."""
        return zip(self._bodies, self._link[self._interfaces.owned :], strict=True)

    def _places(self, poses: np.ndarray) -> np.ndarray:
        """Of the centres of bodies, (bodies, dim)."""
        return self._centres + poses[:, : self._joints.space.dim]

    def _moments(self, x: np.ndarray, *values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Means over each link of ``values`` y (points, dim), (values, links, dim), and Σ (y − ȳ) ⊗ (x − x̄), x the
        first of them."""
        x, free = x[self._free], [y[self._free] for y in values]
        own = [np.column_stack([self._sum @ y, self._sum @ _outer(y, x)]) for y in free]
        sums, dim = self._comm.allreduce(np.array(own)), x.shape[1]
        counts = np.maximum(self._counts, 1.0)[:, None]
        means, moments = sums[..., :dim] / counts, sums[..., dim:]
        moments -= np.array([_outer(mean, means[0]) for mean in means]) * counts
        return means, moments.reshape(*means.shape, dim)

    def _spins(self, inertia: np.ndarray, moment: np.ndarray) -> np.ndarray:
        """φ of each link with Σ a × (d − φ × a) = 0, from Σ a ⊗ a and Σ d ⊗ a (links, dim, dim); zero where it has too
        few nodes."""
        skew = moment - moment.transpose(0, 2, 1)
        trace = np.where(self._turns, np.trace(inertia, axis1=1, axis2=2), 1.0)
        if self._joints.space.dim == 2:
            spins = skew[:, 1, :1] / trace[:, None]
        else:
            axial = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
            matrices = trace[:, None, None] * np.eye(3) - np.where(self._turns[:, None, None], inertia, 0.0)
            spins = np.linalg.solve(matrices, axial[..., None])[..., 0]
        return np.where(self._turns[:, None], spins, 0.0)

    # -- joints --------------------------------------------------------------------------------------------------

    def _closing(
        self, before: State, step: Step, u: np.ndarray, poses: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Displacements and T y, to be taken from (``u``, ``poses``), to which ``step`` led from ``before``; None where
        gaps are rounding."""
        joints, space, dim = self._joints, self._joints.space, self._joints.space.dim
        largest = agreed(self._comm, float(np.max(np.abs(step.z / joints.pose_scale), initial=0.0)))
        if largest**2 < np.finfo(float).eps:
            return None
        motors = before.motors + step.motors
        gaps = joints.value(poses, motors) - joints.value(before.poses, before.motors)
        gaps -= joints.gradient(before.poses, before.motors) @ step.z
        gaps -= joints.motor_rate(before.poses, before.motors, before.multipliers, motors - before.motors)[0]
        places = self._places(poses)
        motions = self._motions(places, poses)
        matrix = joints.row_scale[:, None] * (joints.gradient(poses, motors) @ motions)

        def least() -> np.ndarray:
            if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(gaps))):
                return np.full(matrix.shape[1], np.nan)  # the energy is none either
            y = np.linalg.lstsq(matrix, -joints.row_scale * gaps, rcond=_SINGULAR)[0]
            return y if np.max(np.abs(y), initial=0.0) < largest else np.zeros_like(y)

        y = from_one(self._comm, least)
        du, nodes = np.zeros_like(u), self._interfaces.places(u)
        for link, own in zip(self._movable, y.reshape(-1, space.freedoms), strict=True):
            offsets = nodes[link.nodes] - places[link.bodies[0]]
            self._interfaces.nodal(du)[link.nodes] = joints.length * own[:dim] + across(own[dim:], offsets)
        return du, motions @ y

    def _motions(self, places: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """T, (size, freedoms of all links): of each the slides, in lengths of the mechanism, and turns about the first
        of its bodies, at ``places`` (bodies, dim)."""
        joints, space, dim = self._joints, self._joints.space, self._joints.space.dim
        motions = np.zeros((joints.size, len(self._movable), space.freedoms))
        turns = np.eye(space.freedoms - dim)
        for k, link in enumerate(self._movable):
            for body in link.bodies:
                columns, offset = joints.columns[body], places[body] - places[link.bodies[0]]
                motions[columns[:dim], k, :dim] = joints.length * np.eye(dim)
                motions[columns[:dim], k, dim:] = np.transpose([across(turn, offset) for turn in turns])
                motions[columns[dim:], k, dim:] = space.rotation_rates(poses[body])
        return motions.reshape(joints.size, -1)


def _outer(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a ⊗ b of rows, (n, dim · dim)."""
    return (a[:, :, None] * b[:, None, :]).reshape(len(a), -1)
