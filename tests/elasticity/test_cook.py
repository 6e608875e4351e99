"""Cook's membrane against the deal.II code gallery, to 0.3 % on 16 × 16 squares of quadratic cells."""

import pytest

from fenicsmech.elasticity import PLANE_STRAIN, SPATIAL

from . import cook


def test_panel_between_walls():
    displacement = cook.upward_displacement(PLANE_STRAIN, cook.MIDDLE, count=16, order=2)
    assert displacement == pytest.approx(cook.BETWEEN_WALLS, rel=3e-3)


@pytest.mark.thorough
def test_solid_panel_with_free_faces():
    displacement = cook.upward_displacement(SPATIAL, cook.CORNER, count=16, order=2)
    assert displacement == pytest.approx(cook.FREE_FACES, rel=3e-3)
