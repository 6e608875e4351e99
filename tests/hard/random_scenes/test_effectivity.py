"""Error estimates of random scenes are within a factor of two of the true differences."""

import pytest

from .effectivity import judge
from .thresholds import THRESHOLDS


@pytest.mark.parametrize("seed", [14, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in (15, 18))])
def test_effectivity_of_random_scenes_is_between_a_half_and_two(seed):
    # in plane stress; with two forces; a spatial linkage at a prescribed displacement
    found = judge(seed)
    assert not found.left_out
    for kind in (found.elements, found.plane_stress):
        assert kind is None or 1.0 / THRESHOLDS.effectivity < kind.effectivity < THRESHOLDS.effectivity
