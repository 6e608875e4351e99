"""A random scene as plain data that can be printed, spoiled and described in any order, and its making.

Numbers stay as they are until ``build`` hands them to the package: whatever is wrong with them, the package must say.
"""

from __future__ import annotations

import random
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.mechanism import Force, Motor

Point = tuple[float, ...]


@dataclass(frozen=True)
class Clamp:
    """A rectangular interface: length along the direction at ``angle``, width across it."""

    length: float
    width: float
    angle: float


@dataclass(frozen=True)
class LinkPlan:
    """A link: a strip if it has a ``centreline``, rigid if not.

    ``law`` is the name of a law in ``fenicsmech``; ``size`` the element size.
    """

    name: str
    fixed: bool = False
    centreline: tuple[Point, ...] = ()
    thickness: float = 0.0
    depth: float = 0.0
    young: float = 0.0
    poisson: float = 0.0
    law: str = "NeoHookean"
    size: float = 0.0


@dataclass(frozen=True)
class JointPlan:
    """A joint of the ``kind`` that a method of ``Mechanism`` is called, with its interface on flexible links."""

    name: str
    kind: str
    a: str
    b: str
    at: Point
    axis: Point | None = None
    interface: float | Clamp | None = None


@dataclass(frozen=True)
class MotorPlan:
    """A motor at a ``position``."""

    joint: str
    position: float


@dataclass(frozen=True)
class ForcePlan:
    """A force; ``magnitude`` is that of a constant one, unused for the one that changes."""

    name: str
    on: str
    at: Point
    direction: Point
    magnitude: float = 0.0


@dataclass(frozen=True)
class SpringPlan:
    """A joint spring."""

    joint: str
    stiffness: float
    rest: float


@dataclass(frozen=True)
class CompliancePlan:
    """A joint that gives way."""

    joint: str
    compliance: float


@dataclass(frozen=True)
class PressurePlan:
    """Pressure on the whole boundary of a link."""

    link: str
    pressure: float


@dataclass(frozen=True)
class PrestrainPlan:
    """A link whose strain-free state is stretched, ``along`` a direction or in all."""

    link: str
    stretch: float
    along: Point | None


@dataclass(frozen=True)
class PlanePlan:
    """The obstacle behind a plane."""

    point: Point
    normal: Point


@dataclass(frozen=True)
class CylinderPlan:
    """A cylinder along z."""

    centre: Point
    radius: float


@dataclass(frozen=True)
class ContactPlan:
    """Contact of a link, a rigid one at ``points``; ``stiffness`` by default that of the package."""

    link: str
    obstacle: PlanePlan | CylinderPlan
    stiffness: float | None = None
    points: tuple[Point, ...] = ()


@dataclass(frozen=True)
class GravityPlan:
    """Weight of all flexible links, of one density."""

    acceleration: Point
    density: float


EffectPlan = SpringPlan | CompliancePlan | GravityPlan | PressurePlan | PrestrainPlan | ContactPlan


