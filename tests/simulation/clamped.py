"""Straight flexible links clamped at their root, as slender as a beam, and how far their points have moved."""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.mechanism import Force, Motor, Output

YOUNG = 12000.0


@dataclass(frozen=True)
class Clamped:
    """A simulation with the force at the tip, outputs along the axes there and, if there is one, the motor."""

    simulation: fm.Simulation
    force: Force
    outputs: tuple[Output, ...]
    motor: Motor | None
    bending: float

    def tip(self, frame: fm.Frame) -> np.ndarray:
        """Displacement of the tip from where it was drawn, (dim,)."""
        model = self.simulation.model
        model.load(frame.state)
        return model.point(self.outputs[0]).displacement(model.elastic.u, frame.state.poses)


def cantilever(
    space: str,
    *,
    length: float = 100.0,
    thickness: float = 1.0,
    depth: float = 1.0,
    poisson: float = 0.0,
    size: float | None = None,
    rigid_tip: bool = True,
    driven: bool = False,
    comm: MPI.Comm = MPI.COMM_SELF,
) -> Clamped:
    """The elastic link from x = 0 to ``length``, between blocks that clamp it outside of that.

    Args:
        rigid_tip: the force acts on a rigid hand clamped to the end, else on the end itself.
        driven: a motor turns the hand, which slides freely along x and y.
    """
    block = thickness
    mechanism = fm.Mechanism("cantilever")
    base = mechanism.rigid("base", fixed=True)
    end = length + block if rigid_tip else length
    shape = fm.strip([(-block, 0), (end, 0)], thickness=thickness, depth=depth)
    beam = mechanism.flexible("beam", shape, fm.Material("steel", YOUNG, poisson))
    clamp = fm.Rectangle(block, 1.5 * thickness)
    mechanism.weld(base, beam, at=(-0.5 * block, 0), region=clamp)
    loaded = beam
    if rigid_tip:
        loaded = mechanism.rigid("hand")
        mechanism.weld(beam, loaded, at=(length + 0.5 * block, 0), region=clamp)
    motor = None
    if driven:
        cart, lift = mechanism.rigid("cart"), mechanism.rigid("lift")
        mechanism.prismatic(base, cart, at=(length, 0), axis=(1, 0))
        mechanism.prismatic(cart, lift, at=(length, 0), axis=(0, 1))
        motor = mechanism.motor(mechanism.revolute(lift, loaded, at=(length, 0)))
    force = mechanism.force(on=loaded, at=(length, 0), direction=(0, 1), name="tip load")
    outputs = tuple(
        mechanism.output(on=loaded, at=(length, 0), direction=direction, name=name)
        for name, direction in (("x", (1, 0)), ("y", (0, 1)))
    )
    simulation = fm.Simulation(fm.Scene(mechanism), space=space, size=size or thickness, comm=comm)
    modulus = YOUNG / (1.0 - poisson**2) if space == "plane-strain" else YOUNG
    return Clamped(simulation, force, outputs, motor, modulus * depth * thickness**3 / 12.0)
