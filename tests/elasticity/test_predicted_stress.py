"""The stress predicted by a step: for pure turns, its order in the step, and its part of the stiffness."""

import numpy as np
import pytest

from fenicsmech.elasticity import PLANE_STRAIN, SPATIAL, PredictedStress
from fenicsmech.laws import IsochoricNeoHookean, NeoHookean

from .cases import CASES, name
from .mixed_newton import stiffness_matrix
from .single_link import distorted, forces, interpolate, nodes, single_link, wave

MIXED = ((PLANE_STRAIN, NeoHookean, True), (SPATIAL, IsochoricNeoHookean, True))


def title(case) -> str:
    model, law, mixed = case
    return "-".join([name(model), name(law), *["mixed"] * mixed])


@pytest.fixture(scope="module", params=[*((*case, False) for case in CASES), *MIXED], ids=title)
def body(request):
    model, law, mixed = request.param
    body = single_link(*distorted(model.dim), model=model, law=law, depth=2.5, mixed=mixed)
    interpolate(body.shape, wave(model.dim, 0.1, seed=1))
    return body


@pytest.fixture(scope="module")
def predicted(body):
    return PredictedStress(body)


def values(body, field, *, seed=None):
    """The nodal values of a vector field, and of pressures at random, none without a seed; as ``body.values()``."""
    found = np.zeros(len(body.values()))
    u, *p = body.split(found)
    u[:] = field(nodes(body.u)).ravel()
    if p and seed is not None:
        p[0][:] = np.random.default_rng(seed).uniform(-0.5, 0.5, len(p[0]))
    return found


def stiffness(predicted):
    """∫ ∇v ΔS : ∇w dV, dense."""
    body = predicted._body
    matrix = body.create_stiffness()
    predicted.add_stiffness(matrix)
    matrix.assemble()
    dense = matrix[:, :]
    matrix.destroy()
    count = len(body.u.x.array)
    assert not dense[count:].any() and not dense[:, count:].any()
    return dense[:count, :count]


@pytest.mark.thorough
def test_step_that_turns_predicts_no_stress_where_its_displacements_stretch(body, predicted):
    dim = body.model.dim
    skew = np.zeros((dim, dim))
    skew[0, 1], skew[1, 0] = 0.3, -0.3
    turn = values(body, lambda x: x @ skew)  # of the drawn shape: it turns all of it
    at_rest = np.zeros_like(turn)
    mesh_only = body.shape.x.array.copy()
    body.shape.x.array[:] = 0.0
    body.take(turn)
    stretched = forces(body)
    predicted.take(at_rest, turn)
    assert np.abs(stretched).max() > 1e-3
    assert predicted.forces() == pytest.approx(-stretched, abs=1e-12 * np.abs(stretched).max())
    body.shape.x.array[:] = mesh_only


def test_difference_to_the_stress_of_the_displacements_is_of_second_order_in_the_step(body, predicted):
    before, step = (values(body, wave(body.model.dim, 0.1, seed=seed), seed=seed) for seed in (2, 3))
    sizes = []
    for length in (0.02, 0.01):
        body.take(before + length * step)
        predicted.take(before, length * step)
        sizes.append(np.linalg.norm(predicted.forces()))
    assert sizes[0] > 1e-8
    assert np.log2(sizes[0] / sizes[1]) == pytest.approx(2.0, abs=0.05)


def test_stiffness_is_the_derivative_of_the_forces_of_the_predicted_stress(body, predicted):
    """∂/∂u ∫ F S : ∇v dV of a stress S that does not change is ∫ ∇v S : ∇w dV; S(u) is not predicted but held."""
    before, step = (values(body, wave(body.model.dim, 0.1, seed=seed), seed=seed) for seed in (2, 3))
    way = values(body, wave(body.model.dim, 0.1, seed=4))
    here = before + step

    def held_forces(prediction, x):
        body.take(x)
        predicted.take(*prediction)
        return predicted.forces() + forces(body)

    def derivative(prediction):
        h = 1e-5
        return (held_forces(prediction, here + h * way) - held_forces(prediction, here - h * way)) / (2.0 * h)

    expected = derivative((before, step)) - derivative((here, 0.0 * step))
    body.take(here)
    predicted.take(before, step)
    own = way[: len(body.u.x.array)]
    assert stiffness(predicted) @ own == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())


def test_nothing_is_added_where_there_was_no_step(body, predicted):
    here = values(body, wave(body.model.dim, 0.1, seed=2), seed=2)
    body.take(here)
    predicted.take(here, 0.0 * here)
    assert np.abs(predicted.forces()).max() < 1e-14
    assert np.abs(stiffness(predicted)).max() < 1e-12 * np.abs(stiffness_matrix(body)).max()
