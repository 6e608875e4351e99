"""Linkages at and near their singular positions, with more constraints than they need, and with fewer."""

from __future__ import annotations

from collections.abc import Iterator
from math import acos, pi

import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

import fenicsmech as fm
from fenicsmech.mechanism import Link
from fenicsmech.multibody import assemble, count_freedom

from ..multibody.machine import point_of
from ..multibody.spatial_machines import Bennett
from ..multibody.test_closing_loops import LAST, START, STOPPED
from .case import PLANE, SPACE, Check, Deviation, Fact, HardCase, deviation, travel

SOFT = fm.Material("soft plastic", 200.0, 0.3)


def _dead_centre(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """Slider-crank with a flexible rod: what the slider is pushed with reaches the motor by the line of the pins."""
    crank, rod = 10.0, 30.0
    start = 0.8
    pin = crank * np.array([np.cos(start), np.sin(start)])
    stroke = pin[0] + np.sqrt(rod**2 - pin[1] ** 2)
    mechanism = fm.Mechanism("slider-crank")
    base, wheel, slider = mechanism.rigid("base", fixed=True), mechanism.rigid("crank"), mechanism.rigid("slider")
    bar = mechanism.flexible("rod", fm.strip([tuple(pin), (stroke, 0)], thickness=3.0, depth=6.0), SOFT)
    motor = mechanism.motor(mechanism.revolute(base, wheel, at=(0, 0)))
    mechanism.revolute(wheel, bar, at=pin, interface_radius=2.0)
    mechanism.revolute(bar, slider, at=(stroke, 0), interface_radius=2.0)
    mechanism.prismatic(base, slider, at=(stroke, 0), axis=(1, 0))
    push = mechanism.force(on=slider, at=(stroke, 0), direction=(-1, 0))
    scene = fm.Scene(mechanism)
    simulation = fm.Simulation(scene, space=space, order=1, size=3.0, comm=comm)

    def driven(turn: float) -> fm.Frame:
        configuration = scene.configuration(f"turned by {turn:g}", {motor: turn})
        return simulation.load_displacement(push, forces=[1.0], configuration=configuration).frames[0]

    for angle in (0.0, pi, 1e-6, 2.0):
        frame = driven(angle - start)
        at = crank * np.array([np.cos(angle), np.sin(angle)])
        across = np.array([stroke - travel(simulation, push, frame), 0.0]) - at
        pull = -across / across[0]  # on the crank pin, for a unit push
        torque = pull[0] * at[1] - pull[1] * at[0]
        yield deviation("torque at and beside dead centres", frame.motors[motor], torque, 1e-9, scale=crank)
    once, again = driven(1.0), driven(1.0 + 2.0 * pi)
    yield deviation("the same after a turn through both", again.displacement, once.displacement, 1e-9)


def _change_point(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """A parallelogram with a flexible coupler, driven through its flat positions, and pushed across in one.

    Flat and with its crank held, nothing but its stretch holds the coupler: N = k e, e the growth of the pins'
    distance, balances a force across at the far pin in the deformed position only.
    """
    crank, coupler, start = 20.0, 40.0, 0.7
    pin = crank * np.array([np.cos(start), np.sin(start)])
    far = pin + (coupler, 0.0)
    mechanism = fm.Mechanism("parallelogram")
    base, wheel, rocker = mechanism.rigid("base", fixed=True), mechanism.rigid("crank"), mechanism.rigid("rocker")
    link = mechanism.flexible("coupler", fm.strip([tuple(pin), tuple(far)], thickness=3.0, depth=6.0), SOFT)
    motor = mechanism.motor(mechanism.revolute(base, wheel, at=(0, 0)))
    mechanism.revolute(wheel, link, at=pin, interface_radius=1.5)
    mechanism.revolute(link, rocker, at=far, interface_radius=1.5)
    mechanism.revolute(base, rocker, at=(coupler, 0))
    turned = -start  # flat: from (20, 0) to (60, 0), the rocker from (40, 0)
    # the force is dead: across the flat parallelogram, on the rocker's pin
    push = mechanism.force(on=rocker, at=far, direction=(0, 1))
    scene = fm.Scene(mechanism)
    simulation = fm.Simulation(scene, space=space, order=1, size=3.0, comm=comm)
    for turn in (pi, 2.0 * pi, 4.0):
        configuration = scene.configuration(f"turned by {turn:g}", {motor: turn})
        frame = simulation.load_displacement(push, forces=[0.0], configuration=configuration).frames[0]
        poses = frame.state.poses
        apart = point_of(simulation.linkage, poses, rocker, far) - point_of(simulation.linkage, poses, wheel, pin)
        yield deviation("a parallelogram beyond its change points", apart[:2], [coupler, 0.0], 1e-9)
        yield Deviation("its energy", frame.strain_energy / (SOFT.law.E * coupler**3), 1e-18)
    flat = scene.configuration("flat", {motor: turned})
    frame = simulation.load_displacement(push, forces=[1e-3, 0.05], configuration=flat).frames[-1]
    stiffness = SOFT.law.E * 3.0 * 6.0 / (coupler - 3.0)

    def across(angle: float) -> float:
        """Moment about the rocker's axle that is out of balance, at an ``angle`` of the rocker."""
        arm = crank * np.array([np.cos(angle), np.sin(angle)])
        line = (coupler, 0.0) + arm - (crank, 0.0)
        length = np.linalg.norm(line)
        force = (0.0, 0.05) - stiffness * (length - coupler) * line / length
        return arm[0] * force[1] - arm[1] * force[0]

    wanted = crank * np.sin(brentq(across, 1e-4, 1.0))
    yield deviation("pushed across while flat", frame.displacement, wanted, 2e-2)
    yield Fact("stable there", frame.stable)


def _four_bar(space: str, comm: MPI.Comm, hinges: int) -> tuple[fm.Curve, float]:
    """Loaded four-bar with a flexible coupler and every hinge of the ground ``hinges`` times; torque of its motor."""
    pin, joint = STOPPED.positions(START)
    mechanism = fm.Mechanism("four-bar")
    base, crank, rocker = (mechanism.rigid("base", fixed=True), mechanism.rigid("crank"), mechanism.rigid("rocker"))
    shape = fm.strip([tuple(pin), tuple(joint)], thickness=2.0, depth=4.0)
    coupler = mechanism.flexible("coupler", shape, SOFT)
    motor = mechanism.motor(mechanism.revolute(base, crank, at=STOPPED.shaft))
    mechanism.revolute(crank, coupler, at=pin, interface_radius=1.0)
    mechanism.weld(coupler, rocker, at=joint, interface_radius=1.0)
    mechanism.revolute(base, rocker, at=STOPPED.axle)
    for k in range(1, hinges):
        mechanism.revolute(base, crank, at=(*STOPPED.shaft, 5.0 * k))
        mechanism.revolute(base, rocker, at=(*STOPPED.axle, 5.0 * k))
    push = mechanism.force(on=coupler, at=0.5 * (pin + joint), direction=(0, -1))
    scene = fm.Scene(mechanism)
    simulation = fm.Simulation(scene, space=space, order=1, size=1.5, comm=comm)
    turned = scene.configuration("turned", {motor: -0.2})
    curve = simulation.load_displacement(push, forces=[0.2, 0.5], configuration=turned)
    return curve, curve.frames[-1].motors[motor]


def _redundant_hinges(space: str, comm: MPI.Comm) -> Iterator[Check]:
    (single, torque), (several, again) = (_four_bar(space, comm, hinges) for hinges in (1, 3))
    more = 2 * 2 * (2 if space == PLANE else 5)
    yield Fact(
        "8 redundant equations in the plane, 20 in space",
        several.freedom.redundancy - single.freedom.redundancy == more,
    )
    yield deviation("displacements as with one hinge each", several.displacements, single.displacements, 1e-8)
    yield deviation("torque", again, torque, 1e-8)


def _screw(turn: float, length: float, twist: float) -> np.ndarray:
    """Denavit–Hartenberg step: a turn about z, a bar along the new x, a twist about it, (4, 4)."""
    c, s, ca, sa = np.cos(turn), np.sin(turn), np.cos(twist), np.sin(twist)
    return np.array(
        [[c, -s * ca, s * sa, length * c], [s, c * ca, -c * sa, length * s], [0.0, sa, ca, 0.0], [0.0, 0.0, 0.0, 1.0]]
    )


def bricard(theta: float, *, length: float = 30.0) -> tuple[np.ndarray, np.ndarray]:
    """Positions (6, 3) and axes (6, 3) of the hinges of the threefold-symmetric Bricard loop, twists of ±90°.

    Between neighbouring turns cos θ + cos φ + cos θ cos φ = 0 holds (Chen, You & Tarnai,
    doi:10.1016/j.ijsolstr.2004.09.014).
    """
    phi = acos(-np.cos(theta) / (1.0 + np.cos(theta)))
    frame, points, axes = np.eye(4), [], []
    for k in range(6):
        points.append(frame[:3, 3])
        axes.append(frame[:3, 2])
        frame = frame @ _screw((theta, phi)[k % 2], length, (0.5 * pi, -0.5 * pi)[k % 2])
    if np.max(np.abs(frame - np.eye(4))) > 1e-10 * length:
        raise ValueError("the loop does not close")
    return np.array(points), np.array(axes)


def _paradoxical(hinges, theta: float, turn: float, comm: MPI.Comm, redundancy: int) -> Iterator[Check]:
    """A closed loop that moves though its joints say it cannot, one of its bars flexible.

    The bar next to the driven hinge is a strip between two brackets. The motor's torque against a small force on a
    far hinge is that of virtual work: −F · ∂x/∂θ.
    """
    points, axes = hinges(theta)
    count = len(points)
    mechanism = fm.Mechanism("loop")
    base = mechanism.rigid("base", fixed=True)
    near, away = mechanism.rigid("near bracket"), mechanism.rigid("far bracket")
    ends = [tuple(points[0] + share * (points[1] - points[0]))[:2] for share in (0.2, 0.8)]
    bar = mechanism.flexible("bar", fm.strip(ends, thickness=3.0, depth=3.0), fm.ONYX)
    mechanism.weld(near, bar, at=ends[0], interface_radius=1.5)
    mechanism.weld(bar, away, at=ends[1], interface_radius=1.5)
    links: list[Link] = [base, away, *(mechanism.rigid(f"bar {k}") for k in range(2, count))]
    motor = mechanism.motor(mechanism.revolute(base, near, at=points[0], axis=axes[0]))
    for k in range(1, count):
        mechanism.revolute(links[k], links[(k + 1) % count], at=points[k], axis=axes[k])
    across = (0.48, 0.6, 0.64)
    push = mechanism.force(on=links[2], at=points[2], direction=across)
    scene = fm.Scene(mechanism)
    simulation = fm.Simulation(scene, space=SPACE, order=1, size=3.0, comm=comm)
    turned = scene.configuration("turned", {motor: turn})
    force = 1e-4
    rest, frame = simulation.load_displacement(push, forces=[0.0, force], configuration=turned).frames
    there, _ = hinges(theta + turn)
    found = point_of(simulation.linkage, rest.state.poses, links[2], points[2])
    yield deviation("hinges follow the closed form", found, there[2], 1e-8)
    yield Deviation("energy on the way", rest.strain_energy / (fm.ONYX.law.E * 30.0**3), 1e-15)
    step = 1e-6
    rate = (hinges(theta + turn + step)[0][2] - hinges(theta + turn - step)[0][2]) / (2.0 * step)
    yield deviation("torque against a force", frame.motors[motor], -force * (rate @ across), 2e-3)
    yield Fact(f"equations redundant: {redundancy}", redundancy == _redundant(simulation, turned))


def _redundant(simulation: fm.Simulation, configuration: fm.Configuration) -> int:
    """Redundant equations while all links are rigid."""
    rigid = simulation.linkage.rigid
    poses = assemble(simulation.linkage, configuration).poses
    return count_freedom(rigid, poses, rigid.motor_values(configuration.position)).redundancy


def _bennett(space: str, comm: MPI.Comm) -> Iterator[Check]:
    yield from _paradoxical(Bennett().hinges, 1.2, 1.0, comm, 3)


def _bricard(space: str, comm: MPI.Comm) -> Iterator[Check]:
    yield from _paradoxical(bricard, 1.3, 0.4, comm, 1)


def _hand(space: str, comm: MPI.Comm, kind: str) -> fm.Curve:
    """A clamped link with a rigid hand: one body, several that are held more than they need, or with loose ones."""
    mechanism = fm.Mechanism("hand")
    base, palm = mechanism.rigid("base", fixed=True), mechanism.rigid("palm")
    link = mechanism.flexible("link", fm.strip([(0, 0), (20, 4), (40, 0)], thickness=3.0, depth=5.0), SOFT)
    mechanism.weld(base, link, at=(0, 0), interface_radius=2.0)
    mechanism.weld(link, palm, at=(40, 0), interface_radius=2.0)
    loaded = palm
    if kind == "over-constrained":
        corners = [(40.0, 0.0), (50.0, 0.0), (50.0, 10.0), (40.0, 10.0)]
        bars = {(0, 1): palm}
        pairs = ((1, 2), (2, 3), (3, 0), (0, 2), (1, 3))
        bars |= {pair: mechanism.rigid(f"bar {pair[0]}{pair[1]}") for pair in pairs}
        for k, corner in enumerate(corners):
            first, *others = (bar for pair, bar in bars.items() if k in pair)
            for other in others:
                mechanism.revolute(first, other, at=corner, name=f"{first.name} {other.name}")
        loaded = bars[2, 3]
    if kind == "loose":
        bob = mechanism.rigid("bob")
        mechanism.revolute(palm, bob, at=(45, 0))
        if space == SPACE:
            spun = mechanism.rigid("spun")
            mechanism.spherical(bob, spun, at=(45, 20))
    push = mechanism.force(on=loaded, at=(50, 10), direction=(0.6, -0.8))
    simulation = fm.Simulation(fm.Scene(mechanism), space=space, order=1, size=3.0, comm=comm)
    return simulation.load_displacement(push, forces=[0.1, 0.3, 1.0])


def _over_constrained(space: str, comm: MPI.Comm) -> Iterator[Check]:
    single, braced = (_hand(space, comm, kind) for kind in ("single", "over-constrained"))
    redundancy = 1 if space == PLANE else 10
    yield Fact(
        "a braced square redundant once in the plane, ten times in space", braced.freedom.redundancy == redundancy
    )
    yield deviation("as with one rigid body", braced.displacements, single.displacements, 1e-8)


def _loose(space: str, comm: MPI.Comm) -> Iterator[Check]:
    single, loose = (_hand(space, comm, kind) for kind in ("single", "loose"))
    yield Fact("1 free motion in the plane, 4 in space", loose.freedom.mobility == (1 if space == PLANE else 4))
    yield deviation("as without them", loose.displacements, single.displacements, 1e-8)
    yield Fact("stable", all(loose.stable))


def _closing(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """The crank is too long to turn: it stops where coupler and rocker are in line."""
    pin, joint = STOPPED.positions(START)
    mechanism = fm.Mechanism("four-bar")
    base, crank, coupler, rocker = (
        mechanism.rigid("base", fixed=True),
        *map(mechanism.rigid, ("crank", "coupler", "rocker")),
    )
    motor = mechanism.motor(mechanism.revolute(base, crank, at=STOPPED.shaft))
    mechanism.revolute(crank, coupler, at=pin)
    mechanism.revolute(coupler, rocker, at=joint)
    mechanism.revolute(base, rocker, at=STOPPED.axle)
    beam = mechanism.flexible(
        "whip", fm.strip([tuple(joint), (joint[0], joint[1] + 30.0)], thickness=2.0, depth=4.0), SOFT
    )
    mechanism.weld(rocker, beam, at=joint, interface_radius=1.0)
    push = mechanism.force(on=beam, at=(joint[0], joint[1] + 29.0), direction=(1, 0))
    scene = fm.Scene(mechanism)
    simulation = fm.Simulation(scene, space=space, order=1, size=2.0, comm=comm)
    reach = LAST - START
    # half of the digits are lost where two circles touch: 1e-6 of the joint's place is 1e-12 of the crank's angle
    just = scene.configuration("just", {motor: reach - 1e-12})
    frame = simulation.load_displacement(push, forces=[0.0], configuration=just).frames[0]
    found = point_of(simulation.linkage, frame.state.poses, rocker, joint)
    crank_pin = STOPPED.crank * np.array([np.cos(LAST), np.sin(LAST)])
    stretched = crank_pin + (np.array(STOPPED.axle) - crank_pin) * STOPPED.coupler / (STOPPED.coupler + STOPPED.rocker)
    yield deviation("closes where circles touch", found[:2], stretched, 1e-5)
    # there the coupler must pull a thousand times as hard as the whip
    near = scene.configuration("near", {motor: reach - 1e-6})
    loaded = simulation.load_displacement(push, forces=[0.01], configuration=near).frames[0]
    yield Fact("stable under load 1e-6 rad before", loaded.stable)
    for beyond in (1e-6, 1.0):
        try:
            simulation.load_displacement(
                push, forces=[0.01], configuration=scene.configuration("beyond", {motor: reach + beyond})
            )
            said = ""
        except fm.AssemblyError as error:
            said = str(error)
        yield Fact(
            "1e-6 rad and 1 rad beyond: an error names the loop",
            "does not close" in said and all(link.name in said for link in (crank, coupler, rocker)),
        )


CASES = (
    HardCase("dead centre", "slider-crank with a flexible rod at and beside both dead centres", _dead_centre),
    HardCase(
        "change point",
        "parallelogram passes its flat positions; held there by its coupler's stretch alone",
        _change_point,
    ),
    HardCase("redundant hinges", "planar four-bar, each hinge of the ground three times", _redundant_hinges),
    HardCase("Bennett loop", "moves though its joints say it cannot; one bar flexible", _bennett, (SPACE,)),
    HardCase("Bricard loop", "six hinges, one equation redundant; one bar flexible", _bricard, (SPACE,)),
    HardCase("over-constrained hand", "rigid sub-chain braced twice", _over_constrained),
    HardCase("loose parts", "a bob that nothing holds swings, and one that spins", _loose),
    HardCase(
        "loop that closes only just", "1e-12 rad within its reach, loaded 1e-6 rad within it, and beyond", _closing
    ),
)
