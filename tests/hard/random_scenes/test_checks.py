"""The check of equilibria sees every effect, space, order and formulation: it accepts what the solver finds, and
nothing a hundredth away from it."""

from dataclasses import replace

import pytest

from .assembly_check import smallest_gap
from .blueprint import (
    Blueprint,
    CompliancePlan,
    ContactPlan,
    CylinderPlan,
    ForcePlan,
    GravityPlan,
    JointPlan,
    LinkPlan,
    MotorPlan,
    PlanePlan,
    PressurePlan,
    PrestrainPlan,
    SpringPlan,
    build,
)
from .potential import Potential
from .residual_check import check
from .stability_check import checkable, unstable_directions
from .thresholds import THRESHOLDS


def arch(space: str, order: int, *effects, poisson: float = 0.4) -> Blueprint:
    """Two strips pinned to the ground and to each other, a load on the left one."""
    strips = {"left": ((0.0, 0.0), (30.0, 10.0)), "right": ((60.0, 0.0), (30.0, 10.0))}
    links = [LinkPlan(name, False, at, 2.0, 3.0, 1770.0, poisson, size=2.5) for name, at in strips.items()]
    ends = (
        ("A", "base", "left", (0.0, 0.0)),
        ("B", "left", "right", (30.0, 10.0)),
        ("C", "base", "right", (60.0, 0.0)),
    )
    return Blueprint(
        topology="two-link arch",
        links=(LinkPlan("base", fixed=True), *links),
        joints=tuple(JointPlan(name, "revolute", a, b, at, interface=1.4) for name, a, b, at in ends),
        motors=(),
        forces=(
            ForcePlan("load", "left", (15.0, 5.0), (0.3, -1.0)),
            ForcePlan("other", "right", (45.0, 5.0), (0.0, 1.0)),
        ),
        effects=effects,
        space=space,
        order=order,
        control="forces",
        samples=(0.2,),
        ratios=(1.0, 0.4),
    )


PRESSURE = PressurePlan("left", 40.0), {"pressure": 40.4}
SWELLING = PrestrainPlan("right", 1.001, None), {"stretch": 1.00101}
TENDON = PrestrainPlan("right", 0.999, (-3.0, 1.0)), {"stretch": 0.99899}
WEIGHT = GravityPlan((2000.0, -9000.0), 1e-7), {"density": 1.01e-7}
# within the eyes at the top pin, in elements with straight edges too
FLOOR = ContactPlan("right", PlanePlan((0.0, 11.2), (0.0, -1.0))), {"obstacle": PlanePlan((0.0, 11.198), (0.0, -1.0))}
ROLLER = (
    ContactPlan("left", CylinderPlan((30.0, 16.38), 5.0), 300.0),
    {"obstacle": CylinderPlan((30.0, 16.3798), 5.0)},
)
SPRING = SpringPlan("A", 5.0, 0.2), {"rest": 0.202}
SOFT = CompliancePlan("B", 1e-2), {"compliance": 1.01e-2}
CASES = [
    pytest.param("plane-stress", 2, PRESSURE, {}, id="pressure"),
    pytest.param("plane-stress", 2, SWELLING, {}, id="swelling"),
    pytest.param("plane-stress", 2, ROLLER, {}, id="contact with a cylinder"),
    pytest.param("plane-stress", 3, SPRING, {}, id="spring, third order"),
    pytest.param("plane-strain", 2, TENDON, {"poisson": 0.497}, id="prestrain along a link in u–p form"),
    pytest.param("plane-strain", 2, FLOOR, {}, id="contact with a plane"),
    pytest.param("3d-symmetric", 2, PRESSURE, {}, id="pressure on half a link"),
    pytest.param("3d-symmetric", 1, FLOOR, {}, id="contact of half a link"),
    pytest.param("3d-symmetric", 2, SOFT, {"poisson": 0.497}, id="compliance beside half a link in u–p form"),
    pytest.param("3d", 1, WEIGHT, {}, id="weight in space"),
]


@pytest.mark.thorough
@pytest.mark.parametrize("space, order, effect, options", CASES)
def test_the_check_sees_a_hundredth_of_every_effect(space, order, effect, options):
    plan, stronger = effect
    scene = arch(space, order, plan, **options)
    built = build(scene)
    (frame,) = built.curve(scene).frames
    potential = Potential.of(scene, built.simulation)
    found = check(potential, frame, 0.0)
    assert found.relative < THRESHOLDS.residual
    assert max(found.gap, found.travel_error) < THRESHOLDS.closed
    assert found.energy_error < THRESHOLDS.energy
    other = replace(scene, effects=(replace(plan, **stronger),))
    assert check(Potential.of(other, built.simulation), frame, 0.0).relative > 10.0 * THRESHOLDS.residual
    if checkable(potential):
        assert unstable_directions(potential, frame) == frame.unstable_modes


@pytest.mark.parametrize("pressures", [(), (PressurePlan("left", 5.0),), (PressurePlan("left", -5.0),)])
def test_loads_balance_with_tension_in_links_that_all_but_leave_them_free(pressures):
    """Taut links in line turn by 5e-10 under a load of 1e-9 of their tension, which does all the work against it, part
    of it as pressure."""
    scene, load = arch("plane-stress", 2, PrestrainPlan("right", 0.999, None), *pressures), 1e-8
    taut = [replace(link, centreline=tuple((x, 0.0) for x, _ in link.centreline)) for link in scene.links[1:]]
    joints = tuple(replace(joint, at=(joint.at[0], 0.0)) for joint in scene.joints)
    forces = (ForcePlan("load", "left", (30.0, 0.0), (0.0, -1.0)),)
    scene = replace(scene, links=(scene.links[0], *taut), joints=joints, forces=forces, samples=(load,), ratios=(1.0,))
    built = build(scene)
    (frame,) = built.curve(scene).frames
    potential = Potential.of(scene, built.simulation)
    found = check(potential, frame, 0.0)
    assert found.scale > 2e8 * load and found.unstrained_work < THRESHOLDS.balanced
    pulled = check(potential, replace(frame, force=1.01 * load), 0.0)
    assert pulled.unstrained_work > 100.0 * THRESHOLDS.balanced


@pytest.mark.parametrize("turn, flexible, joined", [(0.0, False, True), (0.1, False, False), (0.1, True, True)])
def test_motors_take_rigid_links_where_they_can_be_joined(turn, flexible, joined):
    scene = arch("plane-stress", 2)
    left, right = (link if flexible else LinkPlan(link.name) for link in scene.links[1:])
    scene = replace(scene, links=(scene.links[0], left, right), motors=(MotorPlan("A", turn),))
    assert (smallest_gap(scene) < THRESHOLDS.joined) == joined