@dataclass(frozen=True)
class Blueprint:
    """A scene and the curve asked for.

    Attributes:
        topology: what kind of mechanism it is.
        control: "forces" or "displacements", or "path": followed to a displacement.
        samples: of the control, or where the path ends.
        forces: those that change first.
        ratios: of those that change, to their common magnitude.
        most: frames of a path.
    """

    topology: str
    links: tuple[LinkPlan, ...]
    joints: tuple[JointPlan, ...]
    motors: tuple[MotorPlan, ...]
    forces: tuple[ForcePlan, ...]
    effects: tuple[EffectPlan, ...]
    space: str
    order: int
    control: str
    samples: tuple[float, ...]
    ratios: tuple[float, ...] = (1.0,)
    most: int = 25

    def link(self, name: str) -> LinkPlan:
        """The link of that name."""
        return next(link for link in self.links if link.name == name)

    def joint(self, name: str) -> JointPlan:
        """The joint of that name."""
        return next(joint for joint in self.joints if joint.name == name)

    @property
    def dim(self) -> int:
        """Dimension of the space that bodies move in."""
        return 3 if self.space == "3d" else 2

    @property
    def half(self) -> bool:
        """Whether half of the links is meshed, the rest its mirror image."""
        return self.space == "3d-symmetric"

    def mixed(self, link: LinkPlan) -> bool:
        """Whether a link is in the u–p formulation: nearly incompressible, of order 2 or 3, volume confined."""
        return self.order > 1 and self.space != "plane-stress" and link.poisson > 0.49

    @property
    def spins(self) -> tuple[LinkPlan, ...]:
        """The links that turn between two ball joints."""
        found = []
        for link in self.links:
            kinds = {joint.kind for joint in self.joints if link.name in (joint.a, joint.b)}
            found += [link] if not link.fixed and kinds == {"spherical"} else []
        return tuple(found)

    @property
    def idle_spins(self) -> int:
        """Number of links that turn idly between two ball joints: neither forces nor effects act on their turns."""
        changed = [plan for plan in self.effects if not isinstance(plan, PressurePlan | PrestrainPlan)]
        acted_on = {force.on for force in self.forces} | {getattr(plan, "link", None) for plan in changed}
        heavy = any(isinstance(plan, GravityPlan) for plan in self.effects)
        return sum(link.name not in acted_on and not (heavy and link.centreline) for link in self.spins)

    @property
    def flexible(self) -> tuple[LinkPlan, ...]:
        """The links that bend."""
        return tuple(link for link in self.links if link.centreline)

    @property
    def length(self) -> float:
        """Largest distance between two joints along a coordinate."""
        places = [(*joint.at, 0.0)[:3] for joint in self.joints]
        return max(max(axis) - min(axis) for axis in zip(*places, strict=True))

    @property
    def summary(self) -> str:
        """In a few words."""
        effects = {type(plan).__name__.removesuffix("Plan").lower() for plan in self.effects}
        words = [self.topology, self.space, f"P{self.order}", *(["u–p"] if any(map(self.mixed, self.flexible)) else [])]
        words += [*(["idle spin"] if self.idle_spins else []), self.control, *sorted(effects)]
        return ", ".join([*words, f"{len(self.forces)} forces"] if len(self.forces) > 1 else words)

    def coarsened(self) -> Blueprint:
        """The same scene with larger elements and fewer loads."""
        links = tuple(replace(link, size=1.6 * link.size) if link.centreline else link for link in self.links)
        return replace(self, links=links, samples=self.samples[-1:], most=12)

    def stiffened(self, names: Collection[str]) -> Blueprint:
        """The same scene with links of some ``names`` rigid, which neither pressure all around nor prestrain moves."""
        links = tuple(replace(link, centreline=()) if link.name in names else link for link in self.links)
        bending = {link.name for link in links if link.centreline}
        joints = tuple(j if bending & {j.a, j.b} else replace(j, interface=None) for j in self.joints)
        within = (PressurePlan, PrestrainPlan)
        effects = tuple(e for e in self.effects if not (isinstance(e, within) and e.link in names))
        return replace(self, links=links, joints=joints, effects=effects)

    def shuffled(self, seed: int) -> Blueprint:
        """The same scene with links and joints in another order."""
        links, joints, order = list(self.links), list(self.joints), random.Random(seed)
        order.shuffle(links)
        order.shuffle(joints)
        return replace(self, links=tuple(links), joints=tuple(joints))


@dataclass
class Built:
    """The package's objects for a blueprint; ``parts`` by name."""

    mechanism: fm.Mechanism
    links: dict[str, object] = field(default_factory=dict)
    joints: dict[str, object] = field(default_factory=dict)
    motors: dict[str, Motor] = field(default_factory=dict)
    forces: dict[str, Force] = field(default_factory=dict)
    simulation: fm.Simulation | None = None
    configuration: fm.Configuration = fm.DRAWN

    def curve(self, blueprint: Blueprint) -> fm.Curve:
        """The curve that the blueprint asks for."""
        if blueprint.control == "path":
            (end,) = blueprint.samples
            return self.follow(blueprint, fm.Until(displacement=end, frames=blueprint.most))
        part, shared = self._loads(blueprint)
        return self.simulation.load_displacement(part, **{blueprint.control: blueprint.samples}, **shared)

    def follow(self, blueprint: Blueprint, until: fm.Until, steps: fm.ArcSteps | None = None) -> fm.Curve:
        """A path of the blueprint's forces."""
        part, shared = self._loads(blueprint)
        return self.simulation.follow(part, until=until, steps=steps, **shared)

    def _loads(self, blueprint: Blueprint) -> tuple[Force | fm.ForceGroup, dict]:
        """The forces that change, and options of every curve."""
        led = len(blueprint.ratios)
        parts = [self.forces[plan.name] for plan in blueprint.forces[:led]]
        part = fm.ForceGroup("loads", dict(zip(parts, blueprint.ratios, strict=True))) if led > 1 else parts[0]
        others = {self.forces[plan.name]: plan.magnitude for plan in blueprint.forces[led:]}
        return part, {"configuration": self.configuration, "others": others}


