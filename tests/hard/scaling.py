"""The same mechanism in other units, far from the origin, and described in other orders."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass

from mpi4py import MPI

import fenicsmech as fm

from .case import Check, Fact, HardCase, deviation

LINKS = {
    "base": None,
    "hammer": None,
    "crank": [(0, 0), (6, 12), (5, 25)],
    "coupler": [(5, 25), (25, 33), (45, 35)],
    "rocker": [(50, 0), (53, 18), (45, 35)],
}
JOINTS = {
    "shaft": ("base", "crank", (0, 0)),
    "crank pin": ("crank", "coupler", (5, 25)),
    "elbow": ("coupler", "rocker", (45, 35)),
    "axle": ("base", "rocker", (50, 0)),
    "middle": ("coupler", "hammer", (25, 33)),
}


@dataclass(frozen=True)
class Described:
    """Variations in the description of the four-bar.

    Attributes:
        length: what a millimetre is.
        modulus: what a megapascal is.
        origin: where (0, 0) is, in millimetres.
        order: seed of the order of links and joints, and of which link of a joint comes first; None as above.
    """

    length: float = 1.0
    modulus: float = 1.0
    origin: tuple[float, float] = (0.0, 0.0)
    order: int | None = None


def four_bar(space: str, comm: MPI.Comm, described: Described) -> tuple[fm.Curve, float]:
    """Loaded motor-driven four-bar of three flexible links, and the torque of its motor."""
    unit, force = described.length, described.modulus * described.length**2

    def at(point):
        return tuple(unit * (origin + c) for origin, c in zip(described.origin, point, strict=True))

    links, joints = list(LINKS), list(JOINTS)
    shuffle = random.Random(described.order)
    if described.order is not None:
        shuffle.shuffle(links)
        shuffle.shuffle(joints)
    material = fm.Material("Onyx", described.modulus * 1770.0, 0.42)
    mechanism, made = fm.Mechanism("four-bar"), {}
    for name in links:
        if LINKS[name] is None:
            made[name] = mechanism.rigid(name, fixed=name == "base")
        else:
            shape = fm.strip([at(point) for point in LINKS[name]], thickness=3.0 * unit, depth=6.0 * unit)
            made[name] = mechanism.flexible(name, shape, material)
    for name in joints:
        first, second, place = JOINTS[name]
        a, b = made[first], made[second]
        if described.order is not None and name != "shaft" and shuffle.random() < 0.5:
            a, b = b, a
        add = mechanism.weld if name == "middle" else mechanism.revolute
        joint = add(a, b, at=at(place), interface_radius=2.5 * unit, name=name)
        if name == "shaft":
            motor = mechanism.motor(joint)
    push = mechanism.force(on=made["hammer"], at=at((30, 60)), direction=(0.6, -0.8))
    scene = fm.Scene(mechanism)
    simulation = fm.Simulation(scene, space=space, order=1, size=4.0 * unit, comm=comm)
    turned = scene.configuration("turned", {motor: 0.3})
    curve = simulation.load_displacement(push, forces=[force, 3.0 * force], configuration=turned)
    return curve, curve.frames[-1].motors[motor]


def _compared(space: str, comm: MPI.Comm, others: dict[str, Described], bound: float) -> Iterator[Check]:
    reference, torque = four_bar(space, comm, Described())
    for name, described in others.items():
        curve, other = four_bar(space, comm, described)
        unit, moment = described.length, described.modulus * described.length**3
        yield deviation(name, curve.displacements / unit, reference.displacements, bound)
        yield deviation(f"{name}: torque", other / moment, torque, bound)
        energies = [frame.strain_energy / moment for frame in curve.frames]
        yield deviation(f"{name}: energy", energies, [frame.strain_energy for frame in reference.frames], bound)
        yield Fact(
            "as stable, as mobile",
            list(curve.stable) == list(reference.stable) and _freedom(curve) == _freedom(reference),
        )


def _freedom(curve: fm.Curve) -> tuple[int, int]:
    return curve.freedom.mobility, curve.freedom.redundancy


def _units(space: str, comm: MPI.Comm) -> Iterator[Check]:
    others = {
        "lengths · 1e-6": Described(length=1e-6),
        "lengths · 1e6": Described(length=1e6),
        "moduli · 1e-6": Described(modulus=1e-6),
        "moduli · 1e6": Described(modulus=1e6),
    }
    yield from _compared(space, comm, others, 1e-8)


def _far(space: str, comm: MPI.Comm) -> Iterator[Check]:
    yield from _compared(space, comm, {"placed at (1e6, −1e6) mm": Described(origin=(1e6, -1e6))}, 1e-8)


def _orders(space: str, comm: MPI.Comm) -> Iterator[Check]:
    yield from _compared(space, comm, {"in another order": Described(order=1), "in a third": Described(order=2)}, 1e-8)


CASES = (
    HardCase("units scaled by a million", "lengths in nm or km, moduli in Pa or TPa", _units),
    HardCase("far from the origin", "mechanism of 60 mm placed 1.4e6 mm away", _far),
    HardCase("any order", "links, joints and the two links of a joint named in any order", _orders),
)
