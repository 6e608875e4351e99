"""Targets of all kinds: vectors, forces at prescribed displacements, bounds and least quantities, met by designs."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import Comparison, Infeasible, SampleEquilibria

from ..equilibrium.arch import RISE, arch
from .mechanisms import PLASTIC, Bench, Case, bench
from .refusal import refused


class Arm:
    """A cantilever with two forces on its hand and one on the link itself, which a motor turns."""

    def __init__(self) -> None:
        mechanism = fm.Mechanism("arm")
        base, foot, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("foot"), mechanism.rigid("hand")
        shape = fm.strip([(0, 0), (25, 4), (50, 0)], thickness=3.0, depth=6.0)
        self.link = mechanism.flexible("link", shape, PLASTIC)
        shaft = mechanism.revolute(base, foot, at=(0, 0), name="hinge")
        self.clamp = mechanism.weld(foot, self.link, at=(0, 0), interface_radius=2.0, name="clamp")
        mechanism.weld(self.link, hand, at=(50, 0), interface_radius=2.0, name="wrist")
        self.push = mechanism.force(on=hand, at=(55, 3), direction=(0, -1), name="push")
        self.pull = mechanism.force(on=hand, at=(55, 3), direction=(1, 0), name="pull")
        self.press = mechanism.force(on=self.link, at=(25, 4), direction=(0.6, 0.8), name="press")
        self.hand, self.motor, self.scene = hand, mechanism.motor(shaft, name="shaft"), fm.Scene(mechanism)
        self.both = fm.Sample({self.push: 3.0, self.press: 2.0, self.motor: 0.2})
        self.moved = fm.Sample({self.push: fm.at(5.0), self.press: 1.0})
        self.bent = fm.Sample({self.press: fm.at(1.0)})  # whose point moves with the design

    def case(self, *targets: fm.Target) -> Case:
        return Case(self.scene, [fm.SplineDesign(self.link, 2)], targets)

    def every(self) -> list[fm.Target]:
        """Targets of all kinds on samples of all kinds."""
        return [
            fm.Target(fm.Displacement(self.hand, at=(60, 0)), self.both, equals=(-1.0, -10.0)),
            fm.Target(fm.ForceMagnitude(self.push), self.moved, equals=2.0),
            fm.Target(fm.ForceMagnitude(self.press), self.bent, equals=2.0),
            fm.Target(fm.Displacement(self.hand, at=(60, 0)), self.bent, equals=(1.0, 1.0)),
            fm.Target(fm.Magnitude(fm.Displacement(self.link, at=(25, 4))), self.both, at_least=1.0),
            fm.Target(fm.Rotation(self.hand), self.moved, at_most=0.1),
            fm.Target(fm.MotorTorque(self.motor), self.both, at_most=100.0),
            fm.Target(fm.Component(fm.JointForce(self.clamp), (1, 0)), self.moved, equals=1.0),
            fm.Target(fm.StrainEnergy(self.link), self.both, equals=20.0),
            fm.Target(fm.LinkMass(density=1e-9), least=True),
            fm.Target(fm.CentrelineLength(self.link), at_most=60.0),
        ]


@cache
def arm() -> Arm:
    return Arm()


@cache
def every() -> Bench:
    case = arm().case(*arm().every())
    return bench(case, case.simulate(size=4.0))


def test_short_form_is_the_displacement_of_a_force_at_its_sample():
    push, motor, scene = arm().push, arm().motor, arm().scene
    short = fm.Target(push, force=4.0, displacement=5.0, weight=2.0)
    assert short == fm.Target(fm.Displacement(push), fm.Sample({push: 4.0}), equals=5.0, weight=2.0)
    assert short.on_curve == (push, 4.0, 5.0, fm.Sample().configuration)
    turned = fm.Sample({push: 4.0, motor: 0.3})
    assert turned.configuration.position(motor) == 0.3
    assert turned.configuration.positions == scene.configuration("turned", {motor: 0.3}).positions
    assert fm.Target(fm.Displacement(push), turned, at_most=5.0).on_curve is None


def test_gradients_of_all_kinds_agree_with_central_differences_of_followed_equilibria():
    both = every()
    placed = both.rest.place(both.design(0.05), None)
    known = both.equilibria.from_zero()
    fields = np.array([gradient.design for gradient in both.equilibria.gradients(known)])
    gradient, direction, step = both.rest.gradient(placed, fields), both.direction(7), 1e-3

    def moved(h: float) -> np.ndarray:
        both.rest.place(placed.p + h * direction, placed)
        return both.equilibria.values(both.equilibria.from_design(known))

    slope = (moved(step) - moved(-step)) / (2.0 * step)
    assert len(slope) == 13
    size = np.abs(both.equilibria.values(known))
    assert gradient @ direction == pytest.approx(slope, rel=1e-5, abs=1e-7 * size.max())


def test_following_ends_where_tracing_does():
    both = every()
    placed = both.rest.place(both.design(0.05), None)
    known = both.equilibria.from_zero()
    both.rest.place(both.design(0.1, seed=2), placed)
    followed = both.equilibria.values(both.equilibria.from_design(known))
    assert followed == pytest.approx(both.equilibria.values(both.equilibria.from_zero()), rel=1e-7, abs=1e-7)


def test_values_at_samples_are_those_that_a_user_computes():
    both = every()
    both.rest.place(both.rest.initial, None)
    values = both.equilibria.values(both.equilibria.from_zero())
    simulation = both.simulation
    curve = simulation.load_displacement(arm().push, displacements=[5.0], others={arm().press: 1.0})
    assert values[2] == pytest.approx(curve.forces[0], rel=1e-8)
    curve = simulation.load_displacement(arm().press, displacements=[1.0])
    assert values[3] == pytest.approx(curve.forces[0], rel=1e-8)
    others = {arm().press: 2.0}
    place = arm().both.configuration
    curve = simulation.load_displacement(arm().push, forces=[3.0], others=others, configuration=place)
    assert values[8] == pytest.approx(curve.frames[0].motors[arm().motor], rel=1e-7)
    assert values[10] == pytest.approx(curve.frames[0].strain_energy, rel=1e-7)


@pytest.mark.thorough
def test_equilibria_at_a_prescribed_displacement_may_be_unstable_under_the_force():
    simulation, push = arch()
    path = simulation.follow(push, until=fm.Until(displacement=1.2 * RISE))
    middle = next(frame for frame in path.frames if not frame.stable)
    held = fm.Target(fm.ForceMagnitude(push), fm.Sample({push: fm.at(middle.displacement)}), equals=1.0)
    known = SampleEquilibria(simulation, [held])
    known = known.values(known.from_zero())
    assert known == pytest.approx([middle.force], rel=1e-6)
    limit = path.limit_points[0].frame
    pushed = fm.Target(push, force=1.2 * limit.force, displacement=limit.displacement)
    with pytest.raises(Infeasible, match="snaps|unstable|no equilibrium"):
        SampleEquilibria(simulation, [pushed]).from_zero()


def test_vectors_and_forces_at_displacements_are_reached():
    case = arm().case()
    drawn = SampleEquilibria(case.simulate(size=4.0), arm().every()[:2])
    x, y, force = drawn.values(drawn.from_zero())
    targets = [
        fm.Target(fm.Displacement(arm().hand, at=(60, 0)), arm().both, equals=(0.75 * float(x), 0.85 * float(y))),
        fm.Target(fm.ForceMagnitude(arm().push), arm().moved, equals=1.15 * float(force)),
    ]
    result = arm().case(*targets).problem(size=4.0).optimise()
    assert all(target.met for target in result.targets) and result.verified
    assert [target.unit for target in result.targets] == ["mm", "N"]
    missed = np.subtract(result.targets[0].corrected, targets[0].wanted)
    assert np.linalg.norm(missed) == pytest.approx(result.targets[0].error * np.linalg.norm(targets[0].wanted))
    assert "met" in str(result) and "mm" in str(result)


def test_mass_falls_as_far_as_bounds_allow():
    stiff = fm.Target(fm.Displacement(arm().push), fm.Sample({arm().push: 2.0}), at_most=9.0)
    case = arm().case(stiff, fm.Target(fm.LinkMass(density=1e-9), least=True))
    result = case.problem(size=4.0).optimise()
    bound, mass = result.targets
    assert bound.met and bound.corrected == pytest.approx(9.0, rel=0.01) and bound.started < 8.0
    assert mass.reached < 0.97 * mass.started and mass.wanted is None and mass.met


@pytest.mark.parallel
def test_ranks_find_the_same_values_and_derivatives():
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        case = arm().case(*arm().every())
        problem = case.problem(comm=comm, size=4.0)
        _, objective = problem._own.team
        here = objective.evaluate(problem.initial)
        found.append((objective.reached, here.gradient, here.inequalities.values, here.inequalities.jacobian))
    for alone, together in zip(*found, strict=True):
        assert together == pytest.approx(alone, rel=1e-7, abs=1e-7 * np.abs(alone).max())


def test_comparison_makes_residuals_bounds_and_objective_of_values():
    push, drawn = arm().push, fm.Sample({arm().push: 1.0})
    compared = Comparison(
        [
            fm.Target(fm.Displacement(arm().hand, at=(0, 0)), drawn, equals=(3.0, 4.0), weight=4.0),
            fm.Target(fm.Displacement(push), drawn, at_least=2.0),
            fm.Target(fm.StrainEnergy(), drawn, least=True, weight=0.5),
        ],
        fm.Units(),
    ).relative_to(np.array([0.0, 0.0, 0.0, 8.0]))
    values = np.array([4.0, 4.0, 1.0, 6.0])
    assert compared.scales == pytest.approx([5.0, 2.0, 8.0])
    assert compared.residuals(values) == pytest.approx([0.4, 0.0])
    assert compared.inequalities(values) == pytest.approx([0.5])
    assert compared.plain(values) == pytest.approx(0.5 * 6.0 / 8.0)
    assert compared.errors(values) == pytest.approx([0.2, 0.5, 0.0])
    rows = np.random.default_rng(1).standard_normal((4, 3))
    for slopes, function in zip(
        compared.slopes(rows), (compared.residuals, compared.plain, compared.inequalities), strict=True
    ):
        step = np.array([1e-3, -2e-3, 3e-3])
        assert slopes @ step == pytest.approx(function(values + rows @ step) - function(values), rel=1e-9, abs=1e-12)


def test_bounds_are_measured_by_themselves_and_equalities_by_others_of_their_kind():
    push, sample = arm().push, fm.Sample({arm().push: 1.0})
    along = fm.Component(fm.Displacement(arm().hand, at=(60, 0)), (1, 0))
    targets = [
        fm.Target(fm.LargestStrain(), sample, at_most=0.02),
        fm.Target(fm.LeastSafety(), sample, at_least=1.5),
        fm.Target(fm.Displacement(push), sample, equals=5.0),
        fm.Target(along, sample, equals=0.1),  # of the kind of the one before
        fm.Target(fm.CentrelineLength(arm().link), equals=0.1),  # of another kind, in the same unit
        fm.Target(along, sample, at_most=0.1),
        fm.Target(along, sample, at_least=0.0),
    ]
    compared = Comparison(targets, fm.Units())
    assert compared.scales == pytest.approx([0.02, 1.5, 5.0, 0.5, 0.1, 0.1, 0.5])
    assert compared.errors(np.array([0.0214, 1.5, 5.0, 0.1, 0.1, 0.1, 0.0]))[0] == pytest.approx(0.07)
    for relation in ({"at_least": 0.0}, {"equals": 0.0}):
        with pytest.raises(fm.DescriptionError, match="zero is wanted.*scale="):
            Comparison([fm.Target(along, sample, **relation), targets[4]], fm.Units())


def test_wanted_components_may_be_an_array_or_the_first_of_a_vector():
    place, sample = fm.Displacement(arm().hand, at=(60, 0)), fm.Sample({arm().push: 1.0})
    assert fm.Target(place, sample, equals=np.array([1.0, 2.0])) == fm.Target(place, sample, equals=(1.0, 2.0))
    first = fm.Target(place, sample, equals=(1.0,))
    first.check(arm().scene, 2)
    assert first.size == 1
    assert fm.Target(fm.Displacement(arm().push), sample, equals=np.float64(2.0)).wanted == (2.0,)
    known = every().equilibria
    along = SampleEquilibria(every().simulation, [fm.Target(place, arm().both, equals=(1.0,))])
    assert along.values(along.from_zero()) == pytest.approx(known.values(known.from_zero())[:1], rel=1e-7)


def test_a_group_of_forces_in_a_sample_is_its_forces():
    own = arm()
    pair = fm.ForceGroup("pair", {own.push: 1.0, own.pull: -0.5})
    assert fm.Sample({pair: 4.0}) == fm.Sample({own.push: 4.0, own.pull: -2.0})
    for loads, problem in (({pair: 1.0, own.push: 1.0}, "'push' is given twice"), ({pair: fm.at(1.0)}, "a group")):
        with pytest.raises(fm.DescriptionError, match=problem):
            fm.Sample(loads)


def test_invalid_targets_are_refused():
    push, energy, sample = arm().push, fm.StrainEnergy(), fm.Sample({arm().push: 1.0})
    upward = fm.Component(fm.JointForce(arm().clamp), (0, 0, 1))
    for make, problem, remedy in (
        (lambda: fm.Target(energy, sample), "has 0 relations", "Give one of"),
        (lambda: fm.Target(energy, sample, equals=1.0, at_most=2.0), "has 2 relations", "Give one of"),
        (lambda: fm.Target(energy, equals=1.0), "its sample is None", "Sample"),
        (lambda: fm.Target(fm.LinkVolume(), sample, equals=1.0), "its sample is", "Leave it out"),
        (lambda: fm.Target(push, sample, equals=1.0), "not a quantity", "Displacement"),
        (lambda: fm.Target(energy, sample, equals=1.0, force=1.0), "belong in its sample", "Sample"),
        (lambda: fm.Target(energy, sample, equals="much"), "not a number", "finite"),
        (lambda: fm.Target(energy, sample, equals=[]), "is empty", "each component"),
        (lambda: fm.Target(energy, sample, at_most=1.0, weight=2.0), "weighs a bound", "scale"),
        (lambda: fm.Target(push), "it is not given", "Sample"),
        (lambda: fm.Target(push, force=1.0), "it is not given", "Sample"),
        (
            lambda: fm.Target(fm.JointForce(arm().clamp), sample, least=True).check(arm().scene, 2),
            "only a number can be least",
            "Magnitude",
        ),
        (lambda: fm.Target(energy, sample, equals=1.0, scale=0.0), "not positive", "greater"),
        (lambda: fm.Sample({push: fm.at(1.0), arm().pull: fm.at(2.0)}), "two displacements", "at"),
        (lambda: fm.Sample(push), "not a mapping", "Sample"),
        (lambda: fm.limits(energy, 3.0, at_most=1.0), "not a list of samples", "targets"),
        (lambda: fm.Target(fm.Magnitude(push), sample, equals=1.0), "not a quantity", "vector"),
        (lambda: fm.Rotation(arm().link, joint="wrist"), "not a joint", "mechanism"),
        (lambda: fm.Sample({arm().link: 1.0}), "neither a force nor a motor", "mechanism"),
        (lambda: fm.Sample({arm().motor: 0.1}, fm.Sample({arm().motor: 0.2}).configuration), "two positions", "one"),
        (lambda: fm.Sample({push: 1.0}, "closed"), "not a configuration", "scene"),
        (lambda: arm().case(fm.Target(energy, sample, equals=0.0)).problem(), "zero is wanted", "scale"),
        (lambda: arm().case(fm.Target(energy, sample, equals=(1.0, 2.0))).problem(), "1 component", "as many"),
        (
            lambda: arm().case(fm.Target(fm.JointForce(arm().clamp), sample, equals=1.0)).problem(),
            "2 component",
            "as many",
        ),
        (
            lambda: arm().case(fm.Target(fm.ForceMagnitude(push), sample, equals=1.0)).problem(),
            "nothing prescribes the displacement",
            "at",
        ),
        (lambda: arm().case(fm.Target(fm.LinkMass(), least=True)).problem(), "the density of 'plastic'", "density"),
        (lambda: arm().case(fm.Target(upward, sample, equals=1.0)).problem(), "leaves the plane", "two coordinates"),
    ):
        refused(make, part="", problem=problem, remedy=remedy)


def test_one_limit_over_samples_is_a_target_at_each_of_them_once():
    own = arm()
    stress = fm.LargestStress()
    found = fm.limits(stress, [own.both, own.moved, own.both], at_most=30.0)
    assert found == tuple(fm.Target(stress, sample, at_most=30.0) for sample in (own.both, own.moved))
    assert fm.limits(stress, own.both, at_most=30.0) == found[:1]
    everywhere = fm.limits(stress, own.every(), at_most=30.0)
    assert [target.sample for target in everywhere] == [own.both, own.moved, own.bent]
    # of a cycle to all others
    cycles = fm.limits(fm.LeastLife(since=own.bent), own.every(), at_least=6.0, scale=0.5)
    assert [target.samples for target in cycles] == [(own.both, own.bent), (own.moved, own.bent)]
    assert {target.scale for target in cycles} == {0.5}
    with pytest.raises(fm.DescriptionError, match="there is no sample"):
        fm.limits(stress, [target for target in own.every() if target.sample is None], at_most=30.0)
    with pytest.raises(fm.DescriptionError, match="it has 0 relations"):
        fm.limits(stress, [own.both])
