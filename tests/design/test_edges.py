"""Edges that follow a design: weights at their midpoints, affine designs, areas of bent strips, estimates, ranks."""

import numpy as np
import pytest
from mpi4py import MPI
from numpy.polynomial import polynomial

import fenicsmech as fm
from fenicsmech.design import BETWEEN, MidEdgeNodes, ShapeError, ShapeMap, edge_weights
from fenicsmech.mechanism import Force
from fenicsmech.meshing import InterfaceSite, LinkMesh, boundary_loops, mesh_link, node_ends

from ..simulation.demo_scenes import describe
from .mechanisms import bench, truss
from .shapes import RADIUS, shape_map, strip_mesh

# the truss of the demo, optimised in plane stress
OPTIMUM = [
    *(8.794, 22.63, -0.024, 13.728, 20.638, 0.51, 12.18, 21.059, -0.02),
    *(18.445, 45.49, 0.757, 15.061, 19.322, 0.032, 17.454, 16.837, -0.002),
]

each_dim = pytest.mark.parametrize("dim", [2, 3])


def quadratic_map(dim: int, comm: MPI.Comm = MPI.COMM_SELF) -> ShapeMap:
    """The map of both links to the vertices and edges of a mesh."""
    return shape_map(dim, 2, comm)


def drawn(shape: ShapeMap) -> np.ndarray:
    """X₀ + c at the nodes of the map, (nodes, dim)."""
    mesh, ends = shape.mesh, node_ends(shape.design.function_space)
    return mesh.vertices[ends].mean(axis=1) + mesh.curved.of_cells(ends)[:, 0]


@each_dim
def test_weights_of_edges_add_up_to_one_and_those_around_an_interface_are_its_own(dim):
    shape = quadratic_map(dim)
    for index, one in enumerate(shape.shapes):
        mesh, own, handles = strip_mesh(index, dim), one.own, one.handles
        assert own.edges.weights.sum(axis=1) == pytest.approx(1.0, abs=1e-9)
        for handle, site in enumerate(handles.site):
            if site == BETWEEN:
                continue
            around = np.isin(own.edges.ends, mesh.cells_of(site)).all(axis=1)
            radii = np.linalg.norm(own.edges.middles[around] - handles.centre[handle], axis=1)
            assert np.sum(around) >= 8
            assert np.any(np.abs(radii - RADIUS) < 1e-3 * RADIUS)  # on the circle, off its chords
            assert own.edges.weights[around, handle] == pytest.approx(1.0, abs=1e-12)


@each_dim
def test_designs_that_turn_and_stretch_a_link_do_so_to_its_edges_too(dim):
    shape, T = quadratic_map(dim), np.array([[0.3, -0.8, 5.0], [0.9, -0.2, -3.0]])
    maps = []
    for own in shape.shapes:
        # (X − X_j, 1) of every handle, so that all of them move X by T (X, 1)
        there = np.repeat(T[None], len(own.handles), axis=0)
        there[:, :, 2] += own.handles.centre @ T[:, :2].T
        maps.append(there)
    X = drawn(shape)[:, :2]
    moved = shape.spread(maps)
    assert moved[:, :2] == pytest.approx(X @ T[:, :2].T + T[:, 2], abs=1e-10)
    assert len(X) > 2 * len(shape.mesh.vertices)


def strip(size: float, dim: int = 2) -> LinkMesh:
    """A straight strip from (0, 0) to (60, 0), 10 mm wide."""
    site = InterfaceSite((0.0,) * dim, fm.Disc(2.0))
    return mesh_link("strip", fm.strip([(0, 0), (60, 0)], thickness=10.0, depth=5.0), [site], dim=dim, size=size)


def bent(points: np.ndarray) -> np.ndarray:
    """The displacement of points (n, 2) when the strip becomes a piece of a ring of the same area."""
    radius, (x, y) = 30.0, points.T
    x, radii = x / radius, radius - y
    return np.column_stack([radii * np.sin(x), radius - radii * np.cos(x)]) - points


def area(points: np.ndarray, middles: np.ndarray) -> float:
    """The area that quadratic edges from each of ``points`` over ``middles`` to the next enclose."""
    total = 0.0
    for a, m, b in zip(points, middles, np.roll(points, -1, axis=0), strict=True):
        x, y = np.transpose([a, 4 * m - 3 * a - b, 2 * (a + b) - 4 * m])
        inner = polynomial.polyint(polynomial.polymul(x, polynomial.polyder(y)))  # ∫ x dy
        total += float(np.sum(inner))
    return total


def test_the_area_of_a_strip_bent_into_a_ring_is_of_fourth_order():
    errors = []
    for size in (5.0, 2.5):
        mesh = strip(size)
        (loop,) = boundary_loops("strip", mesh)
        points = mesh.points[loop]
        ends = np.column_stack([loop, np.roll(loop, -1)])
        drawn = mesh.points[ends].mean(axis=1) + mesh.curved.of_cells(ends)[:, 0]
        edges = edge_weights(mesh, bent(mesh.points))
        keys = [tuple(pair) for pair in edges.ends.tolist()]
        rows = [keys.index(tuple(sorted(pair))) for pair in ends.tolist()]
        moved = points + bent(points)
        chords = 0.5 * (moved + np.roll(moved, -1, axis=0))
        exact = area(points, drawn)
        errors.append([area(moved, middle) - exact for middle in (chords, drawn + edges.weights[rows])])
    (chord, curve), (finer_chord, finer_curve) = np.abs(errors)
    assert np.log2(chord / finer_chord) == pytest.approx(2.0, abs=0.4)
    assert np.log2(curve / finer_curve) > 3.5
    assert finer_curve < 0.01 * finer_chord


