"""The demos, at the element sizes they come with, have as many unknowns as the published simulations."""

import sys

import pytest

import fenicsmech as fm

from .demo_scenes import demo

PUBLISHED = {"truss": (42, 10188), "claw": (77, 16608), "klann": (77, 15915)}  # rigid and flexible


class Reached(Exception):
    """The demo was about to compute its first curve."""


@pytest.mark.parametrize("name", PUBLISHED)
def test_rigid_unknowns_are_those_published_and_flexible_ones_come_close(name, monkeypatch):
    simulations = []

    def stop(simulation, *arguments, **options):
        simulations.append(simulation)
        raise Reached

    monkeypatch.setattr(fm.Simulation, "load_displacement", stop)
    monkeypatch.setattr(sys, "argv", [f"{name}.py"])
    with pytest.raises(Reached):
        demo(name).main()
    (simulation,) = simulations
    assert (simulation.linkage.dim, simulation.fidelity.order) == (3, 2)
    rigid, flexible = PUBLISHED[name]
    assert simulation.model.rigid_dofs == rigid
    assert simulation.model.flexible_dofs == pytest.approx(flexible, rel=0.1)
    assert 3.0 < simulation.mesh_ratio_max < 15.0  # 3 is the regular tetrahedron's


@pytest.mark.parametrize("order, size", [(1, 4.0), (2, 4.0)])
@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_flexible_unknowns_are_the_nodes_outside_interfaces(space, order, size):
    scene = demo("truss").describe()[0]
    simulation = fm.Simulation(scene, space=space, order=order, size=size)
    model, dim = simulation.model, simulation.linkage.dim
    positions = model.elastic.u.function_space.tabulate_dof_coordinates()[: model.interfaces.owned]
    pins = [(0.0, 0.0), (40.0, 60.0)]
    outside = [all((x - a) ** 2 + (y - b) ** 2 > 3.0**2 + 1e-6 for a, b in pins) for x, y, *_ in positions]
    total = simulation.comm.allreduce(sum(outside))
    assert model.flexible_dofs == total * dim
    assert model.rigid_dofs == 6 * {2: 3, 3: 7}[dim]
