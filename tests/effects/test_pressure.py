"""Pressure follows the boundary: virtual work, derivatives, thick-walled cylinders, and which parts are refused."""

from __future__ import annotations

import numpy as np
import pytest
import ufl
from dolfinx import fem
from scipy.optimize import brentq

import fenicsmech as fm
from fenicsmech.compat import compile_form
from fenicsmech.effects import Pressure
from fenicsmech.elasticity import PLANE_STRAIN, SPATIAL
from fenicsmech.mechanism import Arc

from ..design.refusal import refused
from ..elasticity.dirichlet_newton import solve
from ..elasticity.single_link import components, distorted, interpolate, nodes, wave
from ..plot.grids import box, rectangle
from .design_slope import assert_design_gradient
from .form_derivative import form_derivative
from .pressed import POISSON, YOUNG, PressedBody

MODELS = {2: PLANE_STRAIN, 3: SPATIAL}


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("dim", [2, 3])
def test_virtual_work_on_a_closed_boundary_is_that_of_the_deformed_normals(dim, order):
    pressed = PressedBody(*distorted(dim), MODELS[dim], 0.7, order=order)
    fields, work = pressed.fields, fem.Function(pressed.body.u.function_space)
    for field, size, seed in ((fields.body.shape, 0.2, 1), (fields.u, 0.2, 2), (work, 1.0, 3)):
        interpolate(field, wave(dim, size, seed=seed))
    found = fem.assemble_scalar(compile_form(ufl.derivative(pressed.effect.link_energy(fields), fields.u, work)))
    (part,) = pressed.effect.faces
    expected = 0.7 * fem.assemble_scalar(compile_form(fields.flux(work, part, degree=6)))
    assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_virtual_work_on_the_sides_of_an_extruded_link_is_that_within_its_plane(order):
    points, cells = box(2, 2, 3, (1.0, 1.5, 2.0))

    def sides(x):
        return np.isclose(x[:, 0] * (1.0 - x[:, 0]) * x[:, 1] * (1.5 - x[:, 1]), 0.0)

    pressed = PressedBody(points, cells, SPATIAL, 0.7, where=sides, about=(2.0, -1.0), order=order)
    fields, work = pressed.fields, fem.Function(pressed.body.u.function_space)
    for field, size, seed in ((fields.u, 0.2, 2), (work, 1.0, 3)):
        interpolate(field, wave(3, size, seed=seed))
    found = fem.assemble_scalar(compile_form(ufl.derivative(pressed.effect.link_energy(fields), fields.u, work)))
    within = ufl.as_vector([work[0], work[1], 0.0])
    (part,) = pressed.effect.faces
    expected = 0.7 * fem.assemble_scalar(compile_form(fields.flux(within, part, degree=6, within_plane=True)))
    assert found == pytest.approx(expected, rel=1e-12)


def test_faces_aslant_to_an_axis_are_refused():
    points, cells = box(2, 2, 2, (1.0, 1.0, 1.0))
    turned = points @ np.array([[1.0, 0.0, 0.0], [0.0, 0.8, -0.6], [0.0, 0.6, 0.8]])
    pressed = PressedBody(turned, cells, SPATIAL, 0.7, about=(2.0, -1.0))
    refused(
        lambda: pressed.effect.link_energy(pressed.fields), part="'ring'", problem="aslant", remedy="three coordinates"
    )


@pytest.mark.parametrize("where", [None, lambda x: x[:, 1] < 1e-9], ids=["closed", "open"])
@pytest.mark.parametrize("dim", [2, 3])
def test_energy_and_its_gradient_are_differentiated_by_state_and_design(dim, where):
    pressed = PressedBody(*distorted(dim), MODELS[dim], 0.7, where=where, about=(0.3, 0.2, 0.1)[:dim])
    fields, work = pressed.fields, fem.Function(pressed.body.u.function_space)
    for field, size, seed in ((fields.body.shape, 0.2, 1), (fields.u, 0.2, 2), (work, 1.0, 3)):
        interpolate(field, wave(dim, size, seed=seed))
    energy = pressed.effect.link_energy(fields)
    for form in (energy, ufl.derivative(energy, fields.u, work)):
        for field in (fields.u, fields.body.shape):
            rates = form_derivative(form, field, size=0.1, seed=4).rates
            # areas in the plane are quadratic, so their gradient is linear
            assert rates.with_gradient.min() > 1.95 or rates.remainder.max() < 1e-12


