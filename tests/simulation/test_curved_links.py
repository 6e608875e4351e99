"""Links with curved edges move rigidly at no cost, points on their outline with them, on any number of ranks."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial.transform import Rotation

import fenicsmech as fm
from fenicsmech.mechanism import Force, Output
from fenicsmech.meshing import MechanismMesh
from fenicsmech.model import MechanismModel

INNER, OUTER, DEPTH = 12.0, 16.0, 6.0
MIDDLE = 0.5 * (INNER + OUTER)
CASES = [("plane-stress", 2), ("plane-strain", 3), ("3d", 2), ("3d", 3), ("3d-symmetric", 2)]
each_case = pytest.mark.parametrize("space, order", CASES)


def bow(space: str, order: int, comm: MPI.Comm = MPI.COMM_SELF) -> tuple[fm.Simulation, Output, Force]:
    """Half a ring clamped at one end and pulled at the other; the output is the top of its outline."""
    mechanism = fm.Mechanism("bow")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    outer = fm.Arc((0.0, OUTER), (-OUTER, 0.0))
    inner = fm.Arc((0.0, INNER), (INNER, 0.0))
    shape = fm.outline((OUTER, 0.0), [outer, fm.Line((-INNER, 0.0)), inner], depth=DEPTH)
    link = mechanism.flexible("bow", shape, fm.ONYX)
    mechanism.weld(base, link, at=(-MIDDLE, 0.0), region=fm.Rectangle(5.0, 5.0))
    mechanism.weld(link, hand, at=(MIDDLE, 0.0), region=fm.Rectangle(5.0, 5.0))
    pull = mechanism.force(on=hand, at=(MIDDLE, 0.0), direction=(-1, 0), name="pull")
    top = mechanism.output(on=link, at=(0.0, OUTER), direction=(0, 1), name="top")
    return fm.Simulation(fm.Scene(mechanism), space=space, order=order, size=4.0, comm=comm), top, pull


def middles(mesh: MechanismMesh) -> np.ndarray:
    """The middles of all curved edges, (k, dim)."""
    return mesh.vertices[mesh.curved.ends].mean(axis=1) + mesh.curved.bulges


def turned(points: np.ndarray) -> np.ndarray:
    """Displacements of ``points`` (n, dim) turned and shifted."""
    dim = points.shape[1]
    turn = Rotation.from_rotvec([0.0, 0.0, 2.0] if dim == 2 else [0.5, -1.0, 1.5]).as_matrix()[:dim, :dim]
    return points @ (turn - np.eye(dim)).T + np.array([3.0, -7.0, 2.0])[:dim]


def move(model: MechanismModel) -> None:
    """Makes the displacements those of ``turned``."""
    model.elastic.u.x.array[:] = turned(model.elastic.drawn_nodes).ravel()


@pytest.mark.thorough
@each_case
def test_rigid_motion_stores_no_energy_and_takes_no_force(space, order):
    model = bow(space, order)[0].model
    assert model.elastic.bulge is not None
    move(model)
    young = fm.ONYX.law.E
    assert abs(model.elastic.energy()) < 1e-12 * young
    assert np.abs(model.elastic.residuals()).max() < 1e-12 * young * OUTER


@each_case
def test_points_on_curved_edges_are_found_where_they_are_drawn_and_move_with_the_link(space, order):
    simulation, top, _ = bow(space, order)
    model = simulation.model
    move(model)
    places = middles(model.mesh)[::7]
    if space == "3d-symmetric":
        places[:, 2] = 0.0  # the height of all points of half links
    for place in places:
        # on the outer side farther beyond the chord than points are sought beyond cells
        output = Output(top.on, (*place, 0.0)[:3], (1.0, 0.0), "there")
        found = model.point(output).displacement(model.elastic.u, None)
        assert found == pytest.approx(turned(place[None])[0], abs=1e-11 * OUTER)


def test_points_are_found_in_the_most_curved_cells_too():
    # few edges around pins and along a narrow bend: bulges of a tenth of the chord
    mechanism = fm.Mechanism("hook")
    base = mechanism.rigid("base", fixed=True)
    shape = fm.strip([(0.0, 0.0), (8.0, 6.0), (16.0, 0.0)], thickness=3.0, depth=2.0)
    hook = mechanism.flexible("hook", shape, fm.ONYX)
    mechanism.revolute(base, hook, at=(0.0, 0.0), interface_radius=2.4)
    mechanism.revolute(base, hook, at=(16.0, 0.0), interface_radius=2.4)
    model = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=4.0, comm=MPI.COMM_SELF).model
    move(model)
    for place in middles(model.mesh):
        output = Output(hook, tuple(place), (1.0, 0.0), "there")
        found = model.point(output).displacement(model.elastic.u, None)
        assert found == pytest.approx(turned(place[None])[0], abs=1e-11)


def test_linear_fields_have_straight_cells_and_find_points_on_their_chords():
    simulation, top, _ = bow("plane-stress", 1)
    model = simulation.model
    assert model.elastic.bulge is None
    move(model)
    ends = model.mesh.vertices[model.mesh.curved.ends[0]]
    found = model.point(Output(top.on, tuple(ends.mean(axis=0)), (1.0, 0.0), "there"))
    assert found.displacement(model.elastic.u, None) == pytest.approx(turned(ends).mean(axis=0), abs=1e-12)


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_nodes_on_the_outline_lie_on_the_circles(space):
    model = bow(space, 2)[0].model
    radius = np.linalg.norm(model.elastic.drawn_nodes[:, :2], axis=1)
    assert radius.max() == pytest.approx(OUTER, rel=1e-9)
    outer = np.linalg.norm(middles(model.mesh)[:, :2], axis=1) > MIDDLE
    assert np.linalg.norm(middles(model.mesh)[outer, :2], axis=1) == pytest.approx(OUTER, rel=1e-9)
    assert np.linalg.norm(middles(model.mesh)[~outer, :2], axis=1) == pytest.approx(INNER, rel=1e-9)


@pytest.mark.parallel
@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_curves_are_the_same_on_any_number_of_ranks(space):
    curves = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        simulation, top, pull = bow(space, 2, comm)
        curve = simulation.load_displacement(pull, displacements=[0.5])
        curves.append([curve.forces[0], curve.frames[0].outputs[top]])
    assert curves[1] == pytest.approx(curves[0], rel=1e-9)
