"""Links written as STEP files and read again bend as they did before."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.export import PinHole, write_step
from fenicsmech.meshing import gmsh, gmsh_session

from ..meshing.bent_links import CURVED, DEPTH, LENGTH, RADIUS, STRAIGHT, THICKNESS, bent, bent_point, link

FORCES = [-0.5, 1.0, 4.0]


def curve(shape, pins, *, size, space="plane-stress") -> np.ndarray:
    """Displacement of the second pin of a link along the line through both, for each of ``FORCES``."""
    mechanism = fm.Mechanism("bench")
    along = tuple(np.subtract(pins[1], pins[0]) / np.linalg.norm(np.subtract(pins[1], pins[0])))
    ground, slide = mechanism.rigid("ground", fixed=True), mechanism.rigid("slide")
    body = mechanism.flexible("link", shape, fm.Material("plastic", 200.0, 0.35))
    mechanism.revolute(ground, body, at=pins[0], interface_radius=RADIUS)
    mechanism.revolute(body, slide, at=pins[1], interface_radius=RADIUS)
    mechanism.prismatic(ground, slide, at=pins[1], axis=along)
    pull = mechanism.force(on=slide, at=pins[1], direction=along)
    simulation = fm.Simulation(fm.Scene(mechanism), space=space, size=size, comm=MPI.COMM_SELF)
    return np.array(simulation.load_displacement(pull, forces=FORCES).displacements)


def saved(mesh, path):
    """A plane mesh as a gmsh mesh file."""
    with gmsh_session("bent link"):
        gmsh.model.addDiscreteEntity(2, 1)
        numbers = np.arange(1, len(mesh.points) + 1)
        gmsh.model.mesh.addNodes(2, 1, numbers, np.column_stack([mesh.points, np.zeros(len(mesh.points))]).ravel())
        gmsh.model.mesh.addElementsByType(1, 2, [], (mesh.cells + 1).ravel())
        gmsh.write(str(path))
    return fm.gmsh_mesh(path, depth=DEPTH)


@pytest.mark.thorough
@pytest.mark.parametrize("holes", [(), (PinHole(CURVED[0], RADIUS), PinHole(CURVED[-1], RADIUS))])
def test_a_strip_written_and_read_bends_as_it_did(holes, tmp_path):
    pins = CURVED[0], CURVED[-1]
    write_step(tmp_path / "link.step", link(1.0), depth=DEPTH, pins=holes)
    drawn = curve(fm.strip(CURVED, thickness=THICKNESS, depth=DEPTH), pins, size=1.0)
    again = curve(fm.step_file(tmp_path / "link.step", depth=DEPTH), pins, size=1.0)
    assert np.abs(drawn).min() > 0.2
    assert again == pytest.approx(drawn, rel=5e-3)


def test_a_new_shape_written_and_read_bends_as_its_mesh_did(tmp_path):
    pins = bent_point(0.0), bent_point(LENGTH)
    mesh = bent(link(1.0, points=STRAIGHT))
    write_step(tmp_path / "link.step", mesh, depth=DEPTH)
    designed = curve(saved(mesh, tmp_path / "link.msh"), pins, size=1.0)
    again = curve(fm.step_file(tmp_path / "link.step", depth=DEPTH), pins, size=1.0)
    assert again == pytest.approx(designed, rel=5e-3)
