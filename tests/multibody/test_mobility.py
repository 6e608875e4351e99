"""Free directions and dependent constraints are counted as in the theory of mechanisms, and named."""

import numpy as np
import pytest

from fenicsmech.mechanism import Mechanism
from fenicsmech.multibody import build_linkage, count_freedom, spins

from .flexible_machines import finger, flexible_four_bar
from .machine import Machine, freedom_as_drawn
from .planar_machines import CRANK_ROCKER, DRAWN_ANGLE, collinear_parallelogram, four_bar, klann, parallelogram
from .spatial_machines import Bennett, two_ball_rod

HINGES = ("shaft", "pin", "joint", "axle")
MOVING = ("crank", "coupler", "rocker")


@pytest.mark.parametrize(("dim", "redundancy", "names"), [(2, 0, ()), (3, 3, HINGES)])
def test_planar_loop_of_hinges_is_redundant_three_times_in_space_only(dim, redundancy, names):
    freedom = freedom_as_drawn(four_bar(CRANK_ROCKER, DRAWN_ANGLE, driven=None), dim)
    assert (freedom.mobility, freedom.mobile) == (1, MOVING)
    assert (freedom.redundancy, freedom.redundant) == (redundancy, names)


@pytest.mark.parametrize(("dim", "redundancy"), [(2, 0), (3, 3)])
def test_motor_takes_the_freedom_and_adds_no_redundancy(dim, redundancy):
    freedom = freedom_as_drawn(four_bar(CRANK_ROCKER, DRAWN_ANGLE), dim)
    assert (freedom.mobility, freedom.mobile, freedom.redundancy) == (0, (), redundancy)


@pytest.mark.parametrize(("dim", "redundancy"), [(2, 0), (3, 6)])
def test_klann_leg_has_one_freedom_and_two_loops(dim, redundancy):
    assert freedom_as_drawn(klann(), dim).mobility == 0
    freedom = freedom_as_drawn(klann(driven=False), dim)
    assert (freedom.mobility, freedom.redundancy) == (1, redundancy)
    assert freedom.mobile == ("crank", "rod", "first rocker", "second rocker", "leg")


@pytest.mark.parametrize("theta", [0.6, 1.5, 2.5])
def test_bennett_loop_moves_although_its_joints_are_redundant(theta):
    # Grübler: 6 · 3 bodies − 4 hinges · 5 = −2 = 1 − 3
    freedom = freedom_as_drawn(Bennett().machine(theta), 3)
    assert (freedom.mobility, freedom.redundancy) == (1, 3)
    assert freedom.mobile == ("bar 0", "bar 1", "bar 2")
    assert len(freedom.redundant) == 4
    assert freedom_as_drawn(Bennett().machine(theta, driven=True), 3).mobility == 0


def test_skew_hinges_at_random_lock_the_loop():
    # as the count says: 18 − 20 = −2
    rng = np.random.default_rng(0)
    m = Mechanism("skew")
    links = [m.rigid("ground", fixed=True), *(m.rigid(f"bar {k}") for k in range(3))]
    for k in range(4):
        m.revolute(links[k], links[(k + 1) % 4], at=rng.uniform(0.0, 30.0, 3), axis=rng.standard_normal(3))
    freedom = freedom_as_drawn(Machine(m, None), 3)
    assert (freedom.mobility, freedom.redundancy) == (0, 2)


@pytest.mark.parametrize(("dim", "redundancy"), [(2, 0), (3, 3)])
def test_parallelogram_gains_a_freedom_and_a_dependence_at_its_change_point(dim, redundancy):
    beside = freedom_as_drawn(parallelogram(0.7, driven=None), dim)
    assert (beside.mobility, beside.redundancy) == (1, redundancy)
    flat = freedom_as_drawn(collinear_parallelogram(), dim)
    assert (flat.mobility, flat.redundancy) == (2, redundancy + 1)
    held = freedom_as_drawn(collinear_parallelogram(driven=True), dim)
    assert (held.mobility, held.mobile, held.redundancy) == (1, ("coupler", "rocker"), redundancy + 1)


@pytest.mark.parametrize(("dim", "redundancy"), [(2, 0), (3, 3)])
@pytest.mark.parametrize("angle", [1e-2, 1e-4, 1e-6])
def test_near_its_change_point_the_parallelogram_still_counts_as_regular(angle, dim, redundancy):
    freedom = freedom_as_drawn(parallelogram(angle, driven=None), dim)
    assert (freedom.mobility, freedom.redundancy) == (1, redundancy)


def test_rod_between_two_balls_spins_about_itself():
    freedom = freedom_as_drawn(two_ball_rod(), 3)
    assert (freedom.mobility, freedom.mobile, freedom.redundancy) == (1, ("rod",), 0)
    assert freedom_as_drawn(two_ball_rod(driven=False), 3).mobility == 2


