"""The weight of a link with curved edges is that of its exact area, whatever the element size."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.effects import Gravity, LinkFields

DENSITY, G = 1e-6, 9810.0


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_weight_and_energy_are_integrated_exactly_in_curved_cells(space):
    rig = fm.Mechanism("bow")
    wall = rig.rigid("wall", fixed=True)
    nylon = fm.Material("nylon", 2000.0, 0.3, density=DENSITY)
    bow = rig.flexible("bow", fm.strip([(0, 0), (14, 12), (20, 30)], thickness=3.0, depth=4.0), nylon)
    rig.revolute(wall, bow, at=(0, 0), interface_radius=2.0)
    rig.revolute(wall, bow, at=(20, 30), interface_radius=2.0)
    rig.force(on=bow, at=(14, 12), direction=(1, 0))
    gravity = Gravity((0, -G))
    body = fm.Simulation(fm.Scene(rig, effects=[gravity]), space=space, size=4.0, comm=MPI.COMM_SELF).model.elastic
    assert body.bulge is not None
    fields = LinkFields((bow,), body, {})
    body.u.x.array[:] = np.random.default_rng(0).standard_normal(len(body.u.x.array))

    def energy(degree: int) -> float:
        depth = 4.0 if space == "plane-stress" else 1.0
        density = depth * DENSITY * G * fields.u[1] * ufl.det(body.rest_gradient)
        return fem.assemble_scalar(fem.form(density * body.dx(metadata={"quadrature_degree": degree})))

    found = fem.assemble_scalar(fem.form(gravity.link_energy(fields)))
    assert found == pytest.approx(energy(9), rel=1e-11)
    assert energy(2) != pytest.approx(energy(9), rel=1e-6)  # as if cells were straight
