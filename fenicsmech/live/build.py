"""From a project to a simulation and its design problem."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any
from weakref import finalize

import numpy as np

from fenicsmech.design import DEFAULT_REGULARISER, DesignProblem, HandlePlacement, Number, SplineDesign, Target
from fenicsmech.effects import Gravity, JointSpring, Temperature
from fenicsmech.equilibrium import EquilibriumMethod
from fenicsmech.errors import DescriptionError
from fenicsmech.joints import JOINT_KINDS
from fenicsmech.laws import NeoHookean
from fenicsmech.live.carried import made
from fenicsmech.live.project import (
    MOST_ELEMENTS,
    PAPER_NAMES,
    Project,
    elements,
    elements_drawn,
    forces_of,
    materials,
    sampled,
    sized,
    too_many,
)
from fenicsmech.mechanism import (
    DRAWN,
    ONYX,
    SMOOTH_SIL_950,
    Configuration,
    Disc,
    Effect,
    FlexibleLink,
    Force,
    ForceGroup,
    Joint,
    Link,
    Material,
    Mechanism,
    MeshPart,
    Motor,
    Output,
    Rectangle,
    Region,
    Scene,
    Shape,
    StepPart,
    gmsh_mesh,
    material,
    polygon,
    step_file,
    strip,
)
from fenicsmech.meshing import plan_size
from fenicsmech.quantities import Displacement, ForceMagnitude, JointPosition, MotorOffset, NumberKind, Sample, at
from fenicsmech.simulation import CurveRequest, Simulation, read_request

_PAPER = {"SMOOTH_SIL_950": SMOOTH_SIL_950, "ONYX": ONYX}


FILES = {"step": "step", "mesh": "msh"}
"""Endings of the files of links, by the kind of their shape."""

MOST_BYTES = 50_000_000  # of a link's file


@dataclass(frozen=True, eq=False)
class Drawing:
    """The parts of a project's mechanism by their names, and its simulation."""

    links: Mapping[str, Link]
    joints: Mapping[str, Joint]
    motors: Mapping[str, Motor]
    forces: Mapping[str, Force]
    outputs: Mapping[str, Output]
    simulation: Simulation
    _problems: list[DesignProblem] = field(default_factory=list, init=False)

    @property
    def parts(self) -> dict[str, Mapping[str, Any]]:
        """All parts, for what is carried."""
        return {sort: getattr(self, sort) for sort in ("links", "joints", "motors", "forces", "outputs")}

    def configuration(self, curve: Mapping[str, Any]) -> Configuration:
        """That of a curve."""
        if not curve["positions"]:
            return DRAWN
        return Configuration(curve["name"], {self.motors[k]: value for k, value in curve["positions"].items()})  # type: ignore[arg-type]

    def request(self, project: Project, number: int, values: Sequence[float], *, pushed: bool = False) -> CurveRequest:
        """The request of a curve at its values, displacements where these are held unless it is ``pushed``."""
        curve = project["curves"][number]
        held = curve.get("held", False) and not pushed
        part: Force | ForceGroup = self.forces[curve["force"]]
        if "ratios" in curve and not pushed:
            part = ForceGroup(curve["name"], {self.forces[name]: own for name, own in curve["ratios"].items()})  # type: ignore[arg-type]
        return read_request(
            self.simulation.scene.mechanism,
            part,
            forces=None if held else values,
            displacements=values if held else None,
            configuration=self.configuration(curve),
            others={self.forces[name]: value for name, value in curve["others"].items()},
        )

    def target(
        self,
        project: Project,
        number: int,
        value: float,
        wanted: float,
        *,
        weight: float = 1.0,
        scale: float | None = None,
    ) -> Target:
        """A target on a curve: the displacement under a force, or the force where displacements are held."""
        curve = project["curves"][number]
        part = self.forces[curve["force"]]
        loads: dict[Any, Any] = {self.forces[k]: own for k, own in curve["others"].items()}
        if curve.get("held"):
            sample = Sample({part: at(value)} | loads, self.configuration(curve))
            return Target(ForceMagnitude(part), sample, equals=wanted, weight=weight, scale=scale)
        ratios = curve.get("ratios", {curve["force"]: 1.0})
        sample = Sample({self.forces[k]: own * value for k, own in ratios.items()} | loads, self.configuration(curve))
        return Target(Displacement(part), sample, equals=wanted, weight=weight, scale=scale)

    def problem(self, project: Project) -> DesignProblem | None:
        """The design problem of a project's targets and requirements; None without any or without designs."""
        designs = self.designs(project)
        targets = []
        for own in project["targets"]:
            number, options = own["curve"], {"weight": own["weight"], "scale": own.get("scale")}
            targets.append(self.target(project, number, *sampled(project["curves"][number], own), **options))
        targets += [made(own["data"], self.parts) for own in project.get("requirements", ())]
        return self._problem(project, designs, targets) if designs and targets else None

    def along_curves(self, project: Project, values: Sequence[Sequence[float]] | None = None) -> DesignProblem | None:
        """The problem whose quantities are those of all frames of all curves, or at some ``values`` of each; None
        without designs."""
        designs = self.designs(project)
        values = values or [forces_of(project, number) for number in range(len(project["curves"]))]
        pairs = [(number, value) for number, own in enumerate(values) for value in own if value]
        targets = [self.target(project, number, value, 1.0) for number, value in pairs]
        return self._problem(project, designs, targets) if designs else None

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

    def _problem(
        self, project: Project, designs: Sequence[SplineDesign | Number], targets: Sequence[Target]
    ) -> DesignProblem:
        """A problem that shares the handles of the first one: links that change are part of the drawing."""
        if self._problems:
            return self._problems[0].with_targets(targets)
        own = project.get("regulariser")
        regulariser = DEFAULT_REGULARISER if own is None else made(own, self.parts)
        self._problems.append(DesignProblem(self.simulation, designs, targets=targets, regulariser=regulariser))
        return self._problems[0]

    def designs(self, project: Project) -> list[SplineDesign | Number]:
        """The links whose shape changes, and the numbers that do."""
        found: list[SplineDesign | Number] = []
        for own in project["links"]:
            if own["kind"] == "flexible" and own["design"] is not None:
                given = dict(own["design"])
                segments, bounds = given.pop("segments"), given.pop("thickness")
                for key in {"same", "mirrored"} & given.keys():
                    given[key] = [self.links[name] for name in given[key]]
                link = self.links[own["name"]]
                assert isinstance(link, FlexibleLink), "the project says so"
                found.append(SplineDesign(link, segments, thickness=bounds and tuple(bounds), **given))
        return [*found, *(made(own["data"], self.parts) for own in project.get("numbers", ()))]


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
    filed = any("content" in own.get("shape", ()) for own in project["links"])
    folder = Path(mkdtemp(prefix="fenicsmech-")) if filed else None
    for k, own in enumerate(project["links"]):
        if own["kind"] == "rigid":
            links[own["name"]] = mechanism.rigid(own["name"], fixed=own["fixed"])
        else:
            shape = _shape(own["shape"], folder and folder / f"{k}")
            links[own["name"]] = mechanism.flexible(own["name"], shape, material_of(own["material"]))
    if filed:
        _check_size(project, links)
    joints = {own["name"]: _join(mechanism, links, own) for own in project["joints"]}
    motors = {own["name"]: mechanism.motor(joints[own["joint"]], name=own["name"]) for own in project["motors"]}
    parts: dict[str, Mapping[str, Any]] = {"links": links, "joints": joints, "motors": motors}
    forces = {own["name"]: mechanism.force(**_load(own, parts)) for own in project["forces"]}
    outputs = {own["name"]: mechanism.output(**_load(own, parts)) for own in project.get("outputs", ())}
    parts |= {"forces": forces, "outputs": outputs}
    effects = [_effect(own, joints, parts) for own in project["effects"]]
    options = dict(project["simulation"])
    if "sizes" in options:
        ratios = options.pop("sizes")
        options["size"] = {links[name]: ratio * options["size"] for name, ratio in ratios.items()}
    options |= {key: made(options[key], parts) for key in ("quadrature", "formulation") if key in options}
    simulation = Simulation(Scene(mechanism, effects), solver=method, **options)
    drawing = Drawing(links, joints, motors, forces, outputs, simulation)
    if folder is not None:  # it is read when links are meshed
        finalize(drawing, rmtree, folder, ignore_errors=True)
    return drawing


