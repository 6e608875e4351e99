"""A mechanism with something of everything, and states of it in which nothing is zero, small or special."""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import Control, DisplacementControl, EquilibriumSystem, LoadControl, State
from fenicsmech.mechanism import Force

from ..joints.poses import carry

SIZE = 3.0
RUBBER = fm.Material("rubber", 2.0, 0.4)


@dataclass(frozen=True)
class Crowded:
    """The mechanism's simulation, and forces on a rigid link and on a point of a flexible one."""

    simulation: fm.Simulation
    on_rigid: Force
    on_flexible: Force


def crowded(space: str, comm: MPI.Comm = MPI.COMM_SELF, *, rubber: fm.Material | None = None) -> Crowded:
    """Parallelogram of rigid links with a motor, a flexible third leg (redundant) and a flexible diagonal.

    A leg of ``rubber`` is in the u–p formulation.
    """
    mechanism = fm.Mechanism("crowded")
    base = mechanism.rigid("base", fixed=True)
    left, right, tip, plate, slide = (mechanism.rigid(name) for name in ("left", "right", "tip", "plate", "slide"))
    leg = mechanism.flexible("leg", fm.strip([(8, 0), (8, 16)], thickness=4.0, depth=5.0), rubber or RUBBER)
    diagonal = mechanism.flexible("diagonal", fm.strip([(0, 0), (10, 6), (16, 16)], thickness=4.0, depth=5.0), RUBBER)
    shaft = mechanism.revolute(base, left, at=(0, 0))
    mechanism.revolute(base, right, at=(16, 0))
    mechanism.revolute(left, tip, at=(0, 16))
    mechanism.revolute(right, tip, at=(16, 16))
    mechanism.weld(base, diagonal, at=(0, 0), interface_radius=2.5)
    mechanism.weld(diagonal, slide, at=(16, 16), interface_radius=2.5)
    mechanism.prismatic(slide, tip, at=(16, 16), axis=(0.8, 0.6))
    planar = space != "3d"
    if planar:
        mechanism.revolute(base, leg, at=(8, 0), interface_radius=2.5)
        mechanism.revolute(leg, tip, at=(8, 16), interface_radius=2.5)
        mechanism.revolute(plate, right, at=(20, 8))
    else:
        mechanism.universal(base, leg, at=(8, 0), axis=(0, 0, 1), interface_radius=2.5)
        mechanism.spherical(leg, tip, at=(8, 16), interface_radius=2.5)
        mechanism.cylindrical(plate, right, at=(20, 8), axis=(0, 0.6, 0.8))
        mechanism.planar(plate, tip, at=(24, 12), axis=(0.6, 0, 0.8))
    mechanism.motor(shaft)
    across = (0.8, 0.6) if planar else (0.48, 0.6, 0.64)
    on_rigid = mechanism.force(on=plate, at=(22, 9), direction=across, name="on rigid")
    on_flexible = mechanism.force(on=leg, at=(8.3, 8.7), direction=across[::-1], name="on flexible")
    order = 2 if rubber else 1
    simulation = fm.Simulation(fm.Scene(mechanism), space=space, order=order, size=SIZE, comm=comm)
    return Crowded(simulation, on_rigid, on_flexible)


def system_of(case: Crowded, *, controlled: Force) -> EquilibriumSystem:
    """The equilibrium equations with one force ``controlled`` and the other one fixed."""
    model = case.simulation.model
    other = case.on_flexible if controlled is case.on_rigid else case.on_rigid
    return model.system(model.point_load(controlled), [model.point_load(other)])


def control_of(kind: type[Control]) -> Control:
    """A control whose target ``random_state`` misses."""
    return kind({LoadControl: 1.3, DisplacementControl: 2.0}[kind])


def random_state(case: Crowded, system: EquilibriumSystem, *, seed: int = 5) -> State:
    """Links anywhere, flexible ones bent by no more than their cells bear, all multipliers at work (collective)."""
    random = np.random.default_rng(seed)
    linkage, model = case.simulation.linkage, case.simulation.model
    space, joints = linkage.joints.space, linkage.joints
    centres = np.array([body.centre for body in linkage.bodies])

    def pose(shift: float, turn: float) -> np.ndarray:
        rotation = turn * random.uniform(0.5, 1.0, space.rotation_size) * random.choice([-1, 1], space.rotation_size)
        moved = np.concatenate([random.uniform(-shift, shift, space.dim), rotation])
        return space.retract(moved + space.identity)

    poses = np.array([pose(5.0, 0.8) for _ in linkage.bodies])
    poses[[i for i, body in enumerate(linkage.bodies) if body.fixed]] = space.identity
    for group in linkage.interfaces.values():
        for body in group[1:]:
            lever = centres[body] - centres[group[0]]
            poses[body] = carry(space, poses[group[0]], pose(0.1 * SIZE, 0.05), lever)
    motors = np.where([c.motor is not None for c in joints.connections], 0.7, 0.0)
    carried = model.assembled_state(poses, motors)
    # the same field on any number of ranks: a function of position
    block = model.interfaces.block
    positions = model.elastic.u.function_space.tabulate_dof_coordinates()[: model.interfaces.owned, :block]
    waves, phases = random.uniform(0.2, 0.5, (block, block)), random.uniform(0.0, 6.0, block)
    wave = 0.1 * SIZE * np.sin(positions @ waves.T + phases).ravel()
    u = carried.u + np.concatenate([wave, np.zeros(len(carried.u) - len(wave))])
    if model.elastic.pressure is not None:
        places = model.elastic.pressure.p.function_space.tabulate_dof_coordinates()[: len(carried.u) - len(wave)]
        u[len(wave) :] = np.where(model.elastic.pressure.unknown, np.cos(places @ np.array([0.3, 0.4, 0.5])), 0.0)
    multipliers = (
        system.blocks.restrict_border(system.unknowns.scale).multipliers * 0.1 * random.standard_normal(joints.rows)
    )
    return State(u, poses, multipliers, 1.3, motors, constant=np.array([0.7]))
