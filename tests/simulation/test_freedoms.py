"""Redundant constraints, zero-energy modes, dead centres and full turns neither stop a solve nor change its result."""

from math import pi

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

from .demo_scenes import describe

SOFT = fm.Material("soft", 20.0, 0.4)

# joints for planar motion, all of them about or along axes that such a motion leaves alone
JOINTS = {
    "revolute": lambda m, a, b, at: m.revolute(a, b, at=at),
    "spherical": lambda m, a, b, at: m.spherical(a, b, at=at),
    "universal": lambda m, a, b, at: m.universal(a, b, at=at, axis=(1, 0, 0)),
    "cylindrical": lambda m, a, b, at: m.cylindrical(a, b, at=at, axis=(0, 0, 1)),
    "prismatic": lambda m, a, b, at: m.prismatic(a, b, at=at, axis=(1, 0, 0)),
    "cylindrical slide": lambda m, a, b, at: m.cylindrical(a, b, at=at, axis=(1, 0, 0)),
    "planar": lambda m, a, b, at: m.planar(a, b, at=at, axis=(0, 1, 0)),
}


def bow_between(foot: str, head: str, slide: str):
    """A bow from a joint on the ground to a joint on a carriage, which slides; the mesh is symmetric about z = 0."""
    mechanism = fm.Mechanism("bow")
    base = mechanism.rigid("base", fixed=True)
    lower, upper, carriage = (mechanism.rigid(name) for name in ("lower", "upper", "carriage"))
    bow = mechanism.flexible("bow", fm.strip([(0, 0), (20, 12), (40, 10), (60, 0)], thickness=4.0, depth=16.0), fm.ONYX)
    mechanism.weld(lower, bow, at=(0, 0), interface_radius=3.0)
    mechanism.weld(bow, upper, at=(60, 0), interface_radius=3.0)
    JOINTS[foot](mechanism, base, lower, (0, 0))
    JOINTS[head](mechanism, upper, carriage, (60, 0))
    JOINTS[slide](mechanism, base, carriage, (60, 0))
    pull = mechanism.force(on=carriage, at=(60, 0), direction=(1, 0))
    return fm.Simulation(fm.Scene(mechanism), space="3d", order=1, size=4.0, comm=MPI.COMM_SELF), pull


@pytest.fixture(scope="module")
def hinged_bow() -> fm.Curve:
    """The curve that every other set of joints must give as well."""
    simulation, pull = bow_between("revolute", "revolute", "prismatic")
    return simulation.load_displacement(pull, forces=[200.0, -200.0])


@pytest.mark.parametrize(
    "joints, mobility, redundancy",
    [
        (("revolute", "revolute", "prismatic"), 0, 3),
        (("spherical", "revolute", "prismatic"), 0, 1),
        (("universal", "cylindrical", "prismatic"), 0, 1),
        (("universal", "spherical", "prismatic"), 0, 0),
        (("cylindrical", "spherical", "prismatic"), 0, 0),
        (("revolute", "revolute", "cylindrical slide"), 0, 2),
        (("revolute", "revolute", "planar"), 0, 1),
        (("spherical", "spherical", "prismatic"), 1, 0),
        (("spherical", "spherical", "cylindrical slide"), 2, 0),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, tuple) else str(value),
)
def test_spatial_joints_that_let_a_plane_motion_pass_give_the_same_curve(joints, mobility, redundancy, hinged_bow):
    simulation, pull = bow_between(*joints)
    curve = simulation.load_displacement(pull, forces=[200.0, -200.0])
    assert (curve.freedom.mobility, curve.freedom.redundancy) == (mobility, redundancy)
    assert ("bow" in curve.freedom.mobile) == (mobility > 0)
    assert curve.displacements == pytest.approx(hinged_bow.displacements, rel=1e-7)
    assert np.all(curve.stable)
    residual = simulation.linkage.joints.value(curve.frames[-1].state.poses, curve.frames[-1].state.motors)
    assert np.abs(residual).max() < 1e-9 * simulation.linkage.length


