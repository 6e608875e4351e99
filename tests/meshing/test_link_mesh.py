"""Link meshes are positively oriented and free of unused points; cell measures and qualities are right."""

import numpy as np
import pytest

from fenicsmech.meshing import LinkMesh, cell_measures, count_pieces, radius_ratios

TRIANGLE = np.array([(0.0, 0.0), (1.0, 0.0), (0.5, np.sqrt(0.75))])
TETRAHEDRON = np.array([(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)])


@pytest.mark.parametrize("corners", [TRIANGLE, TETRAHEDRON])
def test_cells_are_turned_to_positive_orientation(corners):
    width = len(corners)
    cells = np.array([np.arange(width), np.arange(width)[::-1], np.roll(np.arange(width), 1)])
    mesh = LinkMesh.from_cells(corners, cells, np.zeros(3))
    assert np.all(cell_measures(mesh.points, mesh.cells) > 0.0)
    assert np.array_equal(np.sort(mesh.cells, axis=1), np.sort(cells, axis=1))


def test_unused_points_are_dropped():
    points = np.array([(9.0, 9.0), (0.0, 0.0), (8.0, 8.0), (1.0, 0.0), (0.0, 1.0)])
    mesh = LinkMesh.from_cells(points, np.array([(1, 3, 4)]), np.array([0]))
    assert np.array_equal(mesh.points, points[[1, 3, 4]])
    assert np.array_equal(mesh.cells, [(0, 1, 2)])


def test_a_mesh_cannot_be_written_into():
    mesh = LinkMesh.from_cells(TRIANGLE, np.array([(0, 1, 2)]), np.array([0]))
    with pytest.raises(ValueError, match="read-only"):
        mesh.points[0, 0] = 1.0


@pytest.mark.parametrize("corners, measure", [(TRIANGLE, np.sqrt(3.0) / 4.0), (TETRAHEDRON, -8.0 / 3.0)])
def test_equilateral_cells_have_their_measure_and_quality_one(corners, measure):
    cells = np.arange(len(corners))[None, :]
    assert cell_measures(corners, cells) == pytest.approx([measure])
    assert radius_ratios(corners, cells) == pytest.approx([1.0])
    assert radius_ratios(1e-3 * corners + 5.0, cells) == pytest.approx([1.0])


def test_quality_of_a_right_triangle():
    # legs 3 and 4: inradius 1, circumradius 5/2
    points = np.array([(0.0, 0.0), (3.0, 0.0), (0.0, 4.0)])
    assert radius_ratios(points, np.array([(0, 1, 2)])) == pytest.approx([0.8])


def test_pieces_that_meet_in_a_vertex_only_are_separate():
    assert count_pieces(np.array([(0, 1, 2), (1, 2, 3)])) == 1
    assert count_pieces(np.array([(0, 1, 2), (2, 3, 4)])) == 2
    assert count_pieces(np.array([(0, 1, 2, 3), (2, 3, 4, 5)])) == 2