def test_spins_are_idle_where_balls_hold_a_link_at_two_places():
    def idle(*balls: tuple[float, float, float], acted_on: bool = False) -> int:
        m = Mechanism("rod")
        ground, rod = m.rigid("ground", fixed=True), m.rigid("rod")
        for k, at in enumerate(balls):
            other = m.rigid(f"other {k}")
            m.spherical(rod, other, at=at)
            m.weld(other, ground, at=at)
        linkage = build_linkage(m, 3)
        acted = {linkage.body_of(rod)} if acted_on else ()
        return sum(spin.is_idle(acted) for spin in spins(linkage))

    start, end = (0.0, 0.0, 0.0), (30.0, 5.0, 10.0)
    assert idle(start, end) == 1
    assert idle(start, end, acted_on=True) == 0
    assert idle(start, start, end) == 1  # a node of three links
    assert idle(start, end, (0.0, 5.0, 0.0)) == 0
    assert idle(start, start) == 0


def test_spin_without_effect_does_not_stop_the_assembly():
    machine = two_ball_rod()
    linkage = machine.linkage(3)
    poses = machine.drive(linkage, 0.5).poses
    found = machine.positions(linkage, poses)
    assert np.linalg.norm(found["ball"] - found["pin"]) == pytest.approx(np.linalg.norm([30.0, 5.0, 30.0]), rel=1e-12)
    freedom = count_freedom(linkage.rigid, poses, linkage.rigid.motor_values(lambda motor: 0.5))
    assert (freedom.mobility, freedom.mobile) == (1, ("rod",))


@pytest.mark.parametrize(("dim", "redundancy"), [(2, 1), (3, 10)])
def test_square_braced_twice_is_overdetermined(dim, redundancy):
    # in the plane 5 bodies · 3 − 8 hinges · 2 = −1; in space 5 · 6 − 8 · 5 = −10
    m = Mechanism("braced square")
    corners = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]
    bars = {(0, 1): m.rigid("bar 01", fixed=True)}
    bars |= {ends: m.rigid(f"bar {ends[0]}{ends[1]}") for ends in ((1, 2), (2, 3), (3, 0), (0, 2), (1, 3))}
    for k, corner in enumerate(corners):
        first, *others = (bar for ends, bar in bars.items() if k in ends)
        for other in others:
            m.revolute(first, other, at=corner)
    freedom = freedom_as_drawn(Machine(m, None), dim)
    assert (freedom.mobility, freedom.redundancy) == (0, redundancy)
    assert len(freedom.redundant) == len(m.joints)  # every bar takes part in the self-stress


@pytest.mark.parametrize("dim", [2, 3])
def test_overdetermined_part_leaves_the_rest_its_freedom_and_is_named_alone(dim):
    m = Mechanism("pendulum with a doubly welded bob")
    base, rod, bob = m.rigid("base", fixed=True), m.rigid("rod"), m.rigid("bob")
    m.revolute(base, rod, at=(0.0, 0.0), name="hinge")
    m.weld(rod, bob, at=(10.0, 0.0), name="weld")
    m.weld(rod, bob, at=(10.0, 5.0), name="second weld")
    freedom = freedom_as_drawn(Machine(m, None), dim)
    assert (freedom.mobility, freedom.mobile) == (1, ("rod", "bob"))
    assert (freedom.redundancy, freedom.redundant) == ({2: 3, 3: 6}[dim], ("weld", "second weld"))


@pytest.mark.parametrize("dim", [2, 3])
def test_open_chain_has_a_freedom_per_hinge(dim):
    m = Mechanism("chain")
    links = [m.rigid("base", fixed=True), *(m.rigid(f"link {k}") for k in range(3))]
    for k in range(3):
        m.revolute(links[k], links[k + 1], at=(10.0 * k, k**2))
    freedom = freedom_as_drawn(Machine(m, None), dim)
    assert (freedom.mobility, freedom.redundancy, freedom.redundant) == (3, 0, ())


@pytest.mark.parametrize(("dim", "redundancy"), [(2, 0), (3, 3)])
def test_flexible_links_count_as_rigid(dim, redundancy):
    freedom = freedom_as_drawn(flexible_four_bar(DRAWN_ANGLE, driven=False), dim)
    assert (freedom.mobility, freedom.mobile, freedom.redundancy) == (1, MOVING, redundancy)


def test_diagonal_locks_the_truss_finger_until_it_bends():
    machine = finger(driven=False)
    assert freedom_as_drawn(machine, 2).mobility == 0
    linkage = machine.linkage(2)
    # taken apart from each other, its two ends leave the parallelogram free and turn on their pins
    bending = count_freedom(linkage.joints, linkage.joints.drawn, np.zeros(len(linkage.joints.connections)))
    assert (bending.mobility, bending.redundancy) == (3, 0)


@pytest.mark.parametrize("dim", [2, 3])
def test_mechanism_of_fixed_links_has_no_freedom(dim):
    m = Mechanism("ground")
    m.rigid("base", fixed=True)
    freedom = freedom_as_drawn(Machine(m, None), dim)
    assert (freedom.mobility, freedom.mobile, freedom.redundancy, freedom.redundant) == (0, (), 0, ())


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1.0, 1e3])
def test_counts_do_not_depend_on_the_unit_of_length(scale):
    bennett = Bennett(length=30.0 * scale)
    freedom = freedom_as_drawn(bennett.machine(1.5), 3)
    assert (freedom.mobility, freedom.redundancy) == (1, 3)
