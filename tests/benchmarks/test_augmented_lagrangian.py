"""The augmented Lagrangian's value, gradient and matrix belong together, in the plane and in space."""

import numpy as np
import pytest

import fenicsmech as fm
from benchmarks.solvers import AugmentedLagrangian
from fenicsmech.equilibrium import DisplacementControl, LoadControl

from ..equilibrium.crowded import Crowded, control_of, crowded, random_state, system_of

SOFTNESS = 0.05
H = 1e-3


SPACES = ["plane-stress", "3d-symmetric", pytest.param("3d", marks=pytest.mark.thorough)]


@pytest.fixture(scope="module", params=SPACES)
def case(request) -> Crowded:
    return crowded(request.param)


@pytest.mark.parametrize("kind", [LoadControl, DisplacementControl])
def test_gradient_and_matrix_are_derivatives_of_the_value(case, kind):
    system, control = system_of(case, controlled=case.on_rigid), control_of(kind)
    solver = AugmentedLagrangian().solver(system)
    state = control.prepare(random_state(case, system))
    states = system.blocks.multipliers.local.start

    way = system.unknowns.control_row()
    way.array[:] = np.random.default_rng(2).standard_normal(len(way.array))
    way.array[states:] = 0.0
    way.scale(1e-2 / system.size(system.unknowns.step(way)))
    step = system.unknowns.step(way)

    def value(length):
        return solver._value(solver._moved(state, step, length), control, SOFTNESS)

    values = [value(length) for length in (-2 * H, -H, 0.0, H, 2 * H)]
    slope = np.dot(values, [1.0, -8.0, 0.0, 8.0, -1.0]) / (12.0 * H)
    curvature = np.dot(values, [-1.0, 16.0, -30.0, 16.0, -1.0]) / (12.0 * H**2)

    system.load(state)
    current = solver._updated(state, control, SOFTNESS)
    residual = system.residual(current, control)
    assert residual.vector.dot(way) == pytest.approx(slope, rel=1e-6)

    system.linearise(current, control, residual)
    matrix = system.kkt.matrix()
    system.kkt.soften(SOFTNESS, control)
    system.kkt.shift(0.0)
    # the multipliers eliminated: their rows of K (s, λ) are zero
    full, product = way.copy(), way.duplicate()
    matrix.mult(way, product)
    full.array[states:] = -product.array[states:] / matrix.getDiagonal().array[states:]
    matrix.mult(full, product)
    assert product.dot(way) == pytest.approx(curvature, rel=1e-4)


@pytest.mark.thorough
def test_rounding_of_redundant_hinges_ends_iterations():
    made = fm.Mechanism("four-bar")
    base, left, right = made.rigid("base", fixed=True), made.rigid("left"), made.rigid("right")
    plastic = fm.Material("plastic", 1000.0, 0.35)
    coupler = made.flexible("coupler", fm.strip([(0, 40), (50, 45)], thickness=4.0, depth=6.0), plastic)
    strut = made.flexible("strut", fm.strip([(0, 0), (22, 16), (50, 45)], thickness=3.0, depth=6.0), plastic)
    made.revolute(base, left, at=(0, 0))
    made.revolute(base, right, at=(55, 0))
    made.revolute(left, coupler, at=(0, 40), interface_radius=3.0)
    made.revolute(coupler, right, at=(50, 45), interface_radius=3.0)
    made.revolute(base, strut, at=(0, 0), interface_radius=3.0)
    made.revolute(strut, right, at=(50, 45), interface_radius=3.0)
    push = made.force(on=left, at=(0, 40), direction=(1, 0))
    found = []
    for solver in (fm.PrimalDualNewton(), AugmentedLagrangian()):
        simulation = fm.Simulation(fm.Scene(made), space="3d", order=1, size=6.0, solver=solver)
        curve = simulation.load_displacement(push, forces=[2.0])
        assert curve.freedom.redundancy > 0
        assert curve.frames[0].iterations < 15
        found.append(curve.displacements[0])
    assert found[1] == pytest.approx(found[0], rel=1e-8)
