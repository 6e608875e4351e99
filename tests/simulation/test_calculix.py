"""Flexible links of a loaded mechanism against CalculiX, on the same mesh, their interfaces moved as we found."""

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.elasticity import Quadrature
from fenicsmech.laws import IsochoricNeoHookean

from ..oracles import calculix

pytestmark = [
    pytest.mark.calculix,
    pytest.mark.skipif(not calculix.available(), reason="ccx not found: apt install calculix-ccx"),
]

POISSON = 0.42
YOUNG = {"coupler": 500.0, "rocker": 1770.0}


def four_bar(quadrature: Quadrature | None):
    """A rigid crank held by its motor, a flexible coupler and rocker, a force on a point of the coupler."""
    mechanism = fm.Mechanism("four-bar")
    base, crank = mechanism.rigid("base", fixed=True), mechanism.rigid("crank")

    def link(name, *points):
        material = fm.Material(name, law=IsochoricNeoHookean(YOUNG[name], POISSON))
        return mechanism.flexible(name, fm.strip(points, thickness=3.0, depth=5.0), material)

    coupler, rocker = link("coupler", (0, 20), (25, 33), (50, 30)), link("rocker", (40, 0), (50, 30))
    mechanism.motor(mechanism.revolute(base, crank, at=(0, 0)))
    mechanism.revolute(crank, coupler, at=(0, 20), interface_radius=2.0)
    mechanism.revolute(coupler, rocker, at=(50, 30), interface_radius=2.0)
    mechanism.revolute(base, rocker, at=(40, 0), interface_radius=2.0)
    push = mechanism.force(on=coupler, at=(25.0, 33.0, 0.0), direction=(0.28, -0.96, 0.0))
    simulation = fm.Simulation(fm.Scene(mechanism), space="3d", size=3.0, quadrature=quadrature, comm=MPI.COMM_SELF)
    return simulation, push


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("quadrature", "tolerance"), [(Quadrature(2), 1e-5), (None, 1e-3)], ids=["as CalculiX", "default"]
)
def test_displacements_of_flexible_links_and_reactions_of_joints(quadrature, tolerance):
    simulation, push = four_bar(quadrature)
    frame = simulation.load_displacement(push, forces=[15.0]).frames[0]
    model, linkage = simulation.model, simulation.linkage
    model.load(frame.state)
    space = model.elastic.u.function_space
    computed = model.elastic.u.x.array.reshape(-1, 3)
    assert np.linalg.norm(computed, axis=1).max() > 4.0

    cells = np.array([space.dofmap.cell_dofs(cell) for cell in range(len(model.mesh.link))])
    cells = cells[:, list(calculix.VTK_FROM_BASIX)]
    mesh = calculix.Mesh(model.elastic.drawn_nodes, cells, model.mesh.link)
    links = simulation.scene.mechanism.flexible_links
    materials = {k: calculix.NeoHooke(YOUNG[link.name], POISSON) for k, link in enumerate(links)}
    moved = [calculix.Fixed(nodes, computed[nodes]) for nodes in model.interfaces.nodes.values()]
    point, direction = model.point(push), np.array(push.direction)
    forces = {n: w * frame.force * direction for n, w in zip(point.global_nodes, point.weights, strict=True)}
    reference = calculix.solve(mesh, materials, moved, forces, steps=4)

    error = np.linalg.norm(computed - reference.displacement) / np.linalg.norm(reference.displacement)
    assert error < tolerance
    # each interface of these links has one joint; what the joint exerts is what holds the interface in place
    for connection in linkage.joints.connections:
        reaction = frame.reactions[connection.name].force
        for body, sign in ((connection.a, -1.0), (connection.b, 1.0)):
            if body in model.interfaces.nodes:
                held = reference.force[model.interfaces.nodes[body]].sum(axis=0)
                assert sign * reaction == pytest.approx(held, abs=10 * tolerance * np.linalg.norm(held))
