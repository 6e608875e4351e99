"""The error of plane stress is estimated within a factor of two, and in the right direction."""

from __future__ import annotations

import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.estimates import Calibration, ErrorKind, Estimates

from ..simulation.demo_scenes import describe
from ..simulation.refined import cantilever

LOADS = {"truss": 0.4, "claw": 10.0, "klann": 5.0}


def case(name: str):
    if name == "cantilever":
        return cantilever()
    scene, push = describe(name)[:2]
    return scene, push, LOADS[name]


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["cantilever", "truss", pytest.param("claw", marks=pytest.mark.slow), "klann"])
def test_estimate_is_near_what_space_adds(name):
    scene, push, load = case(name)
    flat = fm.Simulation(scene, space="plane-stress", order=3, size=5.0)
    curve = flat.load_displacement(push, forces=[0.5 * load, load])
    deep = fm.Simulation(scene, space="3d-symmetric", order=3, size=7.5, layers=1)
    there = deep.load_displacement(push, forces=[0.5 * load, load])
    added = there.displacements[-1] + there.error_estimates()[-1] - curve.displacements[-1]
    assert added < 0.0
    assert 0.5 < curve.modelling_errors()[-1] / added < 2.0


def test_blocking_all_contraction_is_plane_strain():
    scene, push, load = cantilever()
    values = []
    for space in ("plane-stress", "plane-strain"):
        simulation = fm.Simulation(scene, space=space, size=3.0)
        curve = simulation.load_displacement(push, forces=[1e-3 * load])
        values.append(curve.displacements[-1])
        if space == "plane-stress":
            estimates, at = Estimates(simulation.model, Calibration(decay=1e6)), curve.equilibrium(curve.frames[-1])
            (estimate,) = estimates.at(simulation.solver(push), at, [ErrorKind.PLANE_STRESS])
    # first order of a change of 13 %
    assert estimate == pytest.approx(values[1] - values[0], rel=0.2)


@pytest.mark.parallel
def test_estimate_is_the_same_on_any_number_of_processes():
    scene, push, load = cantilever()
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        simulation = fm.Simulation(scene, space="plane-stress", size=3.0, comm=comm)
        found.append(simulation.load_displacement(push, forces=[load]).modelling_errors()[-1])
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def test_other_models_are_refused():
    scene, push, load = cantilever()
    simulation = fm.Simulation(scene, space="plane-strain", size=3.0)
    curve = simulation.load_displacement(push, forces=[load])
    with pytest.raises(fm.DescriptionError, match="plane-strain"):
        curve.modelling_errors()


def test_both_kinds_of_error_need_one_factor_per_frame_once(monkeypatch):
    scene, push, load = cantilever()
    simulation = fm.Simulation(scene, space="plane-stress", size=3.0)
    loads = [0.5 * load, load]
    apart, together = (simulation.load_displacement(push, forces=loads) for _ in range(2))
    one, other = apart.error_estimates(), apart.modelling_errors()
    newton, factored = type(simulation.solver(push)), []
    plain = newton.linearise
    monkeypatch.setattr(newton, "linearise", lambda *arguments: factored.append(arguments) or plain(*arguments))
    assert together.corrections == pytest.approx(one + other, rel=1e-10)
    assert together.corrected == pytest.approx(together.displacements + one + other, rel=1e-10)
    assert list(together.displacements) == [frame.displacement for frame in together.frames]
    assert list(together.error_estimates()) == pytest.approx(list(one), rel=1e-10)
    assert len(factored) == len(loads)
