"""Springs in joints: derivatives, closed forms through large turns, stability, and the links they act on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import StayClose
from fenicsmech.effects import Gravity, JointSpring, Mass
from fenicsmech.multibody import JointCoordinate, build_linkage

from ..design.mechanisms import objective, truss
from ..joints.poses import carry, pose, random_pose, turn
from ..joints.taylor import assert_derivative
from ..oracles import dense
from .levers import ARM, PLASTIC, TILTED, UPRIGHT, lever, sled

STIFFNESS = 50.0
each_dim = pytest.mark.parametrize("dim", [2, 3])
each_joint = pytest.mark.parametrize("kind", ["revolute", "prismatic"])


def spring(dim: int, kind: str, *, rest: float = 0.3):
    """The potential of a spring between two free bodies, and the linkage."""
    mechanism = fm.Mechanism("pair")
    a, b = mechanism.rigid("a"), mechanism.rigid("b")
    mechanism.weld(a, mechanism.rigid("c"), at=(7, -4))
    mechanism.weld(b, mechanism.rigid("d"), at=(-2, 9))
    axis = (
        {"revolute": (0.2, -0.5, 0.8), "prismatic": (0.6, 0.8, 0.0)}[kind] if dim == 3 or kind == "prismatic" else None
    )
    joint = getattr(mechanism, kind)(a, b, at=(1, 2), **({} if axis is None else {"axis": axis}))
    linkage = build_linkage(mechanism, dim)
    return _Sum(JointSpring(joint, STIFFNESS, rest).pose_potentials(linkage)), linkage, joint


class _Sum:
    """A spring's stiffness and preload together."""

    def __init__(self, parts):
        (self.bodies,) = {part.bodies for part in parts}
        self.value, self.gradient, self.hessian = (
            lambda poses, name=name: sum(getattr(part, name)(poses) for part in parts)
            for name in ("value", "gradient", "hessian")
        )


def anywhere(linkage, rng) -> np.ndarray:
    """Poses of all bodies far from the drawn ones."""
    return np.array([random_pose(linkage.joints.space, rng) for _ in linkage.bodies])


def on_bodies(function, potential, poses):
    """``function`` of the poses of a potential's bodies alone, flat."""

    def of(z):
        moved = poses.copy()
        moved[list(potential.bodies)] = z.reshape(len(potential.bodies), -1)
        return np.atleast_1d(function(moved))

    return of, poses[list(potential.bodies)].ravel()


@pytest.mark.thorough
@each_dim
@each_joint
@pytest.mark.parametrize("seed", range(3))
def test_gradient_and_hessian_pass_the_taylor_test(dim, kind, seed):
    rng = np.random.default_rng(seed)
    potential, linkage, _ = spring(dim, kind)
    poses = anywhere(linkage, rng)
    value, z = on_bodies(potential.value, potential, poses)
    gradient, _ = on_bodies(potential.gradient, potential, poses)
    curvature = potential.hessian(poses)
    assert np.array_equal(curvature, curvature.T)
    assert_derivative(value, z, potential.gradient(poses)[None], rng)
    assert_derivative(gradient, z, curvature, rng)


@each_dim
@each_joint
def test_hessian_agrees_with_differences_of_values(dim, kind):
    potential, linkage, _ = spring(dim, kind)
    poses = anywhere(linkage, np.random.default_rng(7))
    value, z = on_bodies(potential.value, potential, poses)
    curvature = potential.hessian(poses)
    differences = dense.hessian(lambda y: float(value(y)[0]), z, step=0.02)
    assert curvature == pytest.approx(differences, abs=1e-6 * np.abs(curvature).max())


@each_dim
@each_joint
def test_energy_is_the_same_from_every_frame(dim, kind):
    rng = np.random.default_rng(3)
    potential, linkage, _ = spring(dim, kind)
    space, poses = linkage.joints.space, anywhere(linkage, rng)
    centres = np.array([body.centre for body in linkage.bodies])
    frame = random_pose(space, rng)
    moved = np.array([carry(space, frame, z, c - centres[0]) for z, c in zip(poses, centres, strict=True)])
    assert potential.value(moved) == pytest.approx(potential.value(poses), rel=1e-11)


