"""Equilibria of targets, followed from design to design: the same as from zero load, with exact derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import DesignEquilibria, Infeasible, SampleEquilibria
from fenicsmech.equilibrium import NewtonSolver, NotConverged

from ..effects.levers import lever
from .alike import assert_alike, displacements
from .mechanisms import Bench, Case, bench, bow, sprung, strained, strains, truss, turned_beam

CASES = {
    "truss": lambda: truss((0.1, 1.0), (0.4, 2.0)),
    "force on a link": lambda: bow(20.0, 60.0),
    "strained by motors": lambda: strained(1.0, 3.0),
    "springs wound up by motors": lambda: sprung(1.0, 3.0),
    "turned by 135°": lambda: turned_beam(1.0, 3.0, -2.0),
}
each_case = pytest.mark.parametrize("name", CASES)
# cases whose unloaded point moves with the design
MOVING = ("force on a link", "strained by motors", "springs wound up by motors")


def made(name: str, **fidelity) -> Bench:
    case = CASES[name]()
    return bench(case, case.simulate(**fidelity))


def fields(both: Bench, known: DesignEquilibria) -> np.ndarray:
    """Derivatives of the displacements by the design field, (targets, owned values)."""
    return np.array([gradient.design for gradient in both.equilibria.gradients(known)])


@each_case
def test_following_a_design_ends_where_its_loading_from_zero_ends(name):
    both = made(name)
    first = both.rest.place(both.design(0.03, seed=1), None)
    known = both.equilibria.from_zero()
    both.rest.place(both.design(0.08, seed=2), first)
    followed = both.equilibria.from_design(known)
    assert_alike(followed, both.equilibria.from_zero())
    assert np.abs(displacements(followed) - displacements(known)).max() > 1e-3 * np.abs(displacements(known)).max()
    assert np.array_equal(followed.design.field, both.field())
    # cases are what they claim to be
    assert strains(both.simulation, both.equilibria.targets[0]) == (name == "strained by motors")
    for sample, at in followed.samples.items():
        assert (at.unloaded is not known.samples[sample].unloaded) == (name in MOVING)


@each_case
def test_equilibria_that_were_kept_are_those_of_their_design_and_samples_alone(name):
    both = made(name)
    first = both.rest.place(both.design(0.03, seed=1), None)
    assert both.equilibria.kept() is None
    known = both.equilibria.from_zero()
    both.equilibria.keep(known)
    fewer = SampleEquilibria(both.simulation, both.equilibria.targets[-1:], like=both.equilibria)
    found = fewer.kept()
    assert found is not None and displacements(found) == pytest.approx(displacements(known)[-1:], rel=1e-12)
    fewer.keep(found)
    assert both.equilibria.kept() is None  # it has more samples
    both.equilibria.keep(known)
    both.rest.place(both.design(0.03001, seed=1), first)
    assert both.equilibria.kept() is None


@pytest.mark.parallel
def test_following_in_space_on_any_number_of_ranks():
    both = made("truss", space="3d", size=4.0, order=1, comm=MPI.COMM_WORLD)
    first = both.rest.place(both.rest.initial, None)
    known = both.equilibria.from_zero()
    both.rest.place(both.design(0.08), first)
    assert_alike(both.equilibria.from_design(known), both.equilibria.from_zero())


def bulged(both: Bench) -> np.ndarray:
    """A truss whose diagonal bulges strongly."""
    (link,) = both.rest.links
    sideways = np.zeros((4, 2, 3))
    sideways[1:3, 0, 0] = 8.0
    return both.rest.initial + sideways.ravel()[link.spline.entries]


def test_a_large_change_of_design_is_halved_on_the_way(monkeypatch):
    both = made("truss")
    start = both.rest.place(both.rest.initial, None)
    known = both.equilibria.from_zero()
    both.rest.place(bulged(both), start)
    solver = both.simulation.solver(both.equilibria.targets[0].quantity.part)
    solve, failures = NewtonSolver.solve, []

    def counted(self, *arguments, **options):
        try:
            return solve(self, *arguments, **options)
        except NotConverged as failure:
            failures.append(failure)
            raise

    monkeypatch.setattr(NewtonSolver, "solve", counted)
    solver.options = fm.PrimalDualNewton(iterations=6, predicted_stress=False)
    followed = both.equilibria.from_design(known)
    assert len(failures) >= 1
    solver.options = fm.PrimalDualNewton()
    assert_alike(followed, both.equilibria.from_zero())


def test_a_change_that_is_too_large_is_infeasible_and_leaves_the_design_in_place():
    both = made("truss")
    start = both.rest.place(both.rest.initial, None)
    known = both.equilibria.from_zero()
    both.rest.place(bulged(both), start)
    design = both.field()
    both.simulation.solver(both.equilibria.targets[0].quantity.part).options = fm.PrimalDualNewton(iterations=2)
    with pytest.raises(Infeasible, match="no equilibrium under 'push on tip' of 0.1"):
        both.equilibria.from_design(known)
    assert np.array_equal(both.field(), design)


def column(force: float) -> Case:
    """A slightly bent column under a load along it."""
    mechanism = fm.Mechanism("column")
    base, cap = mechanism.rigid("base", fixed=True), mechanism.rigid("cap")
    shape = fm.strip([(0, 0), (0.0, 20), (0, 40)], thickness=2.0, depth=6.0)
    bar = mechanism.flexible("bar", shape, fm.Material("plastic", 2000.0, 0.35))
    mechanism.revolute(base, bar, at=(0, 0), interface_radius=1.5)
    mechanism.revolute(bar, cap, at=(0, 40), interface_radius=1.5)
    mechanism.prismatic(base, cap, at=(0, 40), axis=(0, 1))
    push = mechanism.force(on=cap, at=(0, 40), direction=(0, -1))
    return Case(fm.Scene(mechanism), [fm.SplineDesign(bar, 2)], [fm.Target(push, force=force, displacement=0.1)])


def test_unstable_equilibria_are_infeasible():
    euler = np.pi**2 * 2000.0 * 6.0 * 2.0**3 / 12.0 / 40.0**2
    case = column(0.5 * euler)
    stable = bench(case, case.simulate(size=2.0))
    stable.rest.place(stable.rest.initial, None)
    stable.equilibria.from_zero()
    case = column(1.5 * euler)
    with pytest.raises(Infeasible, match="unstable"):
        SampleEquilibria(case.simulate(size=2.0), case.targets).from_zero()


def test_load_that_no_equilibrium_carries_is_infeasible():
    case = truss((1e4, 5.0))
    both = bench(case, case.simulate())
    both.rest.place(both.rest.initial, None)
    with pytest.raises(Infeasible, match="push on tip"):
        both.equilibria.from_zero()


@each_case
def test_values_are_those_of_curves_and_gradients_agree_with_differences_and_do_not_disturb_the_design(name):
    both = made(name)
    placed = both.rest.place(both.design(0.05), None)
    known = both.equilibria.from_zero()
    for target, reached in zip(both.equilibria.targets, displacements(known), strict=True):
        curve = both.simulation.load_displacement(
            target.quantity.part,
            forces=[target.sample.magnitude / 2, target.sample.magnitude],
            configuration=target.sample.configuration,
        )
        assert curve.displacements[-1] == pytest.approx(reached, rel=1e-8)
    before = both.field()
    first = fields(both, known)
    assert np.array_equal(both.field(), before)
    assert fields(both, known) == pytest.approx(first, rel=1e-12)
    gradient = both.rest.gradient(placed, first)
    direction, step = both.direction(7), 1e-3

    def moved(h: float) -> np.ndarray:
        both.rest.place(placed.p + h * direction, placed)
        return displacements(both.equilibria.from_design(known))

    slope = (moved(step) - moved(-step)) / (2.0 * step)
    assert gradient @ direction == pytest.approx(slope, rel=1e-5)


def test_targets_of_several_forces_directions_and_sizes_are_told_apart():
    scene = truss().scene
    mechanism = scene.mechanism
    (pushing,) = mechanism.forces
    tip = pushing.on
    lift = mechanism.force(on=tip, at=(20, 70), direction=(0.6, -0.8), name="lift")
    (diagonal,) = mechanism.flexible_links
    targets = [
        fm.Target(pushing, force=0.4, displacement=1.0),
        fm.Target(lift, force=0.2, displacement=1.0),
        fm.Target(pushing, force=0.1, displacement=1.0),
        fm.Target(pushing, force=-0.02, displacement=1.0),
        fm.Target(pushing, force=0.1, displacement=2.0),
        fm.Target(pushing, force=0.0, displacement=1.0),
    ]
    case = Case(scene, [fm.SplineDesign(diagonal, 3)], targets)
    both = bench(case, case.simulate())
    both.rest.place(both.rest.initial, None)
    together = displacements(both.equilibria.from_zero())
    for target, reached in zip(targets, together, strict=True):
        alone = displacements(SampleEquilibria(both.simulation, [target]).from_zero())
        assert alone == pytest.approx([reached], rel=1e-8, abs=1e-12)
    assert together[2] == together[4]
    assert together[3] < 0.0 < together[2] < together[0]
    assert together[5] == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_design_whose_motor_turns_a_spring_in_space_by_more_than_a_full_turn_is_infeasible(sign):
    case = lever(lambda hinge: [fm.JointSpring(hinge, 50.0)], space="3d")
    scene, motor = case.simulation.scene, case.simulation.scene.mechanism.motor(case.joint)
    simulation, kind = fm.Simulation(scene, space="3d", order=1, size=6.0, comm=MPI.COMM_SELF), fm.MotorOffset(motor)
    target = fm.Target(fm.MotorTorque(motor), fm.Sample({case.force: 0.1, motor: 6.1 * sign}), equals=0.0, scale=1.0)
    equilibria = SampleEquilibria(simulation, [target], numbers=[kind])
    known, field = equilibria.from_zero(), simulation.model.design.field
    simulation.model.reshape(fm.Design(field, {kind: 0.1 * sign}))
    nearer = equilibria.from_design(known)
    moments = [equilibria.values(at)[0] for at in (known, nearer)]
    assert moments[1] - moments[0] == pytest.approx(50.0 * 0.1 * sign, rel=0.1)
    simulation.model.reshape(fm.Design(field, {kind: 0.3 * sign}))
    for solve in (equilibria.from_zero, lambda: equilibria.from_design(nearer)):
        with pytest.raises(Infeasible, match="passes 2π" if sign > 0.0 else "passes −2π"):
            solve()
