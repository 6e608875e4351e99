"""A bowed strip whose clamped ends motors turn until it snaps through."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, pi

import numpy as np
from mpi4py import MPI

import fenicsmech as fm

from ..oracles import beam, centreline
from .case import PLANE, Check, Fact, HardCase, deviation

SPAN, RISE, THICKNESS, DEPTH, YOUNG = 60.0, 6.0, 1.0, 2.0, 1000.0
BLOCK = 2.0  # of the strip, straight, in either clamp
POINTS = [
    *((-BLOCK, 0.0), (-0.5 * BLOCK, 0.0)),
    *((x, 0.5 * RISE * (1.0 - cos(2.0 * pi * x / SPAN))) for x in np.linspace(0.0, SPAN, 25)),
    *((SPAN + 0.5 * BLOCK, 0.0), (SPAN + BLOCK, 0.0)),
]


def bowed_beam(poisson: float) -> beam.Beam:
    line = centreline.through(POINTS).trimmed(BLOCK, BLOCK)
    section = beam.Section.rectangle(young=YOUNG, poisson=poisson, thickness=THICKNESS, depth=DEPTH)
    return beam.Beam(line, section, (0.0, 0.0), (SPAN, 0.0))


def turned(line: beam.Beam, left: float, right: float, initial: beam.BeamSolution | None = None) -> beam.BeamSolution:
    """The beam with its ends turned outwards, downwards."""
    start, end = beam.End(x=0.0, y=0.0, rotation=-left), beam.End(x=0.0, y=0.0, rotation=right)
    return beam.solve(line, start, end, initial=initial)


def largest_turn(line: beam.Beam, below: float) -> float:
    """Largest angle of the ends: the angle as a function of the moment at either end, on from ``below``."""
    solution, angles = turned(line, below, below), []
    for moment in solution.end.moment - np.linspace(0.0, 2.0, 81):
        ends = (beam.End(x=0.0, y=0.0, moment=sign * moment) for sign in (-1.0, 1.0))
        solution = beam.solve(line, *ends, initial=solution)
        angles.append(solution.end.rotation)
    assert 0 < np.argmax(angles) < 80
    return max(angles)


def _snap(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """Up to the fold the bow stays up; beyond it, only the equilibrium that hangs down is left.

    That one the beam reaches without a snap if one end is turned far before the other.
    """
    poisson = 0.3 if space == PLANE else 0.0
    mechanism = fm.Mechanism("bow")
    base, left, right = mechanism.rigid("base", fixed=True), mechanism.rigid("left"), mechanism.rigid("right")
    shape = fm.strip(POINTS, thickness=THICKNESS, depth=DEPTH)
    bow = mechanism.flexible("bow", shape, fm.Material("plastic", YOUNG, poisson))
    motors = [mechanism.motor(mechanism.revolute(base, left, at=(0, 0)))]
    motors += [mechanism.motor(mechanism.revolute(base, right, at=(SPAN, 0)))]
    clamp = fm.Rectangle(BLOCK, 2.0 * THICKNESS)
    mechanism.weld(left, bow, at=(-0.5 * BLOCK, 0), region=clamp)
    mechanism.weld(bow, right, at=(SPAN + 0.5 * BLOCK, 0), region=clamp)
    crown = mechanism.force(on=bow, at=(0.5 * SPAN, RISE), direction=(0, -1))
    scene = fm.Scene(mechanism)
    simulation = fm.Simulation(scene, space=space, size=THICKNESS if space == PLANE else 2.0 * THICKNESS, comm=comm)

    def simulated(angle: float) -> fm.Frame:
        turned = scene.configuration(f"{angle:.4f} rad", dict(zip(motors, (-angle, angle), strict=True)))
        return simulation.load_displacement(crown, forces=[0.0], configuration=turned).frames[0]

    line = bowed_beam(poisson)
    largest = largest_turn(line, 0.48)
    before = [share * largest for share in (0.6, 0.99)]
    frames = [simulated(angle) for angle in before]
    wanted = [turned(line, angle, angle).end.moment for angle in before]
    found = [(-frame.motors[motors[0]], frame.motors[motors[1]]) for frame in frames]
    yield deviation("both torques up to 0.99 of the fold", found, np.column_stack([wanted, wanted]), 1e-2)
    yield Fact(
        "stable there, nothing snapped through", all(frame.stable and not frame.snapped_through for frame in frames)
    )
    beyond = [1.01 * largest, 1.2 * largest]
    hanging, wanted = turned(line, 0.0, 2.0 * largest), []
    for angle in beyond[::-1]:
        hanging = turned(line, angle, angle, hanging)
        wanted.insert(0, (hanging.end.moment, hanging.position[len(hanging.position) // 2, 1]))
    frames = [simulated(angle) for angle in beyond]
    found = [frame.motors[motors[1]] for frame in frames]
    yield deviation("torques beyond: of the bow that hangs down", found, [torque for torque, _ in wanted], 2e-2)
    heights = []
    for frame in frames:
        simulation.model.load(frame.state)
        heights.append(RISE - simulation.model.travel(crown, frame.state))
    yield deviation("its crown", heights, [height for _, height in wanted], 1e-2, scale=RISE)
    yield Fact("stable as well", all(frame.stable for frame in frames))


CASES = (HardCase("clamps turned until the bow snaps", "motors lead past a fold, against the beam", _snap),)
