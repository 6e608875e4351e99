"""Every law of its own numbers in a body: patch tests, derivatives for states, designs and fits, and locking.

An example of each stands in ``cases``; a law without one fails here.
"""

import inspect

import numpy as np
import pytest
import ufl
from dolfinx import fem

import fenicsmech.laws
from fenicsmech.compat import compile_form
from fenicsmech.elasticity import PLANE_STRAIN, PLANE_STRESS, SPATIAL
from fenicsmech.laws import Law

from ..oracles.dense import taylor_rates
from ..plot.grids import rectangle
from .cases import EXAMPLES, LAWS, NEARLY_INCOMPRESSIBLE, name
from .end_load import end_load
from .mixed_newton import solve, stiffness_matrix
from .single_link import components, distorted, interpolate, nodes, single_link, wave

STEPS = 10.0 ** -np.arange(2.0, 4.5, 0.5)
GRADIENT = np.array([[0.2, 0.25, -0.1], [-0.15, -0.1, 0.2], [0.1, 0.15, 0.15]])


def cases(model, laws, mixed):
    """Thorough but for displacements in plane strain: others compile long. Ogden's law, which compiles longest, is
    there in plane strain alone; ``test_hand_curves`` has laws of rubber in all models."""
    for law in laws:
        ogden = name(law) == "Ogden"
        if model is PLANE_STRAIN or not ogden:
            marks = [pytest.mark.thorough] * (model is not PLANE_STRAIN or mixed or ogden)
            yield pytest.param((model, law, mixed), id=f"{model.name}-{name(law)}{'-mixed' * mixed}", marks=marks)


CASES = [case for model in (PLANE_STRAIN, PLANE_STRESS) for case in cases(model, EXAMPLES, False)]
CASES += cases(PLANE_STRAIN, NEARLY_INCOMPRESSIBLE, True)
# in space an isotropic law is the formula that it is in plane strain, one of directions shears out of the plane as well
CASES += cases(SPATIAL, [law for law in EXAMPLES if law.directions][-1:], False)
CASES += cases(SPATIAL, NEARLY_INCOMPRESSIBLE[-1:], True)


@pytest.fixture(scope="module", params=CASES)
def body(request):
    model, law, mixed = request.param
    return single_link(*distorted(model.dim), model=model, law=law, depth=2.5, mixed=mixed)


def test_every_law_has_an_example():
    known = {own for _, own in inspect.getmembers(fenicsmech.laws, inspect.isclass) if issubclass(own, Law)}
    concrete = {own for own in known if not inspect.isabstract(own)}
    assert concrete == {*LAWS, *map(type, EXAMPLES)} == {*LAWS, *map(type, NEARLY_INCOMPRESSIBLE)}


def test_homogeneous_strain_is_found_from_its_boundary_values(body):
    """With the pressure, which is constant, and from a distorted guess."""
    dim = body.model.dim
    # at nearly constant volume in the u–p form, where pressures are bounded
    shear = np.array([[0.2, 0.3, 0.0], [0.0, 1.0 / 1.2 - 1.0, 0.0], [0.0, 0.0, 0.0]])
    gradient = (GRADIENT if body.pressure is None else shear)[:dim, :dim]

    def stretched(X):
        return X @ gradient.T + 0.1

    def distort(X):
        inside = np.prod(4.0 * X * (1.0 - X), axis=1, keepdims=True)
        return stretched(X) + inside * wave(dim, 0.03, seed=5)(X)

    interpolate(body.u, stretched)
    expected = body.u.x.array.copy()
    fixed = components(body, lambda X: np.any((X < 1e-9) | (X > 1.0 - 1e-9), axis=1))
    interpolate(body.u, distort)
    solve(body, fixed, expected[fixed])
    assert body.u.x.array == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    residual = body.split(body.residuals())[0]
    inside = np.setdiff1d(np.arange(len(residual)), fixed)
    assert len(inside) > 0
    assert np.abs(residual[inside]).max() < 1e-10 * np.abs(residual).max()
    if body.pressure is not None:
        p = body.pressure.p.x.array
        assert p == pytest.approx(np.full_like(p, p.mean()), abs=1e-8 * np.abs(residual).max())


