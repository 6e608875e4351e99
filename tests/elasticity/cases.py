"""Material laws: those of two constants with every assumption they are tested in, and an example of every other one."""

import pytest

from fenicsmech.elasticity import PLANE_STRAIN, PLANE_STRESS, SPATIAL
from fenicsmech.laws import (
    Gent,
    IsochoricNeoHookean,
    IsochoricSimoNeoHookean,
    LogarithmicNeoHookean,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    Orthotropic,
    TransverselyIsotropic,
    Yeoh,
)

LAWS = (NeoHookean, LogarithmicNeoHookean, IsochoricNeoHookean, IsochoricSimoNeoHookean)
# the plane stress of the others is found by a local solve, see test_new_law.py
CASES = (*((model, law) for model in (SPATIAL, PLANE_STRAIN) for law in LAWS), (PLANE_STRESS, NeoHookean))

EXAMPLES = (
    MooneyRivlin(0.4, 0.1, 0.45),
    Yeoh(0.5, -0.01, 0.002, 0.45),
    Gent(1.0, 60.0, 0.45),
    Ogden((0.63, 0.0012, -0.01), (1.3, 5.0, -2.0), 0.45),
    Orthotropic(10.0, 4.0, 2.0, 0.3, 0.35, 0.4, 1.5, 1.2, 0.7, along=(0.9, 0.4), across=(-0.4, 0.9)),
    TransverselyIsotropic(30.0, 2.0, 0.3, 0.5, 0.9, along=(0.9, 0.4)),
)
# along the strip that bends; incompressible are ν_along = 1/2 and ν_across = 1 − E_across / 2 E_along
NEARLY_INCOMPRESSIBLE = (
    MooneyRivlin(0.4, 0.1, 0.4999),
    Yeoh(0.5, -0.01, 0.002, 0.4999),
    Gent(1.0, 60.0, 0.4999),
    Ogden((0.63, 0.0012, -0.01), (1.3, 5.0, -2.0), 0.4999),
    Orthotropic(3.0, 1.5, 1.5, 0.4999, 0.4999, 0.7498, 0.6, 0.6, 0.43),
    TransverselyIsotropic(3.0, 1.5, 0.4999, 0.7498, 0.6),
)


def name(value) -> str:
    """A name for a model, a law or an example of one in the titles of tests."""
    return getattr(value, "name", None) or getattr(value, "__name__", None) or type(value).__name__


each_law = pytest.mark.parametrize("law", LAWS, ids=name)
each_case = pytest.mark.parametrize(("model", "law"), CASES, ids=name)
