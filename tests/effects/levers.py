"""A rigid lever or sled on the ground, held by what an effect adds, and loaded (mm, N, MPa)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy.spatial.transform import Rotation

import fenicsmech as fm
from fenicsmech.mechanism import Effect, Force, Joint

ARM = 40.0
PLASTIC = fm.Material("plastic", 2000.0, 0.35)
UPRIGHT = Rotation.identity()
TILTED = Rotation.from_rotvec([0.4, -0.7, 0.5])

MakeEffects = Callable[[Joint], list[Effect]]


@dataclass(frozen=True, eq=False)
class Loaded:
    """A simulation, the joint of interest and the force."""

    simulation: fm.Simulation
    joint: Joint
    force: Force


def lever(
    effects: MakeEffects,
    *,
    space: str = "plane-stress",
    pushed: float = 0.5 * np.pi,
    frame: Rotation = UPRIGHT,
    swapped: bool = False,
    comm: MPI.Comm = MPI.COMM_SELF,
) -> Loaded:
    """A lever along x on a hinge at the origin, with a dead force at its end at the angle ``pushed`` to it.

    Args:
        effects: what acts on the hinge.
        space: as of a simulation.
        pushed: rad.
        frame: turns lever, axis and force together.
        swapped: name the lever first and the ground second.
        comm: processes.
    """
    dim = 3 if space == "3d" else 2
    mechanism = fm.Mechanism("lever")
    base, arm = mechanism.rigid("base", fixed=True), mechanism.rigid("lever")
    _unloaded_leaf(mechanism, base)
    ends = (arm, base) if swapped else (base, arm)
    axis = {"axis": frame.apply([0.0, 0.0, 1.0])} if dim == 3 else {}
    hinge = mechanism.revolute(*ends, at=(0, 0), **axis)
    end, along = frame.apply([[ARM, 0.0, 0.0], [np.cos(pushed), np.sin(pushed), 0.0]])[:, :dim]
    push = mechanism.force(on=arm, at=end, direction=along)
    return _simulate(mechanism, effects(hinge), hinge, push, space, comm)


def sled(effects: MakeEffects, *, space: str = "plane-stress", angle: float = 0.0) -> Loaded:
    """A sled on a slider at ``angle`` to x, pushed along x."""
    mechanism = fm.Mechanism("sled")
    base, body = mechanism.rigid("base", fixed=True), mechanism.rigid("sled")
    _unloaded_leaf(mechanism, base)
    slider = mechanism.prismatic(base, body, at=(0, 0), axis=(np.cos(angle), np.sin(angle)))
    push = mechanism.force(on=body, at=(5, 5), direction=(1, 0))
    return _simulate(mechanism, effects(slider), slider, push, space, MPI.COMM_SELF)


def _unloaded_leaf(mechanism: fm.Mechanism, base) -> None:
    """A flexible link without load: a simulation needs one."""
    leaf = mechanism.flexible("leaf", fm.strip([(0, -30), (20, -30)], thickness=6.0, depth=6.0), PLASTIC)
    mechanism.weld(base, leaf, at=(3, -30), interface_radius=2.0)


def _simulate(mechanism, effects, joint: Joint, force: Force, space: str, comm: MPI.Comm) -> Loaded:
    scene = fm.Scene(mechanism, effects=effects)
    return Loaded(fm.Simulation(scene, space=space, order=1, size=6.0, comm=comm), joint, force)
