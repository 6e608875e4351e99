"""Derivatives of every quantity by every parameter of a design pass Taylor tests, in parallel too."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

from ..oracles.dense import linear_term
from .mechanisms import Case, bench

STRENGTH = fm.Strength(yield_stress=40.0, ultimate_stress=60.0, fatigue=fm.Basquin(90.0, -0.1))
PLASTIC = fm.Material("plastic", 2000.0, 0.35, strength=STRENGTH)


class Frame:
    """A coupler on two bowed legs, one on a motor, with a sprung lever on it whose end is pulled by a given way.

    The motor winds up another spring, between a leg and the coupler.

    Args:
        shapes: how the legs change: "mirrored" or "same", with one shape, or "shifted", one with a shape of its own
            and one that follows its joints.
        space: "3d" or another.
        mass: of the coupler, on which gravity acts; 0 for none.
    """

    def __init__(self, shapes: str, space: str, mass: float = 0.0) -> None:
        rig = fm.Mechanism("frame")
        ground, coupler, lever = rig.rigid("ground", fixed=True), rig.rigid("coupler"), rig.rigid("lever")
        out = -4.0 if shapes == "same" else 4.0
        leg, other = (
            rig.flexible(name, fm.strip([(x, 0), (x + bow, 15), (x, 30)], thickness=3.0, depth=6.0), PLASTIC)
            for name, x, bow in (("leg", 0.0, -4.0), ("other leg", 40.0, out))
        )
        shaft = rig.revolute(ground, leg, at=(0, 0), interface_radius=2.0, name="shaft")
        pin = rig.revolute(leg, coupler, at=(0, 30), interface_radius=2.0, name="pin")
        foot = rig.revolute(ground, other, at=(40, 0), interface_radius=2.0, name="foot")
        end = rig.revolute(other, coupler, at=(40, 30), interface_radius=2.0, name="end")
        hinge = rig.revolute(coupler, lever, at=(20, 32), name="hinge")
        motor = rig.motor(shaft)
        spring, wound = fm.JointSpring(hinge, 900.0, rest=-0.1), fm.JointSpring(end, 300.0, rest=0.2)
        weight = [fm.Gravity((0.0, -9810.0), masses={coupler: fm.Mass(mass, (20, 30))})] if mass else []
        self.pull = rig.force(on=lever, at=(22, 50), direction=(1, 0.3))
        lift = rig.output(on=coupler, at=(5, 40), direction=(0, 1), name="lift")
        scene = fm.Scene(rig, [spring, wound, *weight])
        sample = fm.Sample({self.pull: fm.at(4.0)}, configuration=scene.configuration("turned", {motor: 0.2}))
        quantities = [
            fm.ForceMagnitude(self.pull),
            fm.Displacement(lift),
            fm.Displacement(other, at=(40.0 + out, 15)),
            fm.Rotation(lever),
            fm.Rotation(leg, pin),
            fm.MotorTorque(motor),
            fm.JointForce(pin),
            fm.JointMoment(shaft),
            fm.JointMoment(end),
            fm.StrainEnergy(),
            fm.StrainEnergy(other),
            fm.LeastGap(leg, other),
            fm.LeastGap(leg, fm.Cylinder((20.0, 15.0), 5.0)),
            fm.LargestStress(),
            fm.LargestStrain(),
            fm.LeastSafety(other),
            fm.LeastLife(leg),
        ]
        at_rest = [fm.LinkVolume(), fm.LinkMass(leg, density=3.0), fm.CentrelineLength(other)]
        at_rest += [fm.LeastThickness(leg), fm.LargestCurvature(leg), fm.LargestCurvature(other, "concave")]
        dim = 3 if space == "3d" else 2
        targets = [fm.Target(own, sample, equals=_zero(own.size(dim)), scale=1.0) for own in quantities]
        targets += [fm.Target(own, equals=0.0, scale=1.0) for own in at_rest]
        self.numbers = {
            "offset": fm.Number(fm.MotorOffset(motor), -0.1, 0.12),
            "modulus": fm.Number(fm.LawParameter("E", leg), 1000.0, 3500.0),
            "depth": fm.Number(fm.Depth(leg, other), 4.0, 9.0),
            "stiffness": fm.Number(fm.SpringStiffness(spring), 400.0, 2000.0),
            "rest": fm.Number(fm.SpringRest(spring), -0.25, 0.1),
            "wound stiffness": fm.Number(fm.SpringStiffness(wound), 100.0, 800.0),
            "wound rest": fm.Number(fm.SpringRest(wound), 0.0, 0.35),
            "position": fm.Number(fm.JointPosition(hinge, direction=(1, 0.5)), -3.0, 4.0),
        }
        if dim == 3:
            self.numbers["axis"] = fm.Number(fm.JointAxis(hinge, about=(1, 0.4, 0)), -0.1, 0.12)
        if shapes == "shifted":
            designs = [fm.SplineDesign(leg, 2)]
            for name, joint in (("shaft", shaft), ("end", end), ("foot", foot)):
                self.numbers[name] = fm.Number(fm.JointPosition(joint, direction=(1, -0.5)), -3.0, 4.0)
        else:
            designs = [fm.SplineDesign(leg, 2, **{shapes: other})]
        self.case = Case(scene, [*designs, *self.numbers.values()], targets)


def _zero(size: int) -> float | tuple[float, ...]:
    return 0.0 if size == 1 else (0.0,) * size


@pytest.mark.parametrize(
    ("space", "shapes", "formulation"),
    [
        pytest.param("plane-stress", "mirrored", None, marks=pytest.mark.parallel),
        pytest.param("plane-strain", "shifted", fm.MixedFormulation(above=0.3), marks=pytest.mark.thorough),
        pytest.param("3d-symmetric", "same", None, marks=pytest.mark.thorough),
    ],
)
def test_derivatives_of_all_quantities_by_all_parameters(space, shapes, formulation):
    frame = Frame(shapes, space)
    sim = frame.case.simulate(
        space, size=8.0 if space.startswith("3d") else 6.0, formulation=formulation, comm=MPI.COMM_WORLD
    )
    own = bench(frame.case, sim)
    assert bool(sim.model.pressure_dofs) == (formulation is not None)
    p, initial = own.rest.initial.copy(), own.rest.initial
    p[: own.rest.of_numbers.start] += (0.05 * own.direction(1))[: own.rest.of_numbers.start]
    placed = own.rest.place(initial, None)
    solved = own.equilibria.from_zero()
    placed = own.rest.place(p, placed)
    solved = own.equilibria.from_design(solved)
    values = own.equilibria.values(solved)
    slopes = own.rest.slopes(placed, own.equilibria.gradients(solved))

    def changed(direction: np.ndarray) -> np.ndarray:
        own.rest.place(p + direction, placed)
        return own.equilibria.values(own.equilibria.from_design(solved))

    directions = {"shape": np.where(np.arange(len(p)) < own.rest.of_numbers.start, own.direction(2), 0.0)}
    for row, name in enumerate(frame.numbers, start=own.rest.of_numbers.start):
        directions[name] = np.eye(len(p))[row]
    failed = {}
    for name, direction in directions.items():
        steps = (0.008, 0.004, 0.002)
        changes = np.array([changed(h * direction) - values for h in steps])
        remainders = changes - np.outer(steps, slopes @ direction)
        for k, (first, rest) in enumerate(zip(np.abs(changes).max(axis=0), remainders.T, strict=True)):
            largest = np.abs(rest).max()
            rounding = 1e-7 * max(first, 1e-2 * abs(values[k]), 1e-3)
            if largest <= rounding:  # linear, or independent
                continue
            rates = np.log2(np.abs(rest[:-1]) / np.maximum(np.abs(rest[1:]), 1e-300))
            linear = linear_term(rest)
            if not (rates.max() >= 1.95 or linear <= max(0.035 * largest, rounding)):
                failed[name, k] = rates, linear, rest, first, values[k]
    assert not failed


@pytest.mark.parametrize("mass", [0.0, 2e-4])
@pytest.mark.parametrize(
    "space", [pytest.param("plane-stress", marks=pytest.mark.parallel), pytest.param("3d", marks=pytest.mark.thorough)]
)
def test_equilibria_of_a_design_are_the_same_however_they_are_found(space, mass):
    """Springs strain links without any load, in configurations that displacements count from."""
    frame, size = Frame("mirrored", space, mass), 8.0 if space == "3d" else 6.0
    flat, own = (
        bench(frame.case, frame.case.simulate(name, size=size, order=order, comm=MPI.COMM_WORLD))
        for name, order in (("plane-stress", 1), (space, 2))
    )
    p = own.rest.initial + 0.05 * own.direction(1)
    placed = own.rest.place(own.rest.initial, None)
    drawn = own.equilibria.from_zero()
    own.rest.place(p, placed)
    followed, traced = own.equilibria.from_design(drawn), own.equilibria.from_zero()
    flat.rest.place(p, None)
    transferred = own.equilibria.from_other(flat.equilibria.whole(flat.equilibria.from_zero()))
    (at,), (origin,) = traced.samples.values(), drawn.samples.values()
    unloaded, before = at.unloaded.poses, origin.unloaded.poses
    assert np.abs(unloaded - before).max() > 1e-3 * np.abs(at.state.poses).max()
    for solved in (followed, transferred):
        (other,) = solved.samples.values()
        assert other.unloaded.poses == pytest.approx(unloaded, abs=1e-9 * np.abs(unloaded).max())
        assert other.state.poses == pytest.approx(at.state.poses, abs=1e-9 * np.abs(at.state.poses).max())
        for raw, expected in zip(solved.raw, traced.raw, strict=True):
            assert raw == pytest.approx(expected, abs=1e-9 * max(np.abs(expected).max(), 1.0))
