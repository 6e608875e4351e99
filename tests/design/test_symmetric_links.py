"""Designs on half links: the same shapes as on whole ones, given to files as wholes."""

import numpy as np
import pytest

import fenicsmech as fm

from .mechanisms import bench, truss

SPACES = ("3d", "3d-symmetric")


def facets(path) -> np.ndarray:
    """Corners of the facets of a binary STL file, (facets, 3, 3)."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
    return np.frombuffer(path.read_bytes()[84:], dtype=record)["corners"].astype(float)


def volume(corners: np.ndarray) -> float:
    """Enclosed by a closed surface."""
    return np.linalg.det(corners).sum() / 6.0


def test_links_are_shaped_alike_and_exported_whole(tmp_path):
    fields = []
    for space in SPACES:
        case = truss((0.1, 6.0))
        # 20 mm deep: two layers in the whole, one in the half
        simulation = case.simulate(space, size=5.0, order=1)
        problem = fm.DesignProblem(simulation, case.designs, targets=case.targets)
        parts = bench(case, simulation)
        values = problem.rest_shape(parts.design()).field.reshape(-1, 3)
        places = simulation.model.elastic.shape.function_space.tabulate_dof_coordinates()
        at_mid_plane = np.abs(places[:, 2]) < 1e-9
        order = np.lexsort(places[at_mid_plane].round(6).T)
        fields.append(values[at_mid_plane][order])
        problem.export(tmp_path / space, parts.design(), pin_diameter=3.0)
    assert np.abs(fields[0]).max() > 0.1
    assert fields[1] == pytest.approx(fields[0], abs=1e-6)
    whole, half = (facets(tmp_path / space / "diagonal.stl") for space in SPACES)
    assert (half[..., 2].min(), half[..., 2].max()) == (-10.0, 10.0)
    assert volume(half) == pytest.approx(volume(whole), rel=1e-4)
    assert (tmp_path / SPACES[1] / "diagonal.step").exists()
