"""The Klann leg, rigid, walks as its closed form does."""

import numpy as np
import pytest

from ..oracles import klann as patent
from .planar_machines import klann


@pytest.mark.thorough
@pytest.mark.parametrize("dim", [2, 3])
def test_every_pivot_and_the_foot_follow_the_closed_form_over_a_turn(dim):
    machine = klann()
    linkage = machine.linkage(dim)
    for angle in np.radians(np.arange(0.0, 361.0, 15.0)):
        assembly = machine.drive(linkage, angle)
        assert assembly.fraction == 1.0
        wanted = patent.klann(patent.DRAWN_ANGLE + angle)
        for name, found in machine.positions(linkage, assembly.poses).items():
            place = [*getattr(wanted, name), 0.0][:dim]
            assert found == pytest.approx(place, abs=1e-9 * linkage.length), (name, angle)


@pytest.mark.parametrize("dim", [2, 3])
def test_foot_walks_backwards_with_the_crank(dim):
    machine = klann()
    linkage = machine.linkage(dim)
    for angle in (-1.0, -2.5):
        foot = machine.positions(linkage, machine.drive(linkage, angle).poses)["foot"]
        assert foot[:2] == pytest.approx(patent.klann(patent.DRAWN_ANGLE + angle).foot, abs=1e-9 * linkage.length)
