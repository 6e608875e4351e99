"""Projects of the live page: a mechanism, its curves, targets and design as plain JSON of version 1.

A project is a mapping of plain data that ``PROJECT`` describes; ``read_project`` checks what a schema cannot: that
parts refer to each other. Edits return another project and never change the one they are given. Lengths are in mm,
forces in N, as the materials' cards have them. What the page does not edit stands in entries that need not be there:
further effects, laws and shapes, requirements on any quantity, numbers that change with the shapes (``carried``).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from copy import deepcopy
from functools import cache
from itertools import pairwise
from math import hypot
from pathlib import Path
from typing import Any

from fenicsmech.design import Number as NumberDesigned
from fenicsmech.design import Target
from fenicsmech.elasticity import DisplacementFormulation, MixedFormulation, Quadrature
from fenicsmech.errors import DescriptionError
from fenicsmech.joints import JOINT_KINDS
from fenicsmech.live.carried import EFFECTS, REGIONS, REGULARISERS, Carried, references
from fenicsmech.live.schema import (
    FLAG,
    LONGEST_NAME,
    ByEntry,
    ByKind,
    Choice,
    Many,
    Mapped,
    Number,
    Optional,
    Record,
    Refused,
    Schema,
    Text,
    TextOr,
)
from fenicsmech.mechanism import Material, Outline, material_card, material_names
from fenicsmech.model import SPACES

FORMAT = "fenicsmech live project 1"
EXAMPLES = Path(__file__).parent / "examples"

Project = dict[str, Any]


MOST_LINKS = 24
MOST_CURVES = 12
MOST_TARGETS = 40
MOST_ADDED = {"curves": 4, "targets": 12}  # up to which the page adds; scripts bring more
MOST_ELEMENTS = 10_000  # triangles of a mesh, which the page draws in each of up to 160 frames
LARGEST_FILE = 600_000  # characters of the content of a link's file
LARGEST_PROJECT = 2_000_000  # bytes of all but the design, as JSON without spaces
MOST_PARAMETERS = MOST_LINKS * 100 * 2  # of a design: two coordinates of each handle

_COORDINATE = Number(-1e5, 1e5)
_LENGTH = Number(1e-3, 1e5)
_POINT = Many(_COORDINATE, 2, 2)
_VECTOR = Many(_COORDINATE, 2, 3)
_NAME = Text(LONGEST_NAME)
_CURVE = Number(0, MOST_CURVES - 1, whole=True)

# the authors' materials beside those of cards
PAPER_NAMES = {"Smooth-Sil 950 (paper)": "SMOOTH_SIL_950", "Onyx (paper)": "ONYX"}


@cache
def materials() -> tuple[str, ...]:
    """Names of the materials that a project may have: the authors', and those of cards with all constants."""
    cards = [material_card(name) for name in material_names()]
    return (*PAPER_NAMES, *(card.name for card in cards if card.figure("E") and card.figure("nu")))


class _MaterialName(Schema):
    """One of ``materials``."""

    def check(self, value, place=""):
        Choice(materials()).check(value, place)


