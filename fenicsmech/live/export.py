"""Files of a project, made in a process of their own: STEP, STL, DXF, pictures and an animation.

The page names what it wants, never a path: files are made in a folder that is removed, and sent as they are, or as a
ZIP archive if there are several.
"""

from __future__ import annotations

import io
import json
import os
import sys
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from fenicsmech.design import SplineDesign, rest_meshes
from fenicsmech.errors import DescriptionError, FenicsmechError
from fenicsmech.export import smooth_outline
from fenicsmech.files import atomic_write, file_names
from fenicsmech.live.build import Drawing, draw, placement
from fenicsmech.live.project import Project, forces_of
from fenicsmech.meshing import CircleArc, boundary_polygons
from fenicsmech.plot import Panel, draw_configurations
from fenicsmech.simulation import Curve, MechanismPlotter, Simulation, gather


def export(project: Project, what: str, folder: Path) -> list[Path]:
    """Writes the files of a sort into a folder: pictures and animations of each curve, the links of all.

    Raises:
        FenicsmechError: they cannot be made.
    """
    drawing = draw(project)
    if what in ("step", "stl", "dxf"):
        return _links(project, drawing, what, folder)
    simulation, paths = _designed(project, drawing), list[Path]()
    for number in range(len(project["curves"])):
        curve = simulation.compute(drawing.request(project, number, forces_of(project, number)))
        tail = f"-{number + 1}" if len(project["curves"]) > 1 else ""
        if what == "animation":
            paths.append(_animation(drawing, curve, folder / f"animation{tail}.gif"))
            continue
        curve.plot(folder / f"curve{tail}.png")
        curve.picture(folder / f"mechanism{tail}.png")
        paths += [folder / f"curve{tail}.png", folder / f"mechanism{tail}.png"]
    return paths


def _designed(project: Project, drawing: Drawing) -> Simulation:
    problem = drawing.along_curves(project)
    at = placement(project, problem)
    if problem is None or at is None:
        return drawing.simulation
    return drawing.simulation.with_design(problem.rest_shape(at))


def _links(project: Project, drawing: Drawing, what: str, folder: Path) -> list[Path]:
    """The links whose shape changes, each in its place."""
    problem = drawing.along_curves(project)
    if problem is None:
        raise DescriptionError("export", "no link changes its shape", "Let one follow the targets")
    shapes = [own for own in drawing.designs(project) if isinstance(own, SplineDesign)]
    at, links = placement(project, problem) or problem.initial, [link for own in shapes for link in own.links]
    if what != "dxf":
        problem.export(folder, at)
        return sorted(folder.glob(f"*.{what}"))
    model = drawing.simulation.model
    with model.shaped(problem.rest_shape(at)):
        meshes = rest_meshes(drawing.simulation, links)
    names = file_names(link.name for link in links)
    return [
        _write_dxf(folder / f"{name}.dxf", boundary_polygons(link.name, mesh))
        for link, name, mesh in zip(links, names, meshes, strict=True)
    ]


def _write_dxf(path: Path, polygons: Sequence[np.ndarray]) -> Path:
    """The outline of a link and its holes as closed polylines of DXF R12, in mm, points of its smooth curves."""
    lines = ["0", "SECTION", "2", "ENTITIES"]
    for polygon in polygons:
        lines += ["0", "POLYLINE", "8", "0", "66", "1", "70", "1"]
        for curve in smooth_outline(polygon):
            for x, y in _sampled(curve):
                lines += ["0", "VERTEX", "8", "0", "10", f"{x:.6f}", "20", f"{y:.6f}"]
        lines += ["0", "SEQEND"]
    with atomic_write(path) as file:
        file.write("\n".join([*lines, "0", "ENDSEC", "0", "EOF", ""]))
    return path


def _sampled(curve: Any) -> np.ndarray:
    """Points of a curve from its start to before its end, (k, 2)."""
    if isinstance(curve, CircleArc):
        angles = curve.first + curve.sweep * np.linspace(0.0, 1.0, 25)[:-1]
        return curve.centre + curve.radius * np.column_stack([np.cos(angles), np.sin(angles)])
    first, last = curve.t[curve.k], curve.t[-curve.k - 1]
    knots = np.unique(np.clip(curve.t, first, last))
    if curve.k == 1:
        return curve(knots[:-1])
    return curve(np.concatenate([np.linspace(a, b, 9)[:-1] for a, b in zip(knots, knots[1:], strict=False)]))


def _animation(drawing: Drawing, curve: Curve, path: Path) -> Path:
    """The frames of a curve, there and back, as a GIF."""
    from PIL import Image  # matplotlib needs it too

    model, plotter, pictures = drawing.simulation.model, MechanismPlotter(drawing.simulation.model), []
    shapes = []
    for frame in curve.frames:
        snapshot = gather(model, frame)
        assert snapshot is not None, "there is one process"
        shapes.append(plotter.shape(snapshot))
    for k, shape in enumerate(shapes):
        single = path.with_name(f"frame-{k}.png")
        title = f"{curve.frames[k].force:.3g} N, {curve.frames[k].displacement:.3g} mm"
        draw_configurations(single, [Panel(shapes[0], (shapes[-1], shape), title=title)])
        with Image.open(single) as image:
            pictures.append(image.convert("P"))
    there = [*pictures, *pictures[-2:0:-1]]
    there[0].save(path, save_all=True, append_images=there[1:], duration=120, loop=0)
    return path


def packed(paths: Sequence[Path]) -> tuple[str, bytes]:
    """Name and content of one file, or of a ZIP archive of several."""
    if len(paths) == 1:
        return paths[0].name, paths[0].read_bytes()
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in paths:
            archive.write(path, path.name)
    return "files.zip", data.getvalue()


def main() -> None:
    """Reads {project, what} from standard input; writes a line of JSON, {name} or {problem}, and the file."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # libraries print where they like
    task: Mapping[str, Any] = json.load(sys.stdin)
    try:
        with TemporaryDirectory() as folder:
            name, data = packed(export(task["project"], task["what"], Path(folder)))
    except FenicsmechError as error:
        out.write(json.dumps({"problem": str(error)}).encode() + b"\n")
    else:
        out.write(json.dumps({"name": name}).encode() + b"\n" + data)
    out.flush()
