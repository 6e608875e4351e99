"""Strains of 1e-9 and of 2, and motors that turn twice: nothing is lost in rounding, nothing is left behind."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi

import numpy as np
from mpi4py import MPI

import fenicsmech as fm

from .case import PLANE, SPACE, Check, Deviation, Fact, HardCase, deviation

YOUNG = 1770.0


def crane(space: str, comm: MPI.Comm, *, axis=(0, 0, 1)):
    """A motor-driven hub with a beam clamped to it and a loaded hand at the beam's end."""
    mechanism = fm.Mechanism("crane")
    base, hub, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hub"), mechanism.rigid("hand")
    beam = mechanism.flexible("beam", fm.strip([(0, 0), (40, 0)], thickness=4.0, depth=4.0), fm.ONYX)
    motor = mechanism.motor(mechanism.revolute(base, hub, at=(0, 0), axis=axis))
    for link, x in ((hub, 0.0), (hand, 40.0)):
        mechanism.weld(link, beam, at=(x, 0), region=fm.Rectangle(4.0, 5.0))
    push = mechanism.force(on=hand, at=(40, 0), direction=(0, 1))
    scene = fm.Scene(mechanism)
    return fm.Simulation(scene, space=space, size=4.0, comm=comm), push, motor


def _tiny_strain(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """Displacements under 1 and 2 units of a force that strains the link by 1e-9 are 1 : 2 up to that strain.

    Nodes of a link that a motor has carried along by 70 mm are stored to 7e-15 mm; over the 2 mm between them that is
    a strain of 5e-15, 5e-6 of the largest one here. A few of those is what can be asked for.
    """
    simulation, push, motor = crane(space, comm)
    strain, arm, modulus = 1e-9, 36.0, 4.0**3 / 6.0  # largest bending strain; lever arm; section modulus
    force = strain * YOUNG * modulus / arm
    turned = simulation.scene.configuration("turned", {motor: 2.0})
    for where, configuration, bound in (("as drawn", fm.DRAWN, 1e-8), ("turned by 2 rad", turned, 3e-5)):
        curve = simulation.load_displacement(push, forces=[force, 2.0 * force], configuration=configuration)
        single, double = curve.displacements
        yield deviation(f"{where}: half the displacement under half the force", 2.0 * single, double, bound)
    drawn = simulation.load_displacement(push, forces=[force, 1e5 * force]).displacements
    yield deviation("as under 1e5 times the force", 1e5 * drawn[0], drawn[1], 1e-5)


def _large_strain(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """Without lateral contraction a block stretches evenly: P = E/2 (λ − 1/λ), W = E/4 (λ² − 1 − 2 ln λ)."""
    mechanism = fm.Mechanism("block")
    base, carriage = mechanism.rigid("base", fixed=True), mechanism.rigid("carriage")
    shape = fm.polygon([(-2, -2), (14, -2), (14, 2), (-2, 2)], depth=4.0)
    block = mechanism.flexible("block", shape, fm.Material("cork", 2.0, 0.0))
    mechanism.weld(base, block, at=(-1, 0), region=fm.Rectangle(2.0, 6.0))
    mechanism.weld(block, carriage, at=(13, 0), region=fm.Rectangle(2.0, 6.0))
    mechanism.prismatic(base, carriage, at=(13, 0), axis=(1, 0))
    pull = mechanism.force(on=carriage, at=(13, 0), direction=(1, 0))
    simulation = fm.Simulation(fm.Scene(mechanism), space=space, size=2.0, comm=comm)
    stretches = np.array([3.0, 0.5])
    for control in ("displacements", "forces"):
        forces = 16.0 * (stretches - 1.0 / stretches)
        samples = 12.0 * (stretches - 1.0) if control == "displacements" else forces
        curve = simulation.load_displacement(pull, **{control: samples})
        yield deviation("force", curve.forces, forces, 1e-8)
        yield deviation("stretch 3 and 1/2", 1.0 + curve.displacements / 12.0, stretches, 1e-8)
        energies = 2.0 / 4.0 * (stretches**2 - 1.0 - 2.0 * np.log(stretches)) * 12.0 * 16.0
        yield deviation("energy", [frame.strain_energy for frame in curve.frames], energies, 1e-8)


def _two_turns(space: str, comm: MPI.Comm) -> Iterator[Check]:
    axis = (0, 0, 1) if space == PLANE else (0.2, 0.3, 1.0)
    simulation, push, motor = crane(space, comm, axis=axis)
    force, scene = 4.0, simulation.scene
    reference = simulation.load_displacement(push, forces=[force]).frames[0]
    size = abs(reference.displacement)
    for turns in (1, 2, -2):
        configuration = scene.configuration(f"{turns} turns", {motor: 2.0 * pi * turns})
        frame = simulation.load_displacement(push, forces=[force], configuration=configuration).frames[0]
        yield deviation("displacement after 360° and ±720°", frame.displacement, reference.displacement, 1e-9)
        yield deviation("torque", frame.motors[motor], reference.motors[motor], 1e-9)
        if space == SPACE:
            norms = np.linalg.norm(frame.state.poses[:, 3:], axis=1)
            yield Deviation("norm of the quaternions", float(np.max(np.abs(norms - 1.0))), 1e-12)
            sign = (-1.0) ** turns
            moving = simulation.linkage.joints.free_bodies
            found, wanted = (each.state.poses[moving, 3:] for each in (frame, reference))
            yield deviation("quaternions", sign * found, wanted, 1e-9)
        if turns == 2:
            yield deviation("whole state after 720°", frame.state.u, reference.state.u, 1e-9, scale=size)
    steps = np.array([pi - 1e-3, pi - 1e-6, pi, pi + 1e-6, pi + 1e-3])
    frames = [
        simulation.load_displacement(
            push, forces=[force], configuration=scene.configuration("half a turn", {motor: step})
        ).frames[0]
        for step in steps
    ]
    displacements = np.array([frame.displacement for frame in frames])
    # a smooth function of the angle: the parabola through the outer three gives the other two
    inner = np.polyval(np.polyfit(steps[[0, 2, 4]] - pi, displacements[[0, 2, 4]], 2), steps[[1, 3]] - pi)
    yield deviation("smooth through 180°", displacements[[1, 3]], inner, 1e-8)
    yield Fact("all stable", all(frame.stable for frame in frames))


CASES = (
    HardCase("tiny strain", "strains of 1e-9 of a stiff link, also after a motor carried it along", _tiny_strain),
    HardCase(
        "large strain",
        "uniaxial stretch 3 and compression to a half in one step, against the closed form",
        _large_strain,
    ),
    HardCase("two turns of a motor", "motor turns by 720° with a bent link on it; quaternions pass ±π", _two_turns),
)
