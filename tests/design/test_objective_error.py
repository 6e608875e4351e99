"""Error estimates of objectives and designs: within a factor of two of what much finer elements give."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech import model
from fenicsmech.design import Comparison, SampleEquilibria, rest_meshes

from ..simulation.demo_scenes import demo
from ..simulation.five_problems import case
from ..simulation.refined import cantilever, refine
from .mechanisms import sprung, strained, truss


def value(targets, reached) -> float:
    """Σ ½ w r²."""
    return 0.5 * float(np.sum(Comparison(targets, fm.Units()).residuals(reached) ** 2))


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["cantilever", "arch", "truss", "claw", "klann"])
def test_effectivity_is_between_a_half_and_two(name, monkeypatch):
    scene, push, load = case(name)
    simulation = fm.Simulation(scene, space="plane-stress", size=2.0, comm=MPI.COMM_SELF)
    rough = simulation.load_displacement(push, forces=[load]).displacements[0]
    targets = [
        fm.Target(push, force=load, displacement=0.8 * rough, weight=2.0),
        fm.Target(push, force=0.5 * load, displacement=0.3 * rough),
    ]
    equilibria = SampleEquilibria(simulation, targets)
    known = equilibria.from_zero()
    reached = equilibria.values(known)
    estimate = Comparison(targets, fm.Units()).objective_error(reached, equilibria.errors(known))
    refine(monkeypatch, 1)
    finer = fm.Simulation(scene, space="plane-stress", order=3, size=2.0, comm=MPI.COMM_SELF)
    there = SampleEquilibria(finer, targets)
    there = there.values(there.from_zero())
    assert 0.5 < estimate / (value(targets, there) - value(targets, reached)) < 2.0


def test_it_is_exact_in_exact_errors():
    _, push, load = cantilever()
    targets = [
        fm.Target(push, force=load, displacement=4.0, weight=3.0),
        fm.Target(push, force=-load, displacement=0.0),
    ]
    reached, errors = np.array([4.3, 0.1]), np.array([-0.2, 0.05])
    assert Comparison(targets, fm.Units()).objective_error(reached, errors) == pytest.approx(
        value(targets, reached + errors) - value(targets, reached), rel=1e-12
    )


def test_designs_carry_the_errors_of_displacements_and_objective():
    case = truss((0.1, 6.0), (0.4, 9.0))
    problem = case.problem(size=4.0)
    result = problem.optimise(optimiser=fm.LevenbergMarquardt(iterations=2))
    forces = [target.force for target in result.targets]
    curve = problem.simulation.with_design(result).load_displacement(case.targets[0].quantity.part, forces=forces)
    errors = [target.finer_elements_add for target in result.targets]
    assert errors == pytest.approx(curve.error_estimates(), rel=1e-5)
    # targets stay in plane stress, curves lead to space
    towards_space = curve.corrected - [target.corrected for target in result.targets]
    assert towards_space == pytest.approx(curve.modelling_errors(), rel=1e-4)
    reached = np.array([target.reached for target in result.targets])
    assert result.objective_error == pytest.approx(
        Comparison(case.targets, fm.Units()).objective_error(reached, np.array(errors))
    )


@pytest.mark.parametrize("described", [strained, sprung])
def test_errors_of_curves_are_those_of_designs_where_links_are_strained_without_loads(described):
    scene, push, place = _strained(described)
    lift = scene.mechanism.output(on=scene.mechanism.flexible_links[0], at=(20, 36), direction=(0, 1))
    simulation = fm.Simulation(scene, space="plane-stress", size=4.0, comm=MPI.COMM_SELF)
    curve = simulation.load_displacement(push, forces=[2.0], configuration=place)
    (reached,) = curve.displacements
    held = simulation.load_displacement(push, displacements=[reached], configuration=place)
    sample = fm.Sample({push: fm.at(float(reached))}, configuration=place)
    targets = [
        fm.Target(push, force=2.0, displacement=1.0, configuration=place),
        fm.Target(fm.ForceMagnitude(push), sample, equals=1.0),
        fm.Target(fm.Displacement(lift), sample, equals=1.0),
    ]
    equilibria = SampleEquilibria(simulation, targets)
    found = [*curve.error_estimates(), *held.error_estimates(), *held.error_estimates(output=lift)]
    assert found == pytest.approx(equilibria.errors(equilibria.from_zero()), rel=1e-5)


@pytest.mark.thorough
@pytest.mark.parametrize("described", [strained, sprung])
def test_effectivity_where_links_are_strained_without_loads_is_between_a_half_and_two(described, monkeypatch):
    scene, push, place = _strained(described)
    lift = scene.mechanism.output(on=scene.mechanism.flexible_links[0], at=(20, 36), direction=(0, 1))
    samples = {"forces": [2.0]}, {"displacements": [0.4]}

    def curves(order: int) -> list[fm.Curve]:
        simulation = fm.Simulation(scene, space="plane-stress", order=order, size=4.0, comm=MPI.COMM_SELF)
        return [simulation.load_displacement(push, configuration=place, **own) for own in samples]

    coarse = curves(2)
    estimates = [[*curve.error_estimates(), *curve.error_estimates(output=lift)] for curve in coarse]
    refine(monkeypatch, 2)
    for curve, finer, estimated in zip(coarse, curves(3), estimates, strict=True):
        changes = [*(finer.values - curve.values), finer.frames[0].outputs[lift] - curve.frames[0].outputs[lift]]
        effectivity = np.array(estimated) / changes
        assert np.all((effectivity > 0.5) & (effectivity < 2.0))


def _strained(described) -> tuple[fm.Scene, fm.Force, fm.Configuration]:
    """A scene, its force, and a configuration in which links are strained without it."""
    case = described(2.0)
    (target,) = case.targets
    return case.scene, target.quantity.part, target.sample.configuration


@pytest.mark.parametrize(
    "fidelity",
    [{}, {"space": "plane-strain", "formulation": fm.MixedFormulation(above=0.3)}],
    ids=["displacement", "pressure"],
)
def test_estimates_do_not_know_whether_a_shape_was_drawn_or_designed(fidelity, monkeypatch):
    case = truss((0.1, 6.0), (0.4, 9.0))
    problem = case.problem(size=4.0, **fidelity)
    sim, push = problem.simulation, case.targets[0].quantity.part
    design = problem.rest_shape(1.05 * problem.initial)
    curve = sim.with_design(design).load_displacement(push, forces=[0.1, 0.4])
    with sim.model.shaped(design):
        links = rest_meshes(sim, sim.scene.mechanism.flexible_links)
    monkeypatch.setattr(model, "mesh_links", lambda *_: links)
    drawn = case.simulate(size=4.0, **fidelity).load_displacement(push, forces=[0.1, 0.4])
    assert drawn.displacements == pytest.approx(curve.displacements, rel=1e-6)
    assert drawn.error_estimates() == pytest.approx(curve.error_estimates(), rel=1e-4)


def designed(name: str, space: str) -> tuple[fm.DesignProblem, fm.DesignResult]:
    """The problem of a demo with its coarse elements, and its optimum."""
    script = demo(name)
    scene, *rest = script.describe()
    simulation = fm.Simulation(scene, space=space, size=script.QUICK, comm=MPI.COMM_SELF)
    problem = fm.DesignProblem(simulation, **script.wanted(scene, *rest))
    return problem, problem.optimise()


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "space", "finer"), [("truss", "plane-stress", 4.0), ("truss", "3d", 2.0)])
def test_errors_of_designs_are_those_of_their_parts_in_finer_elements(name, space, finer):
    problem, result = designed(name, space)
    for target in problem.verify(result, finer=finer).targets:
        value = target.part.value + target.part.finer_elements_add
        error, estimate = value - target.reached, target.finer_elements_add
        if abs(error) < 1e-3 * abs(value):  # the part's outline differs by as much
            assert abs(estimate - error) < 1e-3 * abs(value)
        else:
            assert 0.5 < estimate / error < 2.0
