"""Displacement control of a point that joints hold is refused for what it is, unless joints give way."""

import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.continuation import LoadSteps
from fenicsmech.equilibrium import EquilibriumSolver


def driven_crank(*effects) -> tuple[fm.Simulation, object]:
    """A rigid crank that a motor holds, and a blade clamped to it; the force acts on the crank."""
    mechanism = fm.Mechanism("crank")
    base, crank = mechanism.rigid("base", fixed=True), mechanism.rigid("crank")
    blade = mechanism.flexible("blade", fm.strip([(20, 0), (50, 0)], thickness=2.0, depth=4.0), fm.ONYX)
    hinge = mechanism.revolute(base, crank, at=(0, 0), name="hinge")
    mechanism.motor(hinge)
    mechanism.weld(crank, blade, at=(20, 0), interface_radius=1.5)
    push = mechanism.force(on=crank, at=(10, 0), direction=(1, 1), name="push")
    scene = fm.Scene(mechanism, effects=[effect(hinge) for effect in effects])
    return fm.Simulation(scene, space="plane-stress", size=2.0, comm=MPI.COMM_SELF), push


def test_point_held_by_a_motor_is_named_after_few_solves(monkeypatch):
    simulation, push = driven_crank()
    tried, solve = [], EquilibriumSolver.solve

    def counted(self, start, control):
        tried.append(control.prescribed)
        return solve(self, start, control)

    monkeypatch.setattr(EquilibriumSolver, "solve", counted)
    with pytest.raises(fm.EquilibriumError) as caught:
        simulation.load_displacement(push, displacements=[0.01])
    assert "'push'" in caught.value.part
    assert "joints and motors hold its point" in caught.value.problem
    assert caught.value.last is not None
    most = LoadSteps().failures_held
    assert most < len(set(tried)) <= most + 2 and len(tried) <= 2 * most + 2  # with and without turning links


def test_point_held_by_a_joint_that_gives_way_moves():
    simulation, push = driven_crank(lambda hinge: fm.JointCompliance(hinge, 1e-3))
    (frame,) = simulation.load_displacement(push, displacements=[0.01]).frames
    assert frame.displacement == pytest.approx(0.01, rel=1e-9)
    assert frame.force == pytest.approx(0.01 / 1e-3, rel=1e-6)
