"""Scenes that make no sense: a sound one with one thing spoiled, and what must be said about it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from random import Random

import fenicsmech as fm
from fenicsmech import AssemblyError, DescriptionError, FenicsmechError, MeshingError

from .blueprint import Blueprint, Clamp, ForcePlan, JointPlan, LinkPlan, MotorPlan, build
from .generator import planar_scene


@dataclass(frozen=True)
class Spoiled:
    """A scene to be refused.

    Attributes:
        what: is wrong with it.
        run: describes and simulates it.
        errors: kinds of errors one of which must come.
        names: one of these must be in the error's part.
    """

    what: str
    run: Callable[[], object]
    errors: tuple[type[FenicsmechError], ...]
    names: tuple[str, ...]


Spoiler = Callable[[Random, Blueprint], Spoiled]


def spoiled_scene(seed: int) -> Spoiled:
    """The spoiled scene of a seed."""
    rng = Random(f"spoiled {seed}")
    scene = planar_scene(rng, rng.choices(("plane-stress", "plane-strain", "3d"), (80, 12, 8))[0])
    if scene.control == "path":
        scene = replace(scene, control="displacements")
    return rng.choice(SPOILERS)(rng, scene)


def _refused(what: str, blueprint: Blueprint, *names: str, errors=(DescriptionError,)) -> Spoiled:
    return Spoiled(what, lambda: build(blueprint).curve(blueprint), tuple(errors), names)


def _with_link(blueprint: Blueprint, link: LinkPlan, **changes) -> Blueprint:
    return replace(blueprint, links=tuple(replace(x, **changes) if x == link else x for x in blueprint.links))


def _with_joint(blueprint: Blueprint, joint: JointPlan, **changes) -> Blueprint:
    return replace(blueprint, joints=tuple(replace(x, **changes) if x == joint else x for x in blueprint.joints))


def _with_force(blueprint: Blueprint, **changes) -> Blueprint:
    first, *others = blueprint.forces
    return replace(blueprint, forces=(replace(first, **changes), *others))


def _bad(rng: Random) -> float:
    """A number that no size can be."""
    return rng.choice((0.0, -1.0, math.nan, math.inf, -math.inf))


def _not_finite(rng: Random) -> float:
    return rng.choice((math.nan, math.inf, -math.inf))


def bad_link_number(rng: Random, scene: Blueprint) -> Spoiled:
    """Thickness, depth, modulus or element size is zero, negative or no number."""
    link, what = rng.choice(scene.flexible), rng.choice(("thickness", "depth", "young", "size"))
    names = (link.name, f"strip {what}", f"law {link.law}")
    return _refused(f"{what} of a link", _with_link(scene, link, **{what: _bad(rng)}), *names)


def bad_poisson(rng: Random, scene: Blueprint) -> Spoiled:
    """ν is 0.5 or more, −1 or less, or no number."""
    link = rng.choice(scene.flexible)
    poisson = rng.choice((0.5, 0.7, 12.0, -1.0, -3.0, math.nan, math.inf))
    return _refused("Poisson's ratio", _with_link(scene, link, poisson=poisson), f"law {link.law}")


def bad_centreline(rng: Random, scene: Blueprint) -> Spoiled:
    """A point of a centreline is not a number, or doubled, or the strip is too short."""
    link = rng.choice(scene.flexible)
    way = rng.choice(("not finite", "doubled", "single"))
    line = {
        "not finite": (*link.centreline[:-1], (link.centreline[-1][0], _not_finite(rng))),
        "doubled": (link.centreline[0], *link.centreline),
        "single": link.centreline[:1],
    }[way]
    spoiled = _with_link(scene, link, centreline=line)
    return _refused(f"centreline: {way}", spoiled, link.name, "centreline", errors=(DescriptionError, MeshingError))


def bad_interface(rng: Random, scene: Blueprint) -> Spoiled:
    """The radius of a pin is zero, negative, no number, or missing."""
    joint = rng.choice([joint for joint in scene.joints if joint.interface is not None])
    return _refused("pin radius", _with_joint(scene, joint, interface=rng.choice((_bad(rng), None))), joint.name)


def pin_bigger_than_link(rng: Random, scene: Blueprint) -> Spoiled:
    """A pin holds more than the whole mechanism: no part of its link bends."""
    joint = rng.choice([joint for joint in scene.joints if joint.interface is not None])
    radius = scene.length * rng.uniform(1.5, 20.0)
    return _refused(
        "pin bigger than link",
        _with_joint(scene, joint, interface=radius),
        joint.name,
        joint.a,
        joint.b,
        errors=(MeshingError,),
    )


def joint_off_link(rng: Random, scene: Blueprint) -> Spoiled:
    """A joint lies beside its flexible link."""
    joint = rng.choice([joint for joint in scene.joints if joint.interface is not None])
    away = scene.length * rng.uniform(1.5, 9.0)
    at = (joint.at[0] + away, joint.at[1] - away)
    return _refused("joint off its link", _with_joint(scene, joint, at=at), joint.name, errors=(MeshingError,))


def bad_joint_position(rng: Random, scene: Blueprint) -> Spoiled:
    """A joint is nowhere."""
    joint = rng.choice(scene.joints)
    at = rng.choice(((_not_finite(rng), 0.0), (1.0,), (1.0, 2.0, 3.0, 4.0), ()))
    return _refused("joint position", _with_joint(scene, joint, at=at), joint.name)


def load_off_link(rng: Random, scene: Blueprint) -> Spoiled:
    """A force acts beside its flexible link."""
    link = rng.choice(scene.flexible)
    away = scene.length * rng.uniform(1.5, 9.0)
    at = (link.centreline[0][0] - away, link.centreline[0][1] + away)
    spoiled = _with_force(scene, on=link.name, at=at)
    return _refused("load off its link", spoiled, scene.forces[0].name, errors=(MeshingError, DescriptionError))


def bad_force(rng: Random, scene: Blueprint) -> Spoiled:
    """A force points nowhere, or acts at no point."""
    direction = rng.choice(((0.0, 0.0), (_not_finite(rng), 1.0), (1.0,)))
    changes = rng.choice(({"direction": direction}, {"at": (_not_finite(rng), 0.0)}))
    return _refused("force", _with_force(scene, **changes), scene.forces[0].name)


def force_on_ground(rng: Random, scene: Blueprint) -> Spoiled:
    """A force acts on the fixed link."""
    return _refused("force on the ground", _with_force(scene, on="base"), scene.forces[0].name)


def bad_samples(rng: Random, scene: Blueprint) -> Spoiled:
    """A sample is not a number, or there is none."""
    samples = rng.choice(((), (0.0, _not_finite(rng)), (_not_finite(rng),)))
    return _refused("samples", replace(scene, samples=samples), scene.forces[0].name)


def twice_the_name(rng: Random, scene: Blueprint) -> Spoiled:
    """Two links, joints or forces share a name."""
    what = rng.choice(("links", "joints", "forces"))
    parts = getattr(scene, what)
    return _refused(f"two {what} of one name", replace(scene, **{what: (*parts, parts[0])}), parts[0].name)


def no_ground(rng: Random, scene: Blueprint) -> Spoiled:
    """Nothing is fixed."""
    return _refused("no ground", _with_link(scene, scene.link("base"), fixed=False), scene.topology)


def adrift(rng: Random, scene: Blueprint) -> Spoiled:
    """A link has no joint."""
    return _refused("link adrift", replace(scene, links=(*scene.links, LinkPlan("spare"))), "spare")


def nothing_bends(rng: Random, scene: Blueprint) -> Spoiled:
    """All links are rigid."""
    links = tuple(LinkPlan(link.name, fixed=link.fixed) for link in scene.links)
    joints = tuple(replace(joint, interface=None) for joint in scene.joints)
    spoiled = replace(scene, links=links, joints=joints, effects=())
    return _refused("no flexible link", spoiled, scene.topology)


def joined_with_itself(rng: Random, scene: Blueprint) -> Spoiled:
    """A joint has one link."""
    joint = rng.choice(scene.joints)
    return _refused("joint of one link", _with_joint(scene, joint, b=joint.a), joint.name)


def overlapping_interfaces(rng: Random, scene: Blueprint) -> Spoiled:
    """Two pins of one strip overlap."""
    link = rng.choice(scene.flexible)
    start, end = link.centreline[0], link.centreline[1]
    old = next(joint for joint in scene.joints if joint.at == start)
    radius = old.interface if isinstance(old.interface, float) else 0.5 * old.interface.length
    step = 0.6 * min(radius, link.thickness) / math.dist(start, end)
    at = (start[0] + step * (end[0] - start[0]), start[1] + step * (end[1] - start[1]))
    extra = JointPlan("extra", "revolute", link.name, "plate", at, interface=0.9 * min(radius, link.thickness))
    spoiled = replace(scene, links=(*scene.links, LinkPlan("plate")), joints=(*scene.joints, extra))
    names = ("extra", old.name, link.name)
    return _refused("overlapping interfaces", spoiled, *names, errors=(MeshingError, DescriptionError))


def motor_on_weld(rng: Random, scene: Blueprint) -> Spoiled:
    """A weld is driven."""
    joint = rng.choice(scene.joints)
    motors = (*(motor for motor in scene.motors if motor.joint != joint.name), MotorPlan(joint.name, 0.1))
    welded = _with_joint(scene, joint, kind="weld", axis=None)
    return _refused("motor on a weld", replace(welded, motors=motors, effects=()), joint.name)


def two_motors(rng: Random, scene: Blueprint) -> Spoiled:
    """A joint is driven twice."""
    joint = scene.joints[0]
    pinned = _with_joint(scene, joint, kind="revolute", interface=_pin(scene, joint))
    twice = (MotorPlan(joint.name, 0.0), MotorPlan(joint.name, 0.0))
    return _refused("two motors on a joint", replace(pinned, motors=twice, effects=()), joint.name)


def _pin(scene: Blueprint, joint: JointPlan) -> float | None:
    held = [link.thickness for link in scene.flexible if link.name in (joint.a, joint.b)]
    return 0.7 * min(held) if held else None


def motor_nowhere(rng: Random, scene: Blueprint) -> Spoiled:
    """A motor's position is not a number."""
    joint = scene.joints[0]
    pinned = _with_joint(scene, joint, kind="revolute", interface=_pin(scene, joint))
    motors = (MotorPlan(joint.name, _not_finite(rng)),)
    return _refused("motor position", replace(pinned, motors=motors, effects=()), joint.name)


