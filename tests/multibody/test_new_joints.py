"""Joints from outside the package: one class each."""

from dataclasses import dataclass

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.multibody import assemble, build_linkage, count_freedom

TURN = 2.0 * np.pi


@dataclass(frozen=True)
class Screw(fm.JointKind):
    """A nut on a spindle: turning by φ about the axis moves it by lead · φ / 2π along the axis."""

    lead: float

    name = "screw"
    motorised = True
    pin_along_axis = True

    def equations(self, a, b):
        apart = b.origin - a.origin
        climb = apart.dot(a.e3) - self.lead / TURN * a.angle_to(b)
        return [apart.dot(a.e1), apart.dot(a.e2), a.e1.dot(b.e3), a.e2.dot(b.e3), climb]

    def coordinate(self, a, b):
        return a.angle_to(b)


class PinInSlot(fm.JointKind):
    """A point of b on a line of a, which lies in the plane of planar models."""

    name = "pin in slot"
    planar = True
    motorised = True
    sliding = True
    axis_in_plane = True

    def equations(self, a, b):
        apart = b.origin - a.origin
        return [apart.dot(a.e1), apart.dot(a.e2)]

    def planar_equations(self, a, b):
        return [(b.origin - a.origin).dot(a.normal)]

    def coordinate(self, a, b):
        return (b.origin - a.origin).dot(a.axis)


LEAD, RADIUS = 4.0, 12.0
AXIS = np.array([2.0, -1.0, 2.0]) / 3.0


def press() -> tuple[fm.Mechanism, list]:
    """A nut that slides without turning on a spindle that turns without sliding, along ``AXIS``."""
    m = fm.Mechanism("press")
    base, spindle, nut = m.rigid("base", fixed=True), m.rigid("spindle"), m.rigid("nut")
    bearing = m.revolute(base, spindle, at=(5, 0, 1), axis=AXIS)
    m.prismatic(base, nut, at=(8, 3, -2), axis=AXIS)
    m.join(Screw(LEAD), spindle, nut, at=(5, 0, 1), axis=AXIS)
    return m, [base, bearing, nut]


def yoke(angle: float) -> tuple[fm.Mechanism, list]:
    """A Scotch yoke: the pin of a crank, drawn at ``angle``, in the slot of a yoke that slides along x."""
    m = fm.Mechanism("Scotch yoke")
    base, crank, slider = m.rigid("base", fixed=True), m.rigid("crank"), m.rigid("yoke")
    pin = (RADIUS * np.cos(angle), RADIUS * np.sin(angle))
    hinge = m.revolute(base, crank, at=(0, 0))
    m.prismatic(base, slider, at=(20, 0), axis=(1, 0))
    slot = m.join(PinInSlot(), slider, crank, at=pin, axis=(0, 1))
    return m, [base, hinge, slider, slot]


def moved(mechanism: fm.Mechanism, dim: int, positions: dict, link) -> np.ndarray:
    """Displacement of the centre of ``link`` in the assembly with motors at ``positions``."""
    linkage = build_linkage(mechanism, dim)
    configuration = fm.Scene(mechanism).configuration("moved", positions)
    return assemble(linkage, configuration).poses[linkage.body_of(link), :dim]


def simulated(mechanism: fm.Mechanism, base, effects: list, space: str) -> fm.Simulation:
    """A simulation; the one flexible link it needs carries no load."""
    leaf = mechanism.flexible("leaf", fm.strip([(0, -30), (20, -30)], thickness=6.0, depth=6.0), fm.ONYX)
    mechanism.weld(base, leaf, at=(3, -30), interface_radius=2.0)
    return fm.Simulation(fm.Scene(mechanism, effects=effects), space=space, order=1, size=6.0, comm=MPI.COMM_SELF)


@pytest.mark.parametrize("turn", [0.5, 3.0, -5.0])
def test_a_nut_climbs_by_its_lead_a_turn(turn):
    m, (_, bearing, nut) = press()
    travel = moved(m, 3, {m.motor(bearing): turn}, nut)
    # against the spindle the nut turns backwards
    assert travel == pytest.approx(-LEAD * turn / TURN * AXIS, abs=1e-12)


