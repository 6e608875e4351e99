"""Random spatial linkages, whose couplers between two ball joints spin idly: RSSR, RSSP, and two loops in a row."""

from __future__ import annotations

import math
from random import Random

from .blueprint import Blueprint, CompliancePlan, EffectPlan, ForcePlan, JointPlan, LinkPlan, MotorPlan, SpringPlan
from .draw import LAWS, MATERIALS, bending_force, decade, length

Vector = tuple[float, float, float]


def spatial_scene(rng: Random) -> Blueprint:
    """A crank about any axis, a flexible coupler in the plane z = 0, and a rocker or a slider; sometimes two loops."""
    unit = decade(rng, 1.0, 2.3)
    b, c = (0.0, 0.0, 0.0), (unit, unit * rng.uniform(-0.3, 0.3), 0.0)
    kind = rng.choices(("RSSR", "RSSP", "RSSR-SSR"), (5, 3, 2))[0]
    links = [LinkPlan("base", fixed=True), LinkPlan("crank"), _coupler(rng, "coupler", b, c)]
    joints = [_pivot(rng, "joint A", "crank", b, unit), _ball("joint B", "crank", links[2], b)]
    last = "slider" if kind == "RSSP" else "rocker"
    links.append(LinkPlan(last))
    joints.append(_ball("joint C", last, links[2], c))
    if kind == "RSSP":
        turn = rng.uniform(-0.9, 0.9)
        at = (c[0], c[1], unit * rng.uniform(-0.3, 0.3))
        joints.append(JointPlan("joint D", "prismatic", "base", "slider", at, (math.cos(turn), math.sin(turn), 0.0)))
    else:
        joints.append(_pivot(rng, "joint D", "rocker", c, unit))
    end = c
    if kind == "RSSR-SSR":
        e = (c[0] + unit * rng.uniform(-0.1, 0.2), c[1] + unit * rng.uniform(0.3, 0.5), 0.0)
        end = (e[0] + unit * rng.uniform(0.5, 0.9), e[1] + unit * rng.uniform(-0.2, 0.2), 0.0)
        links += [_coupler(rng, "second coupler", e, end), LinkPlan("second rocker")]
        joints += [_ball("joint E", "rocker", links[-2], e), _ball("joint F", "second rocker", links[-2], end)]
        joints.append(_pivot(rng, "joint G", "second rocker", end, unit))
        last = "second rocker"
    soft = min((link for link in links if link.centreline), key=bending_force)
    motors, effects = _hold(rng, joints, soft)
    held = {"crank"} if motors else set()
    on = rng.choice([link for link in links if not link.fixed and not link.centreline and link.name not in held])
    near = next(joint.at for joint in joints if joint.b == on.name or joint.a == on.name)
    at = tuple(x + 0.2 * unit * rng.uniform(-1.0, 1.0) for x in near)
    control = rng.choices(("forces", "displacements", "path"), (60, 20, 20))[0]
    size = bending_force(soft) * decade(rng, -5.0, 0.7)
    if control != "forces":
        size = unit * decade(rng, -5.0, -1.3)
    return Blueprint(
        topology=kind,
        links=tuple(links),
        joints=tuple(joints),
        motors=motors,
        forces=(ForcePlan("load", on.name, at, _unit(rng)),),
        effects=effects,
        space="3d",
        order=rng.choice((1, 1, 2)),
        control=control,
        samples=(size,) if control == "path" else rng.choice(((size,), (0.3 * size, size), (0.5 * size, -0.5 * size))),
    )


def _unit(rng: Random) -> Vector:
    vector = [rng.gauss(0.0, 1.0) for _ in range(3)]
    size = math.hypot(*vector)
    return tuple(x / size for x in vector)


def _coupler(rng: Random, name: str, start: Vector, end: Vector) -> LinkPlan:
    """A strip, straight or bowed."""
    (ax, ay, _), (bx, by, _) = start, end
    bow = rng.choice((0.0, 0.0, rng.uniform(-0.2, 0.2)))
    middle = (0.5 * (ax + bx) - bow * (by - ay), 0.5 * (ay + by) + bow * (bx - ax))
    thickness = math.dist(start, end) * decade(rng, -1.3, -0.85)
    young, poisson = rng.choice(MATERIALS)
    return LinkPlan(
        name,
        centreline=((ax, ay), middle, (bx, by)) if bow else ((ax, ay), (bx, by)),
        thickness=thickness,
        depth=thickness * rng.uniform(0.6, 2.0),
        young=young,
        poisson=poisson,
        law=rng.choice(LAWS[:2]),
        size=thickness * rng.uniform(1.0, 1.5),
    )


def _ball(name: str, link: str, coupler: LinkPlan, at: Vector) -> JointPlan:
    return JointPlan(name, "spherical", link, coupler.name, at, interface=0.6 * coupler.thickness)


def _pivot(rng: Random, name: str, link: str, end: Vector, unit: float) -> JointPlan:
    """A hinge of ``link`` and base; ``end`` of the link moves across its axis."""
    arm, size = _unit(rng), unit * rng.uniform(0.25, 0.6)
    at = tuple(x + size * a for x, a in zip(end, arm, strict=True))
    other = _unit(rng)
    along = sum(x * y for x, y in zip(arm, other, strict=True))
    axis = tuple(y - along * x for x, y in zip(arm, other, strict=True))
    return JointPlan(name, "revolute", "base", link, at, axis)


def _hold(rng: Random, joints: list[JointPlan], soft: LinkPlan) -> tuple[tuple[MotorPlan, ...], tuple[EffectPlan, ...]]:
    """A motor on the crank, or a spring; sometimes a ball joint that gives way."""
    effects: list[EffectPlan] = []
    motors = (MotorPlan("joint A", rng.choice((0.0, rng.uniform(-0.5, 0.5)))),) if rng.random() < 0.6 else ()
    if not motors:
        pivots = [joint for joint in joints if joint.kind == "revolute"]
        stiffness = bending_force(soft) * length(soft) * decade(rng, -1.0, 1.0)
        effects.append(SpringPlan(rng.choice(pivots).name, stiffness, rng.choice((0.0, rng.uniform(-0.3, 0.3)))))
    if rng.random() < 0.2:
        balls = [joint.name for joint in joints if joint.kind == "spherical"]
        effects.append(CompliancePlan(rng.choice(balls), length(soft) / bending_force(soft) * decade(rng, -6.0, -1.0)))
    return motors, tuple(effects)