def beyond_assembly(rng: Random, scene: Blueprint) -> Spoiled:
    """A rigid four-bar led to where its loop cannot close; a flexible link hangs on it."""
    crank, ground = rng.uniform(20.0, 50.0), rng.uniform(80.0, 120.0)
    coupler, rocker = crank * rng.uniform(0.7, 1.0), ground * rng.uniform(0.8, 1.0)
    # drawn with B on the way to D; a half turn of the crank takes B to ground + crank > coupler + rocker away from D
    assert ground + crank > coupler + rocker
    b = (crank, 0.0)
    apart = ground - crank
    x = (apart**2 + coupler**2 - rocker**2) / (2.0 * apart)
    if abs(x) >= coupler:
        coupler = 0.6 * crank
        rocker = apart  # an isosceles triangle closes
        x = coupler**2 / (2.0 * apart)
    c = (crank + x, math.sqrt(coupler**2 - x**2))
    blade = LinkPlan("blade", False, (c, (c[0], c[1] + 30.0)), 2.0, 4.0, 1770.0, 0.4, size=2.0)
    links = (LinkPlan("base", fixed=True), LinkPlan("crank"), LinkPlan("coupler"), LinkPlan("rocker"), blade)
    joints = (
        JointPlan("A", "revolute", "base", "crank", (0.0, 0.0)),
        JointPlan("B", "revolute", "crank", "coupler", b),
        JointPlan("C", "revolute", "coupler", "rocker", c),
        JointPlan("D", "revolute", "base", "rocker", (ground, 0.0)),
        JointPlan("E", "weld", "rocker", "blade", c, interface=1.5),
    )
    spoiled = Blueprint(
        topology="four-bar",
        links=links,
        joints=joints,
        motors=(MotorPlan("A", rng.choice((-1.0, 1.0)) * rng.uniform(2.9, 3.3)),),
        forces=(ForcePlan("load", "blade", (c[0], c[1] + 20.0), (1.0, 0.0)),),
        effects=(),
        space=scene.space,
        order=1,
        control="forces",
        samples=(0.0,),
    )
    return _refused("motor beyond assembly", spoiled, "posed", errors=(AssemblyError,))


