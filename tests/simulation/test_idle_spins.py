"""Links between two ball joints spin idly: equilibria and their stability do not depend on it."""

from dataclasses import replace

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.equilibrium import LoadControl

# the rocker's arm at the force over that at the coupler, times Euler's load of the coupler between its balls
BUCKLING = 40.0 / 30.0 * np.pi**2 * 1770.0 * 3.0**4 / 12.0 / 60.0**2


def rssr(*, rod: bool = False, order: int = 2, effects: tuple = ()):
    """A four-bar in space, pushed at its rocker against the locked crank; the coupler may end in a rigid ``rod``."""
    m = fm.Mechanism("RSSR four-bar")
    ground, crank, rocker = m.rigid("ground", fixed=True), m.rigid("crank"), m.rigid("rocker")
    end = (80.0, 0.0, 0.0)
    coupler = m.flexible("coupler", fm.strip([(20, 0), (60 if rod else 80, 0)], thickness=3.0, depth=3.0), fm.ONYX)
    held = coupler
    if rod:
        held = m.rigid("rod")
        m.weld(coupler, held, at=(60, 0, 0), interface_radius=1.5)
    hinge = m.revolute(ground, crank, at=(0, 0, 0))
    m.spherical(crank, coupler, at=(20, 0, 0), interface_radius=1.5)
    m.spherical(held, rocker, at=end, **({} if rod else {"interface_radius": 1.5}))
    m.revolute(rocker, ground, at=(80, 0, 40), axis=(0, 1, 0))
    motor = m.motor(hinge)
    push = m.force(on=rocker, at=(80, 0, 10), direction=(-1, 0, 0), name="push")
    return fm.Simulation(fm.Scene(m, effects=list(effects)), space="3d", size=3.0, order=order), push, motor


@pytest.mark.parametrize("turn", [0.0, 0.6])
def test_idle_coupler_carries_loads_up_to_buckling_without_a_remark(turn):
    simulation, push, motor = rssr()
    configuration = fm.Configuration("turned", [(motor, turn)])
    curve = simulation.load_displacement(push, forces=[8.75, 17.5, 35.0], configuration=configuration)
    assert 35.0 < BUCKLING
    for frame in curve.frames:
        assert (frame.unstable_modes, frame.snapped_through) == (0, False)
        assert frame.iterations <= 4
    followed = simulation.follow(push, until=fm.Until(force=35.0), configuration=configuration)
    assert curve.frames[-1].displacement == pytest.approx(followed.frames[-1].displacement, rel=1e-8)


def test_several_links_may_spin_together():
    simulation, push, _ = rssr(rod=True)
    curve = simulation.load_displacement(push, forces=[5.0, 20.0])
    assert [frame.unstable_modes for frame in curve.frames] == [0, 0]
    alone, own_push, _ = rssr()
    softer = alone.load_displacement(own_push, forces=[5.0, 20.0])
    # the rod does not shorten: nearly two thirds of the strip's length between its interfaces are left
    ratio = curve.frames[0].displacement / softer.frames[0].displacement
    assert ratio == pytest.approx((40.0 - 3.0) / (60.0 - 3.0), rel=0.05)


def test_a_load_on_the_link_stops_it_from_spinning_idly():
    m = fm.Mechanism("hanging rod")
    ground = m.rigid("ground", fixed=True)
    rod = m.flexible("rod", fm.strip([(0, 0), (60, 0)], thickness=3.0, depth=3.0), fm.ONYX)
    arm = m.rigid("arm")
    m.spherical(ground, rod, at=(0, 0, 0), interface_radius=1.5)
    m.weld(rod, arm, at=(60, 0, 0), interface_radius=1.5)
    m.spherical(arm, ground, at=(70, 0, 0))
    pull = m.force(on=arm, at=(60, -5, 0), direction=(0, -1, 0), name="pull")
    frame = fm.Simulation(fm.Scene(m), space="3d", size=3.0).load_displacement(pull, forces=[0.1]).frames[-1]
    assert (frame.unstable_modes, frame.snapped_through) == (0, False)


def idle_hint(simulation, push) -> str:
    """The hint on idle spins, empty if there is none."""
    explanation = simulation.load_displacement(push, forces=[5.0]).explain()
    return next((hint.text for hint in explanation.left_out if hint.what == "idle spins"), "")


