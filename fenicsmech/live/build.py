"""From a project to a simulation and its design problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from fenicsmech.design import DesignProblem, HandlePlacement, SplineDesign, Target
from fenicsmech.effects import Gravity, JointSpring, Temperature
from fenicsmech.equilibrium import EquilibriumMethod
from fenicsmech.laws import NeoHookean
from fenicsmech.live.project import PAPER_NAMES, Project, forces_of, materials
from fenicsmech.mechanism import (
    DRAWN,
    ONYX,
    SMOOTH_SIL_950,
    Configuration,
    Disc,
    Effect,
    FlexibleLink,
    Force,
    Joint,
    Link,
    Material,
    Mechanism,
    Motor,
    Rectangle,
    Region,
    Scene,
    Shape,
    material,
    polygon,
    strip,
)
from fenicsmech.quantities import Displacement, JointPosition, MotorOffset, NumberKind, Sample
from fenicsmech.simulation import CurveRequest, Simulation, read_request

_PAPER = {"SMOOTH_SIL_950": SMOOTH_SIL_950, "ONYX": ONYX}


@dataclass(frozen=True, eq=False)
class Drawing:
    """The parts of a project's mechanism by their names, and its simulation."""

    links: Mapping[str, Link]
    joints: Mapping[str, Joint]
    motors: Mapping[str, Motor]
    forces: Mapping[str, Force]
    simulation: Simulation
    _problems: list[DesignProblem] = field(default_factory=list, init=False)

    def configuration(self, curve: Mapping[str, Any]) -> Configuration:
        """That of a curve."""
        if not curve["positions"]:
            return DRAWN
        return Configuration(curve["name"], {self.motors[k]: value for k, value in curve["positions"].items()})  # type: ignore[arg-type]

    def request(self, project: Project, number: int, forces: Sequence[float]) -> CurveRequest:
        """The request of a curve."""
        curve = project["curves"][number]
        return read_request(
            self.simulation.scene.mechanism,
            self.forces[curve["force"]],
            forces=forces,
            displacements=None,
            configuration=self.configuration(curve),
            others={self.forces[name]: value for name, value in curve["others"].items()},
        )

    def target(self, project: Project, number: int, force: float, displacement: float, weight: float = 1.0) -> Target:
        """A target on a curve."""
        curve = project["curves"][number]
        part = self.forces[curve["force"]]
        loads: dict[Any, Any] = {part: force} | {self.forces[k]: value for k, value in curve["others"].items()}
        sample = Sample(loads, self.configuration(curve))
        return Target(Displacement(part), sample, equals=displacement, weight=weight)

    def problem(self, project: Project) -> DesignProblem | None:
        """The design problem of a project's targets; None without targets or designs."""
        designs = self.designs(project)
        targets = [
            self.target(project, own["curve"], own["force"], own["displacement"], own["weight"])
            for own in project["targets"]
        ]
        return self._problem(designs, targets) if designs and targets else None

    def along_curves(self, project: Project, forces: Sequence[Sequence[float]] | None = None) -> DesignProblem | None:
        """The problem whose quantities are displacements: of all frames of all curves, or at some ``forces`` of each;
        None without designs."""
        designs = self.designs(project)
        forces = forces or [forces_of(project, number) for number in range(len(project["curves"]))]
        targets = [
            self.target(project, number, force, 1.0) for number, own in enumerate(forces) for force in own if force
        ]
        return self._problem(designs, targets) if designs else None

    def movable(self, project: Project) -> list[tuple[dict[str, Any], NumberKind]]:
        """What can be moved beside the shapes: joints that share a place along x and y, and motors; as the page names
        them, and as numbers."""
        places: dict[tuple[float, float], list[int]] = {}
        for k, own in enumerate(project["joints"]):
            places.setdefault(tuple(own["at"]), []).append(k)
        found: list[tuple[dict[str, Any], NumberKind]] = []
        for numbers in places.values():
            joints = [self.joints[project["joints"][k]["name"]] for k in numbers]
            for axis, direction in enumerate(((1.0, 0.0), (0.0, 1.0))):
                kind = JointPosition(*joints, direction=direction)
                found.append(({"kind": "joint", "joints": numbers, "axis": axis}, kind))
        return found + [({"kind": "motor", "name": name}, MotorOffset(own)) for name, own in self.motors.items()]

    def _problem(self, designs: Sequence[SplineDesign], targets: Sequence[Target]) -> DesignProblem:
        """A problem that shares the handles of the first one: links that change are part of the drawing."""
        if self._problems:
            return self._problems[0].with_targets(targets)
        self._problems.append(DesignProblem(self.simulation, designs, targets=targets))
        return self._problems[0]

    def designs(self, project: Project) -> list[SplineDesign]:
        """The links whose shape changes."""
        found = []
        for own in project["links"]:
            if own["kind"] == "flexible" and own["design"] is not None:
                link, bounds = self.links[own["name"]], own["design"]["thickness"]
                assert isinstance(link, FlexibleLink), "the project says so"
                found.append(SplineDesign(link, own["design"]["segments"], thickness=bounds and tuple(bounds)))
        return found