def foreign_part(rng: Random, scene: Blueprint) -> Spoiled:
    """A link, force or motor belongs to another mechanism."""
    what = rng.choice(("link", "force", "motor", "joint"))

    def run():
        built = build(scene)
        other = fm.Mechanism("other")
        ground, arm = other.rigid("alien ground", fixed=True), other.rigid("alien arm")
        joint = other.revolute(ground, arm, at=(0.0, 0.0), name="alien joint")
        force = other.force(on=arm, at=(1.0, 0.0), direction=(0.0, 1.0), name="alien force")
        motor = other.motor(joint, name="alien motor")
        match what:
            case "link":
                built.mechanism.force(on=arm, at=(1.0, 0.0), direction=(0.0, 1.0), name="alien push")
            case "force":
                built.simulation.load_displacement(force, forces=[0.0])
            case "motor":
                built.simulation.scene.configuration("alien pose", {motor: 0.1})
            case "joint":
                built.mechanism.motor(joint, name="alien drive")

    return Spoiled(f"foreign {what}", run, (DescriptionError,), ("alien",))


def bad_fidelity(rng: Random, scene: Blueprint) -> Spoiled:
    """A space or order that does not exist."""
    changes = rng.choice(({"space": "4d"}, {"order": 0}, {"order": 7}))
    return _refused("space or order", replace(scene, **changes), *changes)