_MATERIAL = TextOr(
    _MaterialName(),
    ByEntry(
        {
            "E": Record(
                {
                    "name": _NAME,
                    "E": Number(1e-6, 1e7),
                    "nu": Number(-0.99, 0.4999),
                    "density": Optional(Number(1e-15, 1e-3)),
                }
            ),
            "data": Record({"name": _NAME, "data": Carried((Material,))}),
        }
    ),
)
_SHAPE = ByKind(
    {
        "strip": Record({"line": Many(_POINT, 2, 100), "thickness": _LENGTH, "depth": _LENGTH}),
        "polygon": Record({"corners": Many(_POINT, 3, 1000), "depth": _LENGTH}),
        "outline": Record({"data": Carried((Outline,)), "depth": _LENGTH}),
        # a file with its content, compressed, in base64
        "step": Record({"name": _NAME, "content": Text(LARGEST_FILE), "depth": _LENGTH, "section": _COORDINATE}),
        "mesh": Record({"name": _NAME, "content": Text(LARGEST_FILE), "depth": _LENGTH}),
    }
)
_LINK = ByKind(
    {
        "rigid": Record({"name": _NAME, "fixed": FLAG}),
        "flexible": Record(
            {
                "name": _NAME,
                "shape": _SHAPE,
                "material": _MATERIAL,
                # the shape changes with its targets, within bounds of its thickness in mm; None: by a factor of three
                "design": Optional(
                    Record(
                        {"segments": Number(1, 20, whole=True), "thickness": Optional(_POINT)},
                        {
                            "bend": Number(1e-6, 1e3),
                            "centreline": Many(_POINT, 2, 200),
                            "ends": Many(_POINT, 2, 2),
                            "ends_move": FLAG,
                            "same": Many(_NAME, 1, MOST_LINKS),
                            "mirrored": Many(_NAME, 1, MOST_LINKS),
                        },
                    )
                ),
            }
        ),
    }
)
_REGION = ByKind(
    {
        "disc": Record({"radius": _LENGTH}),
        "rectangle": Record({"length": _LENGTH, "width": _LENGTH, "angle": _COORDINATE}),
    }
)
_JOINT = Record(
    {
        "name": _NAME,
        "kind": Choice(tuple(JOINT_KINDS)),
        "a": _NAME,
        "b": _NAME,
        "at": _POINT,
        "axis": Optional(_VECTOR),  # None: along z
        "region": Optional(_REGION),  # of flexible links
    },
    {"z": _COORDINATE},
)
_LOAD = Record(
    {"name": _NAME, "on": _NAME, "at": _POINT, "direction": _VECTOR}, {"z": _COORDINATE, "region": Carried(REGIONS)}
)
_EFFECT = ByKind(
    {
        "gravity": Record({"acceleration": _POINT}),
        "temperature": Record({"change": Number(-300, 300)}),
        "joint spring": Record({"joint": _NAME, "stiffness": Number(1e-9, 1e9), "rest": _COORDINATE}),
        "carried": Record({"text": Text(300), "data": Carried(EFFECTS)}),
    }
)

PROJECT = Record(
    {
        "format": Choice((FORMAT,)),
        "name": _NAME,
        "links": Many(_LINK, 2, MOST_LINKS),
        "joints": Many(_JOINT, 1, 80),
        "motors": Many(Record({"name": _NAME, "joint": _NAME}), 0, 20),
        "forces": Many(_LOAD, 1, 20),
        "effects": Many(_EFFECT, 0, 20),
        "curves": Many(
            Record(
                {
                    "name": _NAME,
                    "force": _NAME,
                    "largest": Number(-1e6, 1e6),
                    "steps": Number(2, 40, whole=True),
                    "positions": Mapped(Number(-100, 100)),  # of motors, rad or mm
                    "others": Mapped(Number(-1e6, 1e6)),  # constant forces, N
                },
                {
                    "held": FLAG,  # displacements are prescribed, up to the largest in mm
                    "ratios": Mapped(Number(-1e6, 1e6)),  # of forces that grow together, its force's among them
                },
            ),
            1,
            MOST_CURVES,
        ),
        "targets": Many(
            # displacements that are wanted under forces, or forces where the curve holds displacements
            Record(
                {"curve": _CURVE, "force": Number(-1e6, 1e6), "displacement": _COORDINATE, "weight": Number(1e-3, 1e3)},
                {"scale": Number(1e-9, 1e6)},  # to which errors are relative
            ),
            0,
            MOST_TARGETS,
        ),
        "simulation": Record(
            {"space": Choice(tuple(SPACES)), "size": _LENGTH, "order": Number(1, 3, whole=True)},
            {
                "sizes": Mapped(Number(1e-3, 1e3)),  # of elements of links, over the size
                "layers": Number(1, 100, whole=True),
                "segments": Number(3, 200, whole=True),
                "quadrature": Carried((Quadrature,)),
                "formulation": Carried((MixedFormulation, DisplacementFormulation)),
            },
        ),
        # parameters p less those drawn, and handle positions θ; None: as drawn
        "design": Optional(
            Record(
                {
                    "offsets": Many(_COORDINATE, 0, MOST_PARAMETERS),
                    "handles": Many(Number(-1e6, 1e6), 0, MOST_PARAMETERS),
                }
            )
        ),
        "fit": FLAG,  # whether the design follows its targets
    },
    {
        "outputs": Many(_LOAD, 0, 40),
        # what is wanted of other quantities than those of curves
        "requirements": Many(Record({"name": Text(400), "data": Carried((Target,))}), 0, MOST_TARGETS),
        "numbers": Many(Record({"name": Text(400), "data": Carried((NumberDesigned,))}), 0, 40),
        "regulariser": Carried(REGULARISERS),
    },
)

