"""Random scenes that make sense: any seed gives a mechanism that can be built, and always the same one.

Sizes are drawn by the decade: lengths, slenderness, moduli (contrast up to 1e6 in one mechanism), loads from a
millionth of what bends the softest link to a thousand times that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from random import Random

from .blueprint import (
    Blueprint,
    Clamp,
    CompliancePlan,
    EffectPlan,
    ForcePlan,
    JointPlan,
    LinkPlan,
    MotorPlan,
    SpringPlan,
)
from .draw import INCOMPRESSIBLE, LAWS, MATERIALS, bending_force, decade, length
from .link_effects import with_link_effects
from .spatial import spatial_scene
from .topologies import TOPOLOGIES, Point, Skeleton, chain

_NEVER_FLEXIBLE = ("base", "slider", "tip")


def random_scene(seed: int) -> Blueprint:
    """The scene of a seed; two in five of those in three dimensions, whole, are spatial linkages."""
    rng = Random(f"scene {seed}")
    space = rng.choices(("plane-stress", "plane-strain", "3d", "3d-symmetric"), (62, 12, 15, 11))[0]
    if space == "3d" and rng.random() < 0.4:
        return with_link_effects(rng, spatial_scene(rng))
    return with_link_effects(rng, planar_scene(rng, space))


def planar_scene(rng: Random, space: str) -> Blueprint:
    """A planar mechanism without effects on its links."""
    skeleton = _scaled(rng.choice(TOPOLOGIES)(rng), decade(rng, 1.0, 2.3))
    links = _links(rng, skeleton, space)
    draft = _hold(rng, skeleton, _Draft(links, _joints(rng, skeleton, links)))
    forces = [_force(rng, skeleton, links, "load")]
    ratios = (1.0, rng.uniform(-1.0, 1.0)) if rng.random() < 0.1 else (1.0,)
    count = len(ratios) - 1 + rng.choices((0, 1, 2), (85, 11, 4))[0]
    forces += [_force(rng, skeleton, links, f"load {k + 2}") for k in range(count)]
    bend = min(map(bending_force, (link for link in links if link.centreline)))
    size = bend * (decade(rng, 1.0, 3.0) if rng.random() < 0.06 else decade(rng, -6.0, 0.7))
    forces[len(ratios) :] = [replace(force, magnitude=bend * decade(rng, -4.0, 0.0)) for force in forces[len(ratios) :]]
    control = rng.choices(("forces", "displacements", "path"), (60, 22, 18))[0]
    if control != "forces":
        size = _extent(skeleton) * decade(rng, -6.0, -1.0)
    samples = rng.choice(((size,), (0.0, size), (0.3 * size, size), (0.5 * size, -0.5 * size)))
    compiled = {link.law for link in links if link.centreline} == {"NeoHookean"}  # one law is enough with P3
    return Blueprint(
        topology=skeleton.name,
        links=links,
        joints=draft.joints,
        motors=draft.motors,
        forces=tuple(forces),
        effects=(*draft.effects, *_effects(rng, links, draft.joints)),
        space=space,
        order=rng.choices((1, 2, 3), (2, 8, 1 if compiled else 0))[0] if "3d" not in space else rng.choice((1, 1, 2)),
        control=control,
        samples=(size,) if control == "path" else samples,
        ratios=ratios,
    )


@dataclass(frozen=True)
class _Draft:
    links: tuple[LinkPlan, ...]
    joints: tuple[JointPlan, ...]
    motors: tuple[MotorPlan, ...] = ()
    effects: tuple[EffectPlan, ...] = ()

    def welded(self, name: str, interface: float | Clamp | None) -> _Draft:
        """With the joint ``name`` welded."""
        joints = tuple(
            replace(j, kind="weld", axis=None, interface=interface) if j.name == name else j for j in self.joints
        )
        return replace(self, joints=joints)


def _scaled(skeleton: Skeleton, factor: float) -> Skeleton:
    points = {name: (factor * x, factor * y) for name, (x, y) in skeleton.points.items()}
    return replace(skeleton, points=points)


def _extent(skeleton: Skeleton) -> float:
    return max(max(axis) - min(axis) for axis in zip(*skeleton.points.values(), strict=True))


def _links(rng: Random, skeleton: Skeleton, space: str) -> tuple[LinkPlan, ...]:
    candidates = [name for name in skeleton.links if name not in _NEVER_FLEXIBLE]
    flexible = {name for name in candidates if rng.random() < 0.5} or {rng.choice(candidates)}
    shortest = min(
        math.dist(skeleton.points[a], skeleton.points[b])
        for name in flexible
        for a, b in zip(skeleton.links[name], skeleton.links[name][1:], strict=False)
    )
    slender = decade(rng, -1.3 if "3d" in space else -2.0, -0.75)
    law = "NeoHookean" if space == "plane-stress" else rng.choice(LAWS)  # one per scene: each must be compiled
    materials = [rng.choice(MATERIALS) for _ in range(2)]
    if space != "plane-stress" and rng.random() < 0.4:
        materials[0] = INCOMPRESSIBLE
    links = []
    for name, at in skeleton.links.items():
        if name not in flexible:
            links.append(LinkPlan(name, fixed=name == "base"))
            continue
        thickness = shortest * slender * rng.uniform(0.6, 1.2)
        young, poisson = rng.choice(materials)
        links.append(
            LinkPlan(
                name,
                centreline=_centreline(rng, [skeleton.points[p] for p in at]),
                thickness=thickness,
                depth=thickness * rng.uniform(0.5, 3.0),
                young=young,
                poisson=poisson,
                law=law,
                size=thickness * rng.uniform(0.9, 1.5),
            )
        )
    return tuple(links)


def _centreline(rng: Random, points: list[Point]) -> tuple[Point, ...]:
    """Through all points; between two of them straight, or a bow."""
    if len(points) > 2 or rng.random() < 0.5:
        return tuple(points)
    (ax, ay), (bx, by) = points
    bow = rng.uniform(-0.25, 0.25)
    return (ax, ay), (0.5 * (ax + bx) - bow * (by - ay), 0.5 * (ay + by) + bow * (bx - ax)), (bx, by)


def _joints(rng: Random, skeleton: Skeleton, links: tuple[LinkPlan, ...]) -> tuple[JointPlan, ...]:
    """Pins everywhere, but for the slider."""
    plans = {link.name: link for link in links}
    joints = []
    for point, (a, b) in skeleton.joints.items():
        held = [plans[name].thickness for name in (a, b) if plans[name].centreline]
        radius = min(held) * rng.uniform(0.55, 0.95) if held else None
        sliding = point == "S"
        joints.append(
            JointPlan(
                name=f"joint {point}",
                kind="prismatic" if sliding else "revolute",
                a=a,
                b=b,
                at=skeleton.points[point],
                axis=skeleton.slide if sliding else None,
                interface=radius,
            )
        )
    return tuple(joints)


def _clamp(rng: Random, draft: _Draft, joint: JointPlan) -> float | Clamp | None:
    """An interface for a weld: a rectangle at the end of a strip, or the disc of the pin that was there."""
    ends = [link for link in draft.links if link.centreline and link.name in (joint.a, joint.b)]
    if len(ends) != 1 or joint.at not in (ends[0].centreline[0], ends[0].centreline[-1]) or rng.random() < 0.3:
        return joint.interface
    (link,) = ends
    start, inner = link.centreline[:2] if joint.at == link.centreline[0] else link.centreline[:-3:-1]
    angle = math.atan2(inner[1] - start[1], inner[0] - start[0])
    return Clamp(link.thickness * rng.uniform(1.0, 2.0), 1.5 * link.thickness, angle)


def _hold(rng: Random, skeleton: Skeleton, draft: _Draft) -> _Draft:
    """Takes the mechanism its freedoms, as a rule: by motors, clamps or springs."""
    if skeleton.name == chain(Random(0)).name:
        for joint in draft.joints:
            draft = _hold_joint(rng, draft, joint, ("weld", "weld", "motor", "spring"))
        return draft
    if skeleton.mobility == 0:
        ways = ("none", "none", "weld", "motor")
    else:
        ways = ("motor",) * 12 + ("weld",) * 5 + ("spring",) * 3 + ("motor and weld", "none")
    way = rng.choice(ways)
    ground = [joint for joint in draft.joints if "base" in (joint.a, joint.b)]
    if way == "motor and weld":
        draft = _hold_joint(rng, draft, ground[0], ("motor",))
        return _hold_joint(rng, draft, ground[-1], ("weld",)) if ground[-1].kind == "revolute" else draft
    if way == "weld":
        soft = {link.name for link in draft.links if link.centreline}
        choice = [joint for joint in draft.joints if joint.kind == "revolute" and soft & {joint.a, joint.b}]
        return _hold_joint(rng, draft, rng.choice(choice), (way,))
    return draft if way == "none" else _hold_joint(rng, draft, rng.choice(ground), (way,))


def _hold_joint(rng: Random, draft: _Draft, joint: JointPlan, ways: tuple[str, ...]) -> _Draft:
    match rng.choice(ways):
        case "weld":
            return draft.welded(joint.name, _clamp(rng, draft, joint))
        case "motor":
            reach = rng.choices((0.0, 0.5, 1.5), (3, 6, 1))[0] * rng.uniform(-1.0, 1.0)
            extent = max(math.dist(joint.at, other.at) for other in draft.joints)
            position = reach * (0.2 * extent if joint.kind == "prismatic" else 1.0)
            return replace(draft, motors=(*draft.motors, MotorPlan(joint.name, position)))
        case "spring":
            link = min((link for link in draft.links if link.centreline), key=bending_force)
            stiffness = bending_force(link) * length(link) ** (-1 if joint.kind == "prismatic" else 1)
            rest = rng.choice((0.0, rng.uniform(-0.3, 0.3))) * (length(link) if joint.kind == "prismatic" else 1.0)
            spring = SpringPlan(joint.name, stiffness * decade(rng, -1.0, 1.0), rest)
            return replace(draft, effects=(*draft.effects, spring))


def _force(rng: Random, skeleton: Skeleton, links: tuple[LinkPlan, ...], name: str) -> ForcePlan:
    link = rng.choice([link for link in links if not link.fixed])
    if link.centreline:
        at = rng.choice(link.centreline)
        if len(link.centreline) == 2:
            (ax, ay), (bx, by) = link.centreline
            share = rng.uniform(0.0, 1.0)
            at = (ax + share * (bx - ax), ay + share * (by - ay))
    else:
        x, y = skeleton.points[rng.choice(skeleton.links[link.name])]
        reach = 0.3 * _extent(skeleton)
        at = (x + rng.uniform(-reach, reach), y + rng.uniform(-reach, reach))
    angle = rng.uniform(-math.pi, math.pi)
    return ForcePlan(name, link.name, at, (math.cos(angle), math.sin(angle)))


def _effects(rng: Random, links: tuple[LinkPlan, ...], joints: tuple[JointPlan, ...]) -> list[EffectPlan]:
    effects: list[EffectPlan] = []
    soft = min((link for link in links if link.centreline), key=bending_force)
    if rng.random() < 0.12:
        pins = [joint for joint in joints if joint.kind in ("revolute", "weld")]
        compliance = length(soft) / bending_force(soft) * decade(rng, -6.0, -1.0)
        effects.append(CompliancePlan(rng.choice(pins).name, compliance))
    return effects