def test_derivatives_by_state_design_and_parameters(body):
    """Of the energy and of the work zᵀ∂E/∂(u, p) of the residual, which adjoints differentiate."""
    random = np.random.default_rng(4)
    small = body.pressure is not None
    interpolate(body.u, wave(body.model.dim, 0.05 if small else 0.15, seed=2))
    interpolate(body.shape, wave(body.model.dim, 0.02 if small else 0.15, seed=1))
    if body.pressure is not None:
        body.pressure.p.x.array[:] = random.uniform(-0.3, 0.3, len(body.pressure.p.x.array))
    start = body.values()
    z, motion = random.uniform(-1.0, 1.0, (2, len(start)))
    motion *= 0.03
    energy = taylor_rates(lambda x: (body.take(x), body.energy())[1], start, motion, body.residuals(), STEPS)
    assert energy.without[-1] > 0.95
    assert energy.with_gradient.min() > 1.9
    body.take(start)

    law = body.terms[0].law
    numbers = [body.parameters[each] for each in body.parameters if each not in numbers_of(law.directions)]
    fields = [body.shape, *numbers]
    towards, weights = ([fem.Function(own.function_space) for own in group] for group in (fields, body.fields))
    for own, direction in zip(fields, towards, strict=True):
        # Poisson's ratio near 0.5 changes a little
        size = (1e-4 if small and own is not body.shape else 0.05) * np.abs(own.x.array).max()
        direction.x.array[:] = random.uniform(-size, size, len(own.x.array))
    for weight, values in zip(weights, body.split(z), strict=True):
        weight.x.array[:] = values
    work = sum_of(
        ufl.derivative(body.energy_ufl, own, weight) for own, weight in zip(body.fields, weights, strict=True)
    )
    # apart: of the sum of both UFL compares the terms at length
    changes = [ufl.derivative(work, body.shape, towards[0]), ufl.derivative(work, tuple(numbers), tuple(towards[1:]))]
    K = stiffness_matrix(body)
    assert abs(K - K.T).max() < 1e-12 * abs(K).max()
    slope = z @ (K @ motion) + sum(fem.assemble_scalar(compile_form(change)) for change in changes)
    before = [own.x.array.copy() for own in fields]

    def weighted(t):
        body.take(start + t[0] * motion)
        for own, values, direction in zip(fields, before, towards, strict=True):
            own.x.array[:] = values + t[0] * direction.x.array
        return z @ body.residuals()

    rates = taylor_rates(weighted, [0.0], [1.0], [slope], STEPS)
    weighted([0.0])
    body.reshape(np.zeros_like(body.shape.x.array))
    assert rates.without[-1] > 0.95
    assert rates.with_gradient.min() > 1.9


def numbers_of(directions) -> list[str]:
    return [f"{each}{k}" for each in directions for k in range(3)]


def sum_of(terms):
    first, *others = terms
    return sum(others, start=first)


LENGTH, HEIGHT = 10.0, 1.0


def bending_modulus(law: Law) -> tuple[float, float]:
    """Young's modulus along a strip in plane strain, 1 / (S₁₁ − S₁₃² / S₃₃), and the shear modulus."""
    if law.directions:
        (S11, _, S13), _, (_, _, S33) = law.compliance
        return 1.0 / (S11 - S13**2 / S33), law.shear_moduli[0]
    return law.E / (1.0 - law.nu**2), law.E / (2.0 * (1.0 + law.nu))


@pytest.mark.parametrize(
    "law",
    [
        pytest.param(
            law, id=name(law), marks=[pytest.mark.thorough] * (name(law) not in ("Yeoh", "TransverselyIsotropic"))
        )
        for law in NEARLY_INCOMPRESSIBLE
    ],
)
def test_nearly_incompressible_strips_bend_as_beams_with_a_pressure_and_lock_without(law):
    """F L³/3EI + 6/5 F L/GA at the end of a short cantilever of coarse cells, whose clamp holds its sides as well."""
    E, G = bending_modulus(law)
    traction = 1e-5 * E
    beam = traction * HEIGHT * (LENGTH**3 / (3.0 * E * HEIGHT**3 / 12.0) + 1.2 * LENGTH / (G * HEIGHT))
    found = []
    for mixed in (True, False):
        body = single_link(*rectangle(10, 2, LENGTH, HEIGHT), model=PLANE_STRAIN, law=law, mixed=mixed)
        clamped = components(body, lambda X: X[:, 0] < 1e-9)
        solve(body, clamped, np.zeros(len(clamped)), end_load(body, length=LENGTH, traction=(0.0, traction)))
        tip = np.argmin(np.linalg.norm(nodes(body.u) - [LENGTH, HEIGHT / 2.0], axis=1))
        found.append(body.u.x.array.reshape(-1, 2)[tip, 1] / beam)
    short, locked = 1.0 - np.array(found)
    assert 0.0 < short < 0.05
    assert locked > 2.5 * short