_DRAWING = ("links", "joints", "motors", "forces", "effects", "simulation", "outputs", "numbers", "regulariser")


def read_project(data: Any) -> Project:
    """``data`` as a project of its own.

    Raises:
        Refused: it is none.
    """
    PROJECT.check(data)
    _check_length(data)
    project = deepcopy(data)
    links, joints = _named(project, "links"), _named(project, "joints")
    motors, forces = _named(project, "motors"), _named(project, "forces")
    outputs = _named(project, "outputs")
    for k, joint in enumerate(project["joints"]):
        for end in ("a", "b"):
            _known(joint[end], links, f"joints[{k}].{end}")
        if joint["a"] == joint["b"]:
            raise Refused(f"joints[{k}]", f"link {joint['a']!r} is joined with itself")
        if any(links[joint[end]]["kind"] == "flexible" for end in ("a", "b")) and joint["region"] is None:
            raise Refused(f"joints[{k}]", "it has no region on its flexible link")
        if joint["kind"] == "prismatic" and not any(joint["axis"] or ()):
            raise Refused(f"joints[{k}]", "a slider without an axis")
        if joint["axis"] is not None and not any(joint["axis"]):
            raise Refused(f"joints[{k}].axis", "it has no length")
    for k, motor in enumerate(project["motors"]):
        _known(motor["joint"], joints, f"motors[{k}].joint")
    for parts in ("forces", "outputs"):
        for k, load in enumerate(project.get(parts, ())):
            _known(load["on"], links, f"{parts}[{k}].on")
            if not any(load["direction"]):
                raise Refused(f"{parts}[{k}].direction", "it has no length")
    for k, effect in enumerate(project["effects"]):
        if effect["kind"] == "joint spring":
            _known(effect["joint"], joints, f"effects[{k}].joint")
    _check_size(project)
    sorts = {"links": links, "joints": joints, "motors": motors, "forces": forces, "outputs": outputs}
    for sort, name in references({key: own for key, own in project.items() if key != "design"}):
        _known(name, sorts[sort], "")
    for k, link in enumerate(project["links"]):
        design = (link["kind"] == "flexible" and link["design"]) or {}
        for other in (*design.get("same", ()), *design.get("mirrored", ())):
            if links.get(other, {"kind": "none"})["kind"] != "flexible":
                raise Refused(f"links[{k}].design", f"there is no flexible link {other!r}")
    for name in project["simulation"].get("sizes", ()):
        _known(name, links, "simulation.sizes")
    _named(project, "curves")
    for k, curve in enumerate(project["curves"]):
        _known(curve["force"], forces, f"curves[{k}].force")
        if not curve["largest"]:
            raise Refused(f"curves[{k}].largest", "it is zero")
        for own in curve["positions"]:
            _known(own, motors, f"curves[{k}].positions")
        for own in (*curve["others"], *curve.get("ratios", ())):
            _known(own, forces, f"curves[{k}].others")
        if curve["force"] in curve["others"]:
            raise Refused(f"curves[{k}].others", f"{curve['force']!r} is to change and to be held constant")
    for k, target in enumerate(project["targets"]):
        if target["curve"] >= len(project["curves"]):
            raise Refused(f"targets[{k}].curve", f"there is no curve {target['curve']}")
        curve = project["curves"][target["curve"]]
        if "ratios" in curve:
            raise Refused(f"targets[{k}].curve", f"targets on {curve['name']!r} are given in the script")
        given, wanted = ("displacement", "force") if curve.get("held") else ("force", "displacement")
        if not target[given] * curve["largest"] > 0.0:
            raise Refused(f"targets[{k}].{given}", f"it has not the sign of its curve's {given}")
        if not target[wanted] and "scale" not in target:
            raise Refused(f"targets[{k}].{wanted}", "it is zero, to which no error is relative")
    return project


