"""Where load steps start if nothing but loads holds a mechanism: the rigid pose that these prefer (``RestSearch``).

Loads on flexible links are replaced by the dead force, at one point, that does their work in rigid motions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import from_one
from fenicsmech.equilibrium import Control, State
from fenicsmech.mechanism import Force, in_dimension
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import BodyPoint, DeadForce, IdleSpin, PosePotential, RestSearch, TravelSpring, count_freedom

_BALANCED = 1e-9  # sum of the forces on a link, over that of their sizes, that counts as none


@dataclass(frozen=True)
class RestStart:
    """Where load steps start.

    Attributes:
        state: without loads.
        held: whether the loads hold all zero-energy modes there, once they are not zero.
    """

    state: State
    held: bool


def rest_start(
    model: MechanismModel,
    unloaded: State,
    motors: np.ndarray,
    constant: Sequence[tuple[Force, float]],
    ratios: Mapping[Force, float],
    control: Control,
    idle: Sequence[IdleSpin],
) -> RestStart:
    """``unloaded`` in the pose that constant loads prefer, and the controlled force as it starts from zero.

    Where a displacement is prescribed, it is the pose nearest to it.

    It stays as it is where loads drive the mechanism on without end.

    Args:
        model: of the mechanism.
        unloaded: its rigid assembly, loaded.
        motors: of the linkage with rigid links, (connections,).
        constant: other forces and their magnitudes, which act as effects do.
        ratios: of forces to the controlled one.
        control: a force, of which the sign counts, or the displacement of its point from the drawing.
        idle: spins that nothing resists.
    """
    rigid = model.linkage.rigid
    strong = [*_dead_forces(model, dict(constant)), *_effects(model)]
    weak: list[PosePotential] = []
    if control.constrained:
        weak = [TravelSpring([*_dead_forces(model, ratios)], control.prescribed)]
    elif control.prescribed:
        sense = math.copysign(1.0, control.prescribed)
        weak = [*_dead_forces(model, {force: sense * ratio for force, ratio in ratios.items()})]
    levels = (model.spring_potentials, strong, weak)

    def search() -> tuple[np.ndarray | None, bool]:
        poses = RestSearch().pose(rigid, unloaded.poses, motors, levels)
        if poses is None:
            return None, False
        loads = [potential for level in levels for potential in level]
        return poses, not count_freedom(rigid, poses, motors, loads, idle).zero_energy

    # of one process: decisions that depend on rounding are the same on all
    poses, held = from_one(model.mesh.mesh.comm, search)
    if poses is None or np.array_equal(poses, unloaded.poses):
        return RestStart(unloaded, held)
    rest = model.assembled_state(poses, unloaded.motors)
    return RestStart(replace(unloaded, u=rest.u, poses=poses), held)


def _dead_forces(model: MechanismModel, forces: Mapping[Force, float]) -> Iterator[DeadForce]:
    for force, magnitude in forces.items():
        if magnitude:
            point = model.linkage.point(force.on, model.rest_position(force).tolist())
            yield DeadForce(point, magnitude * np.array(in_dimension(force.direction, model.linkage.dim)))


def _effects(model: MechanismModel) -> Iterator[PosePotential]:
    """Potentials of effects that grow with the load factor: on poses, and on links.

    Nodal forces f_i of a link act as their sum F, at the point whose work is theirs if all have one direction:

        Σ f_i ⊗ (X_i − c) = F ⊗ d,     d = (Σ f_i ⊗ (X_i − c))ᵀ F / |F|².
    """
    yield from (potential for potential in model.potentials if not potential.holds)
    elastic, linkage = model.elastic, model.linkage
    if not elastic.depends_on_load_factor:
        return
    owned, dim, comm = model.interfaces.owned, linkage.dim, model.mesh.mesh.comm
    nodal = -elastic.load_factor_residuals()[: owned * model.interfaces.block].reshape(owned, -1)[:, :dim]
    positions = elastic.drawn_nodes[:owned, :dim] + model.design_nodes.values(elastic.design)[:owned, :dim]
    for index, (body, *_) in enumerate(linkage.interfaces.values()):
        nodes = np.flatnonzero(model.node_link[:owned] == index)
        offsets = positions[nodes] - np.array(linkage.bodies[body].centre)
        own = np.concatenate(
            [nodal[nodes].sum(axis=0), (nodal[nodes].T @ offsets).ravel(), [np.abs(nodal[nodes]).sum()]]
        )
        total = comm.allreduce(own, op=MPI.SUM)
        force, moment = total[:dim], total[dim:-1].reshape(dim, dim)
        if np.linalg.norm(force) > _BALANCED * total[-1]:
            at = BodyPoint(body, moment.T @ force / (force @ force), linkage.joints.space)
            yield DeadForce(at, force)
