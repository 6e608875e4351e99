"""Effects on the flexible links of random scenes: weight, pressure, prestrain, or contact with an obstacle.

One or two a scene: forms of each kind must be compiled.
"""

from __future__ import annotations

import math
from dataclasses import replace
from random import Random

from .blueprint import (
    Blueprint,
    ContactPlan,
    CylinderPlan,
    EffectPlan,
    ForcePlan,
    GravityPlan,
    LinkPlan,
    PlanePlan,
    PressurePlan,
    PrestrainPlan,
)
from .draw import bending_force, decade, length


def with_link_effects(rng: Random, scene: Blueprint) -> Blueprint:
    """Some of the scenes with one of the effects, some of these with another; a contact stands in the way of the first
    force."""
    kind = rng.choices(("none", "gravity", "pressure", "prestrain", "contact"), (52, 12, 10, 10, 16))[0]
    scene = _with_effect(rng, scene, kind)
    if kind != "none" and rng.random() < 0.3:
        others = [other for other in ("gravity", "pressure", "prestrain") if other != kind]
        scene = _with_effect(rng, scene, rng.choice(others))
    return scene


def _with_effect(rng: Random, scene: Blueprint, kind: str) -> Blueprint:
    match kind:
        case "gravity":
            return _with(scene, _gravity(rng, scene))
        case "pressure":
            link = rng.choice(scene.flexible)
            return _with(scene, PressurePlan(link.name, rng.choice((-1.0, 1.0)) * link.young * decade(rng, -6.0, -2.5)))
        case "prestrain":
            return _with(scene, _prestrain(rng, scene))
        case "contact":
            return _touching(rng, scene)
    return scene


def _with(scene: Blueprint, effect: EffectPlan) -> Blueprint:
    """With an effect, at the one order whose forms are compiled with effects, and of one law."""
    links = tuple(replace(link, law="NeoHookean") if link.centreline else link for link in scene.links)
    return replace(scene, links=links, effects=(*scene.effects, effect), order=1 if scene.space == "3d" else 2)


def _gravity(rng: Random, scene: Blueprint) -> GravityPlan:
    """The weight of the softest link is a share of what bends it."""
    soft = min(scene.flexible, key=bending_force)
    weight = bending_force(soft) / (soft.thickness * soft.depth * length(soft)) * decade(rng, -3.0, 0.0)
    angle = rng.uniform(-math.pi, math.pi)
    return GravityPlan((9810.0 * math.cos(angle), 9810.0 * math.sin(angle)), weight / 9810.0)


def _prestrain(rng: Random, scene: Blueprint) -> PrestrainPlan:
    """Up to a share of what buckles the link between two fixed pins, (π²/3) (t/ℓ)² for clamped ends."""
    link = rng.choice(scene.flexible)
    strain = rng.choice((-1.0, 1.0)) * (link.thickness / length(link)) ** 2 * decade(rng, -3.0, 0.0)
    (ax, ay), (bx, by) = link.centreline[0], link.centreline[-1]
    along = rng.choice((None, (bx - ax, by - ay))) if scene.space != "plane-strain" else (bx - ax, by - ay)
    return PrestrainPlan(link.name, 1.0 + strain, along)


def _touching(rng: Random, scene: Blueprint) -> Blueprint:
    """An obstacle close to a link, beyond it along a direction that the first force mostly has."""
    angle = rng.uniform(-math.pi, math.pi)
    d = (math.cos(angle), math.sin(angle))
    rigid = [link for link in scene.links if not link.centreline and not link.fixed]
    clearance = scene.length * decade(rng, -4.0, -1.5)
    if rigid and rng.random() < 0.25:
        link = rng.choice(rigid)
        points = tuple(joint.at for joint in scene.joints if link.name in (joint.a, joint.b))
        first = max(points, key=lambda at: at[0] * d[0] + at[1] * d[1])
        stiffness = bending_force(min(scene.flexible, key=bending_force)) / scene.length * decade(rng, 0.0, 3.0)
        plan = ContactPlan(link.name, PlanePlan(_beyond(first, d, clearance), (-d[0], -d[1])), stiffness, points)
        return _straight(rng, replace(scene, effects=(*scene.effects, plan)), link, first, d)
    link = rng.choice(scene.flexible)
    first = max(link.centreline, key=lambda at: at[0] * d[0] + at[1] * d[1])
    surface = 1.2 * link.thickness + clearance  # beyond the eyes of pins
    obstacle: PlanePlan | CylinderPlan = PlanePlan(_beyond(first, d, surface), (-d[0], -d[1]))
    if scene.space == "plane-stress" and rng.random() < 0.5:
        radius = scene.length * rng.uniform(0.1, 1.0)
        obstacle = CylinderPlan(_beyond(first, d, surface + radius), radius)
    stiffness = None if scene.space != "plane-stress" or rng.random() < 0.7 else 0.1 * link.young / link.thickness
    return _straight(rng, _with(scene, ContactPlan(link.name, obstacle, stiffness)), link, first, d)


def _straight(
    rng: Random, scene: Blueprint, link: LinkPlan, at: tuple[float, ...], d: tuple[float, float]
) -> Blueprint:
    """With motors as drawn, so that nothing starts inside the obstacle, and mostly a force on the link towards it."""
    motors = tuple(replace(motor, position=0.0) for motor in scene.motors)
    first, *others = scene.forces
    if rng.random() < 0.7:
        first = ForcePlan(first.name, link.name, at[:2], d)
    return replace(scene, motors=motors, forces=(first, *others))


def _beyond(at: tuple[float, ...], d: tuple[float, float], distance: float) -> tuple[float, float]:
    return at[0] + distance * d[0], at[1] + distance * d[1]
