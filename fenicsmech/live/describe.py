"""From a design problem of a script to the project of a live page.

What the page edits becomes the entries that it knows; everything else is carried as it is (``carried``). Each sample of
a target gives a curve that goes through it.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np

from fenicsmech.design import DEFAULT_REGULARISER, Comparison, DesignProblem, DesignResult, SplineDesign, Target
from fenicsmech.design import Number as NumberDesigned
from fenicsmech.effects import Gravity, JointSpring, Temperature
from fenicsmech.elasticity import PLANE_STRESS, MixedFormulation, Quadrature
from fenicsmech.errors import DescriptionError
from fenicsmech.joints import JOINT_KINDS
from fenicsmech.laws import NeoHookean
from fenicsmech.live.build import draw, material_of
from fenicsmech.live.carried import plain
from fenicsmech.live.project import FORMAT, LARGEST_FILE, Project, materials, read_project
from fenicsmech.live.schema import Refused
from fenicsmech.mechanism import (
    Configuration,
    Disc,
    Effect,
    FlexibleLink,
    Force,
    ForceGroup,
    Joint,
    Line,
    Link,
    Material,
    MeshPart,
    Output,
    Region,
    Shape,
    StepPart,
    Strip,
    Units,
)
from fenicsmech.meshing import LEAST_SEGMENTS
from fenicsmech.quantities import ForceMagnitude, Sample
from fenicsmech.simulation import Simulation

_SMALLER = "Choose larger elements, or give files with fewer faces or elements"
_REMEDY = "Describe it with what the live page knows: python3 -m fenicsmech.live shows a project"


def project_of(problem: DesignProblem, result: DesignResult | None = None) -> Project:
    """A design problem as a project; problems in 3D that plane stress can describe in plane stress.

    Args:
        problem: with its simulation.
        result: whose shape the project has; the drawn one by default.

    Raises:
        DescriptionError: a part of it has no plain data, or is more than the page shows; the result belongs to another
            problem.
    """
    mechanism = problem.simulation.scene.mechanism
    part = f"live page of {mechanism.name!r}"
    try:
        project = read_project(_data(problem))
    except Refused as refused:
        remedy = _SMALLER if refused.place in ("", "simulation.size") else _REMEDY
        raise DescriptionError(part, str(refused), remedy) from None
    except DescriptionError as error:
        raise DescriptionError(part, error.problem, error.remedy) from None
    if result is None:
        return project
    own = draw(project).along_curves(project)
    assert own is not None, "a problem has designs"
    placement = own.placement(result)
    design = {"offsets": (placement.p - own.initial).tolist(), "handles": placement.theta.tolist()}
    return {**project, "design": design}


def _data(problem: DesignProblem) -> Project:
    """The project of a problem, not checked."""
    simulation, scene = problem.simulation, problem.simulation.scene
    mechanism = scene.mechanism
    if scene.units != Units():
        raise DescriptionError("units", f"its units are {scene.units}", "Describe it in mm and N")
    designs = {own.link: own for own in problem.designs if isinstance(own, SplineDesign)}
    numbers = [own for own in problem.designs if isinstance(own, NumberDesigned)]
    curves = _Curves()
    targets, requirements = list[dict[str, Any]](), list[dict[str, Any]]()
    compared = Comparison(problem.targets, scene.units)
    for target, usual in zip(problem.targets, compared.scales.tolist(), strict=True):
        curve = None if target.sample is None else curves.through(target.sample)
        point = _point(target)
        if curve is not None and point is not None:
            given = usual if target.scale is None and not target.wanted[0] else target.scale
            scale = {} if given is None else {"scale": given}
            targets.append({"curve": curve, **point, "weight": target.weight, **scale})
        else:
            requirements.append({"name": _words(target), "data": plain(target)})
    if not curves.found:
        remedy = "Give a target under a force, whose curve the page shows"
        raise DescriptionError("targets", "no force acts in the samples of its targets", remedy)
    more = {
        "outputs": [_load(own) for own in mechanism.outputs],
        "requirements": requirements,
        "numbers": [{"name": str(own), "data": plain(own)} for own in numbers],
    }
    if problem.regulariser != DEFAULT_REGULARISER:
        more["regulariser"] = plain(problem.regulariser)
    return {
        "format": FORMAT,
        "name": mechanism.name,
        "links": [_link(link, simulation, designs) for link in mechanism.links],
        "joints": [_joint(joint) for joint in mechanism.joints],
        "motors": [{"name": own.name, "joint": own.joint.name} for own in mechanism.motors],
        "forces": [_load(own) for own in mechanism.forces],
        "effects": [_effect(own) for own in scene.effects],
        "curves": curves.found,
        "targets": targets,
        "simulation": _simulation(simulation, flat=problem.fits_plane_stress),
        "design": None,
        "fit": True,
        **{key: value for key, value in more.items() if value},
    }


def _point(target: Target) -> dict[str, float] | None:
    """Force and displacement of a target that is a point of a load–displacement curve; None of others."""
    sample = target.sample
    if sample is not None and sample.moved and target.relation == "equals":
        force, displacement = sample.moved
        if target.quantity == ForceMagnitude(force) and displacement:
            return {"force": target.wanted[0], "displacement": displacement}
    if (found := target.on_curve) is not None and found[1]:
        return {"force": found[1], "displacement": found[2]}
    return None


class _Curves:
    """The curves of a project, that go through the samples of targets.

    Attributes:
        found: as the project has them.
    """

    def __init__(self) -> None:
        self.found: list[dict[str, Any]] = []
        self._keys: list[Hashable] = []

    def through(self, sample: Sample) -> int | None:
        """The number of the curve through a sample, added if it is new; None if no force acts there."""
        part, value = sample.part, sample.value
        if not value or not part.ratios:
            return None
        configuration, held, others = sample.configuration, sample.moved is not None, dict(sample.others)
        key = (part.ratios, configuration, held, sample.others, value > 0.0)
        if key not in self._keys:
            self._keys.append(key)
            self.found.append(self._curve(part, configuration, held=held, largest=value, others=others))
        number = self._keys.index(key)
        own = self.found[number]
        if abs(value) > abs(own["largest"]):
            own["largest"] = value
        return number

    def _curve(
        self,
        part: Force | ForceGroup,
        configuration: Configuration,
        *,
        held: bool,
        largest: float,
        others: Mapping[Force, float],
    ) -> dict[str, Any]:
        first, name = part.ratios[0][0], configuration.name[:50]
        more: dict[str, Any] = {"held": True} if held else {}
        if isinstance(part, ForceGroup):
            more["ratios"] = {force.name: ratio for force, ratio in part.ratios}
        return {
            "name": f"{name} {len(self.found) + 1}" if name in [own["name"] for own in self.found] else name,
            "force": first.name,
            "largest": largest,
            "steps": 12,
            "positions": {motor.name: position for motor, position in configuration.positions},
            "others": {force.name: magnitude for force, magnitude in others.items()},
            **more,
        }


def _words(target: Target) -> str:
    """A target in words."""
    wanted = ", ".join(f"{value:.6g}" for value in target.wanted)
    relation = {"equals": f"is {wanted}", "least": "as small as possible"}.get(target.relation)
    return f"{target.name} {relation or f'{target.relation} {wanted}'}"[:400]


def _simulation(simulation: Simulation, *, flat: bool) -> dict[str, Any]:
    fidelity = simulation.fidelity
    model, size = fidelity.model, float(min(fidelity.sizes.values()))
    found = {"space": PLANE_STRESS.name if flat else model.name, "size": size, "order": fidelity.order}
    if any(own != size for own in fidelity.sizes.values()):
        found["sizes"] = {link.name: own / size for link, own in fidelity.sizes.items()}
    if fidelity.layers is not None and not flat:
        found["layers"] = fidelity.layers
    if fidelity.segments != LEAST_SEGMENTS:
        found["segments"] = fidelity.segments
    if fidelity.quadrature != Quadrature.for_order(fidelity.order, model.dim):
        found["quadrature"] = plain(fidelity.quadrature)
    if fidelity.formulation != MixedFormulation():
        found["formulation"] = plain(fidelity.formulation)
    return found


def _link(link: Link, simulation: Simulation, designs: Mapping[FlexibleLink, SplineDesign]) -> dict[str, Any]:
    if not isinstance(link, FlexibleLink):
        return {"kind": "rigid", "name": link.name, "fixed": link.fixed}
    return {
        "kind": "flexible",
        "name": link.name,
        "shape": _shape(link.name, simulation.shapes[link]),
        "material": _material(simulation.materials[link]),
        "design": _design(designs[link]) if link in designs else None,
    }


def _design(design: SplineDesign) -> dict[str, Any]:
    more = {
        "bend": None if design.bend == SplineDesign.bend else design.bend,
        **{
            name: np.array(own, dtype=float).tolist()
            for name, own in (("centreline", design.centreline), ("ends", design.ends))
            if own is not None
        },
        "ends_move": design.ends_move,
        **{name: [link.name for link in getattr(design, name)] for name in ("same", "mirrored")},
    }
    thickness = None if design.thickness is None else list(design.thickness)
    return {"segments": design.segments, "thickness": thickness, **{key: own for key, own in more.items() if own}}


def _joint(joint: Joint) -> dict[str, Any]:
    if JOINT_KINDS.get(joint.kind.name) is not joint.kind:
        remedy = f"Use one of the kinds {', '.join(JOINT_KINDS)}"
        raise DescriptionError(f"{joint.name!r}", f"{joint.name!r} is of a kind of its own, {joint.kind.name}", remedy)
    axis = None if joint.axis == (0.0, 0.0, 1.0) else list(joint.axis if joint.axis[2] else joint.axis[:2])
    return {
        "name": joint.name,
        "kind": joint.kind.name,
        "a": joint.a.name,
        "b": joint.b.name,
        "at": list(joint.at[:2]),
        "axis": axis,
        "region": _region(next((own for own in joint.regions if own is not None), None)),
        **_height(joint.at),
    }


def _load(load: Force | Output) -> dict[str, Any]:
    direction = list(load.direction if any(load.direction[2:]) else load.direction[:2])
    own = {"name": load.name, "on": load.on.name, "at": list(load.at[:2]), "direction": direction, **_height(load.at)}
    return own if load.region is None else {**own, "region": plain(load.region)}


def _height(at: Sequence[float]) -> dict[str, float]:
    return {"z": at[2]} if len(at) == 3 else {}


def _shape(name: str, shape: Shape) -> dict[str, Any]:
    if isinstance(shape, Strip):
        line = [list(point) for point in shape.centreline]
        return {"kind": "strip", "line": line, "thickness": shape.thickness, "depth": shape.depth}
    if isinstance(shape, StepPart | MeshPart):
        own = {"name": shape.path.name, "content": _content(name, shape), "depth": shape.depth}
        if isinstance(shape, MeshPart):
            return {"kind": "mesh", **own}
        return {"kind": "step", **own, "section": shape.section}
    if all(isinstance(own, Line) for own in shape.segments) and shape.segments[-1].end == shape.start:
        corners = [list(shape.start), *(list(own.end) for own in shape.segments[:-1])]
        return {"kind": "polygon", "corners": corners, "depth": shape.depth}
    return {"kind": "outline", "data": plain(shape), "depth": shape.depth}


def _content(name: str, shape: StepPart | MeshPart) -> str:
    """The file of a link, compressed, in base64."""
    try:
        found = base64.b64encode(zlib.compress(shape.path.read_bytes(), 9)).decode()
    except OSError as error:
        problem = f"the file of {name!r} cannot be read: {error.strerror}"
        raise DescriptionError(name, problem, "Give its path") from None
    if len(found) > LARGEST_FILE:
        size = f"{len(found)} characters when compressed, not at most {LARGEST_FILE}"
        raise DescriptionError(name, f"the file of {name!r} has {size}", "Give a file with fewer faces or elements")
    return found


def _material(material: Material) -> Any:
    for name in materials():
        if material_of(name) == material:
            return name
    law = material.law
    if isinstance(law, NeoHookean):
        if Material(material.name, law.E, law.nu, density=material.density) == material:
            return {"name": material.name, "E": law.E, "nu": law.nu, "density": material.density}
    return {"name": material.name, "data": plain(material)}


def _region(region: Region | None) -> dict[str, Any] | None:
    if region is None:
        return None
    if isinstance(region, Disc):
        return {"kind": "disc", "radius": region.radius}
    return {"kind": "rectangle", "length": region.length, "width": region.width, "angle": region.angle}


def _effect(effect: Effect) -> dict[str, Any]:
    if isinstance(effect, Gravity) and not effect.masses and not any(effect.acceleration[2:]):
        return {"kind": "gravity", "acceleration": list(effect.acceleration[:2])}
    if isinstance(effect, JointSpring):
        return {"kind": "joint spring", "joint": effect.joint.name, "stiffness": effect.stiffness, "rest": effect.rest}
    if isinstance(effect, Temperature) and effect.links is None and isinstance(effect.change, float):
        return {"kind": "temperature", "change": effect.change}
    return {"kind": "carried", "text": effect.explain()[:300], "data": plain(effect)}
