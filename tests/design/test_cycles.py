"""Life of cycles between two samples is that of two frames, and its derivatives pass Taylor tests."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

from .mechanisms import Case, bench

STRENGTH = fm.Strength(ultimate_stress=60.0, fatigue=fm.Basquin(90.0, -0.1))
PLASTIC = fm.Material("plastic", 2000.0, 0.3, strength=STRENGTH)


def arm(comm: MPI.Comm = MPI.COMM_SELF, *, space: str = "plane-stress") -> tuple[Case, fm.Simulation]:
    """A bowed arm on a motor, with a hand that is pulled: as drawn, and more where the arm is turned."""
    mechanism = fm.Mechanism("arm")
    base, crank, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("crank"), mechanism.rigid("hand")
    link = mechanism.flexible("link", fm.strip([(0, 0), (15, 4), (30, 0)], thickness=3.0, depth=5.0), PLASTIC)
    motor = mechanism.motor(mechanism.revolute(base, crank, at=(0, 0)))
    mechanism.weld(crank, link, at=(0, 0), interface_radius=1.4)
    mechanism.weld(link, hand, at=(30, 0), interface_radius=1.4)
    pull = mechanism.force(on=hand, at=(32, 0), direction=(0.3, 1))
    scene = fm.Scene(mechanism)
    low = fm.Sample({pull: 1.0})
    high = fm.Sample({pull: fm.at(3.0)}, configuration=scene.configuration("turned", {motor: 0.6}))
    targets = [
        fm.Target(fm.LeastLife(since=low, margin=0.0), high, equals=0.0, scale=1.0),
        fm.Target(fm.Displacement(hand, at=(32, 0)), high, equals=(0.0, 0.0), scale=1.0),
        fm.Target(fm.LinkVolume(link), equals=0.0, scale=1.0),
        fm.Target(fm.LeastLife(link, since=high), low, equals=0.0, scale=1.0),
        fm.Target(fm.Displacement(pull), low, equals=0.0, scale=1.0),
    ]
    numbers = [fm.Number(fm.LawParameter("E", link), 1000.0, 3500.0), fm.Number(fm.Depth(link), 4.0, 9.0)]
    case = Case(scene, [fm.SplineDesign(link, 2), *numbers], targets)
    return case, case.simulate(space, size=8.0 if space.startswith("3d") else 6.0, comm=comm)


def frames(simulation: fm.Simulation, targets) -> list[fm.Frame]:
    """Those of the first target's samples."""
    found = []
    for sample in targets[0].samples:
        values = {"forces" if sample.moved is None else "displacements": [sample.value]}
        curve = simulation.load_displacement(sample.part, **values, configuration=sample.configuration)
        found.append(curve.frames[-1])
    return found


@pytest.mark.parallel
def test_life_between_samples_is_that_between_frames():
    case, simulation = arm(MPI.COMM_WORLD)
    own = bench(case, simulation)
    solved = own.equilibria.from_zero()
    values, errors = own.equilibria.values(solved), own.equilibria.errors(solved)
    high, low = frames(simulation, case.targets)
    turned = np.log10(low.life(high).cycles)
    # the discretisation error is among the errors, of a few hundredths of a decade
    assert values[0] == pytest.approx(turned, abs=0.1)
    assert values[0] + errors[0] == pytest.approx(turned, abs=0.1)
    observable = case.targets[0].quantity.on(simulation.model).holding(low.state)
    simulation.model.load(high.state)
    true = observable.values(high.state) + observable.smoothing_errors(high.state)
    assert true == pytest.approx([turned], rel=1e-9)


def test_derivatives_add_up_over_both_samples():
    case, simulation = arm()
    own = bench(case, simulation)
    p = own.design()
    placed = own.rest.place(own.rest.initial, None)
    solved = own.equilibria.from_zero()
    placed = own.rest.place(p, placed)
    solved = own.equilibria.from_design(solved)
    slopes = own.rest.slopes(placed, own.equilibria.gradients(solved))
    # whichever sample is the other one
    assert slopes[4] == pytest.approx(slopes[0], rel=1e-9)
    steps = (0.02, 0.01)
    for direction in (*np.diag(own.rest.lengths)[-2:], own.direction(3)):

        def values(t: float, direction=direction) -> np.ndarray:
            own.rest.place(p + t * direction, placed)
            return own.equilibria.values(own.equilibria.from_design(solved))

        start, *ahead = (values(t) for t in (0.0, *steps))
        for k in (0, 5):
            first, second = (
                there[k] - start[k] - t * slopes[k] @ direction for there, t in zip(ahead, steps, strict=True)
            )
            assert abs(first) >= 2.0**1.95 * abs(second)


def test_targets_of_two_samples_name_both_and_need_them_to_differ():
    case, simulation = arm()
    target = case.targets[0]
    assert target.name == f"least life of all links in cycles from {target.samples[1]} under {target.sample}"
    with pytest.raises(fm.DescriptionError, match="both of its samples"):
        fm.Target(fm.LeastLife(since=target.sample), target.sample, at_least=6.0)
    with pytest.raises(fm.DescriptionError, match="not a sample"):
        fm.LeastLife(since=1.0)
    stranger = fm.Mechanism("other")
    other = fm.Sample({stranger.force(on=stranger.rigid("hand"), at=(0, 0), direction=(1, 0)): 1.0})
    foreign = fm.Target(fm.LeastLife(since=other), target.sample, at_least=6.0)
    with pytest.raises(fm.DescriptionError):
        fm.DesignProblem(simulation, case.designs, targets=[foreign])
