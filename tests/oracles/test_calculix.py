"""CalculiX as an oracle: node orderings, and blocks with an analytical solution of its neo-Hookean energy."""

import itertools

import numpy as np
import pytest
from scipy.optimize import root

from . import beam, calculix, centreline

MATERIAL = calculix.NeoHooke(young=1770.0, poisson=0.42)
FREE = np.nan


def needs_ccx(test):
    """Mark a test that runs ccx, and skip it where there is none."""
    missing = pytest.mark.skipif(not calculix.available(), reason="ccx not found: apt install calculix-ccx")
    return pytest.mark.calculix(missing(test))


def quadratic(points, tetrahedra):
    """Quadratic mesh, in VTK order, of linear ``tetrahedra`` (m, 4)."""
    points, middles = list(map(tuple, points)), {}
    cells = []
    for tetrahedron in tetrahedra:
        cell = list(tetrahedron)
        for edge in calculix.VTK_EDGES:
            key = tuple(sorted(tetrahedron[v] for v in edge))
            if key not in middles:
                middles[key] = len(points)
                points.append(tuple(0.5 * (np.array(points[key[0]]) + np.array(points[key[1]]))))
            cell.append(middles[key])
        cells.append(cell)
    return calculix.Mesh(np.array(points), np.array(cells), np.ones(len(cells), dtype=int))


def block(counts, size):
    """Box of counts (3,) hexahedra, each of six tetrahedra around its diagonal, half of them inverted."""
    shape = np.array(counts) + 1
    points = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    tetrahedra = []
    for corner in itertools.product(*map(range, counts)):
        for order in itertools.permutations(range(3)):
            path = np.cumsum([corner, *np.eye(3, dtype=int)[list(order)]], axis=0)
            tetrahedra.append([int(np.ravel_multi_index(p, shape)) for p in path])
    return quadratic(points * np.array(size) / np.array(counts), tetrahedra)


def uniaxial(stretch, material):
    """Lateral stretch and nominal stress of a bar under uniaxial tension, from ∂W/∂λ of the energy."""
    c10, d1 = material.coefficients()

    def stress(lengths):
        volume, trace = np.prod(lengths), np.sum(lengths**2)
        isochoric = 2.0 * c10 * volume ** (-2.0 / 3.0) * (lengths - trace / (3.0 * lengths))
        return isochoric + 2.0 / d1 * (volume - 1.0) * volume / lengths

    lateral = root(lambda t: stress(np.array([stretch, t[0], t[0]]))[1:2], [stretch**-0.4], tol=1e-13).x[0]
    return lateral, stress(np.array([stretch, lateral, lateral]))[0]


def plane(mesh, axis, value):
    return np.flatnonzero(np.abs(mesh.points[:, axis] - value) < 1e-9)


def end_forces(mesh, length, total):
    """Nodal forces of a uniform traction of resultant ``total`` (3,) on the end x = ``length`` of a block.

    Its triangles are all of one size; each puts a third of its share on each of its midpoints, nothing on vertices.
    """
    on_end = np.abs(mesh.points[mesh.cells, 0] - length) < 1e-9
    triangles = [cell[on][3:] for cell, on in zip(mesh.cells, on_end, strict=True) if on.sum() == 6]
    forces = {}
    for node in np.ravel(triangles):
        forces[int(node)] = forces.get(int(node), 0.0) + np.asarray(total) / (3.0 * len(triangles))
    return forces


def symmetric(mesh):
    """Rollers on the three coordinate planes."""
    rollers = np.where(np.eye(3, dtype=bool), 0.0, FREE)
    return [calculix.Fixed(plane(mesh, axis, 0.0), rollers[axis]) for axis in range(3)]


def numbered(vertices, edges):
    """Vertices followed by the midpoints of ``edges``."""
    return np.vstack([vertices, [vertices[list(edge)].mean(axis=0) for edge in edges]])


@pytest.mark.parametrize(
    "permutation, edges",
    [
        (calculix.VTK_FROM_BASIX, [(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)]),
        (calculix.VTK_FROM_GMSH, [(0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)]),
    ],
)
def test_orderings_name_the_midpoints_of_the_same_edges(permutation, edges):
    vertices = np.array([[0.0, 0.0, 0.0], [2.0, 0.1, 0.0], [0.3, 3.0, 0.2], [0.4, 0.5, 4.0]])
    other = numbered(vertices, edges)
    assert other[list(permutation)] == pytest.approx(numbered(vertices, calculix.VTK_EDGES))


def test_basix_numbers_its_quadratic_tetrahedron_as_stated():
    basix = pytest.importorskip("basix")
    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType.tetrahedron, 2, basix.LagrangeVariant.gll_warped
    )
    points = element.points[list(calculix.VTK_FROM_BASIX)]
    assert points == pytest.approx(numbered(points[:4], calculix.VTK_EDGES))


def test_gmsh_numbers_its_quadratic_tetrahedron_as_stated():
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize([], False)
    try:
        coordinates = gmsh.model.mesh.getElementProperties(11)[4]
    finally:
        gmsh.finalize()
    points = np.array(coordinates).reshape(10, 3)[list(calculix.VTK_FROM_GMSH)]
    assert points == pytest.approx(numbered(points[:4], calculix.VTK_EDGES))


