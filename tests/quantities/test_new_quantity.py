"""A quantity from outside the package: one description and one observable, with derivatives that pass a Taylor test."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.multibody import JointCoordinate

from ..oracles.dense import taylor_rates
from .test_sensitivity import Bench


@dataclass(frozen=True)
class JointAngle(fm.Quantity):
    """The angle of a hinge."""

    joint: fm.Joint

    @property
    def name(self):
        return f"angle of {self.joint.name!r}"

    def unit(self, units):
        return "rad"

    def on(self, model):
        return _Angle(model, self.joint)


class _Angle(fm.Observable):
    def __init__(self, model, joint: fm.Joint) -> None:
        self._joints, self._coordinate = model.linkage.joints, JointCoordinate(model.linkage, joint)

    def values(self, state):
        return np.array([self._coordinate.value(state.poses)])

    def partials(self, system, state):
        slopes = np.split(self._coordinate.gradient(state.poses), 2)
        ends = zip(self._coordinate.bodies, slopes, strict=True)
        parts = [
            fm.Partial(border=fm.border_of(system, poses=(self._joints.columns[body], slope)))
            for body, slope in ends
            if body in self._joints.columns
        ]
        return [sum(parts, start=fm.Partial())]


def test_new_quantity_has_total_derivatives():
    bench = Bench("plane-stress", MPI.COMM_SELF)
    joint = next(joint for joint in bench.simulation.scene.mechanism.joints if joint.name == "pin")
    bench.quantities = [JointAngle(joint)]
    bench.observables = [bench.quantities[0].on(bench.model)]
    base, direction = bench.field(1), bench.field(2)
    (gradient,) = bench.gradients(base)
    slope = float(gradient.design @ direction)
    steps = [0.2, 0.1, 0.05]
    rates = taylor_rates(lambda t: float(bench.values(base + t[0] * direction)[0]), [0.0], [1.0], [slope], steps)
    assert np.all(rates.with_gradient >= 1.9) and rates.with_gradient[-1] >= 1.95


def test_new_quantity_is_a_target():
    bench = Bench("plane-stress", MPI.COMM_SELF)
    joint = next(joint for joint in bench.simulation.scene.mechanism.joints if joint.name == "pin")
    target = fm.Target(JointAngle(joint), fm.Sample({bench.force: 1.0}), at_most=0.1)
    assert target.name == "angle of 'pin' under " + str(fm.Sample({bench.force: 1.0}))
    with pytest.raises(fm.DescriptionError, match="not a part of"):
        JointAngle(joint).check(fm.Scene(fm.Mechanism("other")), 2)
