"""A curved link pulled and pushed by its pins, against the geometrically exact beam between the rims of the pins."""

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

from ..oracles import beam, centreline

POINTS = [(0.0, 0.0), (20.0, 10.0), (40.0, 9.0), (58.0, 0.0)]
LINE = centreline.through(POINTS)
THICKNESS, DEPTH, YOUNG = LINE.length / 30.0, 4.0, 1000.0
PULLS = [0.3, 1.0, 3.0, 10.0]  # in Euler loads of the straight link
PUSHES = [-2.0, -5.0, -10.0, -20.0]  # growth of the distance of the pins


def pinned(space: str, poisson: float, radius: float):
    """The link on a hinge of the ground and one of a carriage that slides along its chord."""
    mechanism = fm.Mechanism("pinned link")
    base, carriage = mechanism.rigid("base", fixed=True), mechanism.rigid("carriage")
    shape = fm.strip(POINTS, thickness=THICKNESS, depth=DEPTH)
    link = mechanism.flexible("link", shape, fm.Material("steel", YOUNG, poisson))
    mechanism.revolute(base, link, at=POINTS[0], interface_radius=radius)
    mechanism.revolute(link, carriage, at=POINTS[-1], interface_radius=radius)
    mechanism.prismatic(base, carriage, at=POINTS[-1], axis=(1, 0))
    pull = mechanism.force(on=carriage, at=POINTS[-1], direction=(1, 0))
    return fm.Simulation(fm.Scene(mechanism), space=space, size=0.5 * THICKNESS, comm=MPI.COMM_SELF), pull


@pytest.mark.thorough
@pytest.mark.parametrize("radius", [0.5 * THICKNESS, 0.75 * THICKNESS], ids=["within", "wider"])
@pytest.mark.parametrize("poisson", [0.0, 0.42])
@pytest.mark.parametrize("space", ["plane-stress", "plane-strain"])
def test_pulled_and_pushed_link_follows_the_beam(space, poisson, radius):
    section = beam.Section.rectangle(
        young=YOUNG, poisson=poisson, thickness=THICKNESS, depth=DEPTH, plane_strain=space == "plane-strain"
    )
    link = beam.between_pins(LINE, section, rigid=(radius, radius))
    simulation, pull = pinned(space, poisson, radius)
    euler = np.pi**2 * section.bending / LINE.length**2

    forces = [factor * euler for factor in PULLS]
    pulled = simulation.load_displacement(pull, forces=forces)
    expected = [beam.pinned_pinned(link, force=force).extension for force in forces]
    assert pulled.displacements == pytest.approx(expected, rel=5e-3)
    assert [frame.strain_energy for frame in pulled.frames] == pytest.approx(
        [beam.pinned_pinned(link, force=force).solution.energy for force in forces], rel=1e-2
    )

    pushed = simulation.load_displacement(pull, displacements=PUSHES)
    expected = [beam.pinned_pinned(link, extension=extension).force for extension in PUSHES]
    assert pushed.forces == pytest.approx(expected, rel=5e-3)
    assert np.all(pushed.stable)
