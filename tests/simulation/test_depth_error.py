"""What plane stress leaves out is estimated: within a factor of two, and in the right direction."""

from __future__ import annotations

import pytest
from mpi4py import MPI

import fenicsmech as fm

from .demo_scenes import describe
from .refined import cantilever

LOADS = {"truss": 0.4, "claw": 10.0, "klann": 5.0}


def case(name: str):
    if name == "cantilever":
        return cantilever()
    scene, push = describe(name)[:2]
    return scene, push, LOADS[name]


@pytest.mark.parametrize("name", ["cantilever", "truss", pytest.param("claw", marks=pytest.mark.slow), "klann"])
def test_estimate_is_near_what_space_adds(name):
    scene, push, load = case(name)
    flat = fm.Simulation(scene, space="plane-stress", order=3, size=5.0)
    curve = flat.load_displacement(push, forces=[0.5 * load, load])
    deep = fm.Simulation(scene, space="3d-symmetric", order=3, size=7.5, layers=1)
    there = deep.load_displacement(push, forces=[0.5 * load, load])
    added = there.displacements[-1] + deep.error_estimates(there)[-1] - curve.displacements[-1]
    assert added < 0.0
    assert 0.5 < flat.modelling_errors(curve)[-1] / added < 2.0


def test_blocking_all_contraction_is_plane_strain(monkeypatch):
    monkeypatch.setattr("fenicsmech.estimates.depth_error._DECAY", 1e6)
    scene, push, load = cantilever()
    values = []
    for space in ("plane-stress", "plane-strain"):
        simulation = fm.Simulation(scene, space=space, size=3.0)
        values.append(simulation.load_displacement(push, forces=[1e-3 * load]).displacements[-1])
        if space == "plane-stress":
            estimate = simulation.modelling_errors()[-1]
    # first order of a change of 13 %
    assert estimate == pytest.approx(values[1] - values[0], rel=0.2)


@pytest.mark.parallel
def test_estimate_is_the_same_on_any_number_of_processes():
    scene, push, load = cantilever()
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        simulation = fm.Simulation(scene, space="plane-stress", size=3.0, comm=comm)
        simulation.load_displacement(push, forces=[load])
        found.append(simulation.modelling_errors()[-1])
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def test_other_models_are_refused():
    scene, push, load = cantilever()
    simulation = fm.Simulation(scene, space="plane-strain", size=3.0)
    simulation.load_displacement(push, forces=[load])
    with pytest.raises(fm.DescriptionError, match="plane-strain"):
        simulation.modelling_errors()


def test_both_kinds_of_error_share_one_factor_per_frame(monkeypatch):
    scene, push, load = cantilever()
    simulation = fm.Simulation(scene, space="plane-stress", size=3.0)
    curve = simulation.load_displacement(push, forces=[0.5 * load, load])
    apart = simulation.error_estimates(curve), simulation.modelling_errors(curve)
    newton, factored = type(simulation.newton(push)), []
    plain = newton.factor
    monkeypatch.setattr(newton, "factor", lambda *arguments: factored.append(arguments) or plain(*arguments))
    together = simulation.estimates.elements_and_depth(curve)
    assert len(factored) == len(curve.frames)
    for one, other in zip(apart, together, strict=True):
        assert list(one) == pytest.approx(list(other), rel=1e-10)