def _check_length(project: Project) -> None:
    """Refuses more than the page saves and opens again."""
    drawn = {key: own for key, own in project.items() if key != "design"}
    length = len(json.dumps(drawn, ensure_ascii=False, separators=(",", ":")).encode())
    if length > LARGEST_PROJECT:
        raise Refused("", f"a project of {length / 1e6:.3g} MB, not at most {LARGEST_PROJECT / 1e6:g} MB")


def _check_size(project: Project) -> None:
    """Refuses elements so small that there are too many."""
    count = elements_drawn(project)
    if count > MOST_ELEMENTS:
        raise Refused("simulation.size", too_many(project, count))


def elements_drawn(project: Project) -> float:
    """How many elements the flexible links have, without those from files."""
    return sum(
        elements(_area(own["shape"], size), size) for own, size in sized(project) if "content" not in own["shape"]
    )


def too_many(project: Project, count: float) -> str:
    """What is wrong with so many elements."""
    return f"some {count:.2g} elements of {project['simulation']['size']:g} mm, not at most {MOST_ELEMENTS}"


def sized(project: Project) -> list[tuple[dict[str, Any], float]]:
    """The flexible links, and the size of elements of each."""
    size, ratios = project["simulation"]["size"], project["simulation"].get("sizes", {})
    return [(own, size * ratios.get(own["name"], 1.0)) for own in project["links"] if own["kind"] == "flexible"]


def elements(area: float, size: float) -> float:
    """How many elements of a size an area has: equilateral triangles cover 0.43 of its square each."""
    return area / (0.43 * size**2)


def _area(shape: Mapping[str, Any], size: float) -> float:
    """Of a link, where a strip has one element across at least, and a polygon one on each side of its rim."""
    if shape["kind"] == "strip":
        length = sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(shape["line"]))
        return length * max(shape["thickness"], size)
    corners = shape["corners"] if shape["kind"] == "polygon" else _outline_points(shape["data"])
    ahead = [*zip(corners, [*corners[1:], corners[0]], strict=True)]
    rim = sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in ahead)
    return max(0.5 * abs(sum(a[0] * b[1] - a[1] * b[0] for a, b in ahead)), 0.5 * rim * size)


def _outline_points(data: Mapping[str, Any]) -> list[Sequence[float]]:
    """Points of an outline in their order.

    Raises:
        Refused: it is none.
    """
    places = [data["start"]]
    for segment in data["segments"] if isinstance(data["segments"], list) else ():
        if not isinstance(segment, dict) or segment.get("is") not in ("Line", "Arc"):
            raise Refused("outline", "a segment that is neither a line nor an arc")
        places += [segment[key] for key in ("via", "end") if key in segment]
    for place in places:
        _POINT.check(place, "outline")
    return places


