"""A motor goes on past the dead centre of a six-bar, from where its only flexible link must give way.

The crank turns until the rigid dyad E–F–G is stretched. From there on it stays so, as nothing but the rocker C–D
yields, until C comes into line with B and D: there it passes the pull on, and the dyad bends again.
"""

import math

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.multibody import assemble

B, C, D = (38.6, 97.8), (56.8, 95.1), (112.0, -24.6)
E, F, G = (106.8, 101.0), (213.4, 60.8), (179.7, -73.1)
STRETCHED = math.dist(E, F) + math.dist(F, G)


@pytest.fixture(scope="module")
def six_bar():
    mechanism = fm.Mechanism("six-bar")
    names = ("base", "crank", "coupler", "tie", "second rocker")
    base, crank, coupler, tie, second = (mechanism.rigid(name, fixed=name == "base") for name in names)
    bow = fm.strip([D, (74.7, 30.8), C], thickness=13.2, depth=26.4)
    rocker = mechanism.flexible("rocker", bow, fm.Material("steel", 2e5, 0.3))
    motor = mechanism.motor(mechanism.revolute(base, crank, at=(0, 0)))
    mechanism.revolute(crank, coupler, at=B)
    mechanism.revolute(coupler, rocker, at=C, interface_radius=6.0)
    mechanism.revolute(base, rocker, at=D, interface_radius=5.0)
    mechanism.revolute(coupler, tie, at=E)
    mechanism.revolute(tie, second, at=F)
    mechanism.revolute(base, second, at=G)
    push = mechanism.force(on=crank, at=(10, 0), direction=(0, 1))
    scene = fm.Scene(mechanism)
    simulation = fm.Simulation(scene, space="plane-stress", order=1, size=13.0, comm=MPI.COMM_SELF)
    return scene, simulation, motor, push


def strained(six_bar, angle):
    """The unloaded equilibrium with the crank at ``angle``, and the points B, C, E of the coupler in it."""
    scene, simulation, motor, push = six_bar
    beyond = scene.configuration(f"crank at {angle}", {motor: angle})
    assert assemble(simulation.linkage, beyond).fraction < 1.0
    (frame,) = simulation.load_displacement(push, forces=[0.0], configuration=beyond).frames
    bodies = simulation.linkage.bodies
    index = [body.link.name for body in bodies].index("coupler")
    centre, (x, y, turn) = np.array(bodies[index].centre), frame.state.poses[index]
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return frame, [centre + (x, y) + rotation @ (np.array(point) - centre) for point in (B, C, E)]


@pytest.mark.thorough
@pytest.mark.parametrize("angle", [-0.306, -0.34, -0.38])
def test_the_dyad_stays_stretched_while_the_rocker_yields(six_bar, angle):
    frame, (_, _, end) = strained(six_bar, angle)
    assert np.linalg.norm(end - G) == pytest.approx(STRETCHED, rel=1e-10)
    assert frame.stable and not frame.snapped_through
    assert frame.strain_energy > 100.0


@pytest.mark.parametrize("angle", [-0.41, pytest.param(-0.45, marks=pytest.mark.thorough)])
def test_the_dyad_bends_again_once_the_coupler_is_in_line_with_the_rocker(six_bar, angle):
    frame, (pin, middle, end) = strained(six_bar, angle)
    across = np.cross(middle - pin, D - pin) / np.linalg.norm(middle - pin) / np.linalg.norm(D - pin)
    assert across == pytest.approx(0.0, abs=1e-10)
    assert np.linalg.norm(end - G) < 0.995 * STRETCHED
    assert frame.stable and not frame.snapped_through


@pytest.mark.thorough
def test_energy_is_the_work_of_the_motor(six_bar):
    """dE/dφ = M, by the trapezoidal rule along the path that was found."""
    step, angle = 2e-3, -0.341
    (before, _), (after, _) = (strained(six_bar, angle + shift) for shift in (0.0, step))
    torque = 0.5 * sum(moment for frame in (before, after) for moment in frame.motors.values())
    assert (after.strain_energy - before.strain_energy) / step == pytest.approx(torque, rel=1e-3)
