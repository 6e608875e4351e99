"""Every material law, and every combination of assumption and law the package supports."""

import pytest

from fenicsmech.elasticity import PLANE_STRAIN, PLANE_STRESS, SPATIAL
from fenicsmech.laws import IsochoricNeoHookean, IsochoricSimoNeoHookean, LogarithmicNeoHookean, NeoHookean

LAWS = (NeoHookean, LogarithmicNeoHookean, IsochoricNeoHookean, IsochoricSimoNeoHookean)
# the plane stress of the others is found by a local solve, see test_new_law.py
CASES = (*((model, law) for model in (SPATIAL, PLANE_STRAIN) for law in LAWS), (PLANE_STRESS, NeoHookean))


def name(value) -> str:
    """A name for a model or a law in the titles of tests."""
    return getattr(value, "name", None) or value.__name__


each_law = pytest.mark.parametrize("law", LAWS, ids=name)
each_case = pytest.mark.parametrize(("model", "law"), CASES, ids=name)