def build(blueprint: Blueprint) -> Built:
    """The simulation of a blueprint.

    Raises:
        FenicsmechError: the package refuses it.
    """
    mechanism = fm.Mechanism(blueprint.topology)
    built = Built(mechanism)
    density = next((plan.density for plan in blueprint.effects if isinstance(plan, GravityPlan)), None)
    for link in blueprint.links:
        if not link.centreline:
            built.links[link.name] = mechanism.rigid(link.name, fixed=link.fixed)
            continue
        law = getattr(fm, link.law)(link.young, link.poisson)
        material = fm.Material(f"material of {link.name}", law=law, density=density)
        shape = fm.strip(link.centreline, thickness=link.thickness, depth=link.depth)
        built.links[link.name] = mechanism.flexible(link.name, shape, material)
    for joint in blueprint.joints:
        built.joints[joint.name] = _join(mechanism, joint, built.links)
    for motor in blueprint.motors:
        built.motors[motor.joint] = mechanism.motor(built.joints[motor.joint])
    for force in blueprint.forces:
        built.forces[force.name] = mechanism.force(
            on=built.links[force.on], at=force.at, direction=force.direction, name=force.name
        )
    scene = fm.Scene(mechanism, effects=[_effect(plan, built) for plan in blueprint.effects])
    built.simulation = fm.Simulation(
        scene,
        space=blueprint.space,
        order=blueprint.order,
        size={built.links[link.name]: link.size for link in blueprint.flexible},
        comm=MPI.COMM_SELF,
    )
    if blueprint.motors:
        positions = {built.motors[motor.joint]: motor.position for motor in blueprint.motors}
        built.configuration = scene.configuration("posed", positions)
    return built


def _join(mechanism: fm.Mechanism, joint: JointPlan, links: Mapping[str, object]):
    options = {} if joint.axis is None else {"axis": joint.axis}
    match joint.interface:
        case Clamp(length=length, width=width, angle=angle):
            options["region"] = fm.Rectangle(length, width, angle)
        case radius if radius is not None:
            options["interface_radius"] = radius
    return getattr(mechanism, joint.kind)(links[joint.a], links[joint.b], at=joint.at, name=joint.name, **options)


def _effect(plan: EffectPlan, built: Built):
    match plan:
        case SpringPlan(joint=joint, stiffness=stiffness, rest=rest):
            return fm.JointSpring(built.joints[joint], stiffness, rest=rest)
        case CompliancePlan(joint=joint, compliance=compliance):
            return fm.JointCompliance(built.joints[joint], compliance)
        case GravityPlan(acceleration=acceleration):
            return fm.Gravity(acceleration)
        case PressurePlan(link=link, pressure=pressure):
            return fm.Pressure(built.links[link], pressure)
        case PrestrainPlan(link=link, stretch=stretch, along=along):
            return fm.Prestrain(built.links[link], stretch, along=along)
        case ContactPlan(link=link, obstacle=obstacle, stiffness=stiffness, points=points):
            return fm.Contact(built.links[link], _obstacle(obstacle), stiffness=stiffness, points=points)


def _obstacle(plan: PlanePlan | CylinderPlan) -> fm.HalfPlane | fm.Cylinder:
    match plan:
        case PlanePlan(point=point, normal=normal):
            return fm.HalfPlane(point, normal)
        case CylinderPlan(centre=centre, radius=radius):
            return fm.Cylinder(centre, radius)
