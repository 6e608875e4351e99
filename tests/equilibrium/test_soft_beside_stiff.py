"""Links a million times softer than others: free motions stay free."""

from __future__ import annotations

import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.effects import Pressure

STEEL = fm.Material("steel", 2e5, 0.3)


def test_displacement_along_a_free_motion_takes_no_force_however_soft_the_links_that_move():
    # pressure does no work along it; a shift as stiff as the crank would hold the rocker half-bent
    mechanism = fm.Mechanism("four-bar")
    base, coupler = mechanism.rigid("base", fixed=True), mechanism.rigid("coupler")
    crank = mechanism.flexible("crank", fm.strip([(0, 0), (0, 20)], thickness=1.0, depth=1.0), STEEL)
    bent = fm.strip([(30, 0), (34, 15), (40, 30)], thickness=0.5, depth=1.0)
    rocker = mechanism.flexible("rocker", bent, fm.Material("rubber", 0.2, 0.45))
    mechanism.revolute(base, crank, at=(0, 0), interface_radius=0.4)
    mechanism.revolute(crank, coupler, at=(0, 20), interface_radius=0.4)
    mechanism.revolute(coupler, rocker, at=(34, 15), interface_radius=0.2)
    mechanism.revolute(base, rocker, at=(30, 0), interface_radius=0.2)
    push = mechanism.force(on=coupler, at=(15, 25), direction=(1, 0))
    scene = fm.Scene(mechanism, effects=[Pressure(rocker, -1e-5)])
    simulation = fm.Simulation(scene, space="plane-stress", order=1, size=1.0, comm=MPI.COMM_SELF)
    curve = simulation.load_displacement(push, displacements=[0.0, 0.01])
    # of pressure times width, by 1e-5 of which E b of steel is rounded
    assert curve.forces == pytest.approx([0.0, 0.0], abs=1e-7 * 1e-5 * 0.5)
    assert sum(frame.iterations for frame in curve.frames) < 40
