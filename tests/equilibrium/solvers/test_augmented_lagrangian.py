"""The augmented Lagrangian's value, gradient and matrix belong together, in the plane and in space."""

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.equilibrium import DisplacementControl, LoadControl

from ..crowded import control_of, crowded, random_state, system_of

SOFTNESS = 0.05
STEPS = (1e-3, 1e-4)


@pytest.mark.parametrize("kind", [LoadControl, DisplacementControl])
@pytest.mark.parametrize("dim", [2, 3])
def test_gradient_and_matrix_are_derivatives_of_the_value(dim, kind):
    case = crowded(dim)
    system, control = system_of(case, controlled=case.on_rigid), control_of(kind)
    iteration, layout = fm.AugmentedLagrangian().on(system), system.layout
    state = control.prepare(random_state(case, system))

    def gradient_at(state):
        system.load(state)
        current = iteration._updated(state, control, SOFTNESS)
        return current, system.balance(current, control)

    current, balance = gradient_at(state)
    matrix = system.kkt(current, control, balance)
    system.soften(SOFTNESS, control)
    system.shift(0.0)
    states = len(layout.free) + system.joints.size
    K, right = matrix[:, :], balance.vector.array.copy()
    # ∇²L + Aᵀ A / softness, by the elimination of the multipliers
    A, D = K[states:, :states], K[states:, states:]
    hessian = K[:states, :states] - A.T @ np.linalg.solve(D, A)

    x = system.control_row()
    x.array[:states], x.array[states:] = np.random.default_rng(2).standard_normal(states), 0.0
    step = system.step(x).scaled(1e-2 / system.size(system.step(x)))
    way = x.array[:states] * (step.z[0] / system.step(x).z[0])

    def value(length):
        return iteration._value(iteration._moved(state, step, length), control, SOFTNESS)

    def gradient(length):
        return gradient_at(iteration._moved(state, step, length))[1].vector.array[:states].copy()

    h = 1e-3
    slope = (value(h) - value(-h)) / (2.0 * h)
    assert slope == pytest.approx(right[:states] @ way, rel=1e-5)
    system.balance(current, control)
    curvature = way @ hessian @ way
    slopes = []
    for length in (h, -h):
        moved = iteration._moved(state, step, length)
        system.load(moved)
        slopes.append((value(length + h) - value(length - h)) / (2.0 * h))
    assert (slopes[0] - slopes[1]) / (2.0 * h) == pytest.approx(curvature, rel=1e-3)
