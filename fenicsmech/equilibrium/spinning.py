"""Spins that loads resist: links between two ball joints which turn about the line through these under load.

What resists may be tiny: the weight of a straight coupler prefers the direction in which it bends most, by an energy
of second order in the load, 1e-12 of the stiffness of the links. A linear step that turns a link by φ strains it by
φ², and descent would allow turns of some 1e-3 only. So

- a step x ← x + dx is split into the turn φ about the line and the rest, and the turn is a rotation,

      x ← p + R(φ) (x + dx − φ n × (x − p) − p),

- spins are held while all else comes to equilibrium, and are turned from one such equilibrium to the next (``newton``).
  With the hold h, a couple on one body of the set, the matrix K + h hᵀ is regular, and the equilibrium under the moment
  μ of the hold has the residual r = μ h. The motion that the hold alone causes tells the stiffness left in the spin,

      K x = μ h,     s = (K + h hᵀ)⁻¹ h,     x = s μ / (1 − hᵀ s).

That is for loose spins; what loads resist firmly, as a pendulum, Newton's method finds with all else. Loose ones turn
at once, whatever little changes: neither predictions, nor the search for snaps, nor the turns of paths count them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fenicsmech.equilibrium.state import State, Step
from fenicsmech.multibody import InterfaceMap, JointSystem, Spin


class SpinningLinks:
    """The links whose spins loads resist, and their turns in steps.

    Args:
        spins: each with the owned nodes of its flexible links.
        interfaces: of these links.
        joints: the bodies.
    """

    def __init__(self, spins: Sequence[tuple[Spin, np.ndarray]], interfaces: InterfaceMap, joints: JointSystem) -> None:
        self._own, self._interfaces, self._joints = tuple(spins), interfaces, joints
        self.spins = tuple(spin for spin, _ in spins)

    def turned(self, state: State, step: Step) -> tuple[np.ndarray, np.ndarray]:
        """Displacements and poses of ``state`` after ``step``, the turns of spins as rotations. Local."""
        joints, rest = self._joints, self.unspun(state, step)
        angles = [spin.angle(joints, state.poses, step.z) for spin in self.spins]
        u, poses = state.u + rest.u, joints.with_unknowns(state.poses, joints.unknowns(state.poses) + rest.z)
        for (spin, nodes), angle in zip(self._own, angles, strict=True):
            before = self._interfaces.places(u)[nodes]
            poses, after = spin.turned(joints, poses, angle, before)
            self._interfaces.nodal(u)[nodes] += after - before
        return u, poses

    def turned_back(self, state: State, before: State) -> State:
        """``state`` with spins turned back to where they are in ``before``. Local."""
        joints, u, poses = self._joints, state.u.copy(), state.poses
        for spin, nodes in self._own:
            for _ in range(3):  # the error of an angle, from the change of quaternions, is of third order
                change = joints.unknowns(poses) - joints.unknowns(before.poses)
                points = self._interfaces.places(u)[nodes]
                poses, after = spin.turned(joints, poses, -spin.angle(joints, before.poses, change), points)
                self._interfaces.nodal(u)[nodes] += after - points
        return replace(state, u=u, poses=poses)

    def unspun(self, state: State, step: Step) -> Step:
        """``step`` from ``state`` without the turns of spins. Local."""
        joints, u, z = self._joints, step.u.copy(), step.z.copy()
        for spin, nodes in self._own:
            (point, axis), angle = spin.line(state.poses), spin.angle(joints, state.poses, step.z)
            self._interfaces.nodal(u)[nodes] -= angle * np.cross(axis, self._interfaces.places(state.u)[nodes] - point)
            for body, rate in spin.rates(joints, state.poses).items():
                z[joints.columns[body]] -= angle * rate
        return replace(step, u=u, z=z)

    def without(self, step: Step) -> Step:
        """``step`` without the motions of all links that spin. Local."""
        u, z = step.u.copy(), step.z.copy()
        for spin, nodes in self._own:
            self._interfaces.nodal(u)[nodes] = 0.0
            for body in spin.bodies:
                z[self._joints.columns[body]] = 0.0
        return replace(step, u=u, z=z)