@pytest.mark.parametrize("name, redundancy", [("truss", 6), ("claw", 6), ("klann", 6)])
def test_planar_loops_of_spatial_hinges_are_solved_and_their_redundancy_is_reported(name, redundancy):
    scene, force = describe(name)
    load = {"truss": 0.02, "claw": 1.0, "klann": 0.5}[name]
    flat = fm.Simulation(scene, space="plane-stress", order=1, size=6.0, comm=MPI.COMM_SELF)
    deep = fm.Simulation(scene, space="3d", order=1, size=6.0, comm=MPI.COMM_SELF)
    flat_curve, deep_curve = (simulation.load_displacement(force, forces=[load]) for simulation in (flat, deep))
    assert (flat_curve.freedom.mobility, flat_curve.freedom.redundancy) == (0, 0)
    assert (deep_curve.freedom.mobility, deep_curve.freedom.redundancy) == (0, redundancy)
    assert set(deep_curve.freedom.redundant) >= {joint.name for joint in scene.mechanism.joints[1:3]}
    assert deep_curve.displacements == pytest.approx(flat_curve.displacements, rel=0.5)
    assert np.all(deep_curve.stable)


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_two_full_turns_of_the_motor_change_nothing(space):
    scene, lift = describe("klann")
    (motor,) = scene.mechanism.motors
    simulation = fm.Simulation(scene, space=space, order=1, size=6.0, comm=MPI.COMM_SELF)
    curves = {}
    for turns in (0, 2, -1):
        configuration = scene.configuration(f"{turns} turns", {motor: 2.0 * pi * turns})
        curves[turns] = simulation.load_displacement(lift, forces=[1.0, 2.0], configuration=configuration)
    reference = curves[0].frames[-1]
    for turns in (2, -1):
        assert curves[turns].displacements == pytest.approx(curves[0].displacements, rel=1e-8)
        turned = curves[turns].frames[-1]
        assert turned.motors[motor] == pytest.approx(reference.motors[motor], rel=1e-7)
        assert turned.strain_energy == pytest.approx(reference.strain_energy, rel=1e-8)


def toggle(space: str, *, driven: bool):
    """Rigid crank and flexible coupler in one line, which pushes or pulls on a rigid rocker across it."""
    mechanism = fm.Mechanism("toggle")
    base = mechanism.rigid("base", fixed=True)
    crank, rocker = mechanism.rigid("crank"), mechanism.rigid("rocker")
    coupler = mechanism.flexible("coupler", fm.strip([(15, 0), (60, 0)], thickness=4.0, depth=16.0), SOFT)
    shaft = mechanism.revolute(base, crank, at=(0, 0))
    mechanism.revolute(crank, coupler, at=(15, 0), interface_radius=2.0)
    mechanism.revolute(coupler, rocker, at=(60, 0), interface_radius=2.0)
    mechanism.revolute(base, rocker, at=(60, -40))
    if driven:
        mechanism.motor(shaft)
    pull = mechanism.force(on=rocker, at=(60, 0), direction=(1, 0))
    order = 1 if space == "3d" else 2
    return fm.Simulation(fm.Scene(mechanism), space=space, order=order, size=4.0, comm=MPI.COMM_SELF), pull


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_crank_in_line_with_its_coupler_holds_a_pull_and_gives_way_to_a_push_unless_a_motor_holds_it(space):
    stiffness = SOFT.law.E * 4.0 * 16.0 / 41.0  # of the coupler between the rims of its pins
    loads = [0.002 * stiffness, 0.01 * stiffness]
    for driven in (False, True):
        simulation, pull = toggle(space, driven=driven)
        pulled = simulation.load_displacement(pull, forces=loads)
        assert pulled.freedom.mobility == (0 if driven else 1)
        assert pulled.displacements == pytest.approx([0.002, 0.01], rel=0.03)
        assert np.all(pulled.stable)
        pushed = simulation.load_displacement(pull, forces=[-load for load in loads])
        assert pushed.displacements == pytest.approx([-0.002, -0.01], rel=0.03)
        assert [frame.unstable_modes for frame in pushed.frames] == ([0, 0] if driven else [1, 1])


def flat_parallelogram(space: str):
    """Crank, bowed flexible coupler and rocker drawn in one line: the change point of a parallelogram."""
    mechanism = fm.Mechanism("flat parallelogram")
    base = mechanism.rigid("base", fixed=True)
    crank, rocker = mechanism.rigid("crank"), mechanism.rigid("rocker")
    coupler = mechanism.flexible("coupler", fm.strip([(20, 0), (40, 6), (60, 0)], thickness=3.0, depth=12.0), fm.ONYX)
    shaft = mechanism.revolute(base, crank, at=(0, 0))
    mechanism.revolute(crank, coupler, at=(20, 0), interface_radius=2.0)
    mechanism.revolute(coupler, rocker, at=(60, 0), interface_radius=2.0)
    mechanism.revolute(base, rocker, at=(40, 0))
    mechanism.motor(shaft)
    lift = mechanism.force(on=rocker, at=(60, 0), direction=(0, 1))
    order = 1 if space == "3d" else 2
    return fm.Simulation(fm.Scene(mechanism), space=space, order=order, size=4.0, comm=MPI.COMM_SELF), lift


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_change_point_resists_with_the_cube_of_the_displacement(space):
    # at first order nothing resists; the coupler is stretched by y² (1/20 + 1/40) / 2
    simulation, lift = flat_parallelogram(space)
    curve = simulation.load_displacement(lift, displacements=[0.1, 0.2, 0.4])
    assert curve.freedom.mobility == 1
    assert curve.forces[1:] / curve.forces[:-1] == pytest.approx(8.0, rel=0.03)
    assert np.all(curve.stable)


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_change_point_can_be_loaded_by_a_force(space):
    simulation, lift = flat_parallelogram(space)
    held = simulation.load_displacement(lift, displacements=[0.5, 1.0])
    loaded = simulation.load_displacement(lift, forces=held.forces)
    assert loaded.displacements == pytest.approx(held.displacements, rel=1e-6)