@pytest.mark.parametrize("kind", ["output", "force"])
def test_points_away_from_the_line_of_an_idle_spin_are_named_by_explanations(kind):
    for at, named in (((50, 0, 0), False), ((50, 1.0, 0), True)):
        simulation, push, _ = rssr()
        mechanism = simulation.scene.mechanism
        (coupler,) = mechanism.flexible_links
        getattr(mechanism, kind)(on=coupler, at=at, direction=(0, 1, 0), name="side")
        assert ("'side'" in idle_hint(simulation, push)) is named


def test_points_on_the_line_between_joints_of_a_design_are_not_named():
    simulation, push, _ = rssr(rod=True)
    mechanism = simulation.scene.mechanism
    rod, ball = mechanism.links[-1], mechanism.joints[-2]
    for name, y in (("drawn", 0.0), ("designed", 2.0)):  # the ball at x = 80 goes to y = 2.4, that at x = 20 stays
        mechanism.output(on=rod, at=(70, y, 0), direction=(0, 1, 0), name=name)
    text = idle_hint(simulation, push)
    assert "'designed'" in text and "'drawn'" not in text
    numbers = {fm.JointPosition(ball, direction=(0, 1, 0)): 2.4}
    shifted = simulation.with_design(fm.Design(np.zeros_like(simulation.model.design.field), numbers))
    text = idle_hint(shifted, push)
    assert "'drawn'" in text and "'designed'" not in text


def test_points_of_a_link_follow_its_design_to_the_line():
    simulation, push, _ = rssr()
    mechanism = simulation.scene.mechanism
    (coupler,), balls = mechanism.flexible_links, mechanism.joints[1:3]
    mechanism.output(on=coupler, at=(50, 0, 0), direction=(0, 1, 0), name="on the line")
    assert not idle_hint(simulation, push)
    field = np.zeros_like(simulation.model.design.field).reshape(-1, 3)
    field[:, 1] = 2.0
    design = fm.Design(field.ravel(), {fm.JointPosition(*balls, direction=(0, 1, 0)): 2.0})
    assert not idle_hint(simulation.with_design(design), push)


def sliding_rocker():
    """A five-bar in space, held by two motors: crank, idle coupler, a link hinged to the rocker across it, rocker."""
    m = fm.Mechanism("five-bar")
    ground, crank, link, rocker = m.rigid("ground", fixed=True), *(m.rigid(n) for n in ("crank", "link", "rocker"))
    coupler = m.flexible("coupler", fm.strip([(20, 0), (80, 0)], thickness=3.0, depth=3.0), fm.ONYX)
    hinge = m.revolute(ground, crank, at=(0, 0, 0))
    m.spherical(crank, coupler, at=(20, 0, 0), interface_radius=1.5)
    m.spherical(coupler, link, at=(80, 0, 0), interface_radius=1.5)
    m.motor(m.revolute(link, rocker, at=(80, 0, 20), axis=(1, 0, 0)))
    m.revolute(rocker, ground, at=(80, 0, 40), axis=(0, 1, 0))
    push = m.force(on=rocker, at=(80, 0, 30), direction=(-1, 0, 0))
    return m, push, m.motor(hinge)


def two_couplers():
    """A crank, a lever and a rocker, with an idle coupler from each to the next."""
    m = fm.Mechanism("two couplers")
    ground, crank, lever, rocker = m.rigid("ground", fixed=True), *(m.rigid(n) for n in ("crank", "lever", "rocker"))
    hinge = m.revolute(ground, crank, at=(0, 0, 0))
    for name, a, b, x in (("first", crank, lever, 20), ("second", lever, rocker, 70)):
        coupler = m.flexible(name, fm.strip([(x, 0), (x + 50, 0)], thickness=3.0, depth=3.0), fm.ONYX)
        m.spherical(a, coupler, at=(x, 0, 0), interface_radius=1.5)
        m.spherical(coupler, b, at=(x + 50, 0, 0), interface_radius=1.5)
    m.revolute(lever, ground, at=(70, 0, 30), axis=(0, 1, 0))
    m.revolute(rocker, ground, at=(120, 0, 40), axis=(0, 1, 0))
    push = m.force(on=rocker, at=(120, 0, 10), direction=(-1, 0, 0))
    return m, push, m.motor(hinge)


