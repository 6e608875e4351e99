"""Lengths and moduli in any units: the same scene in mm and MPa and in m and Pa."""

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

METRE = {"mm": 1e3, "m": 1.0}  # units of length in a metre; forces are in N in both


def truss(unit: str, space: str):
    """The truss finger with a motor, in either unit."""

    def at(x, y):
        return (1e-3 * METRE[unit] * x, 1e-3 * METRE[unit] * y)

    finger = fm.Mechanism("truss finger")
    base = finger.rigid("base", fixed=True)
    left, right, tip = (finger.rigid(name) for name in ("left leg", "right leg", "tip"))
    silicone = fm.Material("silicone", 1.9e6 / METRE[unit] ** 2, 0.45)
    shape = fm.strip([at(0, 0), at(18, 34), at(40, 60)], thickness=at(6, 0)[0], depth=at(20, 0)[0])
    diagonal = finger.flexible("diagonal", shape, silicone)
    finger.revolute(base, left, at=at(0, 0))
    finger.revolute(base, right, at=at(40, 0))
    finger.revolute(left, tip, at=at(0, 60))
    finger.revolute(right, tip, at=at(40, 60))
    foot = finger.revolute(base, diagonal, at=at(0, 0), interface_radius=at(3, 0)[0])
    finger.revolute(diagonal, tip, at=at(40, 60), interface_radius=at(3, 0)[0])
    finger.motor(foot)
    push = finger.force(on=tip, at=at(20, 70), direction=(1, 0))
    order = 1 if space == "3d" else 2
    size = at(5, 0)[0]
    return fm.Simulation(fm.Scene(finger), space=space, order=order, size=size, comm=MPI.COMM_SELF), push


@pytest.mark.parametrize("space", ["plane-stress", "plane-strain", "3d"])
def test_curve_and_multipliers_do_not_depend_on_the_unit_of_length(space):
    curves = {}
    for unit in METRE:
        simulation, push = truss(unit, space)
        curves[unit] = simulation.load_displacement(push, forces=[0.2, 0.5, -0.2])
    scale = METRE["mm"] / METRE["m"]
    for mm, m in zip(curves["mm"].frames, curves["m"].frames, strict=True):
        assert mm.displacement == pytest.approx(m.displacement * scale, rel=1e-8)
        assert mm.strain_energy == pytest.approx(m.strain_energy * scale, rel=1e-8)
        assert mm.max_stress == pytest.approx(m.max_stress / scale**2, rel=1e-7)
        assert mm.state.u == pytest.approx(m.state.u * scale, abs=1e-8 * np.abs(mm.state.u).max())
        assert list(mm.motors.values()) == pytest.approx([t * scale for t in m.motors.values()], rel=1e-8)
        largest = max(np.abs(reaction.force).max() for reaction in mm.reactions.values())
        for name, reaction in mm.reactions.items():
            assert reaction.force == pytest.approx(m.reactions[name].force, abs=1e-8 * largest), name
            moment = m.reactions[name].moment * scale
            assert reaction.moment == pytest.approx(moment, abs=1e-8 * largest * 0.1 * METRE["mm"]), name


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_same_number_of_iterations_in_either_unit(space):
    counts = []
    for unit in METRE:
        simulation, push = truss(unit, space)
        curve = simulation.load_displacement(push, forces=[0.2, 0.5])
        counts.append([frame.iterations for frame in curve.frames])
    assert counts[0] == counts[1]


def test_stiffness_and_forces_scaled_alike_give_the_same_shape():
    displacements = []
    for stiff in (1e-6, 1.0, 1e6):
        mechanism = fm.Mechanism("bow")
        base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
        shape = fm.strip([(0, 0), (20, 12), (40, 14)], thickness=3.0, depth=4.0)
        bow = mechanism.flexible("bow", shape, fm.Material("any", 2.0 * stiff, 0.4))
        mechanism.weld(base, bow, at=(0, 0), interface_radius=2.0)
        mechanism.weld(bow, hand, at=(40, 14), interface_radius=2.0)
        pull = mechanism.force(on=hand, at=(40, 14), direction=(0, 1))
        simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=3.0, comm=MPI.COMM_SELF)
        displacements.append(simulation.load_displacement(pull, forces=[0.02 * stiff, 0.05 * stiff]).displacements)
    assert displacements[0] == pytest.approx(displacements[1], rel=1e-8)
    assert displacements[2] == pytest.approx(displacements[1], rel=1e-8)
