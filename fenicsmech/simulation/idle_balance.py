"""Whether what acts balances along motions that deform no link.

Stiff links round their nodal forces by more than small loads exert, so that a residual as small as rounding says
nothing about where an idle freedom comes to rest. The forces inside an element cancel along motions that deform no
link, and so do their errors: the work along these is precise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from fenicsmech.equilibrium import Residual, State
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import Motion, stiff_motions

_ROUNDED = 1e-12  # of the work of each reaction: what is left of their sum, which vanishes


def idle_imbalance(model: MechanismModel, residual: Residual, state: State, loads: Sequence[float]) -> float:
    """Largest work along a motion that deforms no link, over loads times the velocity of what moves fastest.

    Args:
        model: the discretised mechanism.
        residual: at the state.
        state: an equilibrium.
        loads: magnitudes of all forces.

    Returns:
        0 where nothing acts, or nothing moves (collective).
    """
    size, worst, joints = sum(map(abs, loads)) + _weights(model, state), 0.0, model.linkage.joints
    parts = np.abs(state.multipliers) @ np.abs(joints.gradient(state.poses, state.motors))
    for motion in stiff_motions(model.linkage, state.poses, state.motors):
        lacking = model.mesh.mesh.comm.allreduce(float(residual.nodal @ _nodal(model, state, motion)))
        work = abs(lacking + float(residual.rigid @ motion.z))
        rounding = _ROUNDED * float(parts @ np.abs(motion.z))
        worst = max(worst, (work - rounding) / motion.fastest(model.linkage.length))
    return worst / size if size > 0.0 else 0.0


def _nodal(model: MechanismModel, state: State, motion: Motion) -> np.ndarray:
    """Velocities of owned nodes, (owned displacements,)."""
    linkage, owned = model.linkage, model.interfaces.owned
    u = state.u[: owned * model.interfaces.block].reshape(owned, -1)
    velocity = np.zeros(u.shape)
    for number, link in enumerate(model.mechanism.flexible_links):
        body = linkage.interfaces[link][0]
        nodes = np.flatnonzero(model.node_link[:owned] == number)
        centre = np.array(linkage.bodies[body].centre) + state.poses[body, : linkage.dim]
        offsets = (model.elastic.drawn_nodes[nodes] + u[nodes])[:, : linkage.dim] - centre
        velocity[nodes, : linkage.dim] = motion.at(body, offsets)
    return velocity.ravel()


def _weights(model: MechanismModel, state: State) -> float:
    """Sum of the sizes of all forces of effects that grow with the share (collective)."""
    total = 0.0
    if model.elastic.shares:
        local = float(np.abs(model.elastic.share_residuals()).sum())
        total += model.mesh.mesh.comm.allreduce(local, op=MPI.SUM)
    for potential in model.potentials:
        if not potential.holds:
            slope = potential.gradient(state.poses).reshape(len(potential.bodies), -1)
            total += float(np.abs(slope[:, : model.linkage.dim]).sum())
            total += float(np.abs(slope[:, model.linkage.dim :]).sum()) / model.linkage.length
    return total
