"""Springs far softer than the links they move: equilibria balance them although links round by more than they do."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.effects import JointSpring

BAR, ANGLE = 50.0, np.radians(20.0)
RUN, RISE = BAR * np.cos(ANGLE), BAR * np.sin(ANGLE)
SOFT = [1e-5, 1e-6]  # stiffness of the spring; that of the steel bar is 4,000
BEYOND = 1.1  # times the limit load
RESOLUTION = 2.0 / 1024.0  # of the limit load
BALANCED = 1e-3  # six reactions of 2.5 times the load, each balanced to 1e-4


def toggle(stiffness: float) -> tuple[fm.Simulation, fm.Force]:
    """Two bars as a roof, one of steel and one rigid, on a slide that a soft spring holds, with a load on its ridge."""
    mechanism = fm.Mechanism("toggle")
    base, right, slide = mechanism.rigid("base", fixed=True), mechanism.rigid("right"), mechanism.rigid("slide")
    along = np.array([np.cos(ANGLE), np.sin(ANGLE)])
    shape = fm.strip([tuple(-along), tuple((BAR + 1.0) * along)], thickness=1.0, depth=1.0)
    left = mechanism.flexible("left", shape, fm.Material("steel", 2e5, 0.3))
    mechanism.revolute(base, left, at=(0, 0), interface_radius=0.3)
    mechanism.revolute(left, right, at=(RUN, RISE), interface_radius=0.3)
    mechanism.revolute(right, slide, at=(2.0 * RUN, 0))
    slider = mechanism.prismatic(base, slide, at=(2.0 * RUN, 0), axis=(1, 0))
    load = mechanism.force(on=right, at=(RUN, RISE), direction=(0, -1))
    scene = fm.Scene(mechanism, effects=[JointSpring(slider, stiffness)])
    return fm.Simulation(scene, space="plane-stress", order=1, size=2.0, comm=MPI.COMM_SELF), load


def force(displacement: float) -> float:
    """The load per stiffness of the spring that holds the ridge where it is, with rigid bars."""
    angle = np.arcsin(np.sin(ANGLE) - displacement / BAR)
    return 4.0 * BAR * (np.cos(angle) - np.cos(ANGLE)) * np.tan(angle)


@pytest.mark.parametrize("stiffness", SOFT)
def test_equilibria_beside_a_limit_load_balance_a_spring_softer_than_the_rounding_of_links(stiffness):
    limit = 4.0 * stiffness * BAR * (1.0 - np.cos(ANGLE) ** (2.0 / 3.0)) ** 1.5
    simulation, load = toggle(stiffness)
    try:
        found = simulation.load_displacement(load, forces=[BEYOND * limit]).frames[-1]
    except fm.EquilibriumError as error:
        found = error.last
        assert (1.0 - RESOLUTION) * limit < found.force < (1.0 + BALANCED) * limit
    else:  # which of the two depends on rounding: the ridge has snapped below the pins
        assert found.snapped_through and found.stable and found.displacement > 2.0 * RISE
    assert found.force == pytest.approx(stiffness * force(found.displacement), rel=BALANCED)


def frame() -> tuple[fm.Simulation, fm.Force]:
    """A symmetric frame of steel legs and rigid arms on soft springs; its ridge sways at a load of 0.02.

    The load spreads the legs more the larger it is, before and beyond the bifurcation alike.
    """
    mechanism, steel = fm.Mechanism("frame"), fm.Material("steel", 2e5, 0.3)
    base, ridge, arms, springs = mechanism.rigid("base", fixed=True), (0.0, 140.0), [], []
    for name, x in (("left", -50.0), ("right", 50.0)):
        leg = mechanism.flexible(name, fm.strip([(x, 0), (x, 100)], thickness=5.0, depth=1.0), steel)
        arms.append(mechanism.rigid(f"{name} arm"))
        springs.append(JointSpring(mechanism.revolute(base, leg, at=(x, 0), interface_radius=2.5), 1.0))
        mechanism.revolute(leg, arms[-1], at=(x, 100), interface_radius=2.5)
    springs.append(JointSpring(mechanism.revolute(*arms, at=ridge), 1.0))
    load = mechanism.force(on=arms[0], at=ridge, direction=(0, -1))
    scene = fm.Scene(mechanism, effects=springs)
    return fm.Simulation(scene, space="plane-stress", order=1, size=10.0, comm=MPI.COMM_SELF), load


def test_load_steps_of_stiff_links_beyond_a_bifurcation_end_where_the_followed_path_does():
    simulation, load = frame()
    path = simulation.follow(load, until=fm.Until(force=0.04, frames=300))
    (bifurcation,) = path.bifurcations
    assert bifurcation.frame.force == pytest.approx(0.02, rel=0.01)
    stepped = simulation.load_displacement(load, forces=[0.03, 0.04])
    assert stepped.forces[-1] == pytest.approx(path.forces[-1], rel=1e-9)
    assert stepped.displacements[-1] == pytest.approx(path.displacements[-1], rel=1e-8)
    assert [frame.unstable_modes for frame in stepped.frames] == [1, 1]
    assert not stepped.snapped_through.any()
    assert stepped.remarks == ("as drawn: 2 of 2 equilibria are unstable under dead loads",)
