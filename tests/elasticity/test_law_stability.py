"""Drucker's stability of laws: eigenvalues by hand, rest, and what simulations and fits tell of it."""

import re

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import minimize

import fenicsmech as fm
from fenicsmech.laws import drucker_stability

from ..oracles.dense import gradient, hessian
from .cases import EXAMPLES, name

YEOH = fm.Yeoh(0.5, -0.06, 0.003, 0.45)
OGDEN = fm.Ogden((0.63, 0.0012, -0.01), (1.3, 5.0, -2.0), 0.45)


def energy(law: fm.Law, logarithms: np.ndarray) -> float:
    """W of the logarithms of principal stretches (3,)."""
    J, s = np.exp(logarithms.sum()), np.exp(logarithms - logarithms.mean())
    if isinstance(law, fm.Yeoh):
        distortion = np.polyval([law.C3, law.C2, law.C1, 0.0], np.sum(s**2) - 3.0)
    else:
        distortion = sum(mu / alpha * (np.sum(s**alpha) - 3.0) for mu, alpha in law.terms)
    return float(distortion + law.E / (3.0 * (1.0 - 2.0 * law.nu)) / 2.0 * (J - 1.0) ** 2)


@pytest.mark.parametrize("law", [YEOH, OGDEN], ids=name)
def test_stability_is_that_by_hand(law):
    """∂²W/∂(ln λ)² and (τᵢ − τⱼ)(λᵢ² + λⱼ²)/(λᵢ² − λⱼ²), in any frame."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    rest = law.E / (1.0 + law.nu)
    for stretches in ([1.8, 0.8, 0.7], [1.05, 1.0, 0.9], [2.4, 0.9, 0.5], [0.6, 1.2, 1.5]):
        logarithms, squares = np.log(stretches), np.square(stretches)
        tau = gradient(lambda x: energy(law, x), logarithms)
        values = list(np.linalg.eigvalsh(hessian(lambda x: energy(law, x), logarithms)))
        values += [
            (tau[i] - tau[j]) * (squares[i] + squares[j]) / (squares[i] - squares[j])
            for i, j in ((0, 1), (0, 2), (1, 2))
        ]
        F = turn @ np.diag(stretches) @ turn.T
        assert drucker_stability(law, F[None])[0] == pytest.approx(min(values) / rest, rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("law", [*EXAMPLES, fm.NeoHookean(2.0, 0.3), fm.LogarithmicNeoHookean(2.0, 0.49)], ids=name)
def test_stability_is_one_at_rest_whatever_the_rotation(law):
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    turn[:, 0] *= np.linalg.det(turn)
    assert drucker_stability(law, np.array([np.eye(3), turn])) == pytest.approx([1.0, 1.0], rel=1e-9)
    if law.stable:
        F = np.eye(3) + np.random.default_rng(3).uniform(-0.9, 0.9, (300, 3, 3))
        assert np.all(drucker_stability(law, F[np.linalg.det(F) > 0.01]) > 0.0)


def strip_under_tension(
    law: fm.Law, displacement: float, comm: MPI.Comm = MPI.COMM_WORLD, *, aside: float = 0.0
) -> fm.Curve:
    """A clamped strip, pulled along itself and, if wanted, ``aside``, which leaves no two places alike."""
    rig = fm.Mechanism("strip")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    strip = rig.flexible("strip", fm.strip([(0, 0), (20, 0)], thickness=4, depth=2), fm.Material("rubber", law=law))
    rig.clamp(wall, strip, end="start", length=2.0)
    rig.clamp(hand, strip, end="end", length=2.0)
    pull = rig.force(on=hand, at=(20, 0), direction=(1, aside))
    simulation = fm.Simulation(fm.Scene(rig), space="plane-strain", size=4.0, comm=comm)
    return simulation.load_displacement(pull, displacements=[displacement])


@pytest.mark.parallel
def test_any_number_of_ranks_finds_the_same_stability():
    alone, together = (
        strip_under_tension(YEOH, 0.1, comm, aside=0.5).frames[-1].law_stability["strip"]
        for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)
    )
    assert together.value == pytest.approx(alone.value, rel=1e-8)
    assert together.place == pytest.approx(alone.place, abs=1e-9)
    assert (together.link, together.law) == (alone.link, alone.law)


def test_auxetic_laws_are_not_taken_for_stable():
    law = fm.NeoHookean(1.0, -0.3)
    assert drucker_stability(law, np.diag([2.0, 1.0, 1.0])[None])[0] < 0.0
    assert not law.stable and not fm.LogarithmicNeoHookean(1.0, -0.1).stable
    assert fm.NeoHookean(1.0, 0.0).stable and fm.IsochoricSimoNeoHookean(1.0, -0.3).stable


def test_explanations_warn_where_a_law_is_used_beyond_its_stability():
    curve = strip_under_tension(YEOH, 0.1)
    near = curve.frames[-1].law_stability["strip"]
    assert near.stable and 0.9 < near.value < 1.0
    hints = {hint.what: hint for hint in curve.explain(weight=1e-6).left_out}
    assert not hints["instability of the material"].matters
    far = strip_under_tension(YEOH, 14.0)
    there = far.frames[-1].law_stability["strip"]
    assert not there.stable
    hint = {hint.what: hint for hint in far.explain(weight=1e-6).left_out}["instability of the material"]
    assert hint.matters and "Yeoh of 'strip'" in hint.text and "fit_law" in hint.text


def test_fits_tell_where_drucker_fails():
    law = YEOH
    stretches = np.linspace(1.2, 3.0, 10)
    fit = fm.fit_law(law, [fm.SpecimenTest("uniaxial", stretches, fm.specimen_stress(law, "uniaxial", stretches))])
    (told,) = [remark for remark in fit.remarks if remark.startswith("uniaxial: by Drucker the law is unstable from")]
    low, high = (float(word) for word in re.findall(r"\d\.\d+", told))
    unstable = []
    for stretch in (low - 0.05, low + 0.05, high - 0.05, high + 0.05):
        sides = minimize(lambda x, stretch=stretch: energy(law, np.array([np.log(stretch), *x])), [0.0, 0.0], tol=1e-9)
        F = np.diag([stretch, *np.exp(sides.x)])
        unstable.append(bool(drucker_stability(law, F[None])[0] <= 0.0))
    assert unstable == [False, True, True, False]
