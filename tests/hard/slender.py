"""Links that are far easier to bend than to stretch, and links a million times softer than their neighbours."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, sin

import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

import fenicsmech as fm

from ..oracles import beam, centreline
from .case import PLANE, SPACE, Check, HardCase, deviation, travel

YOUNG, POISSON, DEPTH = 2000.0, 0.3, 4.0
SLENDERNESS = {PLANE: (30, 100, 500), SPACE: (30, 500)}  # length over thickness
CELL = {PLANE: {30: 1.0, 100: 1.0, 500: 4.0}, SPACE: {30: 2.0, 500: 10.0}}  # its length over the thickness


def section(thickness: float, *, depth: float = DEPTH, young: float = YOUNG, poisson: float = POISSON) -> beam.Section:
    """The beam section of a strip."""
    return beam.Section.rectangle(young=young, poisson=poisson, thickness=thickness, depth=depth)


def cantilever(space: str, comm: MPI.Comm, *, length: float, thickness: float, depth: float, poisson: float = POISSON):
    """A straight link clamped at x < 0 between base and, at x > ``length``, a hand with the force across it."""
    mechanism = fm.Mechanism("cantilever")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    clamp = fm.Rectangle(2.0 * thickness, 2.0 * thickness)
    shape = fm.strip([(-2.0 * thickness, 0), (length + 2.0 * thickness, 0)], thickness=thickness, depth=depth)
    link = mechanism.flexible("link", shape, fm.Material("plastic", YOUNG, poisson))
    mechanism.weld(base, link, at=(-thickness, 0), region=clamp)
    mechanism.weld(link, hand, at=(length + thickness, 0), region=clamp)
    push = mechanism.force(on=hand, at=(length, 0), direction=(0, 1))
    along = mechanism.output(on=hand, at=(length, 0), direction=(1, 0))
    size = CELL[space][round(length / thickness)] * thickness
    return fm.Simulation(fm.Scene(mechanism), space=space, size=size, comm=comm), push, along


def _slender_cantilever(space: str, comm: MPI.Comm) -> Iterator[Check]:
    for slenderness in SLENDERNESS[space]:
        length = 100.0
        thickness = length / slenderness
        # as deep as thick, and without lateral contraction, which no clamp then hinders
        poisson, depth = (POISSON, DEPTH) if space == PLANE else (0.0, thickness)
        stiffness = section(thickness, depth=depth, poisson=poisson)
        simulation, push, along = cantilever(
            space, comm, length=length, thickness=thickness, depth=depth, poisson=poisson
        )
        forces = [parameter * stiffness.bending / length**2 for parameter in (0.1, 2.0)]
        line, found, wanted = beam.Beam(centreline.straight((0, 0), (length, 0)), stiffness), [], []
        for frame in simulation.load_displacement(push, forces=forces).frames:
            found.append((frame.outputs[along], frame.displacement))
            wanted.append(beam.solve(line, beam.CLAMPED, beam.End(force_y=frame.force)).end.displacement)
        yield deviation(f"tip of 1/{slenderness}", found, wanted, 2e-3)


def _slender_rocker(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """Crank on a motor, rigid coupler, and a rocker clamped to the ground that bends as the crank turns.

    The rocker's end moves on a circle about the crank pin and is pulled along the coupler: the coupler's angle is
    the root of the beam's end force across it.
    """
    crank, coupler, length, turn = 20.0, 50.0, 80.0, 0.5
    for slenderness in SLENDERNESS[space]:
        thickness = length / slenderness
        poisson, depth = (POISSON, DEPTH) if space == PLANE else (0.0, thickness)
        mechanism = fm.Mechanism("four-bar")
        base, wheel, bar, foot = (
            mechanism.rigid("base", fixed=True),
            *map(mechanism.rigid, ("crank", "coupler", "hand")),
        )
        shape = fm.strip(
            [(coupler, -2.0 * thickness), (coupler, length + 2.0 * thickness)], thickness=thickness, depth=depth
        )
        rocker = mechanism.flexible("rocker", shape, fm.Material("plastic", YOUNG, poisson))
        clamp = fm.Rectangle(2.0 * thickness, 2.0 * thickness)
        motor = mechanism.motor(mechanism.revolute(base, wheel, at=(0, length - crank)))
        mechanism.revolute(wheel, bar, at=(0, length))
        mechanism.revolute(bar, foot, at=(coupler, length))
        mechanism.weld(base, rocker, at=(coupler, -thickness), region=clamp)
        mechanism.weld(rocker, foot, at=(coupler, length + thickness), region=clamp)
        push = mechanism.force(on=foot, at=(coupler, length), direction=(1, 0))
        scene = fm.Scene(mechanism)
        size = CELL[space][slenderness] * thickness
        simulation = fm.Simulation(scene, space=space, size=size, comm=comm)
        turned = scene.configuration("turned", {motor: turn})
        frame = simulation.load_displacement(push, forces=[0.0], configuration=turned).frames[0]

        line = beam.Beam(
            centreline.straight((coupler, 0), (coupler, length)), section(thickness, depth=depth, poisson=poisson)
        )
        pin = np.array([-crank * sin(turn), crank * (cos(turn) - 1.0)])  # displacement of the crank pin
        end = _end_on_coupler(line, pin, coupler)
        arm = np.array([-crank * sin(turn), crank * cos(turn)])
        torque = arm[0] * end.force[1] - arm[1] * end.force[0]
        yield deviation(f"rocker 1/{slenderness}: pin", travel(simulation, push, frame), end.displacement[0], 1e-3)
        yield deviation(f"rocker 1/{slenderness}: torque", frame.motors[motor], torque, 5e-3)


def _end_on_coupler(line: beam.Beam, pin: np.ndarray, coupler: float) -> beam.EndState:
    """The rocker's end, drawn ``coupler`` beside the crank pin that moved by ``pin`` (2,)."""

    def bent(angle: float) -> tuple[beam.EndState, float]:
        """The rocker pulled along a coupler at ``angle``, and how far its end is beside the coupler's."""
        along, across = np.array([cos(angle), sin(angle)]), np.array([-sin(angle), cos(angle)])
        reach = pin + coupler * (along - (1.0, 0.0))
        end = beam.solve(line, beam.CLAMPED, beam.End(x=reach @ along, axes=angle)).end
        return end, (end.displacement - reach) @ across

    return bent(brentq(lambda angle: bent(angle)[1], -0.2, 0.2, xtol=1e-12))[0]


