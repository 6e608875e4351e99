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
def test_last_equilibrium_before_a_limit_load_balances_a_spring_softer_than_the_rounding_of_links(stiffness):
    limit = 4.0 * stiffness * BAR * (1.0 - np.cos(ANGLE) ** (2.0 / 3.0)) ** 1.5
    simulation, load = toggle(stiffness)
    with pytest.raises(fm.EquilibriumError) as caught:
        simulation.load_displacement(load, forces=[BEYOND * limit])
    last = caught.value.last
    assert last.force == pytest.approx(stiffness * force(last.displacement), rel=BALANCED)
    assert (1.0 - RESOLUTION) * limit < last.force < (1.0 + BALANCED) * limit
