"""The Python script that does what a project does: the same mechanism, design and curves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fenicsmech.live.project import PAPER_NAMES, Project, forces_of


def script(project: Project) -> str:
    """A script of the public API, complete in itself."""
    parts = _Parts(project)
    sections = (
        _head(project),
        [*_links(project, parts), *_joints(project, parts), *_drives(project, parts)],
        _simulation(project, parts),
        _configurations(project, parts),
        _problem(project, parts),
        *(_curve(project, parts, number) for number in range(len(project["curves"]))),
    )
    return "\n\n".join("\n".join(lines) for lines in sections if lines) + "\n"


class _Parts:
    """Identifiers of parts by their names, those of each sort.

    Names of links, joints, motors and forces become different identifiers, whatever they are.
    """

    def __init__(self, project: Project) -> None:
        self._taken: set[str] = set()
        self.links, self.joints, self.motors, self.forces = (
            {own["name"]: self._new(own["name"]) for own in project[sort]}
            for sort in ("links", "joints", "motors", "forces")
        )

    def _new(self, name: str) -> str:
        """An identifier that no other part has."""
        base = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in name.lower()).strip("_")
        base = f"part_{base}"
        found, k = base, 2
        while found in self._taken:
            found, k = f"{base}_{k}", k + 1
        self._taken.add(found)
        return found


# -- sections ---


def _head(project: Project) -> list[str]:
    title = f'"""{_plain(project["name"])}, as the live page left it."""'
    return [title, "", "import numpy as np", "", "import fenicsmech as fm"]


def _links(project: Project, parts: _Parts) -> list[str]:
    lines = [f"mechanism = fm.Mechanism({project['name']!r})"]
    for own in project["links"]:
        name = parts.links[own["name"]]
        if own["kind"] == "rigid":
            fixed = ", fixed=True" if own["fixed"] else ""
            lines.append(f"{name} = mechanism.rigid({own['name']!r}{fixed})")
        else:
            arguments = (repr(own["name"]), _shape(own["shape"]), _material(own["material"]))
            lines += [f"{name} = mechanism.flexible(", *(f"    {own}," for own in arguments), ")"]
    return lines


def _joints(project: Project, parts: _Parts) -> list[str]:
    lines, flexible = [], {own["name"] for own in project["links"] if own["kind"] == "flexible"}
    for own in project["joints"]:
        options = "" if own["axis"] is None or own["kind"] != "prismatic" else f", axis={tuple(own['axis'])}"
        if own["region"] is not None and {own["a"], own["b"]} & flexible:
            options += f", region={_region(own['region'])}"
        ends = f"{parts.links[own['a']]}, {parts.links[own['b']]}"
        place = f"{ends}, at={tuple(own['at'])}{options}, name={own['name']!r}"
        lines.append(f"{parts.joints[own['name']]} = mechanism.{own['kind']}({place})")
    return lines


def _drives(project: Project, parts: _Parts) -> list[str]:
    """Motors and forces."""
    lines = []
    for own in project["motors"]:
        joint = parts.joints[own["joint"]]
        lines.append(f"{parts.motors[own['name']]} = mechanism.motor({joint}, name={own['name']!r})")
    for own in project["forces"]:
        place = f"on={parts.links[own['on']]}, at={tuple(own['at'])}, direction={tuple(own['direction'])}"
        lines.append(f"{parts.forces[own['name']]} = mechanism.force({place}, name={own['name']!r})")
    return lines


def _simulation(project: Project, parts: _Parts) -> list[str]:
    effects, chosen = ", ".join(_effect(own, parts.joints) for own in project["effects"]), project["simulation"]
    options = f"space={chosen['space']!r}, order={chosen['order']}, size={chosen['size']}"
    return [f"scene = fm.Scene(mechanism, [{effects}])", f"sim = fm.Simulation(scene, {options})"]


def _configurations(project: Project, parts: _Parts) -> list[str]:
    lines = []
    for k, curve in enumerate(project["curves"]):
        positions = ", ".join(f"{parts.motors[name]}: {value}" for name, value in curve["positions"].items())
        made = f"scene.configuration({curve['name']!r}, {{{positions}}})" if positions else "fm.DRAWN"
        lines.append(f"configuration_{k} = {made}")
    return lines


def _problem(project: Project, parts: _Parts) -> list[str]:
    """The design problem, and the simulation and the files of the shape that the project holds."""
    designs = [
        f"fm.SplineDesign({parts.links[own['name']]}, segments={own['design']['segments']}{_bounds(own['design'])})"
        for own in project["links"]
        if own["kind"] == "flexible" and own["design"] is not None
    ]
    if not designs or not (project["targets"] or (project["design"] and project["curves"])):
        return []
    targets, note = project["targets"], []
    if not targets:  # a problem has at least one
        targets = [{"curve": 0, "force": forces_of(project, 0)[-1], "displacement": 1.0, "weight": 1.0}]
        note = ["# the page has no targets: this one keeps the place of those to come"]
    lines = [f"designs = [{', '.join(designs)}]", *note, "targets = ["]
    for own in targets:
        lines += _target(own, project["curves"][own["curve"]], parts)
    lines += ["]", "problem = fm.DesignProblem(sim, designs, targets=targets)"]
    if project["design"] is not None:
        offsets = ", ".join(f"{value:.9g}" for value in project["design"]["offsets"])
        lines += [
            "",
            "# the shape that the page shows; problem.optimise(start=found) goes on from there",
            f"found = problem.initial + np.array([{offsets}])",
            "sim = sim.with_design(problem.rest_shape(found))",
            'problem.export("links", found)',
        ]
    return lines


def _target(own: Mapping[str, Any], curve: Mapping[str, Any], parts: _Parts) -> list[str]:
    loads = {curve["force"]: own["force"], **curve["others"]}
    sample = ", ".join(f"{parts.forces[force]}: {value}" for force, value in loads.items())
    return [
        "    fm.Target(",
        f"        fm.Displacement({parts.forces[curve['force']]}),",
        f"        fm.Sample({{{sample}}}, configuration_{own['curve']}),",
        f"        equals={own['displacement']},",
        f"        weight={own['weight']},",
        "    ),",
    ]


def _curve(project: Project, parts: _Parts, number: int) -> list[str]:
    curve = project["curves"][number]
    others = ", ".join(f"{parts.forces[name]}: {value}" for name, value in curve["others"].items())
    return [
        f"curve_{number} = sim.load_displacement(",
        f"    {parts.forces[curve['force']]},",
        f"    forces={forces_of(project, number)},",
        f"    configuration=configuration_{number},",
        f"    others={{{others}}},",
        ")",
        f"print(*curve_{number}.displacements)",
        f'curve_{number}.plot("curve-{number}.png")',
    ]


# -- expressions ---


def _plain(text: str) -> str:
    return text.replace("\\", "/").replace('"', "'")


def _shape(own: Mapping[str, Any]) -> str:
    if own["kind"] == "strip":
        line = ", ".join(map(str, map(tuple, own["line"])))
        return f"fm.strip([{line}], thickness={own['thickness']}, depth={own['depth']})"
    return f"fm.polygon([{', '.join(map(str, map(tuple, own['corners'])))}], depth={own['depth']})"


def _material(own: str | Mapping[str, Any]) -> str:
    if not isinstance(own, str):
        density = "" if own["density"] is None else f", density={own['density']}"
        return f"fm.Material({own['name']!r}, {own['E']}, {own['nu']}{density})"
    name = own
    return f"fm.{PAPER_NAMES[name]}" if name in PAPER_NAMES else f"fm.material({name!r})"


def _region(own: Mapping[str, Any]) -> str:
    if own["kind"] == "disc":
        return f"fm.Disc({own['radius']})"
    return f"fm.Rectangle({own['length']}, {own['width']}, {own['angle']})"


def _bounds(own: Mapping[str, Any]) -> str:
    return "" if own["thickness"] is None else f", thickness={tuple(own['thickness'])}"


def _effect(own: Mapping[str, Any], joints: Mapping[str, str]) -> str:
    if own["kind"] == "gravity":
        return f"fm.Gravity({tuple(own['acceleration'])})"
    if own["kind"] == "temperature":
        return f"fm.Temperature({own['change']})"
    return f"fm.JointSpring({joints[own['joint']]}, {own['stiffness']}, rest={own['rest']})"
