"""Laws of rubber and neo-Hookean ones in uniaxial, planar and equibiaxial tension, in all models, by hand."""

from dataclasses import replace

import numpy as np
import pytest
import ufl
from scipy.optimize import brentq

import fenicsmech as fm
from fenicsmech.elasticity import PLANE_STRAIN, PLANE_STRESS, SPATIAL, cauchy_stress
from fenicsmech.laws import IsochoricNeoHookean, IsochoricSimoNeoHookean, LogarithmicNeoHookean

from .pointwise import pointwise, tensor

# λ̄ ∂W̃/∂λ̄ of each principal stretch at constant volume, from these three
SLOPES = {
    fm.MooneyRivlin(0.4, 0.1, 0.45): lambda s: 0.8 * s**2 - 0.2 * s**-2,
    fm.Yeoh(0.5, -0.01, 0.002, 0.49): lambda s: 2.0 * s**2 * np.polyval([0.006, -0.02, 0.5], np.sum(s**2) - 3.0),
    fm.Gent(1.0, 60.0, 0.45): lambda s: s**2 * 60.0 / (63.0 - np.sum(s**2)),
    fm.Ogden((0.63, 0.0012, -0.01), (1.3, 5.0, -2.0), 0.49): lambda s: 0.63 * s**1.3 + 0.0012 * s**5.0 - 0.01 * s**-2.0,
}
# −p of the volume J over the modulus, and dU/dJ
QUADRATIC = lambda J: J - 1.0, lambda J: J - 1.0
SIMO = lambda J: 0.5 * (J - 1.0 / J), lambda J: 0.5 * (J - 1.0 / J)
LOGARITHMIC = np.log, lambda J: np.log(J) / J
VOLUMETRIC = {
    fm.NeoHookean(2.0, 0.45): SIMO,
    LogarithmicNeoHookean(2.0, 0.45): LOGARITHMIC,
    IsochoricNeoHookean(2.0, 0.45): QUADRATIC,
    IsochoricSimoNeoHookean(2.0, 0.45): SIMO,
    **dict.fromkeys(SLOPES, QUADRATIC),
}
LONG = [pytest.mark.thorough]  # to compile
QUICK = fm.NeoHookean, fm.MooneyRivlin, fm.Gent


def each(laws) -> pytest.MarkDecorator:
    """All tests for each of some laws."""
    named = [pytest.param(law, marks=LONG * (not isinstance(law, QUICK)), id=type(law).__name__) for law in laws]
    return pytest.mark.parametrize("law", named)


def volumetric_modulus(law: fm.Law) -> float:
    """λ where W̃ holds the logarithm of J, else κ."""
    if isinstance(law, fm.NeoHookean | LogarithmicNeoHookean):
        return law.E * law.nu / ((1.0 + law.nu) * (1.0 - 2.0 * law.nu))
    return law.E / (3.0 * (1.0 - 2.0 * law.nu))


def cauchy(law: fm.Law, stretches) -> np.ndarray:
    """Principal Cauchy stresses (3,) of principal stretches (3,)."""
    s, J, mu = np.asarray(stretches), np.prod(stretches), law.E / (2.0 * (1.0 + law.nu))
    if isinstance(law, fm.NeoHookean | LogarithmicNeoHookean):
        shear = mu * (s**2 - 1.0)
    else:
        even = s * J ** (-1.0 / 3.0)
        slopes = SLOPES[law](even) if law in SLOPES else mu * even**2
        shear = slopes - slopes.mean()
    return shear / J + volumetric_modulus(law) * VOLUMETRIC[law][1](J)


def free(of, kept: float) -> float:
    """The stretch of free sides, up to a little more than that at which the volume is ``kept``."""
    return brentq(of, kept**1.1, kept**0.25, xtol=1e-16, rtol=1e-15)


def specimens(law: fm.Law) -> np.ndarray:
    """Stretches (n, 3) of specimens, the last one free."""
    found = []
    for pull in (0.6, 0.9, 1.0 + 1e-6, 1.5, 2.5, 3.5):
        side = free(lambda s, pull=pull: cauchy(law, [pull, s, s])[1], pull**-0.5)
        found.append((pull, side, side))
        for other in (1.0, pull):
            across = free(lambda s, a=pull, b=other: cauchy(law, [a, b, s])[2], 1.0 / (pull * other))
            found.append((pull, other, across))
    return np.array(found)


def stresses(of, gradients: np.ndarray, pressures=0.0) -> np.ndarray:
    """Principal stresses (n, 3) at diagonal gradients (n, dim), from the stress ``of`` H and the pressure."""
    H = np.array([np.diag(row) for row in gradients])

    def build(p, *entries):
        stress = of(tensor(entries), p)
        return ufl.as_vector([stress[k, k] for k in range(3)])

    return pointwise(build, np.column_stack([np.broadcast_to(pressures, len(H)), H.reshape(len(H), -1)]))


@each(VOLUMETRIC)
def test_stresses_are_those_by_hand_in_all_models(law):
    stretches = specimens(law)
    expected = np.array([cauchy(law, row) for row in stretches])
    exactly = {"rel": 1e-9, "abs": 1e-11 * law.E}
    solid = stresses(lambda H, p: cauchy_stress(SPATIAL, law, H), stretches - 1.0)
    assert solid == pytest.approx(expected, **exactly)
    # the solve across the plane finds the free side
    flat = stresses(lambda H, p: cauchy_stress(PLANE_STRESS, law, H), stretches[:, :2] - 1.0)
    assert flat == pytest.approx(expected, **exactly)
    planar = np.column_stack([stretches[:, :2], np.ones(len(stretches))])
    expected_planar = np.array([cauchy(law, row) for row in planar])
    held = stresses(lambda H, p: cauchy_stress(PLANE_STRAIN, law, H), planar[:, :2] - 1.0)
    assert held == pytest.approx(expected_planar, **exactly)
    for model, rows, known in ((SPATIAL, stretches, expected), (PLANE_STRAIN, planar, expected_planar)):

        def mixed(H, p, model=model):
            H = ufl.variable(H)
            strain = model.strain(law, H)
            first = ufl.diff(law.mixed_energy(strain, p), H)
            stress = ufl.dot(first, (ufl.Identity(model.dim) + H).T) / strain.J
            return stress if model is SPATIAL else ufl.as_matrix([[*stress[0, :], 0], [*stress[1, :], 0], [0, 0, 0]])

        balance = -volumetric_modulus(law) * VOLUMETRIC[law][0](np.prod(rows, axis=1))
        balanced = stresses(mixed, rows[:, : model.dim] - 1.0, balance)
        assert balanced[:, : model.dim] == pytest.approx(known[:, : model.dim], **exactly)


@each(SLOPES)
def test_refused_numbers(law):
    with pytest.raises(fm.DescriptionError, match="Poisson's ratio is 0.5"):
        replace(law, nu=0.5)
    softer = {name: -value if name[0] in "Cm" else value for name, value in law.parameters.items()}
    with pytest.raises(fm.DescriptionError, match="shear modulus at small strain is -"):
        replace(law.with_parameters(softer))


@pytest.mark.parametrize(
    ("mu", "alpha", "problem"),
    [((1.0,), (2.0, 3.0), "mu is"), (1.0, 2.0, "mu is 1.0"), ((1.0, 2.0), (3.0, 0.0), "zero")],
)
def test_refused_terms_of_ogden(mu, alpha, problem):
    with pytest.raises(fm.DescriptionError, match=f"law Ogden: .*{problem}"):
        fm.Ogden(mu, alpha, 0.49)
