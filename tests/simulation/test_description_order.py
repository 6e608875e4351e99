"""It does not matter in which order a mechanism is described, nor which of two joined links is named first."""

import random

import pytest
from mpi4py import MPI

import fenicsmech as fm

PLACES = {
    "shaft": (0, 0),
    "crank pin": (5, 25),
    "elbow": (45, 35),
    "axle": (50, 0),
    "middle": (25, 33),
    "lever": (30, 60),
}
LINKS = {
    "base": None,
    "hammer": None,
    "crank": [PLACES["shaft"], (6, 12), PLACES["crank pin"]],
    "coupler": [PLACES["crank pin"], PLACES["middle"], PLACES["elbow"]],
    "rocker": [PLACES["axle"], (53, 18), PLACES["elbow"]],
}
JOINTS = {
    "shaft": ("base", "crank"),
    "crank pin": ("crank", "coupler"),
    "elbow": ("coupler", "rocker"),
    "axle": ("base", "rocker"),
    "middle": ("coupler", "hammer"),
}


def four_bar(space: str, seed: int | None) -> fm.Curve:
    """Motor-driven flexible four-bar with a rigid hammer welded to its coupler; described in an order of its own."""
    links, joints = list(LINKS), list(JOINTS)
    if seed is not None:
        order = random.Random(seed)
        order.shuffle(links)
        order.shuffle(joints)
    mechanism, made = fm.Mechanism("four-bar"), {}
    for name in links:
        if LINKS[name] is None:
            made[name] = mechanism.rigid(name, fixed=name == "base")
        else:
            made[name] = mechanism.flexible(name, fm.strip(LINKS[name], thickness=3.0, depth=6.0), fm.ONYX)
    for name in joints:
        a, b = (made[link] for link in JOINTS[name])
        if seed is not None and name != "shaft" and order.random() < 0.5:
            a, b = b, a
        if name == "middle":
            mechanism.weld(a, b, at=PLACES[name], interface_radius=2.5, name=name)
        else:
            joint = mechanism.revolute(a, b, at=PLACES[name], interface_radius=2.5, name=name)
        if name == "shaft":
            motor = mechanism.motor(joint)
    push = mechanism.force(on=made["hammer"], at=PLACES["lever"], direction=(0.6, -0.8))
    scene = fm.Scene(mechanism)
    order = 1 if space == "3d" else 2
    simulation = fm.Simulation(scene, space=space, order=order, size=4.0, comm=MPI.COMM_SELF)
    turned = scene.configuration("turned", {motor: 0.3})
    return simulation.load_displacement(push, forces=[1.0, 3.0], configuration=turned)


@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d", marks=pytest.mark.thorough)])
def test_links_and_joints_in_any_order_give_the_same_curve(space):
    reference = four_bar(space, None)
    torque = [*reference.frames[-1].motors.values()]
    for seed in range(3):
        curve = four_bar(space, seed)
        assert curve.displacements == pytest.approx(reference.displacements, rel=1e-8)
        assert [*curve.frames[-1].motors.values()] == pytest.approx(torque, rel=1e-8)
        assert curve.frames[-1].strain_energy == pytest.approx(reference.frames[-1].strain_energy, rel=1e-8)
        assert curve.freedom.mobility == reference.freedom.mobility == 0
        assert curve.freedom.redundancy == reference.freedom.redundancy