@needs_ccx
@pytest.mark.parametrize("stretch", [0.7, 1.001, 1.5])
def test_block_stretched_along_one_axis(stretch):
    size = np.array([3.0, 2.0, 1.0])
    mesh = block((2, 1, 1), size)
    pulled = calculix.Fixed(plane(mesh, 0, size[0]), np.array([size[0] * (stretch - 1.0), FREE, FREE]))
    solution = calculix.solve(mesh, {1: MATERIAL}, [*symmetric(mesh), pulled], steps=2)
    lateral, stress = uniaxial(stretch, MATERIAL)
    expected = mesh.points * (np.array([stretch, lateral, lateral]) - 1.0)
    assert solution.displacement == pytest.approx(expected, abs=2e-7 * np.abs(expected).max())
    assert solution.force[pulled.nodes, 0].sum() == pytest.approx(stress * size[1] * size[2], rel=1e-6)


@needs_ccx
def test_block_pulled_by_forces_takes_the_same_stretch():
    mesh = block((2, 1, 1), (3.0, 2.0, 1.0))
    stretch = 1.3
    lateral, stress = uniaxial(stretch, MATERIAL)
    forces = end_forces(mesh, 3.0, [2.0 * stress, 0.0, 0.0])
    solution = calculix.solve(mesh, {1: MATERIAL}, symmetric(mesh), forces, steps=4)
    expected = mesh.points * (np.array([stretch, lateral, lateral]) - 1.0)
    assert solution.displacement == pytest.approx(expected, abs=3e-7)
    for node, force in forces.items():
        assert solution.force[node, 0] == pytest.approx(force[0], rel=1e-6)


@needs_ccx
def test_each_cell_has_the_material_of_its_tag():
    # two materials in series along x, nothing sideways: the stiffer half stretches less, by equal nominal stress
    mesh = block((2, 1, 1), (2.0, 1.0, 1.0))
    tags = np.where(mesh.points[mesh.cells[:, :4]].mean(axis=1)[:, 0] > 1.0, 2, 1)
    mesh = calculix.Mesh(mesh.points, mesh.cells, tags)
    soft, stiff = calculix.NeoHooke(1.0, 0.0), calculix.NeoHooke(5.0, 0.0)
    confined = calculix.Fixed(np.arange(len(mesh.points)), np.array([FREE, 0.0, 0.0]))
    ends = [calculix.Fixed(plane(mesh, 0, x), np.array([u, FREE, FREE])) for x, u in ((0.0, 0.0), (2.0, 1e-3))]
    solution = calculix.solve(mesh, {1: soft, 2: stiff}, [confined, *ends])
    assert solution.displacement[plane(mesh, 0, 1.0), 0] == pytest.approx(1e-3 * 5.0 / 6.0, rel=1e-3)


@needs_ccx
def test_rigid_rotation_takes_no_force():
    mesh = block((1, 1, 1), (1.0, 1.0, 1.0))
    angle = 1.0
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    expected = mesh.points @ (turn - np.eye(3)).T
    outside = np.flatnonzero(np.any((mesh.points < 1e-9) | (mesh.points > 1.0 - 1e-9), axis=1))
    solution = calculix.solve(mesh, {1: MATERIAL}, [calculix.Fixed(outside, expected[outside])], steps=4)
    assert solution.displacement == pytest.approx(expected, abs=1e-6)
    assert np.abs(solution.force).max() < 1e-9 * MATERIAL.young


@needs_ccx
def test_slender_strip_bends_like_the_beam():
    length, thickness, depth, load = 60.0, 2.0, 4.0, 3.0
    mesh = block((24, 2, 1), (length, thickness, depth))
    clamp = calculix.Fixed(plane(mesh, 0, 0.0), np.zeros(3))
    forces = end_forces(mesh, length, [0.0, load, 0.0])
    solid = calculix.solve(mesh, {1: calculix.NeoHooke(1770.0, 0.0)}, [clamp], forces, steps=3)
    axis = np.intersect1d(plane(mesh, 0, length), plane(mesh, 1, 0.5 * thickness))

    section = beam.Section.rectangle(young=1770.0, poisson=0.0, thickness=thickness, depth=depth)
    strip = beam.Beam(centreline.straight((0.0, 0.0), (length, 0.0)), section)
    tip = beam.solve(strip, beam.CLAMPED, beam.End(force_y=load)).end.displacement
    assert tip[1] > 0.5 * length
    assert solid.displacement[axis, :2].mean(axis=0) == pytest.approx(tip, rel=1e-3)


@needs_ccx
def test_unsolvable_problem_is_reported_with_the_output_of_ccx():
    mesh = block((1, 1, 1), (1.0, 1.0, 1.0))
    far_too_much = {int(node): (-1e5, 0.0, 0.0) for node in plane(mesh, 0, 1.0)}
    with pytest.raises(RuntimeError, match=r"ccx stopped at 0\.0(.|\n)*too many cutbacks"):
        calculix.solve(mesh, {1: MATERIAL}, symmetric(mesh), far_too_much)


@needs_ccx
def test_cells_turned_inside_out_are_not_accepted_as_a_solution():
    mesh = block((1, 1, 1), (1.0, 1.0, 1.0))
    crushed = calculix.Fixed(plane(mesh, 0, 1.0), np.array([-1.5, 0.0, 0.0]))
    with pytest.raises(RuntimeError, match="6 of 6 cells inside out"):
        calculix.solve(mesh, {1: MATERIAL}, [*symmetric(mesh), crushed])
