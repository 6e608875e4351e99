"""The Python script that does what a project does: the same mechanism, design and curves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fenicsmech.live.build import FILES, place_of
from fenicsmech.live.carried import source
from fenicsmech.live.project import PAPER_NAMES, Project, forces_of, sampled, wants


def script(project: Project) -> str:
    """A script of the public API, complete in itself."""
    parts = _Parts(project)
    sections = (
        _head(project),
        _files(project, parts),
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
        self.links, self.joints, self.motors, self.forces, self.outputs = (
            {own["name"]: self._new(own["name"]) for own in project.get(sort, ())}
            for sort in ("links", "joints", "motors", "forces", "outputs")
        )

    def source(self, data: Any) -> str:
        """Python of what is carried."""
        return source(data, {sort: getattr(self, sort) for sort in ("links", "joints", "motors", "forces", "outputs")})

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
    filed = ["import base64", "import zlib", "from pathlib import Path", ""] if _filed(project) else []
    return [title, "", *filed, "import numpy as np", "", "import fenicsmech as fm"]


def _filed(project: Project) -> list[Mapping[str, Any]]:
    """The links that come from files."""
    return [own for own in project["links"] if "content" in own.get("shape", ())]


def _files(project: Project, parts: _Parts) -> list[str]:
    """The files of links, with their content."""
    lines = []
    for own in _filed(project):
        content = f"    {own['shape']['content']!r}"
        lines += [f"{_file(own, parts)}.write_bytes(zlib.decompress(base64.b64decode(", content, ")))"]
    return lines


def _file(link: Mapping[str, Any], parts: _Parts) -> str:
    """The file of a link beside the script."""
    name = f"{parts.links[link['name']]}.{FILES[link['shape']['kind']]}"
    return f"Path({name!r})"


def _links(project: Project, parts: _Parts) -> list[str]:
    lines = [f"mechanism = fm.Mechanism({project['name']!r})"]
    for own in project["links"]:
        name = parts.links[own["name"]]
        if own["kind"] == "rigid":
            fixed = ", fixed=True" if own["fixed"] else ""
            lines.append(f"{name} = mechanism.rigid({own['name']!r}{fixed})")
        else:
            arguments = (repr(own["name"]), _shape(own, parts), _material(own["material"], parts))
            lines += [f"{name} = mechanism.flexible(", *(f"    {own}," for own in arguments), ")"]
    return lines


def _joints(project: Project, parts: _Parts) -> list[str]:
    lines, flexible = [], {own["name"] for own in project["links"] if own["kind"] == "flexible"}
    for own in project["joints"]:
        options = "" if own["axis"] is None else f", axis={tuple(own['axis'])}"
        if own["region"] is not None and {own["a"], own["b"]} & flexible:
            options += f", region={_region(own['region'])}"
        ends = f"{parts.links[own['a']]}, {parts.links[own['b']]}"
        place = f"{ends}, at={tuple(place_of(own))}{options}, name={own['name']!r}"
        lines.append(f"{parts.joints[own['name']]} = mechanism.{own['kind']}({place})")
    return lines


def _drives(project: Project, parts: _Parts) -> list[str]:
    """Motors, forces and outputs."""
    lines = []
    for own in project["motors"]:
        joint = parts.joints[own["joint"]]
        lines.append(f"{parts.motors[own['name']]} = mechanism.motor({joint}, name={own['name']!r})")
    for sort, names in (("force", parts.forces), ("output", parts.outputs)):
        for own in project.get(f"{sort}s", ()):
            place = f"on={parts.links[own['on']]}, at={tuple(place_of(own))}, direction={tuple(own['direction'])}"
            region = f", region={parts.source(own['region'])}" if "region" in own else ""
            lines.append(f"{names[own['name']]} = mechanism.{sort}({place}{region}, name={own['name']!r})")
    return lines


def _simulation(project: Project, parts: _Parts) -> list[str]:
    effects, chosen = ", ".join(_effect(own, parts) for own in project["effects"]), project["simulation"]
    size = str(chosen["size"])
    if "sizes" in chosen:
        size = f"{{{', '.join(f'{parts.links[k]}: {own} * {size}' for k, own in chosen['sizes'].items())}}}"
    options = f"space={chosen['space']!r}, order={chosen['order']}, size={size}"
    options += "".join(f", {key}={chosen[key]}" for key in ("layers", "segments") if key in chosen)
    for key in ("quadrature", "formulation"):
        options += f", {key}={parts.source(chosen[key])}" if key in chosen else ""
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
        f"fm.SplineDesign({parts.links[own['name']]}, {_options(own['design'], parts)})"
        for own in project["links"]
        if own["kind"] == "flexible" and own["design"] is not None
    ]
    designs += [parts.source(own["data"]) for own in project.get("numbers", ())]
    requirements = project.get("requirements", [])
    if not designs or not (wants(project) or (project["design"] and project["curves"])):
        return []
    targets, note = project["targets"], []
    if not wants(project):  # a problem has at least one
        given, wanted = ("displacement", "force") if project["curves"][0].get("held") else ("force", "displacement")
        targets = [{"curve": 0, given: forces_of(project, 0)[-1], wanted: 1.0, "weight": 1.0}]
        note = ["# the page has no targets: this one keeps the place of those to come"]
    lines = [f"designs = [{', '.join(designs)}]", *note, "targets = ["]
    for own in targets:
        lines += _target(own, project["curves"][own["curve"]], parts)
    lines += [f"    {parts.source(own['data'])}," for own in requirements]
    own = project.get("regulariser")
    regulariser = "" if own is None else f", regulariser={parts.source(own)}"
    lines += ["]", f"problem = fm.DesignProblem(sim, designs, targets=targets{regulariser})"]
    if project["design"] is not None:
        offsets, handles = (", ".join(map(repr, project["design"][key])) for key in ("offsets", "handles"))
        lines += [
            "",
            "# the shape that the page shows; problem.optimise(start=found) goes on from there",
            f"offsets = np.array([{offsets}])",
            f"handles = np.array([{handles}])",
            "found = fm.HandlePlacement(problem.initial + offsets, handles)",
            "sim = sim.with_design(problem.rest_shape(found))",
            'problem.export("links", found)',
        ]
    return lines


def _target(own: Mapping[str, Any], curve: Mapping[str, Any], parts: _Parts) -> list[str]:
    held, (given, wanted) = curve.get("held"), sampled(curve, own)
    loads = {curve["force"]: f"fm.at({given})" if held else given, **curve["others"]}
    sample = ", ".join(f"{parts.forces[force]}: {value}" for force, value in loads.items())
    return [
        "    fm.Target(",
        f"        fm.{'ForceMagnitude' if held else 'Displacement'}({parts.forces[curve['force']]}),",
        f"        fm.Sample({{{sample}}}, configuration_{own['curve']}),",
        f"        equals={wanted},",
        f"        weight={own['weight']},",
        *([f"        scale={own['scale']},"] if "scale" in own else []),
        "    ),",
    ]


def _curve(project: Project, parts: _Parts, number: int) -> list[str]:
    curve = project["curves"][number]
    others = ", ".join(f"{parts.forces[name]}: {value}" for name, value in curve["others"].items())
    part = parts.forces[curve["force"]]
    if "ratios" in curve:
        ratios = ", ".join(f"{parts.forces[name]}: {value}" for name, value in curve["ratios"].items())
        part = f"fm.ForceGroup({curve['name']!r}, {{{ratios}}})"
    return [
        f"curve_{number} = sim.load_displacement(",
        f"    {part},",
        f"    {'displacements' if curve.get('held') else 'forces'}={forces_of(project, number)},",
        f"    configuration=configuration_{number},",
        f"    others={{{others}}},",
        ")",
        f"print(*curve_{number}.displacements)",
        f'curve_{number}.plot("curve-{number}.png")',
    ]


# -- expressions ---


def _plain(text: str) -> str:
    return text.replace("\\", "/").replace('"', "'")


def _shape(link: Mapping[str, Any], parts: _Parts) -> str:
    own = link["shape"]
    if own["kind"] == "strip":
        line = ", ".join(map(str, map(tuple, own["line"])))
        return f"fm.strip([{line}], thickness={own['thickness']}, depth={own['depth']})"
    if own["kind"] == "polygon":
        return f"fm.polygon([{', '.join(map(str, map(tuple, own['corners'])))}], depth={own['depth']})"
    if own["kind"] == "outline":
        return parts.source({**own["data"], "depth": own["depth"]})
    if own["kind"] == "step":
        return f"fm.step_file({_file(link, parts)}, depth={own['depth']}, section={own['section']})"
    return f"fm.gmsh_mesh({_file(link, parts)}, depth={own['depth']})"


def _material(own: str | Mapping[str, Any], parts: _Parts) -> str:
    if isinstance(own, str):
        return f"fm.{PAPER_NAMES[own]}" if own in PAPER_NAMES else f"fm.material({own!r})"
    if "data" in own:
        return parts.source(own["data"])
    density = "" if own["density"] is None else f", density={own['density']}"
    return f"fm.Material({own['name']!r}, {own['E']}, {own['nu']}{density})"


def _region(own: Mapping[str, Any]) -> str:
    if own["kind"] == "disc":
        return f"fm.Disc({own['radius']})"
    return f"fm.Rectangle({own['length']}, {own['width']}, {own['angle']})"


def _options(own: Mapping[str, Any], parts: _Parts) -> str:
    """Arguments of a design beside its link."""
    text = f"segments={own['segments']}"
    text += "" if own["thickness"] is None else f", thickness={tuple(own['thickness'])}"
    text += "".join(f", {key}={own[key]}" for key in ("bend", "centreline", "ends", "ends_move") if key in own)
    for key in ("same", "mirrored"):
        text += f", {key}=[{', '.join(parts.links[name] for name in own[key])}]" if key in own else ""
    return text


def _effect(own: Mapping[str, Any], parts: _Parts) -> str:
    if own["kind"] == "gravity":
        return f"fm.Gravity({tuple(own['acceleration'])})"
    if own["kind"] == "temperature":
        return f"fm.Temperature({own['change']})"
    if own["kind"] == "joint spring":
        return f"fm.JointSpring({parts.joints[own['joint']]}, {own['stiffness']}, rest={own['rest']})"
    return parts.source(own["data"])
