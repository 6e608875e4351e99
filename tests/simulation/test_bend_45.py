"""The cantilever bent to 45° under a load out of its plane: bending, shear and torsion at once, in space.

Radius 100, section 1 × 1, E = 10⁷, ν = 0, load 300: NAFEMS benchmark 3DNLG-5 (beam theory).
"""

from math import cos, pi, sin

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

RADIUS, LOAD = 100.0, 300.0
# along the radius at the tip's tangent point, across it in the plane, along the load
TIP = {"x": -12.17, "y": -7.173, "z": 40.47}


def on_arc(angle: float) -> tuple[float, float]:
    """The arc leaves the origin along x."""
    return RADIUS * sin(angle), RADIUS * (1.0 - cos(angle))


def bend(order: int, size: float):
    """The arc runs on into its clamps by 0.01 rad at either end."""
    mechanism = fm.Mechanism("45 degree bend")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    points = [on_arc(angle) for angle in np.linspace(-0.01, 0.25 * pi + 0.01, 24)]
    arc = mechanism.flexible("arc", fm.strip(points, thickness=1.0, depth=1.0), fm.Material("steel", 1e7, 0.0))
    block = 1.02  # a little more than the ends that stick out
    tip = np.array(on_arc(0.25 * pi))
    centre = tip + 0.5 * block * np.array([cos(0.25 * pi), sin(0.25 * pi)])
    mechanism.weld(base, arc, at=(-0.5 * block, 0), region=fm.Rectangle(block, 1.5))
    mechanism.weld(arc, hand, at=centre, region=fm.Rectangle(block, 1.5, 0.25 * pi))
    load = mechanism.force(on=hand, at=(*tip, 0), direction=(0, 0, 1), name="load")
    outputs = [
        mechanism.output(on=hand, at=(*tip, 0), direction=direction, name=name)
        for name, direction in zip(TIP, np.eye(3), strict=True)
    ]
    simulation = fm.Simulation(fm.Scene(mechanism), space="3d", order=order, size=size, comm=MPI.COMM_SELF)
    return simulation, load, outputs


@pytest.mark.thorough
def test_tip_moves_as_in_the_benchmark():
    # warping in torsion takes a cubic layer, or two quadratic ones: with one the tip moves 1.3 % less in the plane
    simulation, load, outputs = bend(order=3, size=2.0)
    curve = simulation.load_displacement(load, forces=[30.0, 100.0, 200.0, LOAD])
    moved = [curve.frames[-1].outputs[output] for output in outputs]
    assert moved == pytest.approx(list(TIP.values()), rel=5e-3)
    assert np.all(curve.stable)
