"""Links that are longer without strain than drawn stretch freely, push when held, and are differentiated."""

from __future__ import annotations

import numpy as np
import pytest
import ufl
from dolfinx import fem

import fenicsmech as fm
from fenicsmech.compat import compile_form
from fenicsmech.effects import Prestrain

from ..design.refusal import refused
from ..elasticity.single_link import interpolate, wave
from ..oracles.dense import taylor_rates
from .design_slope import assert_design_gradient
from .form_derivative import form_derivative

SPACES = ["plane-stress", "plane-strain", "3d"]
LENGTH, THICKNESS, DEPTH, BLOCK = 40.0, 2.0, 3.0, 2.0
NYLON = fm.Material("nylon", 2000.0, 0.0)
RUBBER = fm.Material("rubber", 2000.0, 0.4999)  # in the u–p formulation


def bar(
    space: str, stretch: float, *, along=(1.0, 0.0), held: bool = False, bow: float = 0.0, material: fm.Material = NYLON
):
    """A bar between a wall at x = 0 and a block, which is free to move or ``held`` by a slider in y; the force."""
    mechanism = fm.Mechanism("bar")
    wall, block = mechanism.rigid("wall", fixed=True), mechanism.rigid("block")
    line = [(-BLOCK, 0), (0.5 * LENGTH, bow), (LENGTH + BLOCK, 0)] if bow else [(-BLOCK, 0), (LENGTH + BLOCK, 0)]
    link = mechanism.flexible("bar", fm.strip(line, thickness=THICKNESS, depth=DEPTH), material)
    clamp = fm.Rectangle(2.0 * BLOCK, 4.0 * THICKNESS)
    mechanism.weld(wall, link, at=(-BLOCK, 0), region=clamp)
    mechanism.weld(link, block, at=(LENGTH + BLOCK, 0), region=clamp)
    if held:
        mechanism.prismatic(wall, block, at=(LENGTH, 0), axis=(0, 1), name="slider")
    push = mechanism.force(on=block, at=(LENGTH, 0), direction=(0, 1) if held else (1, 0))
    scene = fm.Scene(mechanism, effects=[Prestrain(link, stretch, along)] if stretch != 1.0 else [])
    return fm.Simulation(scene, space=space, size=2.0), push


@pytest.mark.thorough
@pytest.mark.parametrize("stretch", [0.7, 1.0 + 1e-6, 1.4])
@pytest.mark.parametrize("space", SPACES)
def test_a_free_bar_takes_its_strain_free_length(space, stretch):
    simulation, push = bar(space, stretch)
    (frame,) = simulation.load_displacement(push, forces=[0.0]).frames
    assert frame.displacement == pytest.approx((stretch - 1.0) * LENGTH, rel=1e-9)
    assert frame.strain_energy < 1e-12 * 2000.0 * (stretch - 1.0) ** 2 * LENGTH * THICKNESS * DEPTH + 1e-20
    assert frame.max_stress < 1e-6 * 2000.0 * abs(stretch - 1.0)
    assert frame.stable


@pytest.mark.thorough
@pytest.mark.parametrize("stretch", [0.7, 1.4])
@pytest.mark.parametrize("space", ["plane-strain", "3d"])
def test_a_free_bar_of_rubber_does_so_without_pressure(space, stretch):
    simulation, push = bar(space, stretch, material=RUBBER)
    (frame,) = simulation.load_displacement(push, forces=[0.0]).frames
    assert frame.displacement == pytest.approx((stretch - 1.0) * LENGTH, rel=1e-9)
    assert frame.max_stress < 1e-6 * 2000.0 * abs(stretch - 1.0)
    simulation.model.load(frame.state)
    assert simulation.model.pressure_dofs > 0
    assert simulation.model.elastic.pressure.p.x.array == pytest.approx(0.0, abs=1e-6 * 2000.0)
    assert frame.stable


