"""Whether loads balance along motions that deform no link, and equilibria in which they do.

Rounding of the nodal forces of stiff links may exceed small loads, so that a residual of the size of rounding does not
fix the rest position of a zero-energy mode. The forces inside an element cancel along motions that deform no link, and
so do their errors: the work along these is precise. Where Newton's method, from which rounding hides it, leaves a
position out of balance, all links move along such motions m alone to where the works w vanish,

    q ← q − |H|⁻¹ w,     w_i = ∇(V + E_effects − loads) · m_i,     H = ∂w/∂q,

V the potentials of poses and of joints that give way, H by differences, along those motions of the moved links that are
nearest to the ones before; |H|, which descends, has the moduli of its eigenvalues. A step δ that descends ends where
the work along it vanishes, w(q + t δ) · δ = 0: obstacles resist only where links touch them. From an unstable
equilibrium H leads to the one near.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import agreed, from_one
from fenicsmech.equilibrium import Control, EquilibriumPoint, EquilibriumSolver, NotConverged, State, Step
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import Motion, stiff_motions

_BALANCED = 1e-6  # work over loads times the greatest velocity that is small
_DIFFERENCE = 1e-4  # rad, or over the mechanism's length, by which links move for the slopes of works
_LARGEST = 0.1  # likewise in one step
_ITERATIONS = 10  # to vanishing works
_TRIALS = 40  # of the length of one step
_ROUNDED = 1e-14  # motion, rad or over the mechanism's length, that moves nothing
_FELT = 1e-12  # slope over the largest
_ROUNDS = 4  # of moving links and relaxing them


class Balance:
    """The balance of loads along motions that deform no link.

    Args:
        model: of the mechanism, loaded by ``solver``.
        solver: for the equilibria.
    """

    def __init__(self, model: MechanismModel, solver: EquilibriumSolver) -> None:
        self._model, self._solver, self._comm = model, solver, model.mesh.mesh.comm

    def improved(self, point: EquilibriumPoint, control: Control) -> tuple[EquilibriumPoint, float, int]:
        """The equilibrium at ``point``, or near it if loads balance better there; their imbalance; iterations spent.

        Beside reactions ten thousand times the loads, too, a residual that is small leaves motions that these alone
        resist, as the spin of a link between ball joints, far from where they come to rest.
        """
        imbalance = self.imbalance(point.state, control)
        if imbalance <= _BALANCED:
            return point, imbalance, 0
        rested, left, iterations = self._rested(point, control)
        if left < 0.5 * imbalance and rested.unstable_modes <= point.unstable_modes:
            return rested, left, iterations
        return point, imbalance, iterations

    def reached(self, state: State, control: Control) -> tuple[EquilibriumPoint | None, int]:
        """The equilibrium that links reach from ``state`` as rigid bodies, None if none is found; iterations spent.

        Where nothing resists a force before links touch an obstacle, steps of Newton's method on K only creep.
        """
        solver, state, iterations = self._solver.turning or self._solver, control.prepare(state), 0
        for _ in range(_ROUNDS):
            state = self._balanced(state, control, descend=True)
            try:
                point = solver.solve(state, control)
            except NotConverged as failure:
                iterations += failure.iterations
                continue
            return point, iterations + point.iterations
        return None, iterations

    def _rested(self, point: EquilibriumPoint, control: Control) -> tuple[EquilibriumPoint, float, int]:
        """The equilibrium to which motions that deform no link lead from ``point``; its imbalance; iterations spent.

        Where far motions strain links, or open joints, Newton's method relaxes them, and the links move on from there.
        """
        solver, iterations, imbalance = self._solver.turning or self._solver, 0, np.inf
        system = solver.system
        for _ in range(_ROUNDS):
            state = self._balanced(point.state, control, descend=point.unstable_modes == 0)
            system.load(state)
            residual = system.residual(state, control)
            try:
                if residual.norm <= solver.rounding(residual):
                    at = solver.linearise(state, control, residual)
                    hidden = at.drowns_modes  # as is then the stability
                    found = at.point(point.residuals, point.iterations)
                    found = replace(found, stability=point.stability) if hidden else found
                    return found, self.imbalance(state, control), iterations
                point = solver.solve(state, control)
            except NotConverged as failure:
                return point, imbalance, iterations + failure.iterations
            iterations, imbalance = iterations + point.iterations, self.imbalance(point.state, control)
        return point, imbalance, iterations

    def _balanced(self, state: State, control: Control, *, descend: bool) -> State:
        """``state`` moved along motions that deform no link to where works along these vanish."""
        for _ in range(_ITERATIONS):
            motions = self._motions(state)
            if not motions:  # a dead centre
                break
            works = self._works(state, control, motions)
            slopes = np.array([self._slope(state, control, motions, works, k) for k in range(len(motions))])
            # of one process: signs of slopes are decisions that depend on rounding
            q = from_one(self._comm, partial(_newton_step, slopes, works, descend))
            q *= min(1.0, _LARGEST / max(np.abs(q).max(initial=0.0), _LARGEST))
            length = self._length(state, control, motions, works, q) if descend else 1.0
            state = self._moved(state, motions, length * q)
            if length * np.abs(q).max(initial=0.0) <= _ROUNDED or self.imbalance(state, control) <= 1e-3 * _BALANCED:
                break
        return state

    def _slope(
        self, state: State, control: Control, motions: Sequence[Motion], works: np.ndarray, k: int
    ) -> np.ndarray:
        """∂w/∂q_k of ``works`` w along ``motions``, (motions,); zero where no link can move so, as in a dead centre."""
        q = np.zeros(len(motions))
        q[k] = _DIFFERENCE
        there = self._works_after(state, control, motions, q)
        return np.zeros(len(works)) if there is None else (there - works) / _DIFFERENCE

    def _works_after(
        self, state: State, control: Control, motions: Sequence[Motion], q: np.ndarray
    ) -> np.ndarray | None:
        """Works after links have moved by ``q``, along those motions there that are nearest to ``motions``, (motions,);
        None where no link can move."""
        there = self._moved(state, motions, q)
        moved, scale = self._motions(there), self._solver.system.joints.pose_scale
        if not moved:
            return None
        own, wanted = (np.column_stack([motion.z / scale for motion in each]) for each in (moved, motions))
        nearest = from_one(self._comm, lambda: np.linalg.lstsq(own, wanted, rcond=None)[0]).T
        return nearest @ self._works(there, control, moved)

    def _length(
        self, state: State, control: Control, motions: Sequence[Motion], works: np.ndarray, q: np.ndarray
    ) -> float:
        """The part t of a step that descends after which the work along it vanishes: all of it where that does not, or
        by bisection."""

        def along(t: float) -> float:
            there = self._works_after(state, control, motions, t * q)
            return 0.0 if there is None else agreed(self._comm, float(there @ q))

        start, end = agreed(self._comm, float(works @ q)), along(1.0)
        if not start < 0.0 < end:
            return 1.0
        low, high = 0.0, 1.0
        for _ in range(_TRIALS):
            t = 0.5 * (low + high)
            work = along(t)
            if abs(work) <= _BALANCED * abs(start):
                break
            low, high = (t, high) if work < 0.0 else (low, t)
        return t

    def _motions(self, state: State) -> list[Motion]:
        """Those that deform no link and open no joint but one that gives way, on all processes the same basis."""
        rows = self._solver.system.rigid_rows
        return from_one(self._comm, lambda: stiff_motions(self._model.linkage, state.poses, state.motors, rows))

    def _moved(self, state: State, motions: Sequence[Motion], q: np.ndarray) -> State:
        """``state`` after all links have turned along ``motions``, by q (motions,); joints that give way have
        λ = −C / c."""
        u, z = np.zeros(len(state.u)), np.zeros(self._solver.system.joints.size)
        for motion, way in zip(motions, q, strict=True):
            velocity = self._velocity(state, motion)
            u[: len(velocity)] += way * velocity
            z += way * motion.z
        system, multipliers = self._solver.system, state.multipliers.copy()
        moved = system.turned(state, Step(u, z, np.zeros(len(multipliers)), 0.0))
        soft = np.flatnonzero(system.compliances)
        multipliers[soft] = -system.joints.value(moved.poses, moved.motors)[soft] / system.compliances[soft]
        return replace(moved, multipliers=multipliers)

    def imbalance(self, state: State, control: Control) -> float:
        """Largest work of a loaded equilibrium along motions that deform no link, over loads times greatest velocity.

        Of the work of each reaction, 1e-12 is left by rounding of their sum, which vanishes, and of effects 1e-14 of
        what balances on each link; 0 where nothing acts, or nothing moves.
        """
        motions, joints = self._motions(state), self._model.linkage.joints
        works, (loads, cancelled) = self._works(state, control, motions), self._sizes(state)
        reactions = np.abs(state.multipliers) @ np.abs(joints.gradient(state.poses, state.motors))
        worst = 0.0
        for motion, work in zip(motions, works, strict=True):
            speed = motion.fastest(self._model.linkage.length)
            rounding = 1e-12 * float(reactions @ np.abs(motion.z)) + 1e-14 * cancelled * speed
            worst = max(worst, (abs(work) - rounding) / speed)
        return agreed(self._comm, worst / loads if loads > 0.0 else 0.0)

    def _works(self, state: State, control: Control, motions: Sequence[Motion]) -> np.ndarray:
        """Works along ``motions``, (motions,). Links do none where nothing strains them, however their nodal forces are
        rounded: those of loads and effects count."""
        system = self._solver.system
        system.load(state)
        rigid = system.residual(state, control).rigid
        nodal = state.load_factor * self._effects() - system.nodal_loads(state)
        own = np.array([nodal @ self._velocity(state, motion) for motion in motions])
        return self._comm.allreduce(own) + np.array([rigid @ motion.z for motion in motions])

    def _velocity(self, state: State, motion: Motion) -> np.ndarray:
        """Velocities of owned nodes of links along a motion, (owned displacements,)."""
        model, linkage, owned = self._model, self._model.linkage, self._model.interfaces.owned
        u = state.u[: owned * model.interfaces.block].reshape(owned, -1)
        places = u + model.elastic.drawn_nodes[:owned] + model.design_nodes.values(model.elastic.design)[:owned]
        velocity = np.zeros(u.shape)
        for number, link in enumerate(model.mechanism.flexible_links):
            body = linkage.interfaces[link][0]
            nodes = np.flatnonzero(model.node_link[:owned] == number)
            centre = np.array(linkage.bodies[body].centre) + state.poses[body, : linkage.dim]
            offsets = places[nodes][:, : linkage.dim] - centre
            velocity[nodes, : linkage.dim] = motion.at(body, offsets)
        return velocity.ravel()

    def _effects(self) -> np.ndarray:
        """Gradient at load factor 1 of the energies of effects that links as rigid bodies change, at the loaded state,
        (owned displacements,)."""
        model, size = self._model, self._model.interfaces.owned * self._model.interfaces.block
        dead, others = model.elastic.effect_loads(model.effects_on_rigid_links)
        return -(dead + others)[:size]

    def _sizes(self, state: State) -> tuple[float, float]:
        """Sum of the sizes of all loads at the loaded ``state``, those of effects included; the same of what balances.

        Those of effects on a flexible link count by their sum: what balances on each link works along no motion that
        deforms none.
        """
        model, comm, own = self._model, self._comm, self._effects()
        link, links = model.node_link[: model.interfaces.owned], len(model.mechanism.flexible_links)
        sums = np.array(
            [np.bincount(link, part, minlength=links) for part in own.reshape(len(link), model.interfaces.block).T]
        )
        total = float(np.abs(comm.allreduce(sums, op=MPI.SUM)).sum())
        cancelled = comm.allreduce(float(np.abs(own).sum()))
        for potential in model.potentials:
            if not potential.holds:
                slope = potential.gradient(state.poses).reshape(len(potential.bodies), -1)
                total += float(np.abs(slope[:, : model.linkage.dim]).sum())
                total += float(np.abs(slope[:, model.linkage.dim :]).sum()) / model.linkage.length
        return abs(state.force) + abs(state.load_factor) * float(np.abs(state.constant).sum()) + total, cancelled


def _newton_step(slopes: np.ndarray, works: np.ndarray, descend: bool) -> np.ndarray:
    """−H⁻¹ w, or −|H|⁻¹ w to ``descend``; motions that nothing resists stay."""
    values, modes = np.linalg.eigh(0.5 * (slopes + slopes.T))
    felt = np.abs(values) > _FELT * np.abs(values).max()
    values, modes = values[felt], modes[:, felt]
    return -modes @ ((modes.T @ works) / (np.abs(values) if descend else values))
