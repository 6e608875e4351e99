"""From a design problem of a script to the project of a live page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fenicsmech.design import DesignProblem, SplineDesign, Target
from fenicsmech.effects import Gravity, JointSpring, Temperature
from fenicsmech.errors import DescriptionError
from fenicsmech.laws import NeoHookean
from fenicsmech.live.build import material_of
from fenicsmech.live.project import FORMAT, Project, materials, read_project
from fenicsmech.live.schema import Refused
from fenicsmech.mechanism import (
    Configuration,
    Disc,
    Effect,
    FlexibleLink,
    Force,
    Line,
    Link,
    Material,
    Outline,
    Region,
    Shape,
    Strip,
    Units,
)

_REMEDY = "Describe it with what the live page knows: python3 -m fenicsmech.live shows a project"
_SPACES = {"plane-stress": "plane-stress", "plane-strain": "plane-strain", "3d": "plane-stress"}


def project_of(problem: DesignProblem) -> Project:
    """A design problem as a project; problems in 3D in plane stress.

    Raises:
        DescriptionError: a part of it is nothing that the page knows.
    """
    simulation, scene = problem.simulation, problem.simulation.scene
    mechanism, fidelity = scene.mechanism, simulation.fidelity
    part = f"live page of {mechanism.name!r}"
    if scene.units != Units():
        raise DescriptionError(part, f"its units are {scene.units}", "Describe it in mm and N")
    designs = {own.link: own for own in problem.designs if isinstance(own, SplineDesign)}
    for design in designs.values():
        if design.same or design.mirrored or design.centreline or design.ends or design.ends_move:
            raise DescriptionError(part, f"the design of {design.link.name!r} has further options", _REMEDY)
    if len(designs) < len(problem.designs):
        raise DescriptionError(part, "numbers of parts change as well", _REMEDY)
    curves: dict[tuple[Force, Configuration], dict[str, Any]] = {}
    targets = [_target(part, own, curves) for own in problem.targets]
    data = {
        "format": FORMAT,
        "name": mechanism.name,
        "links": [_link(part, link, designs) for link in mechanism.links],
        "joints": [
            {
                "name": joint.name,
                "kind": joint.kind.name,
                "a": joint.a.name,
                "b": joint.b.name,
                "at": list(joint.at[:2]),
                "axis": list(joint.axis[:2]) if joint.kind.sliding else None,
                "region": _region(next((own for own in joint.regions if own is not None), None)),
            }
            for joint in mechanism.joints
        ],
        "motors": [{"name": own.name, "joint": own.joint.name} for own in mechanism.motors],
        "forces": [
            {"name": own.name, "on": own.on.name, "at": list(own.at[:2]), "direction": list(own.direction[:2])}
            for own in mechanism.forces
        ],
        "effects": [_effect(part, own) for own in scene.effects],
        "curves": list(curves.values()),
        "targets": targets,
        "simulation": {
            "space": _SPACES.get(fidelity.model.name, "plane-stress"),
            "size": float(min(fidelity.sizes.values())),
            "order": fidelity.order,
        },
        "design": None,
        "fit": True,
    }
    if any(own.region is not None for own in mechanism.forces):
        raise DescriptionError(part, "a force acts on a region", _REMEDY)
    try:
        return read_project(data)
    except Refused as refused:
        raise DescriptionError(part, str(refused), _REMEDY) from None


def _target(part: str, target: Target, curves: dict[tuple[Force, Configuration], dict[str, Any]]) -> dict[str, Any]:
    """A target, whose curve is added if it is new, and reaches to its largest target."""
    found = target.on_curve
    if found is None or not found[1]:
        raise DescriptionError(part, f"the target of the {target.name} is no point of a curve", _REMEDY)
    force, magnitude, displacement, configuration = found
    curve = curves.setdefault(
        (force, configuration),
        {
            "name": configuration.name if len(curves) == 0 else f"{configuration.name} {len(curves) + 1}",
            "force": force.name,
            "largest": magnitude,
            "steps": 12,
            "positions": {motor.name: value for motor, value in configuration.positions},
            "others": {},
        },
    )
    if abs(magnitude) > abs(curve["largest"]):
        curve["largest"] = magnitude
    number = list(curves).index((force, configuration))
    return {"curve": number, "force": magnitude, "displacement": displacement, "weight": target.weight}


def _link(part: str, link: Link, designs: Mapping[FlexibleLink, SplineDesign]) -> dict[str, Any]:
    if not isinstance(link, FlexibleLink):
        return {"kind": "rigid", "name": link.name, "fixed": link.fixed}
    design = designs.get(link)
    return {
        "kind": "flexible",
        "name": link.name,
        "shape": _shape(part, link.name, link.shape),
        "material": _material(part, link.material),
        "design": design
        and {"segments": design.segments, "thickness": None if design.thickness is None else list(design.thickness)},
    }


def _shape(part: str, name: str, shape: Shape) -> dict[str, Any]:
    if isinstance(shape, Strip):
        line = [list(point) for point in shape.centreline]
        return {"kind": "strip", "line": line, "thickness": shape.thickness, "depth": shape.depth}
    if isinstance(shape, Outline) and all(isinstance(own, Line) for own in shape.segments):
        corners = [list(shape.start), *(list(own.end) for own in shape.segments[:-1])]
        return {"kind": "polygon", "corners": corners, "depth": shape.depth}
    raise DescriptionError(part, f"{name!r} is neither a strip nor a polygon", _REMEDY)


def _material(part: str, material: Material) -> Any:
    for name in materials():
        if material_of(name) == material:
            return name
    if not isinstance(material.law, NeoHookean):
        raise DescriptionError(part, f"{material.name!r} has the law {type(material.law).__name__}", _REMEDY)
    return {"name": material.name, "E": material.law.E, "nu": material.law.nu, "density": material.density}


def _region(region: Region | None) -> dict[str, Any] | None:
    if region is None:
        return None
    if isinstance(region, Disc):
        return {"kind": "disc", "radius": region.radius}
    return {"kind": "rectangle", "length": region.length, "width": region.width, "angle": region.angle}


def _effect(part: str, effect: Effect) -> dict[str, Any]:
    if isinstance(effect, Gravity) and not effect.masses:
        return {"kind": "gravity", "acceleration": list(effect.acceleration[:2])}
    if isinstance(effect, JointSpring):
        return {"kind": "joint spring", "joint": effect.joint.name, "stiffness": effect.stiffness, "rest": effect.rest}
    if isinstance(effect, Temperature) and effect.links is None and isinstance(effect.change, float):
        return {"kind": "temperature", "change": effect.change}
    raise DescriptionError(part, f"{effect.explain()} is no effect that it knows", _REMEDY)
