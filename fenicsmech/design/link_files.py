"""Files of designed links: a picture before and after, and solids to make them from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fenicsmech.collective import on_one
from fenicsmech.design.link_shape import gather_links
from fenicsmech.design.rest_shape import DesignedLink
from fenicsmech.export import PinHole, write_step, write_stl
from fenicsmech.mechanism import DRAWN, Disc, FlexibleLink
from fenicsmech.meshing import LinkMesh, boundary_loops, plan_of
from fenicsmech.multibody import Linkage, assemble
from fenicsmech.report import DesignShape, LinkOutline, draw_designs
from fenicsmech.simulation import Draughtsman, Simulation, rest_vertices


def rest_meshes(simulation: Simulation, links: Sequence[FlexibleLink]) -> list[LinkMesh] | None:
    """Meshes of some links in their present shape on the first process, None elsewhere (collective).

    Links of which one half is meshed are given by their plan.
    """
    meshes = gather_links(simulation.model.mesh, rest_vertices(simulation.model))
    everyone, halves = simulation.scene.mechanism.flexible_links, simulation.fidelity.model.symmetric
    chosen = [meshes[everyone.index(link)] for link in links]
    return on_one(simulation.comm, lambda: [plan_of(mesh).mesh for mesh in chosen] if halves else chosen)


def outline(link: DesignedLink, mesh: LinkMesh, p: np.ndarray) -> LinkOutline:
    """The outline of a link, with centreline, thickness and control points of its parameters ``p``."""
    plan = plan_of(mesh).mesh
    loops = [plan.points[loop] for loop in boundary_loops(f"link {link.name!r}", plan)]
    return LinkOutline(
        loops,
        centreline=link.spline.evaluate(p, link.samples.t)[:, :2],
        thickness=link.thickness * link.samples.thickness(p),
        controls=link.spline.controls_at(p)[:, 0, :2],
    )


def draw_links(
    path: str | Path,
    simulation: Simulation,
    links: Sequence[FlexibleLink],
    before: Sequence[LinkOutline],
    after: Sequence[LinkOutline],
) -> None:
    """Draws links before and after a change (call it on the first process)."""
    scene, linkage = simulation.scene, simulation.linkage
    pen = Draughtsman(scene.mechanism, linkage, simulation.model.mesh)
    shapes = [
        DesignShape(link.name, old, new, np.array(_joints(linkage, link)))
        for link, old, new in zip(links, before, after, strict=True)
    ]
    rigid = pen.rigid(assemble(linkage, DRAWN).poses)
    draw_designs(path, shapes, rigid=rigid, unit=scene.units.length, title=f"{scene.mechanism.name}: links")


def write_solids(
    folder: str | Path, linkage: Linkage, links: Sequence[FlexibleLink], meshes: Sequence[LinkMesh], pin: float | None
) -> list[Path]:
    """Writes ``NAME.step`` and ``NAME.stl`` of every link (call it on the first process).

    Args:
        folder: where to; it is created.
        linkage: knows the joints.
        links: the links.
        meshes: their meshes.
        pin: diameter of the holes left for the pins of round interfaces; None leaves the links whole.

    Returns:
        The files.

    Raises:
        MeshingError: no solid can be made of a link.
    """
    files = []
    for link, mesh in zip(links, meshes, strict=True):
        regions = [linkage.bodies[i] for i in linkage.interfaces[link]]
        pins = [PinHole(tuple(b.centre[:2]), pin) for b in regions if pin and isinstance(b.region, Disc)]
        stem = Path(folder) / link.name.replace(" ", "-")
        for suffix, write in ((".step", write_step), (".stl", write_stl)):
            files.append(stem.with_suffix(suffix))
            write(files[-1], mesh, depth=link.shape.depth, pins=pins, name=link.name)
    return files


def _joints(linkage: Linkage, link: FlexibleLink) -> list[tuple[float, ...]]:
    return [linkage.bodies[i].centre[:2] for i in linkage.interfaces[link]]
