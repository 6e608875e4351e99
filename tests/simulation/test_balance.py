"""Links move as rigid bodies to where loads balance."""

import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import LoadControl
from fenicsmech.simulation import Balance

from .refined import cantilever


def test_mechanisms_without_such_motions_are_left_to_newtons_method():
    scene, push, load = cantilever()
    simulation = fm.Simulation(scene, space="plane-stress", size=4.0, comm=MPI.COMM_SELF)
    curve = simulation.load_displacement(push, forces=[0.1 * load])
    balance = Balance(simulation.model, curve.solver)
    found, iterations = balance.reached(curve.unloaded, LoadControl(0.1 * load))
    assert iterations > 0
    moved = curve.solver.system.load_displacement(found.state)
    assert moved == pytest.approx(curve.displacements[0], rel=1e-8)
