"""Errors in doubt come from equilibria in finer elements, which are those of curves from zero load."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

from ..effects import touching
from ..simulation.refined import arch, cantilever, refine
from .test_doubts import shallow_arch, strained_by_a_motor


def simulated(scene: fm.Scene, order: int, space: str = "plane-stress", size: float = 3.0) -> fm.Simulation:
    return fm.Simulation(scene, space=space, order=order, size=size, comm=MPI.COMM_SELF)


def weighed() -> tuple[fm.Scene, fm.Force, float]:
    """The cantilever under its own weight, too."""
    scene, push, load = cantilever()
    return fm.Scene(scene.mechanism, effects=[fm.Gravity((0.0, -9.81))], units=scene.units), push, load


def by_finer_elements(curve: fm.Curve, finer: fm.Curve) -> np.ndarray:
    """What values differ by, and the estimate there, lowered where estimates fall by more than values."""
    fall, after = finer.values - curve.values, finer.error_estimates()
    part = fall / (curve.error_estimates() - after)
    return fall + np.where(part > 0.0, np.minimum(part, 1.0), 1.0) * after


@pytest.mark.parametrize(
    ("described", "space", "held", "order"),
    [
        (cantilever, "plane-stress", "forces", 1),
        (cantilever, "plane-stress", "displacements", 2),
        (weighed, "plane-strain", "displacements", 1),
        (weighed, "plane-strain", "forces", 2),
        pytest.param(arch, "3d-symmetric", "displacements", 1, marks=pytest.mark.thorough),
        pytest.param(arch, "3d-symmetric", "forces", 2, marks=pytest.mark.thorough),
    ],
)
def test_errors_are_those_of_a_curve_of_the_next_order_in_the_plane_on_quartered_triangles(
    monkeypatch, described, space, held, order
):
    scene, push, load = described()
    values = {"forces": [0.5 * load, load], "displacements": [0.1, 0.2]}[held]
    curve = simulated(scene, order, space).load_displacement(push, **{held: values})
    checked = curve.checked_errors()
    if not space.startswith("3d"):
        refine(monkeypatch, 1)
    finer = simulated(scene, order + 1, space).load_displacement(push, **{held: values})
    assert checked.checked.all()
    assert checked.errors == pytest.approx(by_finer_elements(curve, finer), rel=1e-6)


def test_errors_count_from_the_unloaded_configuration_in_finer_elements(monkeypatch):
    scene, posed, push = strained_by_a_motor()
    curve = simulated(scene, 1, size=2.0).load_displacement(push, forces=[0.2], configuration=posed)
    assert curve.unloaded.has_reactions
    checked = curve.checked_errors()
    refine(monkeypatch, 1)
    finer = simulated(scene, 2, size=2.0).load_displacement(push, forces=[0.2], configuration=posed)
    assert checked.errors == pytest.approx(by_finer_elements(curve, finer), rel=1e-6)


def test_errors_of_elements_that_bend_too_little_are_within_a_tenth(monkeypatch):
    scene, push, load = arch()
    curve = simulated(scene, 1).load_displacement(push, forces=[load])
    refine(monkeypatch, 2)
    true = simulated(scene, 3).load_displacement(push, forces=[load]).values - curve.values
    assert curve.doubts() != ((),)
    checked = curve.checked_errors()
    assert checked.errors == pytest.approx(true, rel=0.1)
    assert checked.doubts == ((),)


def test_errors_that_are_mostly_estimates_are_doubted():
    scene, push, load = cantilever()
    curve = simulated(scene, 1).load_displacement(push, forces=[0.5 * load, load])
    assert curve.checked_errors().doubts == ((), ())
    doubted = curve.checked_errors(fm.DoubtOptions(left=1e-6))
    assert all("most of the error is an estimate" in doubts for doubts in doubted.doubts)


def test_errors_where_links_begin_to_touch_are_within_a_factor_of_two(monkeypatch):
    scene, pull, load = cantilever()
    (link,) = scene.mechanism.flexible_links
    push = scene.mechanism.force(on=pull.on, at=pull.at, direction=(0, -1))
    bar = fm.Contact(link, fm.Cylinder((30.0, -5.5), 2.0), stiffness=50.0)
    laid = fm.Scene(scene.mechanism, effects=[bar], units=scene.units)
    curve = simulated(laid, 2).load_displacement(push, forces=[load])
    checked = curve.checked_errors()
    refine(monkeypatch, 2)
    true = simulated(laid, 2).load_displacement(push, forces=[load]).values - curve.values
    assert 0.5 < checked.errors[0] / true[0] < 2.0


@pytest.mark.parametrize(("displacement", "rounded"), [(1.0, False), (1e-9, True)])
def test_errors_of_equilibria_known_to_rounding_only_are_doubted(displacement, rounded):
    scene, push, _ = cantilever()
    (link,) = scene.mechanism.flexible_links
    strained = fm.Scene(scene.mechanism, effects=[fm.Prestrain(link, 1.01)], units=scene.units)
    curve = simulated(strained, 2).load_displacement(push, displacements=[displacement])
    assert (curve.frames[0].residuals[-1] > 1e-6) == rounded
    for doubts in (curve.doubts(), curve.checked_errors().doubts):
        assert ("equilibrium known to rounding only" in doubts[0]) == rounded


def resting() -> tuple[fm.Scene, fm.Force, float]:
    """A cantilever, its load and one that lays its end on a plane."""
    case = touching.cantilever("plane-stress", gap=1.0)
    return case.simulation.scene, case.force, 0.1


@pytest.mark.parametrize("described", [arch, resting])
def test_errors_of_the_highest_order_come_from_one_beyond(described):
    scene, push, load = described()
    curve, finer = (simulated(scene, 3, size=size).load_displacement(push, forces=[load]) for size in (3.0, 0.75))
    checked, true = curve.checked_errors(), finer.values - curve.values
    assert checked.checked.all()
    assert checked.errors == pytest.approx(true, rel=0.75)


def test_limit_loads_that_finer_elements_do_not_bear_are_doubts():
    scene, push = shallow_arch()
    coarse, finer = (simulated(scene, order, size=2.0) for order in (1, 2))
    values = list(np.linspace(0.1, 2.0, 20))
    limits = [own.load_displacement(push, displacements=values).forces.max() for own in (coarse, finer)]
    assert limits[1] < limits[0]
    curve = coarse.load_displacement(push, forces=[0.3 * limits[1], 0.5 * sum(limits)])
    checked = curve.checked_errors()
    assert list(checked.checked) == [True, False]
    assert checked.errors[1] == curve.error_estimates()[1]
    ((), (reason,)) = checked.doubts
    assert "no equilibrium is near in elements of order 2" in reason


@pytest.mark.parametrize(("held", "order"), [("forces", 1), ("displacements", 2)])
def test_errors_of_plane_stress_are_what_space_adds(held, order):
    scene, push, load = arch()
    values = {"forces": [0.5 * load, load], "displacements": [0.1, 0.2]}[held]
    flat, finer = (simulated(scene, k).load_displacement(push, **{held: values}) for k in (order, order + 1))
    deep = simulated(scene, order + 1, "3d-symmetric").load_displacement(push, **{held: values})
    checked = flat.checked_errors(modelling=True)
    assert checked.checked.all()
    assert checked.errors == pytest.approx(deep.values - finer.values, rel=1e-5)
    last = flat.checked_errors(modelling=True, frame=flat.frames[-1])
    assert last.errors == pytest.approx(checked.errors[1:], rel=1e-9)
    assert last.doubts == checked.doubts[1:]


def test_errors_of_plane_stress_are_refused_in_other_models():
    scene, push, load = arch()
    curve = simulated(scene, 1, "plane-strain").load_displacement(push, forces=[0.1 * load])
    with pytest.raises(fm.DescriptionError, match="only plane stress has one that is known, and space='plane-strain'"):
        curve.checked_errors(modelling=True)


def designed(scene: fm.Scene, push: fm.Force, load: float, order: int) -> fm.Curve:
    """A curve in plane stress of the first link in another shape than the drawn one."""
    (link,) = scene.mechanism.flexible_links
    target = fm.Target(push, force=load, displacement=1.0)
    problem = fm.DesignProblem(simulated(scene, order), [fm.SplineDesign(link, 2)], targets=[target])
    parameters = problem.initial + 0.1 * np.arange(len(problem.initial)) / len(problem.initial)
    shaped = problem.simulation.with_design(problem.rest_shape(parameters))
    return shaped.load_displacement(push, forces=[load])


@pytest.mark.parametrize("order", [1, 2], ids=["straight edges", "curved edges"])
def test_errors_of_designs_are_those_of_their_shape(order):
    """The same parameters make another shape on another mesh."""
    scene, push, load = arch()
    curve, finer = (designed(scene, push, load, k) for k in (order, order + 1))
    assert np.abs(curve.frames[0].design.field).max() > 0.01
    # smaller elements take away about what is estimated
    fall, estimate = curve.in_finer_elements().displacement - finer.values[0], finer.error_estimates()[0]
    assert 0.5 < fall / estimate < 2.0
    checked = curve.checked_errors()
    assert checked.checked.all()
    assert checked.errors == pytest.approx(by_finer_elements(curve, finer), rel=0.1)


def test_what_space_adds_to_designs_is_about_what_is_estimated():
    """In space on the very shape: the same parameters make another one on another mesh."""
    scene, push, load = arch()
    curve = designed(scene, push, 0.5 * load, 2)
    checked = curve.checked_errors(modelling=True)
    assert checked.checked.all()
    assert checked.errors == pytest.approx(curve.modelling_errors(), rel=0.3)


def test_frames_in_finer_elements_have_all_quantities_of_these(monkeypatch):
    scene, push, load = arch()
    own = simulated(scene, 2).load_displacement(push, forces=[0.5 * load, load])
    refine(monkeypatch, 1)
    finer = simulated(scene, 3).load_displacement(push, forces=[0.5 * load, load])
    for wanted, frame in zip(finer.frames, own.frames, strict=True):
        found = own.in_finer_elements(frame)
        assert found.displacement == pytest.approx(wanted.displacement, rel=1e-8)
        assert found.strain_energy == pytest.approx(wanted.strain_energy, rel=1e-7)
        assert found.peak.value == pytest.approx(wanted.peak.value, rel=1e-6)
    assert own.in_finer_elements().force == load


@pytest.mark.parallel
@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d-symmetric", marks=pytest.mark.thorough)])
def test_errors_are_the_same_on_any_number_of_processes(space):
    scene, push, load = arch()
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        simulation = fm.Simulation(scene, space=space, order=1, size=4.0, comm=comm)
        found.append(simulation.load_displacement(push, forces=[load]).checked_errors().errors)
    assert found[1] == pytest.approx(found[0], rel=1e-5)
