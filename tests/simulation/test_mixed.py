"""Nearly incompressible links in whole simulations: chosen by themselves, alike on all ranks, free where not needed."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from dolfinx.io import XDMFFile
from mpi4py import MPI

import fenicsmech as fm

from .test_ranks import COMMS, assert_alike

RUBBER, PLASTIC = fm.Material("rubber", 2.0, 0.4995), fm.Material("plastic", 20.0, 0.35)


def arm(materials=(RUBBER, PLASTIC), *, space="plane-strain", comm=MPI.COMM_SELF, **options):
    """Two links welded end to end, clamped at one end, pushed aside within the first and at the other end."""
    mechanism = fm.Mechanism("arm")
    base, knee, hand = (mechanism.rigid(name, fixed=name == "base") for name in ("base", "knee", "hand"))
    upper = mechanism.flexible("upper", fm.strip([(0, 0), (30, 0)], thickness=6.0, depth=6.0), materials[0])
    lower = mechanism.flexible("lower", fm.strip([(30, 0), (60, 0)], thickness=6.0, depth=6.0), materials[1])
    for a, b, x in ((base, upper, 0), (upper, knee, 30), (knee, lower, 30), (lower, hand, 60)):
        mechanism.weld(a, b, at=(x, 0), interface_radius=2.0)
    push = mechanism.force(on=hand, at=(60, 0), direction=(0, 1))
    mechanism.force(on=upper, at=(16, 0.5), direction=(0, 1), name="inner")
    return fm.Simulation(fm.Scene(mechanism), space=space, size=4.0, comm=comm, **options), push


def test_pressures_are_those_of_nodes_of_bulky_links_outside_interfaces():
    simulation, _ = arm()
    elastic = simulation.model.elastic
    x, y, _ = elastic.pressure.p.function_space.tabulate_dof_coordinates().T
    pressed = elastic.pressure.unknown
    assert np.all(x[pressed] < 33.0 + 1e-9)  # the link ends beyond its pin
    assert not np.any(pressed & (np.hypot(x, y) < 1.9))
    rubber = simulation.model.mixed
    assert rubber == (True, False)
    assert simulation.model.pressure_dofs == pressed.sum() > 10


@pytest.mark.parametrize("space", ["plane-strain", "plane-stress", "3d"])
def test_nothing_is_added_where_no_link_is_bulky(space):
    """Not a form, not an unknown, not a matrix entry."""
    materials = (PLASTIC, fm.Material("silicone", 2.0, 0.49))
    if space == "plane-stress":
        materials = (RUBBER, PLASTIC)
    found = []
    for formulation in (None, fm.DisplacementFormulation()):
        simulation, push = arm(materials, space=space, formulation=formulation)
        system = simulation.solver(push).system
        elastic = simulation.model.elastic
        extended = system.kkt.extended
        found.append(
            (
                elastic.energy_ufl.signature(),
                extended.size,
                extended.getInfo()["nz_used"],
                extended.getBlockSize(),
                system.numbering.block,
            )
        )
        assert elastic.pressure is None and simulation.model.pressure_dofs == system.blocks.pressures.size == 0
        assert len(elastic.fields) == 1
    assert found[0] == found[1]


@pytest.mark.thorough
@pytest.mark.parallel
@pytest.mark.parametrize("space", ["plane-strain", "3d"])
def test_results_are_the_same_on_any_number_of_ranks(space):
    curves, errors = [], []
    for comm in COMMS:
        simulation, push = arm(space=space, comm=comm)
        inner = simulation.scene.mechanism.forces[1]
        curves.append(simulation.load_displacement(push, forces=[0.005, 0.02], others={inner: 0.01}))
        simulation.load_displacement(inner, displacements=[1.0])
        errors.append(curves[-1].error_estimates())
    assert_alike(*curves)
    assert errors[1] == pytest.approx(errors[0], rel=1e-5)
    assert all(frame.stable for frame in curves[0].frames)


@pytest.mark.thorough
def test_limit_of_incompressibility_is_approached_without_failure():
    """Newton's method needs as many iterations, and what is left of the way falls as 1 − 2ν."""
    tips, iterations = [], []
    for poisson in (0.499, 0.4999, 0.49999):
        simulation, push = arm((fm.Material("rubber", 2.0 * (1.0 + poisson), poisson), PLASTIC))
        curve = simulation.load_displacement(push, forces=[0.01, 0.05])
        tips.append(curve.displacements[-1])
        iterations.append(sum(frame.iterations for frame in curve.frames))
    gaps = np.abs(np.diff(tips))
    assert gaps[1] == pytest.approx(gaps[0] / 10.0, rel=0.05)
    assert max(iterations) <= min(iterations) + 1


@pytest.mark.thorough
def test_wherever_the_limit_is_set_compressible_links_bend_alike():
    curves = []
    for formulation in (fm.DisplacementFormulation(), fm.MixedFormulation(above=0.0), fm.MixedFormulation(above=0.36)):
        simulation, push = arm((fm.Material("soft", 2.0, 0.37), PLASTIC), formulation=formulation)
        curves.append(simulation.load_displacement(push, forces=[0.01, 0.05]))
    for curve in curves[1:]:
        assert curve.displacements == pytest.approx(curves[0].displacements, rel=5e-3)
        assert [f.strain_energy for f in curve.frames] == pytest.approx(
            [f.strain_energy for f in curves[0].frames], rel=5e-3
        )
        assert curve.frames[-1].max_stress == pytest.approx(curves[0].frames[-1].max_stress, rel=0.05)


@pytest.mark.parallel
def test_pressure_is_written(shared_tmp_path):
    simulation, push = arm(comm=MPI.COMM_WORLD)
    curve = simulation.load_displacement(push, forces=[0.0, 0.02])
    path = shared_tmp_path / "arm.xdmf"
    curve.write(path)
    names = {attribute.get("Name") for attribute in ElementTree.parse(path).iter("Attribute")}
    assert names >= {"displacement", "von Mises stress", "pressure"}
    with XDMFFile(MPI.COMM_WORLD, str(path), "r") as file:
        assert file.read_mesh(name="mesh").topology.dim == 2
