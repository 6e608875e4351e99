"""Numbers from outside the package: derivatives pass Taylor tests, and designs find them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

from ..effects.test_new_effect import Foundation, simulation
from .test_numbers import assert_derivatives
from .test_sensitivity import Bench


@dataclass(frozen=True, init=False)
class FoundationStiffness(fm.NumberKind):
    """The stiffness of foundations, a field on links."""

    what = "stiffness of the foundation"

    @staticmethod
    def candidates(scene):
        return [effect for effect in scene.effects if isinstance(effect, Foundation)]

    @staticmethod
    def label(part):
        return part.link.name

    def described(self, part):
        return part.stiffness

    def unit(self, units):
        return f"{units.force}/{units.length}⁴"

    def on(self, model):
        return fm.EffectNumber(model, self.parts, "stiffness")


@dataclass(frozen=True)
class Ballast(fm.Effect):
    """V = −w u along y of a point of a rigid link."""

    link: fm.RigidLink
    weight: float

    def explain(self):
        return f"a ballast on {self.link.name}"

    def pose_potentials(self, linkage):
        return [_Hanging(linkage.point(self.link, (20.0, 35.0)), {"weight": self.weight})]


class _Hanging(fm.PosePotential):
    def __init__(self, point: fm.BodyPoint, numbers: dict[str, float]) -> None:
        self.bodies, self.numbers, self._point = (point.body,), numbers, point

    def value(self, poses):
        return -self.numbers["weight"] * self._point.displacement(None, poses)[1]

    def gradient(self, poses):
        return self.numbers["weight"] * self.gradient_by("weight", poses)

    def hessian(self, poses):
        along = np.eye(len(self._point.displacement(None, poses)))[1]
        return -self._point.hessian(poses, self.numbers["weight"] * along)

    def gradient_by(self, name, poses):
        return -self._point.gradient(poses)[1]


@dataclass(frozen=True, init=False)
class BallastWeight(fm.NumberKind):
    """The weight of ballasts, a number of potentials of poses."""

    what = "weight of the ballast"

    @staticmethod
    def candidates(scene):
        return [effect for effect in scene.effects if isinstance(effect, Ballast)]

    @staticmethod
    def label(part):
        return part.link.name

    def described(self, part):
        return part.weight

    def unit(self, units):
        return units.force

    def on(self, model):
        return fm.EffectNumber(model, self.parts, "weight")


@dataclass(frozen=True, init=False)
class Bow(fm.NumberKind):
    """How far flexible links are bowed along x at half of their height, a part of the design field."""

    what = "bow"

    @staticmethod
    def candidates(scene):
        return scene.mechanism.flexible_links

    @property
    def reshaped(self):
        return self.parts

    def described(self, part):
        return 0.0

    def unit(self, units):
        return units.length

    def check_value(self, value):
        assert np.isfinite(value)

    def on(self, model):
        return _Bowed(model)


class _Bowed(fm.ModelNumber):
    drawn = value = 0.0

    def __init__(self, model) -> None:
        places = model.elastic.shape.function_space.tabulate_dof_coordinates()
        field = np.zeros((len(places), model.elastic.model.dim))
        field[:, 0] = np.sin(np.pi * places[:, 1] / 30.0)
        self.rate = field.ravel()

    def set(self, value):
        self.value = value

    def slope(self, terms):
        return 0.0


KINDS = {
    "foundation": (lambda scene: FoundationStiffness(scene.effects[0]), (2e-3, 1e-3, 5e-4, 2.5e-4)),
    "ballast": (lambda scene: BallastWeight(scene.effects[1]), (6.4, 3.2, 1.6)),
    "bow": (lambda scene: Bow(*scene.mechanism.flexible_links), (0.1, 0.05, 0.025, 0.0125)),
}


@pytest.fixture(
    scope="module",
    params=[
        pytest.param("plane-stress", marks=pytest.mark.parallel),
        pytest.param("3d-symmetric", marks=pytest.mark.thorough),
    ],
)
def bench(request) -> Bench:
    def effects(mechanism: fm.Mechanism) -> list[fm.Effect]:
        return [Foundation(mechanism.flexible_links[1], 0.02), Ballast(mechanism.rigid_links[1], 3.0)]

    return Bench(request.param, MPI.COMM_WORLD, effects=effects)


@pytest.mark.parametrize("name", KINDS)
def test_derivatives_by_a_new_number(bench, name):
    describe, steps = KINDS[name]
    assert_derivatives(bench, describe(bench.simulation.scene), steps)


def test_a_new_number_is_found_by_a_design_and_kept_in_files(tmp_path):
    sled, push = simulation(0.05)
    kind, stiffness, volume = FoundationStiffness(sled.scene.effects[1]), 0.08, 30.0 * 4.0 * 2.0
    travel = 0.5 / (1.0 + stiffness * volume)
    target = fm.Target(push, force=0.5, displacement=travel)
    problem = fm.DesignProblem(sled, [fm.Number(kind, 0.02, 0.2)], targets=[target])
    result = problem.optimise(
        optimiser=fm.LevenbergMarquardt(tolerance=1e-16), correction=fm.Correction(estimates=False)
    )
    (found,) = result.numbers
    assert found.value == pytest.approx(stiffness, rel=1e-5)
    assert "stiffness of the foundation of 'block': 0.08" in str(result)
    result.save(tmp_path / "design.json")
    again = sled.with_design(fm.DesignResult.load(tmp_path / "design.json"))
    assert again.load_displacement(push, forces=[0.5]).displacements[-1] == pytest.approx(travel, rel=1e-6)


def test_a_number_that_an_effect_does_not_have_is_refused():
    sled, _ = simulation(None)
    with pytest.raises(fm.DescriptionError, match="neither a field on links nor a potential"):
        fm.EffectNumber(sled.model, sled.scene.effects, "length")


class Twice(Foundation):
    """Asks for its stiffness on each use."""

    def link_energy(self, fields):
        return super().link_energy(fields) + super().link_energy(fields)


class Doubled(Foundation):
    """Has twice its stiffness in the field."""

    def link_energy(self, fields):
        stiffness = fields.number("stiffness", 2.0 * self.stiffness, [self.link])
        return fields.integral(stiffness * fields.u[0] ** 2, degree=2 * fields.order)


def test_fields_that_a_design_would_change_in_part_or_by_a_jump_are_refused():
    twice, push = simulation(0.05, Twice)
    with pytest.raises(fm.DescriptionError, match=r"'stiffness'.* twice"):
        twice.load_displacement(push, forces=[0.5])
    doubled, _ = simulation(0.05, Doubled)
    with pytest.raises(fm.DescriptionError, match=r"has the value 0\.1, and the effect 0\.05"):
        doubled.model.number(FoundationStiffness(doubled.scene.effects[1]))