@each_dim
@pytest.mark.parametrize("full", [0.1, 0.9, 1.5, 1.99])
def test_angle_is_that_of_the_turn_even_beyond_half_a_turn(dim, full):
    mechanism = fm.Mechanism("pair")
    a, b = mechanism.rigid("a"), mechanism.rigid("b")
    joint = mechanism.revolute(a, b, at=(1, 2), **({"axis": (0.2, -0.5, 0.8)} if dim == 3 else {}))
    linkage = build_linkage(mechanism, dim)
    coordinate, space = JointCoordinate(linkage, joint), linkage.joints.space
    poses = linkage.joints.drawn
    axis = np.array(joint.axis) if dim == 3 else np.ones(1)
    # small turns one after the other, as on a path: scipy's quaternions know no more than half a turn
    for _ in range(20):
        step = pose(space, np.zeros(dim), turn(space, full * np.pi / 20 * axis))
        poses[1] = carry(space, poses[1], step, np.zeros(dim))
    assert coordinate.value(poses) == pytest.approx(full * np.pi, rel=1e-12)


@pytest.mark.thorough
@pytest.mark.parametrize(("space", "frame"), [("plane-stress", UPRIGHT), ("3d", UPRIGHT), ("3d", TILTED)])
@pytest.mark.parametrize("swapped", [False, True])
def test_lever_on_a_torsion_spring_balances_its_load_up_to_170_degrees(space, frame, swapped):
    # k φ = f L sin(β − φ)
    pushed = np.radians(175.0)
    angles = np.radians([5.0, 40.0, 90.0, 140.0, 170.0])
    forces = STIFFNESS * angles / (ARM * np.sin(pushed - angles))
    case = lever(
        lambda hinge: [JointSpring(hinge, STIFFNESS)], space=space, pushed=pushed, frame=frame, swapped=swapped
    )
    curve = case.simulation.load_displacement(case.force, forces=forces)
    coordinate = JointCoordinate(case.simulation.linkage, case.joint)
    found = [coordinate.value(f.state.poses) for f in curve.frames]
    assert found == pytest.approx((-1.0 if swapped else 1.0) * angles, rel=1e-7)
    assert curve.displacements == pytest.approx(ARM * (np.cos(pushed - angles) - np.cos(pushed)), rel=1e-7)
    assert np.all(curve.stable)


@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric", "3d"])
def test_lever_without_load_rests_where_its_spring_is_relaxed(space):
    case = lever(lambda hinge: [JointSpring(hinge, STIFFNESS, rest=0.6)], space=space)
    (frame,) = case.simulation.load_displacement(case.force, forces=[0.0]).frames
    assert frame.displacement == pytest.approx(ARM * np.sin(0.6), rel=1e-7)


@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric", "3d"])
def test_sled_on_a_spring_goes_as_far_as_the_load_pushes_along_it(space):
    angle, force = 0.5, 30.0
    case = sled(lambda slider: [JointSpring(slider, 2.0, rest=1.5)], space=space, angle=angle)
    (frame,) = case.simulation.load_displacement(case.force, forces=[force]).frames
    assert frame.displacement == pytest.approx((1.5 + force * np.cos(angle) / 2.0) * np.cos(angle), rel=1e-7)


@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric", "3d"])
def test_weight_hangs_on_a_spring(space):
    # k (φ − φ₀) = −m g l cos φ
    weight, rest = 1.2, 0.4

    def effects(hinge):
        mass = {hinge.b: Mass(weight / 9810.0, at=(0.5 * ARM, 0.0))}
        return [JointSpring(hinge, STIFFNESS, rest), Gravity((0.0, -9810.0), masses=mass)]

    case = lever(effects, space=space)
    (frame,) = case.simulation.load_displacement(case.force, forces=[0.0]).frames
    angle = JointCoordinate(case.simulation.linkage, case.joint).value(frame.state.poses)
    assert STIFFNESS * (angle - rest) == pytest.approx(-weight * 0.5 * ARM * np.cos(angle), rel=1e-6)