@pytest.mark.parametrize("space", ["plane-strain", "3d"])
def test_residuals_of_displacement_and_pressure_are_differentiated_by_the_load_factor(space):
    body = bar(space, 1.2, along=(0.8, 0.6), material=RUBBER)[0].model.elastic
    for field, size, seed in ((body.shape, 0.1, 1), (body.u, 0.1, 2)):
        interpolate(field, wave(body.model.dim, size, seed=seed))
    body.pressure.p.x.array[:] = np.linspace(-30.0, 20.0, len(body.pressure.p.x.array))
    weights = np.random.default_rng(4).uniform(-1.0, 1.0, len(body.values()))

    def at_load_factor(values):
        body.load_factor.value = values[0]
        return weights @ body.residuals()

    body.load_factor.value = 0.8
    rate = weights @ body.load_factor_residuals()
    rates = taylor_rates(at_load_factor, [0.8], [1.0], [rate], [0.1, 0.05, 0.025])
    assert rates.with_gradient.min() > 1.9


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric"])
def test_a_bar_that_swells_in_all_directions_grows_as_long_as_it_would(space):
    # its ends are held across: away from them it is free
    simulation, push = bar(space, 1.1, along=None)
    (frame,) = simulation.load_displacement(push, forces=[0.0]).frames
    assert frame.displacement == pytest.approx(0.1 * LENGTH, rel=0.02)


@pytest.mark.thorough
@pytest.mark.parametrize("space", SPACES)
def test_a_held_bar_pushes_by_its_stiffness_times_the_strain_it_may_not_have(space):
    strain = 1e-5
    simulation, push = bar(space, 1.0 + strain, held=True)
    (frame,) = simulation.load_displacement(push, forces=[0.0]).frames
    force = frame.reactions["slider"].force[0]
    assert abs(force) == pytest.approx(2000.0 * THICKNESS * DEPTH * strain, rel=1e-4)
    assert frame.stable


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("space", "along"),
    [("plane-stress", (0.8, 0.6)), ("plane-stress", None), ("plane-strain", None), ("3d", (0.8, 0.6))],
)
def test_energy_and_its_gradient_are_differentiated(space, along):
    simulation, _ = bar(space, 1.2, along=along)
    body, dim = simulation.model.elastic, simulation.linkage.dim
    work = fem.Function(body.u.function_space)
    for field, size, seed in ((body.shape, 0.1, 1), (body.u, 0.1, 2), (work, 1.0, 3)):
        interpolate(field, wave(dim, size, seed=seed))
    body.load_factor.value = 0.8
    residual = ufl.derivative(body.energy_ufl, body.u, work)
    for form in (body.energy_ufl, residual):
        for field in (body.u, body.shape):
            assert form_derivative(form, field, size=0.05, seed=5).rates.with_gradient[-1] > 1.95

    # what the path of growing effects needs: the derivative of the residual by the load factor
    compiled = compile_form(residual)
    vector = work.x.array.copy()
    rate = body.load_factor_residuals()[: len(vector)] @ vector

    def at_load_factor(values):
        body.load_factor.value = values[0]
        return fem.assemble_scalar(compiled)

    rates = taylor_rates(at_load_factor, [0.8], [1.0], [rate], [0.1, 0.05, 0.025])
    assert rates.with_gradient.min() > 1.9


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_displacements_are_differentiated_by_the_design_field(space):
    simulation, push = bar(space, 1.1, held=True, bow=4.0)
    assert_design_gradient(simulation, push, 1.0)


def test_without_prestrain_the_energy_has_no_field_for_it():
    counts = []
    for stretch in (1.0, 1.1):
        simulation, _ = bar("plane-stress", stretch)
        counts.append(len(simulation.model.elastic.energy_ufl.coefficients()))
    assert counts[0] == 5  # u, d, E, ν, depth
    assert counts[1] > counts[0]


def test_invalid_prestrain_is_refused():
    simulation, push = bar("plane-strain", 1.1)
    mechanism = simulation.scene.mechanism
    (link,) = mechanism.flexible_links
    refused(lambda: Prestrain(link, 0.0), part="'bar'", problem="not positive", remedy="greater")
    refused(lambda: Prestrain(link, 1.1, (0, 0)), part="direction", problem="zero length", remedy="somewhere")
    refused(lambda: Prestrain(mechanism.rigid_links[0], 1.1), part="prestrain", problem="not a flexible", remedy="Give")
    out = fm.Scene(mechanism, effects=[Prestrain(link, 1.1, (0, 0, 1))])
    refused(lambda: fm.Simulation(out, space="plane-stress", size=2.0), part="prestrain", problem="plane", remedy="two")
    twice = fm.Scene(mechanism, effects=[Prestrain(link, 1.1, (1, 0)), Prestrain(link, 1.2, (1, 0))])
    both = fm.Simulation(twice, space="plane-stress", size=2.0)
    refused(lambda: both.load_displacement(push, forces=[0.0]), part="'bar'", problem="twice", remedy="one")
