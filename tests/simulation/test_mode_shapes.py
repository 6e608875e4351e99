"""Buckling modes of a column are found in every space and formulation: the load is Euler's, the link bends sideways."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

LENGTH, THICKNESS, DEPTH = 60.0, 2.0, 6.0


def column(material: fm.Material) -> tuple[fm.Scene, fm.Force]:
    """A straight link between a hinge and one on a slide, pressed along its axis."""
    rig = fm.Mechanism("column")
    ground, slide = rig.rigid("ground", fixed=True), rig.rigid("slide")
    strut = rig.flexible("strut", fm.strip([(0, 0), (LENGTH, 0)], thickness=THICKNESS, depth=DEPTH), material)
    rig.revolute(ground, strut, at=(0, 0), interface_radius=0.5)
    rig.revolute(strut, slide, at=(LENGTH, 0), interface_radius=0.5)
    rig.prismatic(ground, slide, at=(LENGTH, 0), axis=(1, 0))
    return fm.Scene(rig), rig.force(on=slide, at=(LENGTH, 0), direction=(-1, 0))


@pytest.mark.parallel
@pytest.mark.parametrize(
    ("space", "poisson", "pressed"),
    [("plane-stress", 0.0, False), ("plane-strain", 0.4995, True), ("3d-symmetric", 0.0, False)],
)
def test_column_buckles_in_the_plane_at_its_euler_load(space, poisson, pressed):
    # N = π² E I / L², with E / (1 − ν²) in plane strain
    stiffness = 100.0 / (1.0 - poisson**2)
    euler = np.pi**2 * stiffness * DEPTH * THICKNESS**3 / 12.0 / LENGTH**2
    scene, push = column(fm.Material("soft", 100.0, poisson))
    simulation = fm.Simulation(scene, space=space, size=2.0, comm=MPI.COMM_WORLD)
    curve = simulation.load_displacement(push, forces=[0.2 * euler])
    assert (simulation.model.pressure_dofs > 0) is pressed
    (load,) = curve.buckling_points(count=1)
    assert load.value == pytest.approx(euler, rel=0.03)
    assert load.mode.link == "strut"
    assert load.mode.out_of_plane < 1e-3
    assert curve.soft_modes(count=1)[0].mode.link == "strut"
