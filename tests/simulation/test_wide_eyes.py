"""Strips with eyes wider than themselves: the eye is rigid, the strip bends from its rim on."""

import math

import pytest

import fenicsmech as fm

LENGTH, CLAMPED, RADIUS, DEPTH, E, NU = 40.0, 4.0, 3.0, 5.0, 1770.0, 0.42


def deflection(region, thickness, space, force):
    """Of a force at the end of a cantilever, on a rigid body that holds ``region`` around it."""
    mechanism = fm.Mechanism("cantilever")
    wall, tip = mechanism.rigid("wall", fixed=True), mechanism.rigid("tip")
    shape = fm.strip([(0, 0), (LENGTH, 0)], thickness=thickness, depth=DEPTH)
    beam = mechanism.flexible("beam", shape, fm.ONYX)
    mechanism.weld(wall, beam, at=(0, 0), region=fm.Rectangle(2.0 * CLAMPED, 2.0 * thickness))
    mechanism.weld(beam, tip, at=(LENGTH, 0), region=region)
    push = mechanism.force(on=tip, at=(LENGTH, 0), direction=(0, 1))
    size = 0.5 * thickness if space == "plane-stress" else thickness
    simulation = fm.Simulation(fm.Scene(mechanism, effects=[]), space=space, size=size)
    return simulation.load_displacement(push, forces=[force]).displacements[0]


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["plane-stress", "3d"])
@pytest.mark.parametrize("thickness", [2.5, 1.0])
def test_a_cantilever_with_an_eye_is_one_with_a_rigid_end(thickness, space):
    rigid = math.sqrt(RADIUS**2 - 0.25 * thickness**2)
    force = 1e-3 * thickness**3
    eye = deflection(fm.Disc(RADIUS), thickness, space, force)
    end = deflection(fm.Rectangle(2.0 * rigid, 2.0 * thickness), thickness, space, force)
    assert eye == pytest.approx(end, rel=3e-4)
    if space == "plane-stress":
        # a beam of the length l with a rigid piece a at its end: F (l³/3 + l² a + l a²) / E I
        free = LENGTH - CLAMPED - rigid
        beam = free**3 / 3.0 + free**2 * rigid + free * rigid**2
        assert eye == pytest.approx(force * beam / (E * DEPTH * thickness**3 / 12.0), rel=3e-3)


@pytest.mark.parametrize("thickness", [2.0, 1.0, 0.5])
def test_a_lever_bends_between_its_eyes_wherever_they_are(thickness):
    """A lever on two pins, one of them in the middle, of any thickness between eyes that stay."""
    mechanism = fm.Mechanism("lever")
    base, handle = mechanism.rigid("base", fixed=True), mechanism.rigid("handle")
    lever = mechanism.flexible("lever", fm.strip([(0, 0), (40, 0)], thickness=thickness, depth=DEPTH), fm.ONYX)
    for at in ((0, 0), (20, 0)):
        mechanism.revolute(base, lever, at=at, interface_radius=RADIUS)
    mechanism.weld(lever, handle, at=(40, 0), region=fm.Disc(RADIUS))
    push = mechanism.force(on=handle, at=(40, 0), direction=(0, 1))
    simulation = fm.Simulation(fm.Scene(mechanism, effects=[]), space="plane-stress", size=0.5 * thickness)
    force = 1e-3 * thickness**3
    # Timoshenko's beam: the moment of a unit force grows with the distance from either end, the shear force is even
    rim = math.sqrt(RADIUS**2 - 0.25 * thickness**2)
    bending = 2.0 * ((20.0 - rim) ** 3 - rim**3) / 3.0 / (E * DEPTH * thickness**3 / 12.0)
    shear = 2.0 * (20.0 - 2.0 * rim) / (5.0 / 6.0 * E / (2.0 * (1.0 + NU)) * DEPTH * thickness)
    reached = simulation.load_displacement(push, forces=[force]).displacements[0]
    assert reached == pytest.approx(force * (bending + shear), rel=0.02)
