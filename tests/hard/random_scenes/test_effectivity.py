"""Error estimates of random scenes are within a factor of two of the true differences."""

import pytest

from .effectivity import judge
from .thresholds import THRESHOLDS


@pytest.mark.parametrize("seed", [14, 94, 99, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in (15, 18))])
def test_effectivity_of_random_scenes_is_between_a_half_and_two(seed):
    # a slider-crank, two-link arches under forces and displacements, a four-bar, a spatial linkage
    found = judge(seed)
    assert not found.left_out
    for kind in (found.elements, found.plane_stress):
        assert kind is None or 1.0 / THRESHOLDS.effectivity < kind.effectivity < THRESHOLDS.effectivity