def _check_size(project: Project, links: Mapping[str, Link]) -> None:
    """Refuses too many elements of links from files, before these are meshed."""
    count = elements_drawn(project)
    for own, size in sized(project):
        link = links[own["name"]]
        if isinstance(link, FlexibleLink) and isinstance(link.shape, StepPart | MeshPart):
            area, given = plan_size(link.shape, f"link {link.name!r}")
            count += elements(area, size) + given
    if count > MOST_ELEMENTS:
        remedy = "Choose larger elements, or give files with fewer"
        raise DescriptionError("elements of links from files", too_many(project, count), remedy)


def placement(project: Project, problem: DesignProblem | None) -> HandlePlacement | None:
    """The design that a project holds; None as drawn, or if it has another number of parameters."""
    design = project["design"]
    if problem is None or design is None or len(design["offsets"]) != len(problem.initial):
        return None
    return HandlePlacement(problem.initial + design["offsets"], np.array(design["handles"]))


def material_of(own: str | Mapping[str, Any]) -> Material:
    """A material by its name in ``materials()``, or with its numbers."""
    if isinstance(own, str):
        return _PAPER[PAPER_NAMES[own]] if own in PAPER_NAMES else material(own)
    if "data" in own:
        return made(own["data"], {})
    return Material(own["name"], own["E"], own["nu"], density=own["density"])


