"""Whether loads balance along motions that deform no link, and equilibria in which they do.

Rounding of the nodal forces of stiff links may exceed small loads, so that a residual of the size of rounding does not
fix the rest position of a zero-energy mode. The forces inside an element cancel along motions that deform no link, and
so do their errors: the work along these is precise.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import agreed, from_one
from fenicsmech.continuation import LoadSteps
from fenicsmech.equilibrium import Control, EquilibriumPoint, EquilibriumSolver, NotConverged, State
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import Motion, stiff_motions

_BALANCED = 1e-6  # work over loads times the greatest velocity that is small
_ROUNDING = 1e-16  # least relative residual


class Balance:
    """The balance of loads along motions that deform no link.

    Args:
        model: of the mechanism, loaded by ``solver``.
        solver: for the equilibria.
    """

    def __init__(self, model: MechanismModel, solver: EquilibriumSolver) -> None:
        self._model, self._solver = model, solver

    def improved(self, point: EquilibriumPoint, control: Control) -> tuple[EquilibriumPoint, float, int]:
        """The equilibrium at ``point``, or near it if loads balance better there; their imbalance; iterations spent.

        Beside reactions ten thousand times the loads, a residual that is small leaves motions that these alone resist,
        as the spin of a link between ball joints, far from where they come to rest: there it must be smaller still.
        """
        imbalance, options, iterations = self.imbalance(point.state, control), self._solver.options, 0
        if imbalance <= _BALANCED:
            return point, imbalance, iterations
        reached = min(options.tolerance, max(point.residuals[-1], _ROUNDING))
        finer = copy(self._solver.turning or self._solver)  # with the same factor
        finer.options = replace(options, tolerance=0.1 * _BALANCED / imbalance * reached)
        # shifts slow steps down along the motions that are out of balance
        for shift in LoadSteps().least_shifts(point.state.minimum_shift).elsewhere:
            try:
                found = finer.solve(replace(point.state, minimum_shift=shift), control)
            except NotConverged as failure:
                iterations += failure.iterations
                continue
            iterations += found.iterations
            left = self.imbalance(found.state, control)
            if left < 0.5 * imbalance and found.unstable_modes <= point.unstable_modes:
                point, imbalance = found, left
            if imbalance <= _BALANCED:
                break
        return point, imbalance, iterations

    def imbalance(self, state: State, control: Control) -> float:
        """Largest work of a loaded equilibrium along motions that deform no link, over loads times greatest velocity.

        Of the work of each reaction, 1e-12 is left by rounding of their sum, which vanishes, and of effects 1e-14 of
        what balances on each link; 0 where nothing acts, or nothing moves. Links do no work where nothing strains them,
        however their nodal forces are rounded: those of loads and effects count.
        """
        model, system = self._model, self._solver.system
        system.load(state)
        joints, rigid = model.linkage.joints, system.residual(state, control).rigid
        nodal = -system.nodal_loads(state)
        own = np.zeros(len(nodal))  # of effects, at load factor 1
        if model.elastic.depends_on_load_factor:
            own = model.elastic.load_factor_residuals()[: len(nodal)]
            nodal += state.load_factor * own
        effects, cancelled = self._effect_forces(own, state)
        loads = abs(state.force) + abs(state.load_factor) * float(np.abs(state.constant).sum()) + effects
        worst = 0.0
        reactions = np.abs(state.multipliers) @ np.abs(joints.gradient(state.poses, state.motors))
        # all processes take the same basis of the motions
        comm = model.mesh.mesh.comm
        for motion in from_one(comm, lambda: stiff_motions(model.linkage, state.poses, state.motors)):
            fastest = motion.fastest(model.linkage.length)
            rounding = 1e-12 * float(reactions @ np.abs(motion.z)) + 1e-14 * cancelled * fastest
            work = abs(self._work(nodal, state, motion) + float(rigid @ motion.z))
            worst = max(worst, (work - rounding) / fastest)
        return agreed(comm, worst / loads if loads > 0.0 else 0.0)

    def _work(self, nodal: np.ndarray, state: State, motion: Motion) -> float:
        """r · u̇ of ``nodal`` forces r on links, (owned displacements,), along a motion."""
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
        return model.mesh.mesh.comm.allreduce(float(nodal @ velocity.ravel()))

    def _effect_forces(self, own: np.ndarray, state: State) -> tuple[float, float]:
        """Sum of the sizes of all forces of effects that grow with the load factor; the same of what balances.

        Those on a flexible link, ``own``, count by their sum: what balances on each link, as pressure all around it
        does, works along no motion that deforms none.
        """
        model, comm = self._model, self._model.mesh.mesh.comm
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
        return total, cancelled
