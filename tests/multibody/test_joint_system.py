"""All constraints of a mechanism at once: values, gradients, Hessians and forces against finite differences."""

import numpy as np
import pytest

from fenicsmech.joints import CYLINDRICAL, PLANAR_JOINT, PRISMATIC, REVOLUTE, SPHERICAL, UNIVERSAL, WELD
from fenicsmech.mechanism import Mechanism
from fenicsmech.multibody import JointSystem, build_linkage

from ..joints.poses import random_pose
from ..oracles import dense
from .planar_machines import parallelogram

EVERY_DIMENSION = pytest.mark.parametrize("dim", [2, 3])
SPATIAL_KINDS = (REVOLUTE, PRISMATIC, CYLINDRICAL, SPHERICAL, UNIVERSAL, PLANAR_JOINT, WELD)


def zoo(dim: int) -> JointSystem:
    """A chain with every joint there is, motors where there can be, two fixed links and a loop."""
    rng = np.random.default_rng(7)
    m = Mechanism("zoo")
    links = [m.rigid("ground", fixed=True)]
    for kind in (kind for kind in SPATIAL_KINDS if dim == 3 or kind.planar):
        links.append(m.rigid(f"after {kind.name}"))
        axis = rng.standard_normal(3) if dim == 3 else (1.0, 2.0) if kind.axis_in_plane else (0.0, 0.0, 1.0)
        joint = m.join(kind, *links[-2:], at=rng.uniform(0.0, 30.0, dim), axis=axis)
        if kind.motorised:
            m.motor(joint)
    wall = m.rigid("wall", fixed=True)
    m.revolute(links[-1], wall, at=rng.uniform(0.0, 30.0, dim))
    m.revolute(links[2], links[4], at=rng.uniform(0.0, 30.0, dim))
    return build_linkage(m, dim).joints


@pytest.fixture(params=[2, 3], ids=["2d", "3d"])
def system(request) -> JointSystem:
    return zoo(request.param)


def anywhere(system: JointSystem, seed: int = 0):
    """Poses of all bodies, fixed ones at rest, motor values and multipliers; no joint closes."""
    rng = np.random.default_rng(seed)
    poses = system.drawn
    for body in system.free_bodies:
        poses[body] = random_pose(system.space, rng)
    motors = np.where([c.motor is not None for c in system.connections], rng.uniform(-1, 1, len(system.connections)), 0)
    return poses, motors, rng.standard_normal(system.rows)


def put(system: JointSystem, poses: np.ndarray, z: np.ndarray) -> np.ndarray:
    """``poses`` with the unknowns ``z``, not put back on the rotations: derivatives are taken in all directions."""
    moved = poses.copy()
    moved[system.free_bodies] = z.reshape(-1, system.space.pose_size)
    return moved


def test_drawn_bodies_satisfy_every_constraint(system):
    value = system.value(system.drawn, np.zeros(len(system.connections)))
    assert np.max(np.abs(value)) <= 4e-16


def test_gradient_is_the_dense_jacobian(system):
    poses, motors, _ = anywhere(system)
    z = system.unknowns(poses)
    expected = dense.jacobian(lambda y: system.value(put(system, poses, y), motors), z)
    assert system.gradient(poses, motors) == pytest.approx(expected, abs=1e-8)


def test_hessian_blocks_add_up_to_the_dense_jacobian_of_the_force(system):
    poses, motors, multipliers = anywhere(system)
    z = system.unknowns(poses)
    expected = dense.jacobian(lambda y: system.gradient(put(system, poses, y), motors).T @ multipliers, z)
    hessian = np.zeros((system.size, system.size))
    for rows, columns, block in system.hessian_blocks(poses, motors, multipliers):
        hessian[np.ix_(rows, columns)] += block
    assert hessian == pytest.approx(expected, abs=1e-8)
    assert hessian == pytest.approx(hessian.T, abs=1e-13)


def test_motor_rate_is_the_derivative_by_the_motor_values(system):
    poses, motors, multipliers = anywhere(system)
    direction = np.random.default_rng(1).standard_normal(len(motors))
    rate, force_rate = system.motor_rate(poses, motors, multipliers, direction)
    of_values = dense.jacobian(lambda phi: system.value(poses, phi), motors)
    of_force = dense.jacobian(lambda phi: system.gradient(poses, phi).T @ multipliers, motors)
    assert rate == pytest.approx(of_values @ direction, abs=1e-9)
    assert force_rate == pytest.approx(of_force @ direction, abs=1e-9)


def test_joints_without_motor_have_no_motor_rate(system):
    direction = np.where([c.motor is None for c in system.connections], 1.0, 0.0)
    rate, force_rate = system.motor_rate(*anywhere(system), direction)
    assert not np.any(rate)
    assert not np.any(force_rate)


def test_forces_of_all_connections_and_norms_add_up_to_the_whole(system):
    poses, motors, multipliers = anywhere(system)
    total = system.gradient(poses, motors).T @ multipliers
    for body in system.free_bodies:
        norm = [k for k, name in enumerate(system.row_names) if name == f"norm of {system.bodies[body].name}"]
        wrench = system.space.norm_gradient(poses[body]).T @ multipliers[norm]
        for k, connection in enumerate(system.connections):
            if body in (connection.a, connection.b):
                wrench = wrench + system.generalised_force(k, body, poses, motors, multipliers)
        assert wrench == pytest.approx(total[system.columns[body]], abs=1e-12)