def draw(project: Project, method: EquilibriumMethod | None = None) -> Drawing:
    """The mechanism of a project with its simulation.

    Args:
        project: that describes it.
        method: for equilibria.

    Raises:
        FenicsmechError: it contradicts itself.
    """
    mechanism = Mechanism(project["name"])
    links: dict[str, Link] = {}
    for own in project["links"]:
        if own["kind"] == "rigid":
            links[own["name"]] = mechanism.rigid(own["name"], fixed=own["fixed"])
        else:
            made = mechanism.flexible(own["name"], _shape(own["shape"]), material_of(own["material"]))
            links[own["name"]] = made
    joints = {own["name"]: _join(mechanism, links, own) for own in project["joints"]}
    motors = {own["name"]: mechanism.motor(joints[own["joint"]], name=own["name"]) for own in project["motors"]}
    forces = {
        own["name"]: mechanism.force(on=links[own["on"]], at=own["at"], direction=own["direction"], name=own["name"])
        for own in project["forces"]
    }
    effects = [_effect(own, joints) for own in project["effects"]]
    options = project["simulation"]
    simulation = Simulation(
        Scene(mechanism, effects), space=options["space"], order=options["order"], size=options["size"], solver=method
    )
    return Drawing(links, joints, motors, forces, simulation)


def placement(project: Project, problem: DesignProblem | None) -> HandlePlacement | None:
    """The design that a project holds; None as drawn, or if it has another number of parameters."""
    design = project["design"]
    if problem is None or design is None or len(design["offsets"]) != len(problem.initial):
        return None
    return HandlePlacement(problem.initial + design["offsets"], np.array(design["handles"]))


def material_of(own: str | Mapping[str, Any]) -> Material:
    """A material by its name in ``materials()``, or with its numbers."""
    if not isinstance(own, str):
        return Material(own["name"], own["E"], own["nu"], density=own["density"])
    name = own
    return _PAPER[PAPER_NAMES[name]] if name in PAPER_NAMES else material(name)


@cache
def constants() -> dict[str, dict[str, float | None]]:
    """Those of the materials by their names, from which one of its own may start; of neo-Hookean ones."""
    laws = ((name, own.law, own.density) for name in materials() for own in [material_of(name)])
    return {
        name: {"E": law.E, "nu": law.nu, "density": density}
        for name, law, density in laws
        if isinstance(law, NeoHookean)
    }


def _shape(own: Mapping[str, Any]) -> Shape:
    if own["kind"] == "strip":
        return strip(own["line"], thickness=own["thickness"], depth=own["depth"])
    return polygon(own["corners"], depth=own["depth"])


def _region(own: Mapping[str, Any] | None) -> Region | None:
    if own is None:
        return None
    return Disc(own["radius"]) if own["kind"] == "disc" else Rectangle(own["length"], own["width"], own["angle"])


def _join(mechanism: Mechanism, links: Mapping[str, Link], own: Mapping[str, Any]) -> Joint:
    a, b, options = links[own["a"]], links[own["b"]], {"region": _region(own["region"]), "name": own["name"]}
    if not any(isinstance(link, FlexibleLink) for link in (a, b)):
        options["region"] = None
    if own["kind"] == "prismatic":
        return mechanism.prismatic(a, b, at=own["at"], axis=own["axis"], **options)
    join = mechanism.revolute if own["kind"] == "revolute" else mechanism.weld
    return join(a, b, at=own["at"], **options)


def _effect(own: Mapping[str, Any], joints: Mapping[str, Joint]) -> Effect:
    if own["kind"] == "gravity":
        return Gravity(tuple(own["acceleration"]))
    if own["kind"] == "temperature":
        return Temperature(own["change"])
    return JointSpring(joints[own["joint"]], own["stiffness"], rest=own["rest"])
