"""Displacements alone lock as ν approaches 0.5; links in the u–p (mixed) formulation do not (Cook's membrane).

Errors against the same elements on 32 × 32 squares, of the displacement in the middle of the loaded edge.
"""

from functools import cache

import numpy as np
import pytest

from fenicsmech.elasticity import LOCKING, PLANE_STRAIN
from fenicsmech.laws import NeoHookean

from .cook import EDGE, LENGTH, MIDDLE, SHEAR_MODULUS, panel
from .end_load import end_load
from .mixed_newton import solve
from .single_link import components, nodes, single_link


@cache
def upward_displacement(poisson: float, *, count: int, mixed: bool, order: int = 2) -> float:
    body = single_link(
        *panel(count, 2),
        model=PLANE_STRAIN,
        law=NeoHookean,
        order=order,
        young=2.0 * SHEAR_MODULUS * (1.0 + poisson),
        poisson=poisson,
        mixed=mixed,
    )
    fixed = components(body, lambda X: X[:, 0] < 1e-9)
    solve(body, fixed, np.zeros(len(fixed)), end_load(body, length=LENGTH, traction=(0.0, 1.0 / EDGE)), steps=3)
    node = np.argmin(np.linalg.norm(nodes(body.u) - MIDDLE, axis=1))
    return float(body.u.x.array.reshape(-1, 2)[node, 1])


def error(poisson: float, **how) -> float:
    reference = upward_displacement(poisson, count=32, mixed=True)
    return abs(upward_displacement(poisson, **how) / reference - 1.0)


@pytest.mark.thorough
@pytest.mark.parametrize("count", [4, 8])
def test_displacements_alone_lose_accuracy_with_every_nine_of_poissons_ratio_and_with_a_pressure_they_do_not(count):
    ratios = (0.49, 0.499)
    alone, pressed = ([error(poisson, count=count, mixed=own) for poisson in ratios] for own in (False, True))
    assert alone[1] > 1.5 * alone[0]
    assert alone[1] > 4.0 * pressed[1]
    assert pressed[1] < 1.1 * pressed[0]


@pytest.mark.thorough
def test_limit_is_where_displacements_alone_become_more_than_twice_as_wrong():
    below, at = (
        error(poisson, count=8, mixed=False) / error(poisson, count=8, mixed=True)
        for poisson in (LOCKING - 0.02, LOCKING)
    )
    assert below < 2.0 < at < 3.0


def test_nothing_grows_on_the_way_to_the_incompressible_limit():
    values = [upward_displacement(poisson, count=8, mixed=True) for poisson in (0.4999, 0.49999, 0.499999)]
    gaps = np.abs(np.diff(values))
    assert gaps[1] == pytest.approx(gaps[0] / 10.0, rel=0.02)  # linear in 1 − 2ν


@pytest.mark.thorough
def test_both_converge_to_the_same_compressible_panel():
    gaps = [
        abs(
            upward_displacement(0.3, count=count, mixed=True) / upward_displacement(0.3, count=count, mixed=False) - 1.0
        )
        for count in (4, 8, 16)
    ]
    # the corner at the clamp keeps it from being 4 and more
    assert gaps[0] > 3.0 * gaps[1] > 9.0 * gaps[2]
    assert gaps[2] < 3e-4
