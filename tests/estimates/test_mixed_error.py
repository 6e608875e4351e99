"""Error estimates of links in the u–p (mixed) formulation: within a factor of two, the pressure's error included."""

from __future__ import annotations

import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.compat import compile_form
from fenicsmech.estimates import PressureError, Recovery

from ..simulation.refined import refine

RUBBER = fm.Material("rubber", 2.0, 0.4995)


def clamped(length: float, thickness: float, direction: tuple[float, float], load: float):
    """A link between two clamps, and a force on the second one."""
    rig = fm.Mechanism("clamped")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    link = rig.flexible("link", fm.strip([(-3, 0), (length + 3, 0)], thickness=thickness, depth=5.0), RUBBER)
    for a, b, x in ((wall, link, -1.5), (link, hand, length + 1.5)):
        rig.weld(a, b, at=(x, 0), region=fm.Rectangle(3, thickness + 2.0))
    return fm.Scene(rig), rig.force(on=hand, at=(length, 0), direction=direction), load


def arch():
    """A curved link pressed together by its pins."""
    rig = fm.Mechanism("arch")
    ground, slide = rig.rigid("ground", fixed=True), rig.rigid("slide")
    link = rig.flexible("link", fm.strip([(0, 0), (20, 9), (40, 0)], thickness=3.0, depth=5.0), RUBBER)
    rig.revolute(ground, link, at=(0, 0), interface_radius=2.5)
    rig.revolute(link, slide, at=(40, 0), interface_radius=2.5)
    rig.prismatic(ground, slide, at=(40, 0), axis=(1, 0, 0))
    return fm.Scene(rig), rig.force(on=slide, at=(40, 0), direction=(-1, 0)), 0.034


CASES = {
    "cantilever": lambda: clamped(60.0, 3.0, (0, 1), 0.0034),
    "thick cantilever": lambda: clamped(60.0, 9.0, (0, 1), 0.09),
    "sheared block": lambda: clamped(20.0, 16.0, (0, 1), 1.2),
    "pressed block": lambda: clamped(20.0, 16.0, (-1, 0), 1.2),
    "arch": arch,
}


def simulated(name: str, size: float, *, order: int, space: str = "plane-strain", comm: MPI.Comm = MPI.COMM_SELF):
    scene, push, load = CASES[name]()
    simulation = fm.Simulation(scene, space=space, order=order, size=size, comm=comm)
    return simulation, simulation.load_displacement(push, forces=[0.5 * load, load])


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "order"), [*((name, 2) for name in CASES), ("thick cantilever", 3), ("pressed block", 3)]
)
def test_effectivity_is_between_a_half_and_two(name, order, monkeypatch):
    simulation, curve = simulated(name, 4.0, order=order)
    assert simulation.model.pressure_dofs > 0
    estimate = curve.error_estimates()[-1]
    refine(monkeypatch, order - 1)
    error = simulated(name, 4.0, order=3)[1].displacements[-1] - curve.displacements[-1]
    assert 0.5 < estimate / error < 2.0


@pytest.mark.thorough
def test_effectivity_in_half_the_depth_is_between_a_half_and_two():
    simulation, curve = simulated("thick cantilever", 5.0, order=2, space="3d-symmetric")
    estimate = curve.error_estimates()[-1]
    error = simulated("thick cantilever", 5.0, order=3, space="3d-symmetric")[1].displacements[-1]
    assert 0.5 < estimate / (error - curve.displacements[-1]) < 2.0


def test_error_of_a_quadratic_pressure_is_recovered():
    """Interpolated at the vertices it is off by what ``PressureError`` says, but for cells at the rim."""
    simulation = fm.Simulation(CASES["thick cantilever"]()[0], space="plane-strain", size=2.0, comm=MPI.COMM_SELF)
    elastic = simulation.model.elastic
    p, x = elastic.pressure.p, ufl.SpatialCoordinate(elastic.mesh)

    def square(f) -> float:
        return fem.assemble_scalar(compile_form(f**2 * elastic.free(4)))

    for exact, left in ((lambda x: 1.0 + x[0] - 2.0 * x[1], 0.0), (lambda x: x[0] ** 2 - x[0] * x[1], 0.05)):
        p.interpolate(exact)
        pressure = PressureError(elastic, p, Recovery(simulation.model, 1))
        pressure.update()
        assert square(exact(x) - p - pressure.error) <= left * square(exact(x) - p) + 1e-20


@pytest.mark.parallel
def test_estimate_is_the_same_on_any_number_of_processes():
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        _, curve = simulated("thick cantilever", 6.0, order=2, comm=comm)
        found.append(curve.error_estimates()[-1])
    assert found[1] == pytest.approx(found[0], rel=1e-5)
