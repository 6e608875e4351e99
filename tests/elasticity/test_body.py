"""Integral over the mesh: material, depth and cells of each link, and units."""

import numpy as np
import pytest
from mpi4py import MPI

from fenicsmech.compat import cell_nodes, create_mesh
from fenicsmech.elasticity import PLANE_STRAIN, ElasticBody, Quadrature
from fenicsmech.laws import IsochoricNeoHookean
from fenicsmech.mechanism import Material
from fenicsmech.stress import von_mises

from ..plot.grids import rectangle
from . import textbook
from .cases import each_case
from .single_link import distorted, forces, interpolate, nodes, single_link, wave

GRADIENT = np.array([[0.2, 0.1, -0.05], [-0.3, -0.1, 0.2], [0.1, 0.05, 0.15]])


@each_case
def test_homogeneous_strain_has_the_energy_density_times_volume(model, law):
    dim, depth = model.dim, 2.5
    body = single_link(*distorted(dim), model=model, law=law, young=1.9, poisson=0.475, depth=depth)
    H = GRADIENT[:dim, :dim]
    interpolate(body.u, lambda X: X @ H.T)
    volume = 1.0 if dim == 3 else depth
    density = float(textbook.energy(model, law, H.tolist(), 1.9, 0.475))
    assert body.energy() == pytest.approx(density * volume, rel=1e-13)


def test_each_link_has_its_own_material_law_and_depth_and_rigid_cells_store_nothing():
    # four unit squares in a row: two links of two laws, one square of each rigid
    points, cells = rectangle(4, 1, 4.0, 1.0)
    mesh = create_mesh(MPI.COMM_SELF, cells, points)
    square = np.floor(mesh.geometry.x[cell_nodes(mesh), 0].mean(axis=1)).astype(int)
    materials = [Material("a", 2.0, 0.3), Material("b", law=IsochoricNeoHookean(5.0, 0.45))]
    body = ElasticBody(
        mesh,
        link=square // 2,
        free=square % 2 == 0,
        materials=materials,
        depths=[3.0, 0.5],
        model=PLANE_STRAIN,
        order=1,
        quadrature=Quadrature.for_order(1, 2),
    )
    H = GRADIENT[:2, :2]
    interpolate(body.u, lambda X: X @ H.T)
    energies = [
        depth * float(textbook.energy(PLANE_STRAIN, type(m.law), H.tolist(), m.law.E, m.law.nu))
        for m, depth in zip(materials, (3.0, 0.5), strict=True)
    ]
    assert body.energy() == pytest.approx(sum(energies), rel=1e-13)


@each_case
def test_a_single_cell_turned_inside_out_leaves_no_energy(model, law):
    body = single_link(*distorted(model.dim), model=model, law=law, order=1)
    assert body.energy() == 0.0
    inner = np.argmin(np.linalg.norm(nodes(body.u) - 0.5, axis=1))
    body.u.x.array.reshape(-1, model.dim)[inner, 0] = 10.0
    assert np.isnan(body.energy())


@pytest.mark.thorough
@each_case
@pytest.mark.parametrize("order", [1, 2])
def test_units_do_not_matter(model, law, order):
    # lengths in mm and moduli in MPa against m and Pa: forces stay in N, energies go from N·mm to N·m
    points, cells = distorted(model.dim)
    seen = []
    for length, stress in ((1.0, 1.0), (1e-3, 1e6)):
        body = single_link(
            points * length, cells, model=model, law=law, order=order, young=1770.0 * stress, depth=2.5 * length
        )
        for field, seed in ((body.shape, 1), (body.u, 2)):
            interpolate(field, lambda x, length=length, seed=seed: length * wave(model.dim, 0.2, seed=seed)(x / length))
        seen.append((body.energy() / length, forces(body), von_mises(body.stress_samples()[0]) / stress))
    (energy, force, stress), (energy_in_m, force_in_m, stress_in_pa) = seen
    assert energy_in_m == pytest.approx(energy, rel=1e-12)
    assert force_in_m == pytest.approx(force, abs=1e-12 * np.abs(force).max())
    assert stress_in_pa == pytest.approx(stress, rel=1e-12)
