"""Laws with directions: engineering constants at small strain, rotations of link and axes, and refused constants."""

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

import fenicsmech as fm
from fenicsmech.elasticity import PLANE_STRAIN, PLANE_STRESS, SPATIAL, cauchy_stress

from .pointwise import pointwise, tensor

TURN = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
TURN[:, 2] *= np.linalg.det(TURN)
PLY = (10.0, 4.0, 2.0, 0.3, 0.35, 0.4, 1.5, 1.2, 0.7)
FIBRES = (30.0, 2.0, 0.3, 0.5, 0.9)


def stresses(law: fm.Law, F: np.ndarray, model=SPATIAL) -> np.ndarray:
    """Cauchy stresses (n, 3, 3)."""
    H = F - np.eye(F.shape[-1])

    def build(*entries):
        return cauchy_stress(model, law, tensor(entries))

    return pointwise(build, H.reshape(len(H), -1)).reshape(-1, 3, 3)


def plies(axes=None) -> fm.Orthotropic:
    return fm.Orthotropic(*PLY) if axes is None else fm.Orthotropic(*PLY, along=axes[:, 0], across=axes[:, 1])


def gradients(count: int = 6) -> np.ndarray:
    return np.eye(3) + np.random.default_rng(8).uniform(-0.3, 0.3, (count, 3, 3))


def strain_under(law: fm.Law, size: float = 1e-7) -> np.ndarray:
    """The compliance (6, 6) at small strain, strains 11, 22, 33, 2·12, 2·13, 2·23 by stresses likewise."""
    pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    F = np.stack([np.eye(3)] * 6)
    for k, (i, j) in enumerate(pairs):
        F[k, i, j] += size / 2
        F[k, j, i] += size / 2
    found = stresses(law, F)
    return np.linalg.inv(np.array([[stress[i, j] / size for i, j in pairs] for stress in found]).T)


def test_constants_are_those_of_small_strain():
    E1, E2, E3, nu12, nu13, nu23, G12, G13, G23 = PLY
    expected = np.diag([1 / E1, 1 / E2, 1 / E3, 1 / G12, 1 / G13, 1 / G23])
    for (i, j), value in {(0, 1): -nu12 / E1, (0, 2): -nu13 / E1, (1, 2): -nu23 / E2}.items():
        expected[i, j] = expected[j, i] = value
    assert strain_under(plies()) == pytest.approx(expected, rel=1e-6, abs=1e-7)


def test_one_axis_is_three_of_which_two_are_alike():
    along, across, nu, nu_across, G = FIBRES
    sides = across / (2 * (1 + nu_across))
    for axes in (np.eye(3), TURN):
        three = fm.Orthotropic(
            along, across, across, nu, nu, nu_across, G, G, sides, along=axes[:, 0], across=axes[:, 1]
        )
        one = fm.TransverselyIsotropic(*FIBRES, along=axes[:, 0])
        assert stresses(one, gradients()) == pytest.approx(stresses(three, gradients()), rel=1e-9, abs=1e-11)


def test_equal_constants_are_hookes_law_at_small_strain():
    E, nu = 3.0, 0.4
    law = fm.TransverselyIsotropic(E, E, nu, nu, E / (2 * (1 + nu)), along=(1.0, 2.0, -1.0))
    assert strain_under(law) == pytest.approx(strain_under(fm.NeoHookean(E, nu)), rel=1e-6, abs=1e-7)
    assert (law.E, law.nu) == (pytest.approx(E), pytest.approx(nu))


@pytest.mark.parametrize("law", [plies(), fm.TransverselyIsotropic(*FIBRES)], ids=lambda law: type(law).__name__)
def test_stress_turns_with_the_body_and_with_link_and_axes(law):
    F = gradients()
    expected = stresses(law, F)
    scale = {"rel": 1e-9, "abs": 1e-11 * law.E}
    spun = stresses(law, TURN @ F)
    assert spun == pytest.approx(TURN @ expected @ TURN.T, **scale)
    axes = {name: tuple(TURN @ getattr(law, name)) for name in ("along", "across") if name in law.__dataclass_fields__}
    numbers = {name: getattr(law, name) for name in law.__dataclass_fields__}
    turned = type(law)(**{**numbers, **axes})
    assert stresses(turned, TURN @ F @ TURN.T) == pytest.approx(TURN @ expected @ TURN.T, **scale)