@pytest.mark.parametrize(("describe", "spins"), [(sliding_rocker, 1), (two_couplers, 2)])
@pytest.mark.parametrize("turn", [0.0, 0.6])
def test_load_steps_agree_with_a_path_that_is_followed_whatever_spins_idly(describe, spins, turn):
    mechanism, push, motor = describe()
    simulation = fm.Simulation(fm.Scene(mechanism), space="3d", size=3.0)
    configuration = fm.Configuration("turned", [(motor, turn)])
    curve = simulation.load_displacement(push, forces=[5.0, 17.5, 35.0], configuration=configuration)
    assert (curve.freedom.mobility, curve.freedom.zero_energy, curve.remarks) == (spins, (), ())
    assert all(frame.stable and frame.iterations <= 4 for frame in curve.frames)
    followed = simulation.follow(push, until=fm.Until(force=35.0), configuration=configuration)
    assert curve.frames[-1].displacement == pytest.approx(followed.frames[-1].displacement, rel=1e-8)
    assert followed.remarks == ()


TURNING = {
    "pressure and prestrain": lambda link: (fm.Pressure(link, 0.5), fm.Prestrain(link, 1.002)),
    "distant obstacle": lambda link: (fm.Contact(link, fm.HalfPlane((0, -50, 0), (0, 1, 0))),),
}


@pytest.mark.parametrize("kind", TURNING)
def test_links_spin_idly_under_effects_that_turn_with_them(kind):
    mechanism, push, _ = two_couplers()
    effects = TURNING[kind](mechanism.flexible_links[0])
    simulation = fm.Simulation(fm.Scene(mechanism, effects=effects), space="3d", size=3.0)
    curve = simulation.load_displacement(push, forces=[17.5, 35.0])
    assert (curve.freedom.mobility, curve.freedom.zero_energy, curve.remarks) == (2, (), ())
    assert all(frame.stable and not frame.snapped_through for frame in curve.frames)
    followed = simulation.follow(push, until=fm.Until(force=35.0))
    assert curve.frames[-1].displacement == pytest.approx(followed.frames[-1].displacement, rel=1e-8)


def test_spins_are_not_idle_where_their_links_touch_obstacles():
    simulation, push, _ = rssr()
    mechanism = simulation.scene.mechanism
    (coupler,) = mechanism.flexible_links
    wall = fm.Contact(coupler, fm.HalfPlane((0, -1.4, 0), (0, 1, 0)))  # bends the coupler
    touching = fm.Simulation(fm.Scene(mechanism, effects=[wall]), space="3d", size=3.0)
    curve = touching.load_displacement(push, forces=[5.0, 10.0])
    assert curve.freedom.zero_energy == ()
    assert all(frame.stable and not frame.snapped_through for frame in curve.frames)
    solver, frame = touching.solver(push), curve.frames[-1]
    assert solver.system.touching(frame.state).any()
    # without a gauge the rate is right: that of the secant
    more = touching.load_displacement(push, forces=[10.0 - 1e-3, 10.0 + 1e-3])
    secant = (more.frames[1].displacement - more.frames[0].displacement) / 2e-3
    rate = solver.linearise(frame.state, LoadControl(frame.force)).point((), 0).conjugate_rate
    assert rate == pytest.approx(secant, rel=1e-5)


def test_forces_at_ball_joints_leave_their_links_idle():
    simulation, _, _ = rssr()
    mechanism = simulation.scene.mechanism
    (coupler,), rocker = mechanism.flexible_links, mechanism.links[2]
    travels = []
    for link in (coupler, rocker):
        push = mechanism.force(on=link, at=(80, 0, 0), direction=(-1, 0, 0), name=f"push on {link.name}")
        curve = simulation.load_displacement(push, forces=[5.0, 20.0])
        assert (curve.freedom.zero_energy, curve.remarks) == ((), ())
        travels.append(curve.displacements)
    assert travels[0] == pytest.approx(travels[1], rel=1e-8)