def _named(project: Project, parts: str) -> Mapping[str, Any]:
    found: dict[str, Any] = {}
    for k, own in enumerate(project.get(parts, ())):
        if own["name"] in found:
            raise Refused(f"{parts}[{k}].name", f"the name {own['name']!r} is taken")
        found[own["name"]] = own
    return found


def _known(name: str, parts: Mapping[str, Any], place: str) -> None:
    if name not in parts:
        raise Refused(place, f"there is no {name!r}")


def edited(project: Project, changes: Sequence[Mapping[str, Any]]) -> Project:
    """The project after some changes at paths of keys and indices: values set, inserted into a list, or removed.

    Raises:
        Refused: there is no such place, or the result is not a project.
    """
    data = deepcopy(project)
    for change in changes:
        *way, last = change["path"]
        place, at = "", data
        for step in way:
            at, place = _step(at, step, place), f"{place}.{step}".lstrip(".")
        if change["kind"] == "set":
            _step(at, last, place)
            at[last] = deepcopy(change["value"])
        elif change["kind"] == "insert":
            if not isinstance(at, list) or type(last) is not int or not 0 <= last <= len(at):
                raise Refused(place, f"no list with a place {last!r}")
            at.insert(last, deepcopy(change["value"]))
        else:
            if not isinstance(at, list):
                raise Refused(place, "not a list")
            _step(at, last, place)
            del at[last]
    return read_project(data)


def _step(at: Any, step: str | int, place: str) -> Any:
    if isinstance(at, dict) and isinstance(step, str) and step in at:
        return at[step]
    if isinstance(at, list) and type(step) is int and 0 <= step < len(at):
        return at[step]
    raise Refused(place, f"it has no {str(step)[:40]!r}")


def drawing(project: Project) -> str:
    """What a mesh depends on, as a text to compare."""
    return json.dumps([project.get(key) for key in _DRAWING], sort_keys=True)


def wants(project: Project) -> bool:
    """Whether something is wanted of its design."""
    return bool(project["targets"] or project.get("requirements"))


def sampled(curve: Mapping[str, Any], target: Mapping[str, Any]) -> tuple[float, float]:
    """The force that a target prescribes and the displacement that it wants, or these the other way round where its
    curve holds displacements."""
    force, displacement = target["force"], target["displacement"]
    return (displacement, force) if curve.get("held") else (force, displacement)


def forces_of(project: Project, curve: int, *, coarse: bool = False) -> list[float]:
    """The forces of a curve's frames, from zero, those of its targets among them; a third of them if ``coarse``.

    Displacements where these are prescribed.
    """
    own = project["curves"][curve]
    steps = -(-own["steps"] // 3) if coarse else own["steps"]
    even = [own["largest"] * k / steps for k in range(steps + 1)]
    wanted = [sampled(own, target)[0] for target in project["targets"] if target["curve"] == curve]
    spacing = abs(own["largest"]) / steps
    kept = [force for force in even if all(abs(force - other) > 0.2 * spacing for other in wanted)]
    return sorted({0.0, *kept, *wanted}, key=abs)


def load_project(path: str | Path) -> Project:
    """A project from its file.

    Raises:
        DescriptionError: there is no such file, or it holds no project.
    """
    part = f"project {str(path)!r}"
    try:
        return read_project(json.loads(Path(path).read_text(encoding="utf-8")))
    except FileNotFoundError:
        raise DescriptionError(part, "there is no such file", "Give a file saved by the page") from None
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError):
        raise DescriptionError(part, "it is not JSON", "Give a file saved by the page") from None
    except Refused as refused:
        raise DescriptionError(part, str(refused), "Give a file saved by the page") from None


def example(name: str) -> Project:
    """A project that comes with the page."""
    return load_project(EXAMPLES / f"{name}.json")


def example_names() -> tuple[str, ...]:
    """Names of the projects that come with the page."""
    return tuple(sorted(path.stem for path in EXAMPLES.glob("*.json")))