@pytest.mark.parallel
@each_dim
def test_edges_and_the_transpose_do_not_depend_on_the_number_of_ranks(dim):
    alone, shared = (quadratic_map(dim, comm) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    count = len(alone.mesh.vertices)
    p = alone.initial + 0.05 * np.random.default_rng(1).standard_normal(len(alone.initial))
    whole, pulled = {}, []
    for shape in (alone, shared):
        keys = (node_ends(shape.design.function_space) @ (count, 1)).tolist()
        field = shape.field(p, shape.initial_theta)
        whole = whole or dict(zip(keys, field, strict=True))
        assert field == pytest.approx(np.array([whole[key] for key in keys]), abs=1e-12)
        g = np.sin(np.array(keys))[:, None] * np.arange(1, dim + 1)
        pulled.append(shape.apply_transpose(p, shape.initial_theta, g[: shape.owned]))
    for one, other in zip(*pulled, strict=True):
        assert other == pytest.approx(one, rel=1e-10, abs=1e-10)


def place_along_chord(x: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """The place of the middles of edges along their chords in the plane, 0 halfway, from the positions of all nodes."""
    vertex = {int(a): k for k, (a, b) in enumerate(ends) if a == b}
    middles = np.flatnonzero(ends[:, 0] != ends[:, 1])
    a, b = (x[[vertex[int(end)] for end in ends[middles, side]], :2] for side in (0, 1))
    chords, long = b - a, np.linalg.norm(b - a, axis=1) > 1e-9
    bulges = x[middles, :2] - 0.5 * (a + b)
    return np.sum((bulges * chords)[long], axis=1) / np.sum(chords[long] ** 2, axis=1)


@each_dim
def test_middles_of_edges_keep_their_place_along_the_chord_and_move_along_it_alone(dim):
    shape = quadratic_map(dim)
    ends, X = node_ends(shape.design.function_space), drawn(shape)
    middles = MidEdgeNodes(ends, X)
    slid = shape.initial_theta.copy()
    for own, positions in zip(shape.shapes, np.split(slid, [len(shape.shapes[0].handles)]), strict=True):
        t = own.handles.t[own.handles.slides]
        positions[own.handles.slides] = t + 0.3 * np.sin(np.pi * t / own.handles.t[-1])  # bunched up at one end
    raw = shape.field(shape.initial, slid)
    placed = middles.placed(raw)
    assert np.abs(place_along_chord(X + raw, ends) - place_along_chord(X, ends)).max() > 0.03
    assert place_along_chord(X + placed, ends) == pytest.approx(place_along_chord(X, ends), abs=1e-12)
    moved = np.flatnonzero(np.any(placed != raw, axis=1))
    assert np.all(ends[moved, 0] != ends[moved, 1])
    position = {int(a): (X + raw)[k] for k, (a, b) in enumerate(ends) if a == b}
    chords = np.array([position[int(b)] - position[int(a)] for a, b in ends[moved]])[:, :2]
    shifts = (placed - raw)[moved, :2]
    across = shifts[:, 0] * chords[:, 1] - shifts[:, 1] * chords[:, 0]
    assert across == pytest.approx(0.0, abs=1e-10)
    assert np.array_equal(middles.placed(np.zeros_like(X)), np.zeros_like(X))


@each_dim
def test_the_transpose_of_placed_middles_is_that_of_their_derivative(dim):
    shape = quadratic_map(dim)
    middles = MidEdgeNodes(node_ends(shape.design.function_space), drawn(shape))
    random = np.random.default_rng(2)
    field, way, g = (scale * random.standard_normal(drawn(shape).shape) for scale in (0.05, 1.0, 1.0))
    pulled = float(np.sum(middles.apply_transpose(field, g) * way))
    errors = []
    for step in (1e-2, 5e-3):
        change = middles.placed(field + step * way) - middles.placed(field - step * way)
        errors.append(abs(np.sum(g * change) / (2.0 * step) - pulled))
    assert errors[1] < 1e-2 * abs(pulled)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)  # of central differences


def test_a_design_whose_edges_would_squeeze_cells_is_refused():
    both = bench(case := truss((0.1, 6.0)), case.simulate(size=3.0))
    near = both.rest.place(both.rest.initial, None)
    before = both.field()
    with pytest.raises(ShapeError, match="squeeze"):
        both.rest.place(both.design(3.0, 3), near)
    assert np.array_equal(both.field(), before)


@pytest.mark.slow
def exported_truss(path) -> tuple[fm.Scene, Force]:
    """The truss with its diagonal as in a STEP file, and its force."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(fm, "strip", lambda *_, depth, **__: fm.step_file(path, depth=depth))
        return describe("truss")


@pytest.mark.slow
def test_the_exported_part_on_a_finer_mesh_confirms_a_design_within_its_estimate(tmp_path):
    case = truss((0.1, 6.0))
    coarse, push, forces = case.simulate(size=2.1), case.scene.mechanism.forces[0], (0.1, 0.4)
    problem = fm.DesignProblem(coarse, case.designs, targets=case.targets)
    problem.export(tmp_path, np.array(OPTIMUM))
    curve = coarse.with_design(problem.rest_shape(OPTIMUM)).load_displacement(push, forces=forces)
    scene, push = exported_truss(tmp_path / "diagonal.step")
    fine = fm.Simulation(scene, space="plane-stress", size=0.75).load_displacement(push, forces=forces)
    found = fine.displacements + fine.error_estimates() - curve.displacements
    ratio = curve.error_estimates()[-2:] / found[-2:]
    assert np.all((ratio > 0.5) & (ratio < 2.0)), ratio