@cache
def constants() -> dict[str, dict[str, float | None]]:
    """Those of the materials by their names, from which one of its own may start; of neo-Hookean ones."""
    laws = ((name, own.law, own.density) for name in materials() for own in [material_of(name)])
    return {
        name: {"E": law.E, "nu": law.nu, "density": density}
        for name, law, density in laws
        if isinstance(law, NeoHookean)
    }


def content_of(shape: Mapping[str, Any]) -> bytes:
    """The content of a link's file.

    Raises:
        DescriptionError: it is not compressed as the page does it, or too large.
    """
    part, remedy = f"file {shape['name']!r}", "Open a project that was saved by the page"
    try:
        reader = zlib.decompressobj()
        found = reader.decompress(base64.b64decode(shape["content"], validate=True), MOST_BYTES)
    except (ValueError, zlib.error):
        raise DescriptionError(part, "its content cannot be read", remedy) from None
    if reader.unconsumed_tail:
        problem = f"it has more than {MOST_BYTES} bytes"
        raise DescriptionError(part, problem, "Give a file with fewer faces or elements")
    return found


def _shape(own: Mapping[str, Any], file: Path | None = None) -> Shape:
    """The shape of a link; its ``file`` is written where it is from one."""
    if own["kind"] == "strip":
        return strip(own["line"], thickness=own["thickness"], depth=own["depth"])
    if own["kind"] == "polygon":
        return polygon(own["corners"], depth=own["depth"])
    if own["kind"] == "outline":
        return replace(made(own["data"], {}), depth=own["depth"])
    assert file is not None, "the drawing has a folder"
    path = file.with_suffix(f".{FILES[own['kind']]}")
    path.write_bytes(content_of(own))
    if own["kind"] == "step":
        return step_file(path, depth=own["depth"], section=own["section"])
    return gmsh_mesh(path, depth=own["depth"])


def _region(own: Mapping[str, Any] | None) -> Region | None:
    if own is None:
        return None
    return Disc(own["radius"]) if own["kind"] == "disc" else Rectangle(own["length"], own["width"], own["angle"])


def _join(mechanism: Mechanism, links: Mapping[str, Link], own: Mapping[str, Any]) -> Joint:
    a, b = links[own["a"]], links[own["b"]]
    region = _region(own["region"]) if any(isinstance(link, FlexibleLink) for link in (a, b)) else None
    axis = {} if own["axis"] is None else {"axis": own["axis"]}
    return mechanism.join(JOINT_KINDS[own["kind"]], a, b, at=place_of(own), region=region, name=own["name"], **axis)


def place_of(own: Mapping[str, Any]) -> list[float]:
    """The place of a joint, force or output."""
    return [*own["at"], own["z"]] if "z" in own else own["at"]


def _load(own: Mapping[str, Any], parts: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Arguments of a force or output."""
    region = {"region": made(own["region"], parts)} if "region" in own else {}
    on = parts["links"][own["on"]]
    return {"on": on, "at": place_of(own), "direction": own["direction"], "name": own["name"], **region}


def _effect(own: Mapping[str, Any], joints: Mapping[str, Joint], parts: Mapping[str, Mapping[str, Any]]) -> Effect:
    if own["kind"] == "gravity":
        return Gravity(tuple(own["acceleration"]))
    if own["kind"] == "temperature":
        return Temperature(own["change"])
    if own["kind"] == "joint spring":
        return JointSpring(joints[own["joint"]], own["stiffness"], rest=own["rest"])
    return made(own["data"], parts)