def test_coupler_turns_its_flat_side_to_its_weight():
    """What resists its spin is of second order in the weight; the sag is that of a beam about the weaker axis."""
    m = fm.Mechanism("RSSR four-bar")
    ground, crank, rocker = m.rigid("ground", fixed=True), m.rigid("crank"), m.rigid("rocker")
    length, width, depth, young, density, g = 60.0, 3.0, 2.0, 1770.0, 1e-9, 1e6
    material = fm.Material("flat", E=young, nu=0.0, density=density)
    strip = fm.strip([(20, 0), (20 + length, 0)], thickness=width, depth=depth)
    coupler = m.flexible("coupler", strip, material)
    m.motor(m.revolute(ground, crank, at=(0, 0, 0)))
    m.spherical(crank, coupler, at=(20, 0, 0), interface_radius=1.0)
    m.spherical(coupler, rocker, at=(20 + length, 0, 0), interface_radius=1.0)
    m.revolute(rocker, ground, at=(80, 0, 40), axis=(0, 1, 0))
    push = m.force(on=rocker, at=(80, 0, 10), direction=(-1, 0, 0), name="push")
    down = tuple(np.array([0.0, -1.0, -1.0]) / np.sqrt(2.0))
    middle = m.output(on=coupler, at=(20 + length / 2, 0, 0), direction=down, name="middle")
    scene = fm.Scene(m, effects=[fm.Gravity(tuple(g * np.array(down)))])
    frame = fm.Simulation(scene, space="3d", size=3.0).load_displacement(push, forces=[0.0]).frames[-1]
    sag = 5.0 * density * g * width * depth * length**4 / (384.0 * young * width * depth**3 / 12.0)
    assert (frame.unstable_modes, frame.snapped_through) == (0, False)
    assert frame.outputs[middle] == pytest.approx(sag, rel=0.03)
    assert frame.iterations <= 40


def test_paths_do_not_turn_with_links_whose_spin_hardly_anything_resists():
    simulation, push, _ = rssr(order=1, effects=(fm.Gravity((0.0, -1e-2, 3e-3)),))
    curve = simulation.follow(push, until=fm.Until(force=35.0, frames=8))
    assert not curve.events and max(frame.iterations for frame in curve.frames[1:]) == 1

    system, state = simulation.solver(push).system, curve.frames[-1].state
    (spin,) = system.spinning.spins
    (point, axis), joints, angle = spin.line(state.poses), system.joints, 0.7
    u, z = np.zeros_like(state.u), np.zeros(joints.size)
    system.interfaces.nodal(u)[:] = angle * np.cross(axis, system.interfaces.places(state.u) - point)
    for body, rates in spin.rates(joints, state.poses).items():
        z[joints.columns[body]] = angle * rates
    none = system.difference(state, state)
    spun = system.moved(state, replace(none, u=u, z=z))
    assert state.loose and system.size(system.difference(spun, state)) > 0.3
    assert system.size(system.settled_difference(spun, state)) < 1e-6


def pendulum():
    """A rod with an arm that hangs between two balls, its ``load`` at the arm's end; the angle is known exactly."""
    m = fm.Mechanism("pendulum")
    ground, arm = m.rigid("ground", fixed=True), m.rigid("arm")
    rod = m.flexible("rod", fm.strip([(0, 0), (60, 0)], thickness=3.0, depth=3.0), fm.ONYX)
    m.spherical(ground, rod, at=(0, 0, 0), interface_radius=1.5)
    m.weld(rod, arm, at=(60, 0, 0), interface_radius=1.5)
    m.spherical(arm, ground, at=(70, 0, 0))
    end = (60, -10, 0)
    forces = [m.force(on=arm, at=end, direction=d, name=n) for n, d in (("load", (0, -1, 0)), ("side", (0, 0, 1)))]
    return fm.Simulation(fm.Scene(m), space="3d", size=4.0), *forces


def test_spins_that_loads_resist_firmly_take_few_iterations():
    simulation, load, side = pendulum()
    forces = [0.02, 0.05, 0.1, 0.3]
    curve = simulation.load_displacement(side, forces=forces, others={load: 0.1})
    for force, frame in zip(forces, curve.frames, strict=True):
        assert frame.displacement == pytest.approx(10.0 * np.sin(np.arctan(force / 0.1)), rel=0.01)
        assert (frame.unstable_modes, frame.snapped_through) == (0, False)
        assert frame.iterations <= 18


def test_pendulum_pushed_up_stays_in_its_unstable_equilibrium_and_is_told_so():
    simulation, load, _ = pendulum()
    curve = simulation.load_displacement(load, forces=[0.5, -0.5])
    assert [frame.unstable_modes for frame in curve.frames] == [0, 1]
    assert abs(curve.frames[-1].displacement) < 1.0