CONTRAST = {"silicone": 1.9, "Onyx": 1770.0, "hard": 1.9e6}


def _contrast(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """Three links in series, each clamped between carriages that slide across it only, and a rigid lever at the end."""
    length, thickness = 30.0, 1.0
    poisson, depth = (POISSON, DEPTH) if space == PLANE else (0.0, 1.0)
    mechanism = fm.Mechanism("series")
    before, clamp = mechanism.rigid("base", fixed=True), fm.Rectangle(2.0 * thickness, 2.0 * thickness)
    base, outputs, start = before, {}, 0.0
    for name, young in CONTRAST.items():
        end = start + length
        carriage = mechanism.rigid(f"carriage of {name}")
        shape = fm.strip([(start - 2.0, 0), (end + 2.0, 0)], thickness=thickness, depth=depth)
        link = mechanism.flexible(name, shape, fm.Material(name, young, poisson))
        mechanism.weld(before, link, at=(start - 1.0, 0), region=clamp)
        mechanism.weld(link, carriage, at=(end + 1.0, 0), region=clamp)
        mechanism.prismatic(base, carriage, at=(end, 0), axis=(0, 1))
        outputs[name] = mechanism.output(on=carriage, at=(end, 0), direction=(0, 1))
        before, start = carriage, end + 10.0
    push = mechanism.force(on=before, at=(start, 0), direction=(0, 1))
    simulation = fm.Simulation(fm.Scene(mechanism), space=space, size=CELL[space][30] * thickness, comm=comm)
    bending = section(thickness, depth=depth, poisson=poisson, young=CONTRAST["silicone"]).bending
    force = 12.0 * bending / length**3 * 3.0  # the softest moves by a tenth of its length, were it linear
    frame = simulation.load_displacement(push, forces=[force]).frames[0]
    reached = 0.0
    for name, young in CONTRAST.items():
        stiffness = section(thickness, depth=depth, poisson=poisson, young=young)
        line = beam.Beam(centreline.straight((0, 0), (length, 0)), stiffness)
        wanted = beam.solve(line, beam.CLAMPED, beam.End(x=0.0, rotation=0.0, force_y=force)).end.displacement[1]
        yield deviation(name, frame.outputs[outputs[name]] - reached, wanted, 5e-3)
        reached = frame.outputs[outputs[name]]


CASES = (
    HardCase(
        "slender cantilever",
        "thickness/length down to 1/500: bending a million times softer than stretching",
        _slender_cantilever,
    ),
    HardCase(
        "slender rocker of a four-bar",
        "a motor bends a clamped rocker, thickness/length down to 1/500",
        _slender_rocker,
    ),
    HardCase(
        "silicone beside Onyx beside hard beside rigid", "stiffness contrast 1e6 in series, against beams", _contrast
    ),
)