def out_of_plane(rng: Random, scene: Blueprint) -> Spoiled:
    """A planar model with a force or an axis out of the plane, or a ball joint."""
    flat = replace(scene, space="plane-stress", effects=(), motors=())
    flat = replace(flat, links=tuple(replace(link, law="NeoHookean") for link in flat.links))
    if rng.random() < 0.5:
        return _refused("force out of the plane", _with_force(flat, direction=(0.0, 1.0, 1.0)), scene.forces[0].name)
    joint = rng.choice(flat.joints)
    return _refused("ball joint in the plane", _with_joint(flat, joint, kind="spherical", axis=None), joint.name)


def interfaces_cover_link(rng: Random, scene: Blueprint) -> Spoiled:
    """A clamp holds the whole link: nothing of it can bend."""
    link = rng.choice(scene.flexible)
    joint = next(joint for joint in scene.joints if joint.at == link.centreline[0])
    clamp = Clamp(9.0 * scene.length, 9.0 * scene.length, 0.0)
    spoiled = replace(_with_joint(scene, joint, kind="weld", axis=None, interface=clamp), motors=(), effects=())
    return _refused("clamp as big as its link", spoiled, joint.a, joint.b, joint.name, errors=(MeshingError,))


SPOILERS: tuple[Spoiler, ...] = (
    bad_link_number,
    bad_poisson,
    bad_centreline,
    bad_interface,
    pin_bigger_than_link,
    joint_off_link,
    bad_joint_position,
    load_off_link,
    bad_force,
    force_on_ground,
    bad_samples,
    twice_the_name,
    no_ground,
    adrift,
    nothing_bends,
    joined_with_itself,
    overlapping_interfaces,
    motor_on_weld,
    two_motors,
    motor_nowhere,
    beyond_assembly,
    foreign_part,
    bad_fidelity,
    out_of_plane,
    interfaces_cover_link,
)
