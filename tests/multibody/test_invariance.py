"""The assembly does not depend on the order, the unit, the origin or the plane in which a mechanism was described."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fenicsmech.mechanism import Configuration, Mechanism
from fenicsmech.multibody import assemble, build_linkage

from .machine import Machine
from .planar_machines import CRANK_ROCKER, DRAWN_ANGLE, four_bar
from .spatial_machines import two_ball_rod

EVERY_DIMENSION = pytest.mark.parametrize("dim", [2, 3])
TURN = 2.5


def displacements(machine: Machine, dim: int, turn: float = TURN) -> dict[str, np.ndarray]:
    """Displacement of each pivot when the motor turns."""
    linkage = machine.linkage(dim)
    found = machine.positions(linkage, machine.drive(linkage, turn).poses)
    return {name: found[name] - np.array([*at, 0.0])[:dim] for name, (_, at) in machine.pivots.items()}


@EVERY_DIMENSION
@pytest.mark.parametrize("order", list(itertools.permutations(range(4)))[1::4])
def test_order_of_joints_does_not_matter(order, dim):
    wanted = displacements(four_bar(CRANK_ROCKER, DRAWN_ANGLE), dim)
    for name, found in displacements(four_bar(CRANK_ROCKER, DRAWN_ANGLE, order=order), dim).items():
        assert found == pytest.approx(wanted[name], abs=1e-12 * CRANK_ROCKER.coupler)


@EVERY_DIMENSION
@pytest.mark.parametrize("order", list(itertools.permutations(range(4)))[1::4])
def test_order_of_links_does_not_matter(order, dim):
    def described(order):
        m = Mechanism("four-bar")
        links = {k: m.rigid(f"link {k}", fixed=k == 0) for k in order}
        pin, joint = CRANK_ROCKER.positions(DRAWN_ANGLE)
        shaft = m.revolute(links[0], links[1], at=CRANK_ROCKER.shaft)
        m.revolute(links[1], links[2], at=pin)
        m.revolute(links[2], links[3], at=joint)
        m.revolute(links[0], links[3], at=CRANK_ROCKER.axle)
        return Machine(m, m.motor(shaft), {"pin": (links[1], tuple(pin)), "joint": (links[3], tuple(joint))})

    wanted = displacements(described(range(4)), dim)
    for name, found in displacements(described(order), dim).items():
        assert found == pytest.approx(wanted[name], abs=1e-12 * CRANK_ROCKER.coupler)


@EVERY_DIMENSION
def test_naming_the_links_of_a_joint_the_other_way_round_turns_its_motor_round(dim):
    def described(ends):
        m = Mechanism("lever")
        links = {name: m.rigid(name, fixed=name == "base") for name in ("base", "lever")}
        hinge = m.revolute(links[ends[0]], links[ends[1]], at=(1.0, 2.0))
        return Machine(m, m.motor(hinge), {"end": (links["lever"], (11.0, 2.0))})

    ahead = displacements(described(("base", "lever")), dim, 0.5)["end"]
    behind = displacements(described(("lever", "base")), dim, -0.5)["end"]
    assert ahead == pytest.approx(behind, abs=1e-13)
    assert ahead[1] == pytest.approx(10.0 * np.sin(0.5))


@EVERY_DIMENSION
@pytest.mark.parametrize("scale", [1e-3, 1e3], ids=["metres", "micrometres"])
def test_unit_of_length_scales_the_motion_and_nothing_else(scale, dim):
    millimetres = four_bar(CRANK_ROCKER, DRAWN_ANGLE)
    other = four_bar(CRANK_ROCKER, DRAWN_ANGLE, place=lambda x, y: (scale * x, scale * y))
    linkage = other.linkage(dim)
    wanted = millimetres.drive(millimetres.linkage(dim), TURN).poses
    found = other.drive(linkage, TURN).poses
    assert linkage.length == pytest.approx(scale * millimetres.linkage(dim).length, rel=1e-14)
    assert found[:, :dim] == pytest.approx(scale * wanted[:, :dim], abs=1e-12 * linkage.length)
    assert found[:, dim:] == pytest.approx(wanted[:, dim:], abs=1e-12)


@EVERY_DIMENSION
def test_an_origin_far_away_costs_no_more_than_the_rounding_of_the_positions(dim):
    # positions near 1e6 are themselves rounded to 1e-10
    wanted = displacements(four_bar(CRANK_ROCKER, DRAWN_ANGLE), dim)
    far = four_bar(CRANK_ROCKER, DRAWN_ANGLE, place=lambda x, y: (x + 1e6, y - 1e6))
    linkage = far.linkage(dim)
    poses = far.drive(linkage, TURN).poses
    for name, found in displacements(far, dim).items():
        assert found == pytest.approx(wanted[name], abs=1e-8)
    # but the loop closes as tightly as near the origin
    residual = linkage.rigid.row_scale * linkage.rigid.value(poses, linkage.rigid.motor_values(lambda motor: TURN))
    assert np.max(np.abs(residual)) <= 1e-13


@pytest.mark.parametrize("seed", range(3))
def test_plane_of_a_mechanism_may_lie_anywhere_in_space(seed):
    rotation = Rotation.from_quat(np.random.default_rng(seed).standard_normal(4))
    flat = four_bar(CRANK_ROCKER, DRAWN_ANGLE)
    m = Mechanism("tilted")
    links = {link.name: m.rigid(link.name, fixed=link.fixed) for link in flat.mechanism.links}
    axis = rotation.apply([0.0, 0.0, 1.0])
    places = {joint.name: rotation.apply([*joint.at, 0.0]) for joint in flat.mechanism.joints}
    joints = {
        j.name: m.revolute(links[j.a.name], links[j.b.name], at=places[j.name], axis=axis)
        for j in flat.mechanism.joints
    }
    pivots = {name: (links[link.name], tuple(places[name])) for name, (link, _) in flat.pivots.items()}
    tilted = displacements(Machine(m, m.motor(joints["shaft"]), pivots), 3)
    for name, wanted in displacements(flat, 3).items():
        assert tilted[name] == pytest.approx(rotation.apply(wanted), abs=1e-12 * CRANK_ROCKER.coupler)


@EVERY_DIMENSION
def test_reaching_a_position_in_one_go_or_by_a_turn_more_is_the_same(dim):
    machine = four_bar(CRANK_ROCKER, DRAWN_ANGLE)
    once, again = displacements(machine, dim), displacements(machine, dim, TURN + 2.0 * np.pi)
    for name, found in again.items():
        assert found == pytest.approx(once[name], abs=1e-12 * CRANK_ROCKER.coupler)


def test_spin_without_effect_is_left_alone():
    # of all positions of a rod that may spin, the assembly takes the one nearest to where it came from
    machine = two_ball_rod()
    linkage = machine.linkage(3)
    there = machine.drive(linkage, 0.4).poses[2]
    rod = np.array([30.0, 5.0, 30.0]) / np.linalg.norm([30.0, 5.0, 30.0])
    turned = Rotation.from_quat(np.roll(there[3:], -1)).as_rotvec()
    assert abs(turned @ rod) < 0.1 * np.linalg.norm(turned)


@EVERY_DIMENSION
def test_a_motor_about_minus_z_turns_the_other_way(dim):
    def pose(turn: float, axis: tuple[float, float, float]) -> np.ndarray:
        m = Mechanism("crank")
        base, crank = m.rigid("base", fixed=True), m.rigid("crank")
        motor = m.motor(m.revolute(base, crank, at=(3.0, 1.0), axis=axis))
        linkage = build_linkage(m, dim)
        return assemble(linkage, Configuration("turned", {motor: turn})).poses[1]

    assert pose(0.4, (0.0, 0.0, -1.0)) == pytest.approx(pose(-0.4, (0.0, 0.0, 1.0)), abs=1e-14)
