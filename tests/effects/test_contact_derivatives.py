"""Derivatives of contact energies by state and design, by Taylor tests with part of the boundary in contact."""

from __future__ import annotations

import numpy as np
import pytest
import ufl
from dolfinx import fem
from petsc4py import PETSc

import fenicsmech as fm
from fenicsmech.compat import assemble_matrix, assemble_vector, compile_form
from fenicsmech.effects import Contact, Cylinder, HalfPlane
from fenicsmech.multibody import build_linkage

from ..elasticity.single_link import interpolate, wave
from ..oracles.dense import gradient, jacobian
from .form_derivative import form_derivative

OBSTACLES = {"cylinder": Cylinder((9.0, -3.0), 2.5), "half-plane": HalfPlane((9.0, -0.9), (0.1, 1.0))}


def strip(space: str, obstacle, order: int) -> tuple[Contact, object]:
    """A deformed and redesigned strip, pressed into ``obstacle``, and the fields its energy is written in."""
    mechanism = fm.Mechanism("strip")
    base = mechanism.rigid("base", fixed=True)
    link = mechanism.flexible("link", fm.strip([(0, 0), (20, 0)], thickness=2.0, depth=1.5), fm.ONYX)
    mechanism.weld(base, link, at=(0, 0), interface_radius=1.0)
    contact = Contact(link, obstacle)
    model = fm.Simulation(fm.Scene(mechanism, effects=[contact]), space=space, size=2.0, order=order).model
    fields = model.fields
    interpolate(fields.body.shape, wave(fields.dim, 0.2, seed=1))
    interpolate(fields.u, wave(fields.dim, 0.2, seed=2))
    return contact, fields


@pytest.mark.parametrize("obstacle", OBSTACLES)
@pytest.mark.parametrize("space, order", [("plane-stress", 1), ("plane-stress", 2), ("3d", 2)])
def test_energy_and_its_gradient_are_differentiated_by_state_and_design(space, order, obstacle):
    contact, fields = strip(space, OBSTACLES[obstacle], order)
    energy = contact.link_energy(fields)
    work = fem.Function(fields.u.function_space)
    interpolate(work, wave(fields.dim, 1.0, seed=5))
    assert fem.assemble_scalar(compile_form(energy)) > 0.0
    for form in (energy, ufl.derivative(energy, fields.u, work)):
        for field in (fields.u, fields.body.shape):
            found = form_derivative(form, field, size=0.02, seed=4)
            # the gradient has kinks where points come into contact, none of them on the last step; on a half-plane it
            # is linear in u between them, and what remains is the rounding of values
            rounding = 1e-12 * max(abs(found.slope), abs(found.value))
            assert found.rates.with_gradient[-1] > 1.95 or found.rates.remainder[-1] < rounding


@pytest.mark.parametrize("obstacle", OBSTACLES)
@pytest.mark.parametrize("space, order", [("plane-stress", 1), ("plane-stress", 3), ("3d-symmetric", 2)])
def test_points_of_surfaces_carry_the_forces_and_the_stiffness_of_the_energy(space, order, obstacle):
    contact, fields = strip(space, OBSTACLES[obstacle], order)
    residual = ufl.derivative(contact.link_energy(fields), fields.u)
    (surface,) = contact.one_sided(fields)
    surface.update()
    pressures = np.maximum(-surface.gaps, 0.0) / surface.compliances
    assert pressures.any()
    work = fem.Function(fields.u.function_space)
    forces = assemble_vector(compile_form(residual), work).copy()
    size = np.abs(forces).max()
    assert np.abs(surface.forces(pressures) - forces).max() < 1e-9 * size
    rates = surface.rates(forces / size)
    assert surface.forces(pressures) @ forces / size == pytest.approx(-(surface.weights * pressures) @ rates)
    matrix = assemble_matrix(compile_form(ufl.derivative(residual, fields.u)), fields.mesh.comm)
    whole = matrix.norm()
    matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_LOCATION_ERR, True)
    count = fields.dim

    def rows(nodes):
        return (count * nodes[:, None] + np.arange(count)).ravel()

    surface.add_stiffness(matrix, rows, -1.0 * (surface.gaps < 0.0) / surface.compliances, -pressures)
    matrix.assemble()
    assert matrix.norm() < 1e-9 * whole


@pytest.mark.parametrize("obstacle", OBSTACLES)
@pytest.mark.parametrize("dim", [2, 3])
def test_points_of_rigid_links_have_exact_gradients_and_hessians(dim, obstacle):
    mechanism = fm.Mechanism("pair")
    base, arm = mechanism.rigid("base", fixed=True), mechanism.rigid("arm")
    link = mechanism.flexible("link", fm.strip([(0, 0), (20, 0)], thickness=2.0, depth=2.0), fm.ONYX)
    mechanism.weld(base, link, at=(0, 0), interface_radius=1.0)
    mechanism.weld(link, arm, at=(20, 0), interface_radius=1.0)
    linkage = build_linkage(mechanism, dim)
    # the last point stays clear of the obstacle
    contact = Contact(arm, OBSTACLES[obstacle], 7.0, points=[(8.5, -1.2), (9.8, -1.3), (9.0, 3.0)])
    (potential,) = contact.pose_potentials(linkage)
    (body,) = potential.bodies
    poses = np.tile(linkage.joints.space.identity, (len(linkage.bodies), 1))
    poses[body] += np.random.default_rng(1).uniform(-0.03, 0.03, poses.shape[1])

    def at(pose):
        changed = poses.copy()
        changed[body] = pose
        return changed

    assert potential.value(poses) > 0.0
    slope = gradient(lambda pose: potential.value(at(pose)), poses[body], step=1e-3)
    assert potential.gradient(poses) == pytest.approx(slope, rel=1e-7, abs=1e-7)
    curvature = jacobian(lambda pose: potential.gradient(at(pose)), poses[body], step=1e-3)
    assert potential.hessian(poses) == pytest.approx(curvature, rel=1e-7, abs=1e-6)


@pytest.mark.parametrize("obstacle", OBSTACLES)
@pytest.mark.parametrize("dim", [2, 3])
def test_gaps_are_distances(dim, obstacle):
    shape, point = OBSTACLES[obstacle], np.array([7.3, -1.2, 0.4])[:dim]
    slope = gradient(lambda x: shape.gap(x, shape.numbers, np.sqrt), point)
    assert np.linalg.norm(slope) == pytest.approx(1.0, abs=1e-9)
    on_surface = point - shape.gap(point, shape.numbers, np.sqrt) * slope
    assert shape.gap(on_surface, shape.numbers, np.sqrt) == pytest.approx(0.0, abs=1e-8)