def test_a_thick_walled_cylinder_widens_under_inner_pressure_as_lame_says():
    # a quarter, its ends on the axes of symmetry, which pass through the centre
    inner, outer, pressure = 10.0, 20.0, 0.01
    grid, cells = rectangle(6, 24, outer - inner, 0.5 * np.pi)
    radius, angle = inner + grid[:, 0], grid[:, 1]
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    pressed = PressedBody(
        points, cells, PLANE_STRAIN, pressure, where=lambda x: np.hypot(*x.T) < inner + 1e-9, about=(0.0, 0.0)
    )
    body = pressed.body
    fixed = np.concatenate([components(body, lambda X, k=k: np.abs(X[:, 1 - k]) < 1e-9)[1 - k :: 2] for k in (0, 1)])
    solve(body, fixed, np.zeros(len(fixed)))
    at = nodes(body.u)
    moved = np.linalg.norm(body.u.x.array.reshape(-1, 2), axis=1)
    # u = (1 + ν) p a² / E (b² − a²) · ((1 − 2 ν) r + b² / r)
    for r in (inner, outer):
        scale = (1.0 + POISSON) * pressure * inner**2 / (YOUNG * (outer**2 - inner**2))
        expected = scale * ((1.0 - 2.0 * POISSON) * r + outer**2 / r)
        (on,) = np.nonzero((np.abs(at[:, 1]) < 1e-9) & (np.abs(at[:, 0] - r) < 1e-9))
        assert moved[on[0]] == pytest.approx(expected, rel=2e-3)
        assert body.u.x.array.reshape(-1, 2)[on[0], 0] > 0.0


@pytest.mark.parametrize("dim", [2, 3])
def test_a_compressed_block_shrinks_as_much_as_its_law_says_at_large_strain(dim):
    pressure = 40.0
    points, cells = rectangle(2, 2, 1.0, 1.0) if dim == 2 else box(2, 2, 2, (1.0, 1.0, 1.0))
    pressed = PressedBody(points, cells, MODELS[dim], pressure)
    body = pressed.body
    # held against rigid motion only: sides stay on their planes by themselves
    fixed = np.concatenate([components(body, lambda X, k=k: X[:, k] < 1e-9)[k::dim] for k in range(dim)])
    solve(body, fixed, np.zeros(len(fixed)))
    mu, lam = YOUNG / (2.0 * (1.0 + POISSON)), YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))

    def force(s):
        # d/ds of W(s) + p s^dim, W = μ/2 (dim s² − 2 dim ln s) + λ/4 (J² − 2 ln J), J = s^dim
        return dim * (mu * (s - 1.0 / s) + 0.5 * lam * (s ** (2 * dim - 1) - 1.0 / s) + pressure * s ** (dim - 1))

    stretch = brentq(force, 0.2, 1.0, xtol=1e-14)
    assert stretch < 0.9
    assert body.u.x.array == pytest.approx(((stretch - 1.0) * nodes(body.u)).ravel(), abs=1e-10)