def test_a_motor_turns_a_nut():
    m = fm.Mechanism("jack")
    base, nut = m.rigid("base", fixed=True), m.rigid("nut")
    thread = m.join(Screw(LEAD), base, nut, at=(0, 0, 0), axis=AXIS)
    assert moved(m, 3, {m.motor(thread): 2.0}, nut) == pytest.approx(LEAD * 2.0 / TURN * AXIS, abs=1e-12)


@pytest.mark.thorough
def test_screws_of_different_lead_are_different_joints():
    travels = []
    for lead in (LEAD, 2.0 * LEAD):
        m = fm.Mechanism("jack")
        base, nut = m.rigid("base", fixed=True), m.rigid("nut")
        travels.append(moved(m, 3, {m.motor(m.join(Screw(lead), base, nut, at=(0, 0), axis=AXIS)): 1.0}, nut))
    assert travels[1] == pytest.approx(2.0 * travels[0], abs=1e-12)


def test_a_screw_press_has_one_freedom_and_four_equations_too_many():
    m, _ = press()
    system = build_linkage(m, 3).rigid
    freedom = count_freedom(system, system.drawn, np.zeros(len(system.connections)))
    assert (freedom.mobility, freedom.redundancy) == (1, 4)


def test_a_force_on_the_nut_winds_up_a_spring_on_the_spindle():
    # virtual work: F dx = k φ dφ with x = lead φ / 2π
    m, (base, bearing, nut) = press()
    push = m.force(on=nut, at=(8, 3, -2), direction=AXIS)
    stiffness, forces = 3.0, np.array([1.0, 6.0])
    simulation = simulated(m, base, [fm.JointSpring(bearing, stiffness)], "3d")
    curve = simulation.load_displacement(push, forces=forces)
    assert curve.displacements == pytest.approx(forces * (LEAD / TURN) ** 2 / stiffness, rel=1e-7)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("turn", [0.4, 2.0, -4.0])
def test_a_scotch_yoke_moves_as_the_cosine(dim, turn):
    m, (_, hinge, slider, _) = yoke(0.3)
    travel = moved(m, dim, {m.motor(hinge): turn}, slider)
    assert travel == pytest.approx([RADIUS * (np.cos(0.3 + turn) - np.cos(0.3)), *[0.0] * (dim - 1)], abs=1e-11)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_motor_in_the_slot_turns_the_crank(dim):
    m, (_, _, slider, slot) = yoke(0.0)
    rise = 5.0
    travel = moved(m, dim, {m.motor(slot): rise}, slider)
    assert travel[0] == pytest.approx(np.sqrt(RADIUS**2 - rise**2) - RADIUS, abs=1e-11)


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_a_force_on_the_yoke_balances_a_spring_on_the_crank(space):
    # drawn upright: x = −r sin φ, F r cos φ = k φ
    m, (base, hinge, slider, _) = yoke(0.25 * TURN)
    push = m.force(on=slider, at=(20, 0), direction=(-1, 0))
    stiffness, turns = 50.0, np.array([0.2, 0.7])
    simulation = simulated(m, base, [fm.JointSpring(hinge, stiffness)], space)
    curve = simulation.load_displacement(push, forces=stiffness * turns / (RADIUS * np.cos(turns)))
    assert curve.displacements == pytest.approx(RADIUS * np.sin(turns), rel=1e-7)


def test_a_spring_acts_along_a_slot(caplog):
    # drawn upright: s = r (cos φ − 1), F = dV/d(r sin φ) with V = ½ k s²: of fourth order in φ, yet at rest as drawn
    m, (base, _, slider, slot) = yoke(0.25 * TURN)
    push = m.force(on=slider, at=(20, 0), direction=(-1, 0))
    stiffness, turns = 3.0, np.array([0.8])
    simulation = simulated(m, base, [fm.JointSpring(slot, stiffness)], "plane-stress")
    curve = simulation.load_displacement(push, displacements=RADIUS * np.sin(turns))
    assert curve.forces == pytest.approx(stiffness * RADIUS * (1.0 - np.cos(turns)) * np.tan(turns), rel=1e-7)
    assert "no pose at rest" not in caplog.text


def test_a_joint_without_planar_form_is_refused_in_the_plane():
    m = fm.Mechanism("jack")
    base = m.rigid("base", fixed=True)
    m.join(Screw(LEAD), base, m.rigid("nut"), at=(0, 0))
    with pytest.raises(fm.DescriptionError, match="a screw joint does not exist in a planar model"):
        simulated(m, base, [], "plane-stress")
