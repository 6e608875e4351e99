"""A random scene as plain data that can be printed, spoiled and described in any order, and its making.

Numbers stay as they are until ``build`` hands them to the package: whatever is wrong with them, the package must say.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, field

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
class GravityPlan:
    """Weight of all flexible links, of one density."""

    acceleration: Point
    density: float


EffectPlan = SpringPlan | CompliancePlan | GravityPlan


@dataclass(frozen=True)
class Blueprint:
    """A scene and the curve asked for.

    Attributes:
        topology: what kind of mechanism it is.
        control: "forces" or "displacements".
        samples: of the control.
        forces: the one that changes first.
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

    def link(self, name: str) -> LinkPlan:
        """The link of that name."""
        return next(link for link in self.links if link.name == name)

    def joint(self, name: str) -> JointPlan:
        """The joint of that name."""
        return next(joint for joint in self.joints if joint.name == name)

    @property
    def dim(self) -> int:
        """Dimension of the model."""
        return 3 if self.space == "3d" else 2

    @property
    def flexible(self) -> tuple[LinkPlan, ...]:
        """The links that bend."""
        return tuple(link for link in self.links if link.centreline)

    @property
    def length(self) -> float:
        """Largest distance between two joints along a coordinate."""
        return max(max(axis) - min(axis) for axis in zip(*(joint.at[:2] for joint in self.joints), strict=True))

    def shuffled(self, seed: int) -> Blueprint:
        """The same scene with links and joints in another order."""
        links, joints, order = list(self.links), list(self.joints), random.Random(seed)
        order.shuffle(links)
        order.shuffle(joints)
        return Blueprint(**{**self.__dict__, "links": tuple(links), "joints": tuple(joints)})


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
        first, *others = blueprint.forces
        return self.simulation.load_displacement(
            self.forces[first.name],
            configuration=self.configuration,
            others={self.forces[plan.name]: plan.magnitude for plan in others},
            **{blueprint.control: blueprint.samples},
        )


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