def test_a_disc_on_a_rigid_core_shrinks_as_lame_says():
    radius, core, pressure = 10.0, 2.0, 0.05
    mechanism = fm.Mechanism("disc")
    base = mechanism.rigid("base", fixed=True)
    arcs = [Arc((0, radius), (-radius, 0)), Arc((0, -radius), (radius, 0))]
    disc = mechanism.flexible("disc", fm.outline((radius, 0), arcs, depth=3.0), fm.Material("rubber", YOUNG, POISSON))
    mechanism.weld(base, disc, at=(0, 0), interface_radius=core)
    edge = mechanism.force(on=disc, at=(radius, 0), direction=(-1, 0))
    scene = fm.Scene(mechanism, effects=[Pressure(disc, pressure)])
    simulation = fm.Simulation(scene, space="plane-strain", size=1.0)
    (frame,) = simulation.load_displacement(edge, forces=[0.0]).frames
    # u = A (r − c² / r); σ_r = 2 μ A ((1 + c² / r²) + 2 ν / (1 − 2 ν)) = −p at the rim
    mu = YOUNG / (2.0 * (1.0 + POISSON))
    slope = 2.0 * mu * (1.0 + (core / radius) ** 2 + 2.0 * POISSON / (1.0 - 2.0 * POISSON))
    assert frame.displacement == pytest.approx(pressure / slope * (radius - core**2 / radius), rel=5e-3)
    assert frame.stable


def beam(space: str, pressure: float, *, about=(0.0, 0.0), bow: float = 0.0) -> tuple[fm.Simulation, object]:
    """A link clamped at both ends, under pressure from above, and a force at its middle."""
    mechanism = fm.Mechanism("beam")
    base = mechanism.rigid("base", fixed=True)
    line = [(-2, 0), (30, bow), (62, 0)] if bow else [(-2, 0), (62, 0)]
    shape = fm.strip(line, thickness=2.0, depth=3.0)
    link = mechanism.flexible("beam", shape, fm.Material("nylon", 2000.0, 0.0))
    for at in line[:: len(line) - 1]:
        mechanism.weld(base, link, at=at, region=fm.Rectangle(4.0, 6.0))
    push = mechanism.force(on=link, at=(30, bow), direction=(0, -1))

    def above(x):
        return (x[:, 1] > bow * (1.0 - ((x[:, 0] - 30.0) / 32.0) ** 2) + 0.5) & (np.abs(x[:, 0] - 30.0) < 31.0)

    scene = fm.Scene(mechanism, effects=[Pressure(link, pressure, above, about)])
    return fm.Simulation(scene, space=space, size=2.0), push


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric", "3d"])
def test_a_clamped_beam_bends_under_pressure_from_above(space):
    simulation, push = beam(space, 0.001)
    (frame,) = simulation.load_displacement(push, forces=[0.0]).frames
    # by bending, and 1 % by shear
    expected = 0.001 * (60.0**4 / (384.0 * 2000.0 * 2.0**3 / 12.0) + 60.0**2 / (8.0 * 5.0 / 6.0 * 1000.0 * 2.0))
    assert frame.displacement == pytest.approx(expected, rel=2e-3)
    assert frame.stable


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric", "3d"])
def test_displacements_under_pressure_are_differentiated_by_the_design_field(space):
    simulation, push = beam(space, 0.02, bow=6.0)
    assert_design_gradient(simulation, push, 0.05)


def test_invalid_pressure_is_refused():
    _, push = beam("plane-stress", 1.0)
    link, stranger = push.on, fm.Mechanism("other").rigid("stranger")
    remedy = "a flexible link of the mechanism"
    refused(lambda: Pressure(stranger, 1.0), part="pressure", problem="not a flexible link", remedy=remedy)
    refused(lambda: Pressure(link, np.nan), part="'beam'", problem="nan", remedy="finite")
    refused(lambda: Pressure(link, 1.0, about=(0,)), part="centre", problem="coordinates", remedy="2 or 3")
    other, _ = beam("plane-stress", 1.0)
    scene = fm.Scene(other.scene.mechanism, effects=[Pressure(fm.mechanism.FlexibleLink("x", link.shape, fm.ONYX), 1)])
    refused(
        lambda: fm.Simulation(scene, space="3d", size=2.0),
        part="Pressure",
        problem="is not a link of",
        remedy="Name a link",
    )
    simulation, push = beam("plane-stress", 1.0, about=None)
    refused(lambda: simulation.load_displacement(push, forces=[0.0]), part="'beam'", problem="is open", remedy="about=")
