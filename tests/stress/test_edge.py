"""Stress and strain along edges: beam theory, equilibrium of sections, free growth, and what may be asked."""

import math

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.files import read_csv

from ..plot.png import png_size
from ..simulation.clamped import YOUNG, cantilever
from .test_peak import bent_bar

FORCE, LENGTH = 1e-2, 20.0
SPACES = [
    "plane-stress",
    pytest.param("3d-symmetric", marks=pytest.mark.thorough),
    pytest.param("3d", marks=pytest.mark.thorough),
]


def bent(space: str) -> tuple[fm.Curve, fm.FlexibleLink]:
    beam = cantilever(space, length=LENGTH, poisson=0.3, size=1.0)
    (link,) = beam.simulation.scene.mechanism.flexible_links
    return beam.simulation.load_displacement(beam.force, forces=[FORCE]), link


@pytest.mark.parametrize("space", SPACES)
def test_edges_of_a_cantilever_bear_its_moment_and_opposite_ones_opposite_stress(space):
    curve, link = bent(space)
    upper, lower = (curve.edge_stress(link, start=(2.0, y), end=(LENGTH - 2.0, y)) for y in (0.5, -0.5))
    x = upper.points[:, 0]
    assert upper.arc_length == pytest.approx(x - x[0], abs=1e-9)
    # 6 F (L − x) / b h², a force along y
    largest = 6.0 * FORCE * LENGTH
    assert upper.along == pytest.approx(-6.0 * FORCE * (LENGTH - x), abs=0.005 * largest)
    assert upper.von_mises == pytest.approx(np.abs(upper.along), abs=0.01 * largest)
    assert YOUNG * upper.strain == pytest.approx(upper.along, abs=0.01 * largest)
    opposite = np.interp(x, lower.points[:, 0], lower.along)
    assert opposite == pytest.approx(-upper.along, abs=0.005 * largest)
    # ∫ σ ds between both ends
    (a, b), s = LENGTH - x[[0, -1]], upper.arc_length
    total = np.sum(0.5 * (upper.along[1:] + upper.along[:-1]) * np.diff(s))
    assert total == pytest.approx(-3.0 * FORCE * (a**2 - b**2), rel=0.003)
    assert not upper.singular.any() and upper.error.max() < 0.02 * largest


def test_the_whole_outline_is_as_long_as_the_link_and_unknown_where_joints_hold_it():
    curve, link = bent("plane-stress")
    edge = curve.edge_stress(link)
    assert edge.arc_length[-1] == pytest.approx(2.0 * (LENGTH + 3.0), rel=1e-9)
    x = edge.points[:, 0]
    # counter-clockwise from the leftmost point: along the underside first
    assert edge.points[0] == pytest.approx((-1.0, -0.5), abs=1e-9)
    assert edge.points[1, 1] == pytest.approx(-0.5, abs=1e-9)
    held = (x < -1e-9) | (x > LENGTH + 1e-9)
    for values in (edge.along, edge.strain, edge.strain_error):
        assert np.isnan(values[held]).all() and np.isfinite(values[~held]).mean() > 0.95
    assert edge.singular[(x > 0.0) & (x < 0.2)].all()


def golovin(moment: float, inner: float, outer: float, r: float) -> float:
    """Hoop stress at radius r of a curved bar of depth 1 in pure bending (Golovin 1881)."""
    a, b = inner, outer
    n = (b**2 - a**2) ** 2 - 4.0 * a**2 * b**2 * math.log(b / a) ** 2
    terms = a**2 * b**2 / r**2 * math.log(a / b) + b**2 * math.log(r / b) + a**2 * math.log(a / r) + b**2 - a**2
    return 4.0 * moment / n * terms


def test_the_inner_edge_of_a_curved_bar_in_pure_bending_has_the_stress_of_golovin():
    simulation, _ = bent_bar(0.5)
    mechanism = simulation.scene.mechanism
    couple, (bar,) = fm.ForceGroup("couple", dict.fromkeys(mechanism.forces, 1.0)), mechanism.flexible_links
    curve = simulation.load_displacement(couple, forces=[2e-4])
    edge = curve.edge_stress(bar, start=(2.0, 0.0), end=(-2.0, 0.0))
    assert edge.arc_length[-1] == pytest.approx(2.0 * math.pi, rel=1e-3)
    assert np.linalg.norm(edge.points, axis=1) == pytest.approx(2.0, rel=1e-3)
    inner = (edge.arc_length > 2.0) & (edge.arc_length < 4.3)
    expected = abs(golovin(0.02, 2.0, 4.0, 2.0))
    assert np.abs(edge.along[inner]) == pytest.approx(expected, rel=0.02)
    assert 1e6 * np.abs(edge.strain[inner]) == pytest.approx(expected, rel=0.02)
    assert 0.0 < 1e6 * edge.strain_error[inner].max() < 0.02 * expected


def test_free_expansion_is_no_strain_along_an_edge():
    mechanism = fm.Mechanism("strip")
    base = mechanism.rigid("base", fixed=True)
    hot = fm.Material("hot", 1e5, 0.3, expansion=1e-4)
    strip = mechanism.flexible("strip", fm.strip([(-1, 0), (10, 0)], thickness=1.0, depth=1.0), hot)
    mechanism.weld(base, strip, at=(-0.5, 0), region=fm.Rectangle(1.0, 3.0))
    push = mechanism.force(on=strip, at=(10, 0), direction=(0, 1), region=fm.Face())
    scene = fm.Scene(mechanism, effects=[fm.Temperature(100.0)])
    simulation = fm.Simulation(scene, space="plane-stress", size=1.0, comm=MPI.COMM_SELF)
    curve = simulation.load_displacement(push, forces=[1e-2])
    edge = curve.edge_stress(strip, start=(5.0, -0.5), end=(8.0, -0.5))
    x = edge.points[:, 0]
    # 6 F (L − x) / E b h², all lengths 1 % longer
    assert edge.strain == pytest.approx(6e-7 * (10.0 - x) / 1.01**2, rel=0.005)


def test_edges_are_drawn_and_tabulated(tmp_path):
    curve, link = bent("plane-stress")
    edge = curve.edge_stress(link)
    edge.plot(tmp_path / "edge.png")
    edge.write_csv(tmp_path / "edge.csv")
    assert min(png_size(tmp_path / "edge.png")) > 300
    table, known = read_csv(tmp_path / "edge.csv"), np.isfinite(edge.along)
    assert table["along the edge [MPa]"] == pytest.approx(edge.along[known], abs=0.0)
    assert table["arc length [mm]"] == pytest.approx(edge.arc_length[known], abs=0.0)
    assert table["strain along the edge"] == pytest.approx(edge.strain[known], abs=0.0)


def test_requests_that_name_no_edge_are_refused():
    curve, link = bent("plane-stress")
    base = curve.discretisation.scene.mechanism.rigid_links[0]
    with pytest.raises(fm.DescriptionError, match="flexible"):
        curve.edge_stress(base)
    with pytest.raises(fm.DescriptionError, match="no start"):
        curve.edge_stress(link, end=(0.0, 0.5))
