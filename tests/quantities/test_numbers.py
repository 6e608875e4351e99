"""Derivatives of every quantity pass Taylor tests in every number that designs change, away from the drawn shape."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.quantities import Sensitivity

from .test_sensitivity import Bench, assert_slopes


def links(bench: Bench) -> list[fm.FlexibleLink]:
    return bench.simulation.scene.mechanism.flexible_links


def joints(bench: Bench) -> list[fm.Joint]:
    return bench.simulation.scene.mechanism.joints


# kinds of numbers, and steps of their Taylor tests
NUMBERS = {
    "modulus": (lambda bench: fm.LawParameter("E", links(bench)[1]), (16.0, 8.0, 4.0)),
    "Poisson's ratio": (lambda bench: fm.LawParameter("nu", links(bench)[1]), (0.016, 0.008, 0.004, 0.002)),
    "modulus of both": (lambda bench: fm.LawParameter("E", *links(bench)), (16.0, 8.0, 4.0)),
    "depth": (lambda bench: fm.Depth(links(bench)[1]), (0.1, 0.05, 0.025, 0.0125)),
    "depth of both": (lambda bench: fm.Depth(*links(bench)), (0.1, 0.05, 0.025, 0.0125)),
    "stiffness": (lambda bench: fm.SpringStiffness(*bench.simulation.scene.effects), (8.0, 4.0, 2.0, 1.0)),
    "shift": (lambda bench: fm.JointPosition(joints(bench)[3], direction=(1, 0.5)), (0.4, 0.2, 0.1, 0.05)),
    "shift of both pivots": (
        lambda bench: fm.JointPosition(joints(bench)[0], joints(bench)[2], direction=(0.3, 1)),
        (0.4, 0.2, 0.1, 0.05),
    ),
    "rest": (lambda bench: fm.SpringRest(*bench.simulation.scene.effects), (0.1, 0.05, 0.025)),
    "offset": (lambda bench: fm.MotorOffset(*bench.simulation.scene.mechanism.motors), (0.04, 0.02, 0.01, 0.005)),
    "axis": (lambda bench: fm.JointAxis(joints(bench)[3], about=(1, 0.4, 0)), (0.04, 0.02, 0.01, 0.005)),
}
TURNED = 0.2  # of the hinge whose axis is changed, already
SPACES = ("plane-stress", "plane-stress moved", "plane-strain pressure", "3d-symmetric", "3d moved", "3d pressure")
SHARED = ("plane-stress", "plane-strain pressure", "3d-symmetric")  # where numbers of two parts are tested too
MARKS = {"plane-stress": pytest.mark.parallel, "plane-stress moved": ()}  # else thorough


@cache
def made(case: str) -> Bench:
    space, *more = case.split()
    formulation = fm.MixedFormulation(above=0.3) if "pressure" in more else None
    return Bench(space, MPI.COMM_WORLD, formulation, moved="moved" in more, springs=True)


@pytest.mark.parametrize(
    ("space", "name"),
    [
        pytest.param(space, name, marks=MARKS.get(space, pytest.mark.thorough))
        for space in SPACES
        for name in NUMBERS
        if (space in SHARED or "both" not in name) and ("3d " in space or name != "axis")
    ],
)
def test_derivatives_by_a_number(space, name):
    bench, (describe, steps) = made(space), NUMBERS[name]
    assert_derivatives(bench, describe(bench), steps, start=TURNED if name == "axis" else None)


def assert_derivatives(bench: Bench, kind: fm.NumberKind, steps: Sequence[float], start: float | None = None) -> None:
    """Taylor tests of all quantities at a value of a number, the drawn one by default."""
    base = bench.field(1)
    kind.check(bench.simulation.scene, bench.model.linkage.dim)
    bench.adjoint, number = Sensitivity(bench.model, [kind]), bench.model.number(kind)
    here = number.drawn if start is None else start
    gradients = bench.gradients(fm.Design(base, {kind: here}))
    assert MPI.COMM_WORLD.size > 1 or np.any([gradient.numbers for gradient in gradients])

    def changed(step: float) -> np.ndarray:
        return bench.values(fm.Design(base, {kind: here + step}))

    assert_slopes(bench, changed, [gradient.numbers[0] for gradient in gradients], steps)
