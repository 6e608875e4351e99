"""Freedoms that motors leave minimise the energy of springs; the others are zero-energy modes."""

import numpy as np
import pytest

from fenicsmech.effects import JointSpring
from fenicsmech.mechanism import Joint, Mechanism, Scene
from fenicsmech.multibody import assemble, build_linkage, count_freedom, spring_potentials

FIRST, SECOND, LENGTH, DRIVEN = 0.3, 0.02, 30.0, 0.7


def arm() -> tuple[Mechanism, list[Joint]]:
    """Three links of equal length on a line, hinged to the ground and to each other."""
    mechanism = Mechanism("arm")
    links = [mechanism.rigid("ground", fixed=True), *(mechanism.rigid(name) for name in ("upper", "fore", "hand"))]
    pairs = zip(links, links[1:], strict=False)
    joints = [mechanism.revolute(a, b, at=(LENGTH * k, 0.0)) for k, (a, b) in enumerate(pairs)]
    return mechanism, joints


@pytest.mark.parametrize("dim", [2, 3])
def test_a_spring_keeps_its_joint_while_a_motor_turns_the_next_one(dim):
    mechanism, (shoulder, elbow, _) = arm()
    motor = mechanism.motor(elbow)
    scene = Scene(mechanism, effects=[spring := JointSpring(shoulder, 1e-3)])
    linkage, configuration = build_linkage(mechanism, dim), scene.configuration("bent", {motor: DRIVEN})
    springs = spring_potentials([spring], linkage)
    poses = assemble(linkage, configuration, springs).poses
    upper, fore = (poses[[body.name for body in linkage.bodies].index(name)] for name in ("upper", "fore"))
    assert upper[:dim] == pytest.approx(0.0, abs=1e-12)
    turned = fore[2] if dim == 2 else 2.0 * np.arctan2(fore[6], fore[3])
    assert turned == pytest.approx(DRIVEN, abs=1e-12)


def test_springs_in_series_turn_in_proportion_to_their_compliance():
    # two springs in a row pull on the freedom that the motor leaves, ½ k₁ x₁² + ½ k₂ x₂² is least
    mechanism = Mechanism("slides")
    ground, slide, crank = mechanism.rigid("ground", fixed=True), mechanism.rigid("slide"), mechanism.rigid("crank")
    first = mechanism.prismatic(ground, slide, at=(0.0, 0.0), axis=(1.0, 0.0))
    second = mechanism.prismatic(slide, crank, at=(0.0, 0.0), axis=(1.0, 0.0))
    third = mechanism.prismatic(ground, crank, at=(0.0, 0.0), axis=(1.0, 0.0))
    motor = mechanism.motor(third)
    scene = Scene(mechanism, effects=[JointSpring(first, FIRST), JointSpring(second, SECOND)])
    linkage = build_linkage(mechanism, 2)
    springs = spring_potentials(scene.effects, linkage)
    poses = assemble(linkage, scene.configuration("apart", {motor: 5.0}), springs).poses
    # k₁ x₁ = k₂ x₂, x₁ + x₂ = 5
    assert poses[1, 0] == pytest.approx(5.0 * SECOND / (FIRST + SECOND), rel=1e-10)


@pytest.mark.parametrize("stiffness", [1e3, 1e-12])
def test_soft_springs_hold_as_stiff_ones_do(stiffness):
    mechanism, (shoulder, elbow, wrist) = arm()
    linkage = build_linkage(mechanism, 2)
    still, drawn = np.zeros(3), linkage.rigid.drawn

    def loose(*joints: Joint) -> tuple[int, tuple[str, ...]]:
        springs = spring_potentials([JointSpring(joint, stiffness) for joint in joints], linkage)
        freedom = count_freedom(linkage.rigid, drawn, still, springs)
        return freedom.mobility, freedom.zero_energy

    assert loose() == (3, ("upper", "fore", "hand"))
    assert loose(shoulder) == (3, ("fore", "hand"))
    assert loose(shoulder, elbow) == (3, ("hand",))
    assert loose(shoulder, elbow, wrist) == (3, ())


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("stiffness", [1e-3, 1e4])
def test_a_spring_that_a_motor_holds_wound_up_holds_no_other_joint(stiffness, dim):
    mechanism, (shoulder, _, _) = arm()
    motor = mechanism.motor(shoulder)
    scene = Scene(mechanism, effects=[JointSpring(shoulder, stiffness)])
    linkage, configuration = build_linkage(mechanism, dim), scene.configuration("wound", {motor: DRIVEN})
    springs, motors = spring_potentials(scene.effects, linkage), linkage.rigid.motor_values(configuration.position)
    poses = assemble(linkage, configuration, springs).poses
    freedom = count_freedom(linkage.rigid, poses, motors, springs)
    assert (freedom.mobility, freedom.zero_energy) == (2, ("fore", "hand"))
    # nor does the rounding of its moment turn these
    assert poses == pytest.approx(assemble(linkage, configuration).poses, abs=1e-9)
