"""Interface nodes follow their bodies, wherever the cells of the interfaces lie."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from fenicsmech.multibody import InterfaceMap

from ..joints.poses import PLANAR, SPATIAL
from ..oracles.dense import jacobian
from .shared_mesh import barycentric, shared_mesh

pytestmark = pytest.mark.parallel

SPACES = {2: PLANAR, 3: SPATIAL}


def interface_cells(corners):
    """Body of each cell, −1 if free: bodies 1 and 2 have one cell each, body 3 all cells along one side."""
    body = np.where(corners[:, :, 1].mean(axis=1) < 0.6, 3, -1)
    taken = {tuple(vertex) for vertex in corners[body == 3].reshape(-1, corners.shape[2])}
    for cell in np.random.default_rng(5).permutation(len(corners)):
        vertices = set(map(tuple, corners[cell]))
        if body.max(where=body < 3, initial=0) < 2 and not vertices & taken:
            body[cell] = body.max(where=body < 3, initial=0) + 1
            taken |= vertices
    return body


class Setting:
    """Four bodies, the first without an interface here; where the nodes of the others lie is found from positions."""

    def __init__(self, dim, order, comm=MPI.COMM_WORLD):
        self.mesh, self.space = shared_mesh(dim, order=order, comm=comm), SPACES[dim]
        cell_body = interface_cells(self.mesh.corners)
        self.body = np.full(len(self.mesh.nodes), -1)
        for cell in np.flatnonzero(cell_body >= 0):
            inside = barycentric(self.mesh.corners[cell], self.mesh.nodes).min(axis=1) > -1e-9
            self.body[inside] = cell_body[cell]
        random = np.random.default_rng(6)
        self.centres = random.uniform(-1.0, 3.0, (4, dim))
        self.poses = self.space.retract(random.uniform(-2.0, 2.0, (4, self.space.pose_size)))
        self.map = InterfaceMap(
            self.mesh.u,
            self.mesh.u.function_space.tabulate_dof_coordinates()[:, :dim],
            cell_body[self.mesh.here],
            self.centres,
            self.space,
        )

    def expected(self, nodes):
        """Displacements of marked ``nodes`` by a formula of their own."""
        moved = []
        for node in nodes:
            body = self.body[node]
            pose, dim = self.poses[body], self.space.dim
            turn = [0.0, 0.0, pose[2]] if dim == 2 else None
            R = (Rotation.from_rotvec(turn) if dim == 2 else Rotation.from_quat([*pose[4:], pose[3]])).as_matrix()
            X, c = self.mesh.nodes[node], self.centres[body]
            moved.append(R[:dim, :dim] @ (X - c) + c + pose[:dim] - X)
        return np.array(moved).reshape(-1, self.space.dim)


@pytest.fixture(scope="module", params=[(2, 1), (2, 2), (3, 1), (3, 2)], ids=lambda p: f"{p[0]}d-P{p[1]}")
def setting(request):
    return Setting(*request.param)


def test_every_rank_knows_the_body_of_its_nodes_even_if_the_interface_lies_elsewhere(setting):
    assert np.array_equal(setting.map.body, setting.body)
    owned = setting.mesh.u.function_space.dofmap.index_map.size_local
    assert setting.map.owned == owned
    counts = MPI.COMM_WORLD.allreduce(np.bincount(setting.map.body[:owned] + 1, minlength=5))
    nodes_of_a_cell = len(setting.mesh.u.function_space.dofmap.cell_dofs(0))
    assert list(counts[1:4]) == [0, nodes_of_a_cell, nodes_of_a_cell]
    assert counts[4] > 2 * nodes_of_a_cell


def test_nodes_move_rigidly_with_their_body_and_the_others_stay(setting):
    setting.mesh.values[:] = 7.0
    setting.map.place(setting.poses)
    marked = np.flatnonzero(setting.body >= 0)
    assert setting.mesh.values[marked] == pytest.approx(setting.expected(marked), abs=1e-14)
    assert np.all(setting.mesh.values[setting.body < 0] == 7.0)


def test_bodies_that_have_not_moved_leave_their_nodes_exactly_in_place(setting):
    setting.mesh.values[:] = 7.0
    setting.map.place(np.tile(setting.space.identity, (4, 1)))
    assert not setting.mesh.values[setting.body >= 0].any()


def test_small_motions_keep_their_digits(setting):
    # u = ω × (X − c), what follows is of order ω²
    poses = np.tile(setting.space.identity, (4, 1))
    poses[:, -1] = 1e-14
    setting.map.place(poses)
    marked = np.flatnonzero(setting.body >= 0)
    arm = setting.mesh.nodes[marked] - setting.centres[setting.body[marked]]
    turn = {2: 1e-14, 3: 2e-14}[setting.space.dim]  # a quaternion turns by twice its vector
    assert setting.mesh.values[marked, :2] == pytest.approx(turn * arm[:, [1, 0]] * [-1.0, 1.0], rel=1e-11, abs=0.0)


def test_gradient_rows_are_the_derivatives_of_the_motion(setting):
    for body in setting.map.nodes:
        nodes, rows = setting.map.gradient_rows(setting.poses, body)
        assert np.array_equal(nodes, np.flatnonzero(setting.body[: setting.map.owned] == body))

        def moved(pose, body=body, nodes=nodes):
            poses = setting.poses.copy()
            poses[body] = pose
            setting.map.place(poses)
            return setting.mesh.values[nodes].copy()

        assert rows == pytest.approx(jacobian(moved, setting.poses[body]), abs=1e-9)


def test_moments_give_the_second_derivative_of_the_work(setting):
    forces = np.random.default_rng(7 + MPI.COMM_WORLD.rank).normal(size=(setting.map.owned, setting.space.dim))
    for body, moment in setting.map.moments(forces).items():

        def work_gradient(pose, body=body):
            poses = setting.poses.copy()
            poses[body] = pose
            nodes, rows = setting.map.gradient_rows(poses, body)
            return np.einsum("ni,nia->a", forces[nodes], rows)

        hessian = setting.space.displacement_hessian(setting.poses[body], moment)
        assert hessian == pytest.approx(jacobian(work_gradient, setting.poses[body]), abs=1e-9)


@pytest.mark.parametrize("dim", [2, 3])
def test_moments_count_every_node_once_on_any_number_of_ranks(dim):
    totals = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        setting = Setting(dim, 2, comm)
        moments = setting.map.moments(np.cos(setting.mesh.nodes[: setting.map.owned]))
        totals.append([comm.allreduce(moments.get(body, np.zeros((dim, dim)))) for body in (1, 2, 3)])
    assert np.array(totals[1]) == pytest.approx(np.array(totals[0]), rel=1e-13)