def test_joint_acts_on_both_of_its_bodies_in_balance(system):
    # action and reaction: a joint does no work while its bodies move together
    motors = np.zeros(len(system.connections))
    multipliers = np.random.default_rng(2).standard_normal(system.rows)
    dim = system.space.dim
    for k, c in enumerate(system.connections):
        on_a, on_b = (system.generalised_force(k, body, system.drawn, motors, multipliers) for body in (c.a, c.b))
        assert on_a[:dim] == pytest.approx(-on_b[:dim], abs=1e-13)
        # moments about the origin, from those about the centres
        total = np.zeros(2 * dim - 3)
        for body, wrench in ((c.a, on_a), (c.b, on_b)):
            arm, force = ([*v, 0.0][:3] for v in (system.bodies[body].centre, wrench[:dim]))
            moment = np.cross(arm, force)[-total.size :]
            total = total + system.space.rotation_rates(system.space.identity).T @ wrench[dim:] + moment
        assert total == pytest.approx(np.zeros(2 * dim - 3), abs=1e-12 * system.length)


def test_row_scale_gives_every_row_a_unit_gradient_as_drawn(system):
    scaled = system.row_scale[:, None] * system.gradient(system.drawn, np.zeros(len(system.connections)))
    assert np.linalg.norm(scaled * system.pose_scale, axis=1) == pytest.approx(np.ones(system.rows))


def test_pose_scale_is_the_length_for_displacements_and_one_for_rotations(system):
    one = [system.length] * system.space.dim + [1.0] * system.space.rotation_size
    assert np.array_equal(system.pose_scale, one * len(system.free_bodies))


def test_pattern_of_blocks_never_changes(system):
    def pattern(blocks):
        return [(tuple(rows), tuple(columns), block.shape) for rows, columns, block in blocks]

    motors, multipliers = np.zeros(len(system.connections)), np.zeros(system.rows)
    moved = anywhere(system)
    assert pattern(system.gradient_blocks(system.drawn, motors)) == pattern(system.gradient_blocks(*moved[:2]))
    as_drawn = pattern(system.hessian_blocks(system.drawn, motors, multipliers))
    assert as_drawn == pattern(system.hessian_blocks(*moved))


def test_every_row_and_column_has_its_place(system):
    rows = sorted({row for rows, _, _ in system.gradient_blocks(*anywhere(system)[:2]) for row in rows})
    assert rows == list(range(system.rows)) == list(range(len(system.row_names)))
    assert np.array_equal(np.concatenate(list(system.columns.values())), np.arange(system.size))


def test_motor_rows_are_those_that_move_with_the_motor(system):
    poses, motors, multipliers = anywhere(system)
    assert len(system.motor_rows) == 2
    for k, c in enumerate(system.connections):
        if c.motor is not None:
            rate, _ = system.motor_rate(poses, motors, multipliers, np.eye(len(motors))[k])
            assert np.flatnonzero(rate).tolist() == [system.motor_rows[c.motor]]
            assert system.row_names[system.motor_rows[c.motor]] == c.name


def test_unknowns_are_put_back_on_the_rotations_and_fixed_bodies_stay(system):
    poses, _, _ = anywhere(system)
    z = system.unknowns(poses)
    kept = poses.copy()
    moved = system.with_unknowns(poses, 1.5 * z)
    assert np.array_equal(poses, kept)
    fixed = [i for i, body in enumerate(system.bodies) if body.fixed]
    assert len(fixed) == 2
    assert np.array_equal(moved[fixed], poses[fixed])
    assert system.with_unknowns(poses, z) == pytest.approx(poses, abs=1e-15)
    assert all(np.max(np.abs(system.space.norm_residual(pose)), initial=0.0) <= 4e-16 for pose in moved)


def test_motor_values_come_by_connection(system):
    values = system.motor_values(lambda motor: {REVOLUTE: 2.0, PRISMATIC: 3.0}[motor.joint.kind])
    assert values[:2].tolist() == [2.0, 3.0]
    assert [c.motor is None for c in system.connections[2:]] == (values[2:] == 0.0).tolist()


@pytest.mark.parametrize(("dim", "redundancy"), [(2, 0), (3, 3)])
def test_multipliers_without_self_stress_balance_the_same_forces_with_the_least_norm(dim, redundancy):
    machine = parallelogram(0.7, driven=None)
    system = machine.linkage(dim).joints
    poses, still, rigid = system.drawn, np.zeros(len(system.connections)), np.zeros(system.rows)
    given = np.random.default_rng(3).standard_normal(system.rows)
    found = system.without_self_stress(given, poses, still, rigid)
    gradient = system.gradient(poses, still)
    assert gradient.T @ found == pytest.approx(gradient.T @ given, abs=1e-12 * np.abs(gradient).max())
    least = np.linalg.pinv(system.scaled_gradient(poses, still).T, rcond=1e-9)
    forces = system.pose_scale * (gradient.T @ given)
    assert found / system.row_scale == pytest.approx(least @ forces, abs=1e-10 * np.abs(given / system.row_scale).max())
    assert bool(np.abs(found - given).max() > 1e-3) == (redundancy > 0)
    # a soft joint tells its own multiplier
    assert system.without_self_stress(given, poses, still, np.ones(system.rows)) == pytest.approx(given, rel=1e-12)


def test_gaps_of_joints_keep_their_digits_below_the_rounding_of_positions(system):
    # compliant pins exert forces in proportion
    gap = 1e-19 * system.length * np.arange(1.0, 1.0 + system.space.dim)
    for connection in system.connections:
        if connection.kind.shares_point:
            poses = system.drawn.copy()
            poses[connection.b, : system.space.dim] = gap
            rows = [row for row, name in enumerate(system.row_names) if name == connection.name][: system.space.dim]
            assert system.value(poses, -system.offsets)[rows] == pytest.approx(gap, rel=1e-12)
