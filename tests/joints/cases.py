"""Every joint in every dimension, with the motions it leaves free written out by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from fenicsmech.joints import (
    CYLINDRICAL,
    PLANAR_JOINT,
    PRISMATIC,
    REVOLUTE,
    RIGID_SPACES,
    SPHERICAL,
    UNIVERSAL,
    WELD,
    JointKind,
    RigidSpace,
    constraint,
)

from .poses import carry, matrix, pose, random_rotation, turn

# Motions of b relative to a: "t1" slides along the joint's first unit vector, "r3" turns about its third. In the
# plane the vectors are axis, normal; "r3" turns in it.
MOTIONS = {2: ("t1", "t2", "r3"), 3: ("t1", "t2", "t3", "r1", "r2", "r3")}


@dataclass(frozen=True)
class Case:
    """A joint kind in one dimension; ``own`` is the coordinate a motor drives."""

    kind: JointKind
    dim: int
    free: tuple[str, ...]
    own: str | None = None

    def __str__(self) -> str:
        return f"{self.kind.name}-{self.dim}d"

    @property
    def space(self) -> RigidSpace:
        return RIGID_SPACES[self.dim]

    @property
    def blocked(self) -> tuple[str, ...]:
        return tuple(motion for motion in MOTIONS[self.dim] if motion not in self.free)


CASES = (
    Case(REVOLUTE, 3, ("r3",), "r3"),
    Case(PRISMATIC, 3, ("t3",), "t3"),
    Case(CYLINDRICAL, 3, ("t3", "r3")),
    Case(SPHERICAL, 3, ("r1", "r2", "r3")),
    Case(UNIVERSAL, 3, ("r1", "r2")),
    Case(PLANAR_JOINT, 3, ("t1", "t2", "r3")),
    Case(WELD, 3, ()),
    Case(REVOLUTE, 2, ("r3",), "r3"),
    Case(PRISMATIC, 2, ("t1",), "t1"),
    Case(PLANAR_JOINT, 2, ("t1", "t2", "r3")),
    Case(WELD, 2, ()),
)
DRIVEN = tuple(case for case in CASES if case.own)


@dataclass(frozen=True)
class Drawn:
    """A joint drawn anywhere: ``anchors`` (2, dim) from the centres of both bodies, ``triad`` (dim, dim) in rows."""

    space: RigidSpace
    anchors: np.ndarray
    triad: np.ndarray

    @property
    def identity(self) -> np.ndarray:
        """Both bodies where they were drawn, (2 pose_size,)."""
        return np.concatenate([self.space.identity] * 2)

    def moved(self, a: np.ndarray, motions: dict[str, float]) -> np.ndarray:
        """Poses of both: a at pose ``a`` (pose_size,), b where ``motions`` relative to a take it (slides, then turns).

        Turns about several axes follow each other, r1 first, each about the axis as the turns before left it.
        """
        dim = self.space.dim
        slide = sum((motions.get(f"t{k + 1}", 0.0) * self.triad[k] for k in range(dim)), np.zeros(dim))
        rotation = Rotation.identity()
        for name, k in (("r1", 0), ("r2", 1), ("r3", -1)):
            axis = self.triad[k] if dim == 3 else np.ones(1)
            rotation = rotation * turn(self.space, motions.get(name, 0.0) * axis)
        # b turns about the joint: its centre, at −anchor from there, follows
        lever = matrix(self.space, rotation) @ -self.anchors[1] + self.anchors[1]
        return np.concatenate([a, carry(self.space, a, pose(self.space, slide + lever, rotation), self._apart)])

    @property
    def _apart(self) -> np.ndarray:
        return self.anchors[0] - self.anchors[1]

    def rigid_motion(self, both: np.ndarray, motion: str, slot: int) -> np.ndarray:
        """∂``both`` (2 pose_size,) while body ``slot`` makes the unit ``motion`` along or about a's triad."""
        space, k = self.space, int(motion[1]) - 1
        a = both[: space.pose_size]
        z = both[slot * space.pose_size :][: space.pose_size]
        # from the joint on a to the body's centre
        arm = z[: space.dim] - a[: space.dim] - space.rotate(a, self.anchors[0]) + self.anchors[0] - self.anchors[slot]
        if motion[0] == "t":
            own = np.concatenate([space.rotate(a, self.triad[k]), np.zeros(space.rotation_size)])
        elif space.dim == 2:
            own = np.array([-arm[1], arm[0], 1.0])
        else:
            omega = space.rotate(a, self.triad[k])
            own = np.concatenate([np.cross(omega, arm), space.rotation_rates(z) @ omega])
        rest = np.zeros(space.pose_size)
        return np.concatenate([rest, own] if slot else [own, rest])


def draw(space: RigidSpace, rng: np.random.Generator) -> Drawn:
    """A joint with random anchors and triad."""
    triad = matrix(space, random_rotation(space, rng))
    return Drawn(space, rng.standard_normal((2, space.dim)), triad)


class Compiled:
    """The package's equations of a case, by z (2 pose_size,), anchors (2, dim), triad (dim, dim) and a motor's φ."""

    def __init__(self, case: Case, driven: bool) -> None:
        self._equations, self._driven = constraint(case.kind, case.dim, driven), driven
        self.rows = self._equations.size

    def value(self, *point) -> np.ndarray:
        """C, (rows,)."""
        return self._equations.value(*self._arguments(*point))

    def gradient(self, z, *point) -> np.ndarray:
        """∂C/∂z, (rows, 2 pose_size)."""
        return self._equations.gradient(*self._arguments(z, *point))[:, : z.size]

    def hessian(self, z, *point) -> np.ndarray:
        """Σ λ_k ∂²C_k/∂z², (2 pose_size, 2 pose_size), λ last."""
        return self._equations.hessian(*self._arguments(z, *point[:-1]), point[-1])[: z.size, : z.size]

    def rate(self, *point) -> np.ndarray:
        """∂C/∂φ, (rows,)."""
        assert self._driven
        return self._equations.gradient(*self._arguments(*point))[:, -1]

    def force_rate(self, z, *point) -> np.ndarray:
        """Σ λ_k ∂²C_k/∂z∂φ, (2 pose_size,), λ last."""
        assert self._driven
        return self._equations.hessian(*self._arguments(z, *point[:-1]), point[-1])[-1, : z.size]

    def _arguments(self, z, anchors, triad, value) -> tuple[np.ndarray, np.ndarray]:
        return np.append(z, value) if self._driven else z, np.concatenate([anchors.ravel(), triad.ravel()])


def compiled(case: Case, *, driven: bool = False) -> Compiled:
    """The package's equations of ``case``."""
    return Compiled(case, driven)
