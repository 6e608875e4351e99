"""The default quadrature: exact for linear displacements, and far better than the mesh for quadratic ones."""

import pytest

from fenicsmech.elasticity import PLANE_STRAIN, PLANE_STRESS, SPATIAL, Quadrature

from . import cook
from .cases import each_case, name
from .single_link import distorted, interpolate, single_link, wave
from .strip import sideways_displacement

# Error of the tip displacement of the strip of strip.py with NeoHookean and quadratic displacements, by degree of
# quadrature, in per cent of the value on a much finer mesh: cells along × across, then 2, 3, 4, 6 (5 in 3D)
#
#     plane strain    10 × 1    −4.51   −4.56   −4.71   −4.71
#                     40 × 2    −0.451  −0.452  −0.453  −0.453
#     plane stress    10 × 1    −1.17   −1.22   −1.33   −1.33
#                     40 × 2    −0.127  −0.127  −0.128  −0.128
#     3D              10 × 1    −4.30   −4.28   −4.54   −4.54
#                     20 × 1    −1.70   −1.70   −1.72   −1.72


@each_case
def test_one_point_is_exact_for_linear_displacements(model, law):
    energies = []
    for quadrature in (Quadrature.for_order(1, model.dim), Quadrature(4)):
        body = single_link(*distorted(model.dim), model=model, law=law, order=1, quadrature=quadrature)
        interpolate(body.shape, wave(model.dim, 0.2, seed=1))
        interpolate(body.u, wave(model.dim, 0.2, seed=2))
        energies.append(body.energy())
    assert energies[0] == pytest.approx(energies[1], rel=1e-13)


@pytest.mark.parametrize("model", [SPATIAL, PLANE_STRAIN, PLANE_STRESS], ids=name)
def test_more_points_change_a_bent_strip_less_than_smaller_cells_do(model):
    default = Quadrature.for_order(2, model.dim)
    coarse, accurate, fine = (
        sideways_displacement(model, along=along, across=1, order=2, quadrature=quadrature)
        for along, quadrature in ((10, default), (10, Quadrature(default.degree + 3)), (20, default))
    )
    assert abs(accurate - coarse) < 0.15 * abs(fine - coarse)


def test_more_points_change_cooks_membrane_less_than_smaller_cells_do():
    default = Quadrature.for_order(2, 2)
    coarse, accurate = (
        cook.upward_displacement(PLANE_STRAIN, cook.MIDDLE, count=8, order=2, quadrature=quadrature)
        for quadrature in (default, Quadrature(default.degree + 3))
    )
    assert abs(accurate - coarse) < 1e-4 * abs(cook.BETWEEN_WALLS - coarse)
