"""Slender clamped links against closed forms of the elastica."""

from math import cos, pi, sin

import numpy as np
import pytest

from .clamped import cantilever

# P L² / EI → x / L, w / L of the tip of a cantilever under a dead load across it (elliptic integrals)
TIP = {
    10.0 / 9.0: (0.93263, 0.32860),
    10.0 / 3.0: (0.71871, 0.62897),
    50.0 / 9.0: (0.58506, 0.73211),
    10.0: (0.44500, 0.81061),
}


@pytest.mark.thorough
@pytest.mark.parametrize(
    "space, poisson, rigid_tip",
    [
        ("plane-stress", 0.0, True),
        ("plane-stress", 0.0, False),
        ("plane-stress", 0.3, True),
        ("plane-strain", 0.3, True),
    ],
)
def test_dead_load_at_the_tip(space, poisson, rigid_tip):
    length = 100.0
    case = cantilever(space, length=length, poisson=poisson, rigid_tip=rigid_tip)
    loads = [parameter * case.bending / length**2 for parameter in TIP]
    curve = case.simulation.load_displacement(case.force, forces=loads)
    for frame, (x, w) in zip(curve.frames, TIP.values(), strict=True):
        along, across = (frame.outputs[output] for output in case.outputs)
        assert length + along == pytest.approx(x * length, rel=1e-3)
        assert across == pytest.approx(w * length, rel=1e-3)
        assert frame.displacement == pytest.approx(across, rel=1e-12)
        assert frame.stable


def test_dead_load_at_the_tip_in_space():
    length = 60.0
    case = cantilever("3d", length=length, thickness=1.0, size=2.0)
    loads = [parameter * case.bending / length**2 for parameter in (0.5, *TIP)]
    curve = case.simulation.load_displacement(case.force, forces=loads)
    for frame, (x, w) in zip(curve.frames[1:], TIP.values(), strict=True):
        along, across = (frame.outputs[output] for output in case.outputs)
        assert length + along == pytest.approx(x * length, rel=5e-3)
        assert across == pytest.approx(w * length, rel=5e-3)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "space, poisson, turn",
    [
        *(("plane-stress", 0.3, turn) for turn in (0.5, pi, 2.0 * pi, 2.5 * pi)),
        *(("plane-strain", 0.3, turn) for turn in (0.5, pi, 2.0 * pi, 2.5 * pi)),
        *(("3d", 0.0, turn) for turn in (0.5, pi, 2.0 * pi, 2.5 * pi)),
    ],
)
def test_motor_at_the_tip_bends_the_link_into_a_circle(space, poisson, turn):
    length, size = (40.0, 2.0) if space == "3d" else (100.0, 1.0)
    # a closed ring as deep as thick can turn about its clamp for nothing, and would leave its plane from there on
    case = cantilever(space, length=length, depth=4.0, poisson=poisson, size=size, driven=True)
    configuration = case.simulation.scene.configuration("turned", {case.motor: turn})
    frame = case.simulation.load_displacement(case.force, forces=[0.0], configuration=configuration).frames[0]
    expected = np.array([length * (sin(turn) / turn - 1.0), length / turn * (1.0 - cos(turn))])
    assert case.tip(frame)[:2] == pytest.approx(expected, abs=1e-3 * length)
    assert frame.motors[case.motor] == pytest.approx(case.bending * turn / length, rel=2e-3)
    assert frame.strain_energy == pytest.approx(0.5 * case.bending * turn**2 / length, rel=2e-3)