def test_planes_see_the_same_material_as_space():
    """Axis 3 across the plane, the others turned in it; up to the double length in plane stress."""
    c, s = np.cos(0.4), np.sin(0.4)
    law = plies(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
    F = np.array([np.eye(2), np.diag([1.3, 0.9]), np.diag([0.8, 1.1]), [[1.2, 0.3], [-0.2, 0.9]], np.diag([2.5, 2.5])])
    full = np.stack([np.eye(3)] * len(F))
    full[:, :2, :2] = F
    assert stresses(law, F, PLANE_STRAIN) == pytest.approx(stresses(law, full), rel=1e-10, abs=1e-12)
    flat = stresses(law, F, PLANE_STRESS)
    assert np.abs(flat[:, 2]).max() < 1e-12 * np.abs(flat).max()


def by_hand(law: fm.Law, F: np.ndarray) -> np.ndarray:
    """Cauchy stress of 3 × 3 gradients: S = (ℂ − K 1 ⊗ 1) : E + K/2 (J² − 1) C⁻¹, ℂ from the compliance in the axes."""
    E1, E2, E3, nu12, nu13, nu23, G12, G13, G23 = PLY
    if isinstance(law, fm.TransverselyIsotropic):
        E1, E2, nu12, nu23, G12 = law.E_along, law.E_across, law.nu_along, law.nu_across, law.G_along
        E3, nu13, G13, G23 = E2, nu12, G12, E2 / (2.0 * (1.0 + nu23))
    S = np.diag([1.0 / E1, 1.0 / E2, 1.0 / E3])
    S[0, 1], S[0, 2], S[1, 2] = -nu12 / E1, -nu13 / E1, -nu23 / E2
    S += np.triu(S, 1).T
    K, shear = 1.0 / S.sum(), np.array([[0.0, G12, G13], [G12, 0.0, G23], [G13, G23, 0.0]])
    axes = np.array(law.axes)  # rows
    C = F.T @ F
    strain = axes @ (C - np.eye(3)) @ axes.T / 2.0
    stress = np.diag((np.linalg.inv(S) - K) @ np.diag(strain)) + 2.0 * shear * strain
    J = np.linalg.det(F)
    stress = axes.T @ stress @ axes + K / 2.0 * (J**2 - 1.0) * np.linalg.inv(C)
    return F @ stress @ F.T / J


def spatial(in_plane: np.ndarray, across: float) -> np.ndarray:
    F = np.diag([1.0, 1.0, across])
    F[:2, :2] = in_plane
    return F


def free_across(law: fm.Law, in_plane: np.ndarray) -> np.ndarray:
    """The gradient that takes no stress across the plane."""
    across = brentq(lambda s: by_hand(law, spatial(in_plane, s))[2, 2], 1e-3, 3.0, xtol=1e-16, rtol=1e-15)
    return spatial(in_plane, across)


INCLINED, ACROSS = (0.9, 0.4, 0.0), (0.0, 0.0, 1.0)
DIRECTED = {
    "fibres": [
        fm.TransverselyIsotropic(*FIBRES, along=INCLINED),
        fm.TransverselyIsotropic(*FIBRES, along=ACROSS),
        fm.TransverselyIsotropic(3000.0, *FIBRES[1:], along=ACROSS),
        fm.TransverselyIsotropic(3000.0, *FIBRES[1:], along=INCLINED),
    ],
    "plies": [
        fm.Orthotropic(*PLY, along=INCLINED, across=(-0.4, 0.9)),
        fm.Orthotropic(*PLY, along=ACROSS, across=INCLINED),
        fm.Orthotropic(*PLY, along=(0.0, 1.0), across=ACROSS),
    ],
}


@pytest.mark.parametrize("kind", DIRECTED)
def test_stresses_are_those_by_hand_in_all_models_whichever_axis_is_across_the_plane(kind):
    """Uniaxial (the side as it likes), planar and equibiaxial stretches, and some with shear."""
    flat = [np.diag(s) for s in [(0.8, 1.1), (1.3, 0.9), (0.8, 1.0), (1.01, 1.0), (1.6, 1.0), (1.6, 1.6), (2.5, 2.5)]]
    flat += [np.array([[1.2, 0.3], [-0.2, 0.9]]), np.array([[0.9, 0.2], [0.1, 1.1]])]
    laws = [law for law in DIRECTED[kind] for _ in flat]
    in_plane = np.array(flat * len(DIRECTED[kind]))
    numbers = np.array([list(law.parameters.values()) for law in laws])
    form = laws[0]

    def found(F, stress, *more):
        """Of laws whose numbers are one value per cell; ``stress`` from law, H and more."""
        H = F - np.eye(F.shape[-1])

        def build(*given):
            law = form.with_parameters(dict(zip(form.parameters, given, strict=False)))
            own = given[numbers.shape[1] :]
            return stress(law, tensor(own[len(more) :]), *own[: len(more)])

        return pointwise(build, np.column_stack([numbers, *more, H.reshape(len(H), -1)])).reshape(-1, 3, 3)

    def near(stress, expected):
        # of each stress, in units of its largest component
        size = np.abs(expected).max(axis=(1, 2), keepdims=True)
        assert np.abs((stress - expected) / size).max() < 1e-9

    free = np.array([free_across(law, F) for law, F in zip(laws, in_plane, strict=True)])
    expected = np.array([by_hand(law, F) for law, F in zip(laws, free, strict=True)])
    near(found(free, lambda law, H: cauchy_stress(SPATIAL, law, H)), expected)
    near(found(in_plane, lambda law, H: cauchy_stress(PLANE_STRESS, law, H)), expected)
    held = np.array([by_hand(law, spatial(F, 1.0)) for law, F in zip(laws, in_plane, strict=True)])
    near(found(in_plane, lambda law, H: cauchy_stress(PLANE_STRAIN, law, H)), held)
    J = np.linalg.det(free)
    pressures = [-law.volumetric_modulus * (j - 1.0 / j) / 2.0 for law, j in zip(laws, J, strict=True)]
    near(found(free, lambda law, H, p: cauchy_stress(SPATIAL, law, H, p), pressures), expected)


def test_specimens_contract_differently_to_their_sides():
    law = fm.Orthotropic(*PLY, along=(0.0, 1.0), across=(1.0, 0.0))
    stretches = np.array([0.9, 1.0 + 1e-6, 1.2, 1.5])

    def sides(pull: float) -> np.ndarray:
        return fsolve(lambda s: np.diag(by_hand(law, np.diag([pull, *s])))[1:], [pull**-0.3, pull**-0.4], xtol=1e-12)

    expected = []
    for pull in stretches:
        free = sides(pull)
        expected.append(by_hand(law, np.diag([pull, *free]))[0, 0] * np.prod(free))
    assert fm.specimen_stress(law, "uniaxial", stretches) == pytest.approx(expected, rel=1e-9, abs=1e-13)
    for kind, other in (("planar", lambda pull: 1.0), ("equibiaxial", lambda pull: pull)):
        F = [free_across(law, np.diag([pull, other(pull)])) for pull in stretches]
        nominal = [by_hand(law, f)[0, 0] * np.linalg.det(f) / f[0, 0] for f in F]
        assert fm.specimen_stress(law, kind, stretches) == pytest.approx(nominal, rel=1e-9, abs=1e-13)
    with pytest.raises(fm.DescriptionError, match="specimen of TransverselyIsotropic.*inclined"):
        fm.specimen_stress(fm.TransverselyIsotropic(*FIBRES, along=INCLINED), "uniaxial", stretches)


def test_an_axis_that_leaves_the_plane_is_refused():
    beam = fm.Mechanism("beam")
    fibres = fm.Material("fibres", law=fm.TransverselyIsotropic(*FIBRES, along=(1.0, 0.0, 1.0)))
    base = beam.rigid("base", fixed=True)
    strip = beam.flexible("strip", fm.strip([(0, 0), (40, 0)], thickness=4, depth=2), fibres)
    beam.weld(base, strip, at=(2, 0), region=fm.Rectangle(4.0, 6.0))
    pull = beam.force(on=strip, at=(40, 0), direction=(0, 1))
    with pytest.raises(fm.DescriptionError, match="'fibres'.*along.*plane"):
        fm.Simulation(fm.Scene(beam), space="plane-stress", size=4.0).load_displacement(pull, forces=[0.1])


def test_the_second_axis_follows_from_the_first_in_the_plane():
    numbers = [getattr(plies(), name) for name in fm.Orthotropic.__dataclass_fields__][:9]
    turned, root = fm.Orthotropic(*numbers, along=(1.0, 1.0)), 0.5**0.5
    assert np.array(turned.axes) == pytest.approx(np.array([[root, root, 0], [-root, root, 0], [0, 0, 1]]))
    assert fm.Orthotropic(*numbers).across == fm.Orthotropic(*numbers, along=(0, 0, 1)).across == (0.0, 1.0, 0.0)
    with pytest.raises(fm.DescriptionError, match="leaves the plane.*across"):
        fm.Orthotropic(*numbers, along=(1.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"E2": -1.0}, "E2 of law Orthotropic: -1 is not positive"),
        ({"nu12": 1.6}, "nu12 is 1.6.*between ±1.581"),
        ({"nu12": 1.2, "nu13": 1.2, "nu23": 0.9}, "nu12 = 1.2, nu13 = 1.2, nu23 = 0.9"),
        ({"across": (1.0, 1.0)}, "not normal to each other"),
        ({"along": (0.0, 0.0)}, "along of law Orthotropic: the direction has zero length"),
    ],
)
def test_refused_constants(change, problem):
    numbers = {name: getattr(plies(), name) for name in fm.Orthotropic.__dataclass_fields__}
    with pytest.raises(fm.DescriptionError, match=problem):
        fm.Orthotropic(**{**numbers, **change})


def test_a_limit_that_is_no_root_is_given_as_a_number():
    with pytest.raises(fm.DescriptionError, match="nu_across is 1.1") as caught:
        fm.TransverselyIsotropic(30.0, 2.0, 0.3, 1.1, 0.9)
    assert caught.value.remedy == "Give a value between ±1"