@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric", "3d"])
def test_motor_in_the_joint_of_a_spring_holds_it_wound_up(space):
    case = lever(lambda hinge: [JointSpring(hinge, STIFFNESS, rest=-0.2)], space=space)
    mechanism = case.simulation.scene.mechanism
    motor = mechanism.motor(case.joint)
    simulation = fm.Simulation(case.simulation.scene, space=space, order=1, size=6.0, comm=MPI.COMM_SELF)
    turned = case.simulation.scene.configuration("turned", {motor: 2.5})
    (frame,) = simulation.load_displacement(case.force, forces=[0.0], configuration=turned).frames
    assert frame.motors[motor] == pytest.approx(STIFFNESS * 2.7, rel=1e-9)


def motorised(space: str):
    """The lever on a spring with a motor in its joint, and that."""
    case = lever(lambda hinge: [JointSpring(hinge, STIFFNESS)], space=space)
    motor = case.simulation.scene.mechanism.motor(case.joint)
    return fm.Simulation(case.simulation.scene, space=space, order=1, size=6.0, comm=MPI.COMM_SELF), case.force, motor


@pytest.mark.parametrize(
    ("space", "angle"), [("plane-stress", 7.0), ("3d-symmetric", -20.0), ("3d", 6.2), ("3d", -6.2)]
)
def test_moment_of_a_spring_grows_with_every_turn_in_the_plane_and_up_to_a_full_turn_in_space(space, angle):
    simulation, force, motor = motorised(space)
    turned = simulation.scene.configuration("turned", {motor: angle})
    (frame,) = simulation.load_displacement(force, forces=[0.0], configuration=turned).frames
    assert frame.motors[motor] == pytest.approx(STIFFNESS * angle, rel=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_spring_in_space_that_is_turned_further_is_refused(sign):
    simulation, force, motor = motorised("3d")
    turned = simulation.scene.configuration("turned", {motor: 7.0 * sign})
    with pytest.raises(fm.EquilibriumError, match="passes 2π" if sign > 0.0 else "passes −2π") as caught:
        simulation.load_displacement(force, forces=[0.0], configuration=turned)
    assert "'revolute joint base–lever'" in caught.value.part and "plane" in caught.value.remedy
    steps = fm.ArcSteps(motion=0.5, largest=0.2)
    with pytest.raises(fm.EquilibriumError, match="full turn") as caught:
        simulation.follow(motor, until=fm.Until(position=7.0 * sign), steps=steps)
    frames = caught.value.frames
    angles = sign * np.array([frame.displacement for frame in frames])
    assert 5.0 < angles.max() < 2.0 * np.pi and caught.value.last is frames[-1]
    assert sign * np.array([frame.force for frame in frames]) == pytest.approx(STIFFNESS * angles, abs=1e-6)


def test_springs_of_one_joint_add_up():
    one = lever(lambda hinge: [JointSpring(hinge, STIFFNESS)])
    two = lever(lambda hinge: [JointSpring(hinge, 0.3 * STIFFNESS), JointSpring(hinge, 0.7 * STIFFNESS)])
    reached = [case.simulation.load_displacement(case.force, forces=[1.0]).displacements for case in (one, two)]
    assert reached[1] == pytest.approx(reached[0], rel=1e-9)


@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric", "3d"])
def test_inverted_pendulum_buckles_at_stiffness_over_length(space):
    critical = STIFFNESS / ARM
    case = lever(lambda hinge: [JointSpring(hinge, STIFFNESS)], space=space, pushed=np.pi)
    curve = case.simulation.load_displacement(case.force, forces=[0.999 * critical, 1.001 * critical])
    assert curve.stable.tolist() == [True, False]
    assert [frame.unstable_modes for frame in curve.frames] == [0, 1]
    assert curve.displacements == pytest.approx([0.0, 0.0], abs=1e-9)


def tower(effects, *, hinged: bool) -> tuple[fm.Simulation, fm.mechanism.Force]:
    """A rigid post hinged or welded to the ground, with a flexible beam on top, pushed at its end."""
    mechanism = fm.Mechanism("tower")
    base, post = mechanism.rigid("base", fixed=True), mechanism.rigid("post")
    beam = mechanism.flexible("beam", fm.strip([(0, 30), (0, 60)], thickness=3.0, depth=4.0), PLASTIC)
    joint = (mechanism.revolute if hinged else mechanism.weld)(base, post, at=(0, 0))
    mechanism.weld(post, beam, at=(0, 32), interface_radius=1.5)
    push = mechanism.force(on=beam, at=(0, 60), direction=(1, 0))
    return fm.Simulation(fm.Scene(mechanism, effects=effects(joint)), space="plane-stress", size=1.5), push


def test_flexible_link_on_a_spring_bends_as_far_as_both_do_one_by_one_under_small_loads():
    stiffness, force = 4e4, 1e-4
    simulation, push = tower(lambda joint: [JointSpring(joint, stiffness)], hinged=True)
    together = simulation.load_displacement(push, forces=[force]).displacements[0]
    simulation, push = tower(lambda joint: [], hinged=False)
    bending = simulation.load_displacement(push, forces=[force]).displacements[0]
    turning = force * 60.0**2 / stiffness
    assert 0.1 < turning / bending < 10.0
    assert together == pytest.approx(bending + turning, rel=1e-5)


def sprung_truss(*effects_of, **design):
    """The truss finger with effects on its first joint."""
    case = truss((0.1, 2.0), (0.4, 3.2), **design)
    hinge = case.scene.mechanism.joints[0]
    return replace(case, scene=replace(case.scene, effects=[make(hinge) for make in effects_of]))


@pytest.mark.thorough
def test_design_gradient_with_a_spring_agrees_with_central_differences():
    case = sprung_truss(lambda hinge: JointSpring(hinge, 200.0, rest=0.02))
    whole, bench = objective(case, StayClose())
    p, direction = bench.design(0.05, seed=5), bench.direction(6)
    here = whole.evaluate(p)
    step = 1e-3
    ahead, back = (whole.evaluate(p + h * direction) for h in (step, -step))
    assert here.gradient @ direction == pytest.approx((ahead.value - back.value) / (2 * step), rel=1e-5)
    without, other = objective(sprung_truss(), StayClose())
    assert abs(without.evaluate(p).value - here.value) > 1e-2 * here.value  # the spring is felt


@pytest.mark.parallel
def test_ranks_agree_on_a_mechanism_with_a_spring():
    curves = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        case = sprung_truss(lambda hinge: JointSpring(hinge, 200.0, rest=0.02))
        push = case.targets[0].quantity.part
        curves.append(case.simulate(comm=comm).load_displacement(push, forces=[0.1, 0.4]))
    assert curves[1].displacements == pytest.approx(curves[0].displacements, rel=1e-8)
    assert curves[1].stable.tolist() == curves[0].stable.tolist()


def test_invalid_springs_are_refused():
    mechanism = fm.Mechanism("pair")
    a, b = mechanism.rigid("a", fixed=True), mechanism.rigid("b")
    hinge, ball = mechanism.revolute(a, b, at=(0, 0)), mechanism.spherical(a, b, at=(0, 0), name="ball")
    with pytest.raises(fm.DescriptionError, match="not positive"):
        JointSpring(hinge, 0.0)
    for other in (mechanism.motor(hinge), "hinge"):
        with pytest.raises(fm.DescriptionError, match="joint spring: .* is not a joint"):
            JointSpring(other, 1.0)
    with pytest.raises(fm.DescriptionError, match="no single free coordinate"):
        JointSpring(ball, 1.0).check(mechanism, 3)
    with pytest.raises(fm.DescriptionError, match="is not a joint of 'other'"):
        JointSpring(hinge, 1.0).check(fm.Mechanism("other"), 2)
    with pytest.raises(fm.DescriptionError, match="full turn"):
        JointSpring(hinge, 1.0, rest=7.0).check(mechanism, 3)
    JointSpring(hinge, 1.0, rest=7.0).check(mechanism, 2)
    assert JointSpring(hinge, 3.0, rest=0.1).explain() == (
        "spring of stiffness 3 in 'revolute joint a–b', relaxed at 0.1"
    )
