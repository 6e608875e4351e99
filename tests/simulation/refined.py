"""Simulations whose meshes are refined without changing their outline: triangles are cut in four."""

from __future__ import annotations

import numpy as np

import fenicsmech as fm
from fenicsmech import model
from fenicsmech.meshing import CurvedEdges, LinkMesh


def quartered(mesh: LinkMesh) -> LinkMesh:
    """The triangles of a link, each cut in four at the midpoints of its edges, its outline as before."""
    points, cells = mesh.points, mesh.cells
    edges = np.sort(np.vstack([cells[:, [1, 2]], cells[:, [2, 0]], cells[:, [0, 1]]]), axis=1)
    unique, inverse = np.unique(edges, axis=0, return_inverse=True)
    a, b, c = np.split(inverse.ravel() + len(points), 3)
    parts = [(cells[:, 0], c, b), (cells[:, 1], a, c), (cells[:, 2], b, a), (a, b, c)]
    finer = np.vstack([np.column_stack(part) for part in parts])
    middles = points[unique].mean(axis=1)
    count = len(points)
    rows = np.searchsorted(unique @ (count, 1), mesh.curved.ends @ (count, 1))
    middles[rows] += mesh.curved.bulges
    # at a quarter of its way the curve bulges three quarters as much as in the middle, half a bulge above the chord
    ends = np.vstack([np.column_stack([end, rows + count]) for end in mesh.curved.ends.T])
    curved = CurvedEdges(ends, np.tile(0.25 * mesh.curved.bulges, (2, 1)))
    return LinkMesh.from_cells(np.vstack([points, middles]), finer, np.tile(mesh.interface, 4), curved)


def refine(monkeypatch, levels: int) -> None:
    """Makes the simulations made from now on use meshes refined ``levels`` times."""
    plain = model.mesh_links

    def mesh_links(*arguments):
        meshes = plain(*arguments)
        for _ in range(levels):
            meshes = [quartered(mesh) for mesh in meshes]
        return meshes

    monkeypatch.setattr(model, "mesh_links", mesh_links)


def cantilever() -> tuple[fm.Scene, object, float]:
    """A straight link between clamps, and a force that bends it by a sixth of its length."""
    rig = fm.Mechanism("cantilever")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    link = rig.flexible("link", fm.strip([(-3, 0), (63, 0)], thickness=3.0, depth=5.0), fm.ONYX)
    rig.weld(wall, link, at=(-1.5, 0), region=fm.Rectangle(3, 5))
    rig.weld(link, hand, at=(61.5, 0), region=fm.Rectangle(3, 5))
    return fm.Scene(rig), rig.force(on=hand, at=(60, 0), direction=(0, 1)), 3.0


def arch(expansion: float | None = None) -> tuple[fm.Scene, object, float]:
    """A curved link pressed together by its pins; the thermal expansion of its material."""
    nylon = fm.Material("nylon", law=fm.ONYX.law, density=fm.ONYX.density, expansion=expansion)
    rig = fm.Mechanism("arch")
    ground, slide = rig.rigid("ground", fixed=True), rig.rigid("slide")
    link = rig.flexible("link", fm.strip([(0, 0), (20, 9), (40, 0)], thickness=3.0, depth=5.0), nylon)
    rig.revolute(ground, link, at=(0, 0), interface_radius=2.5)
    rig.revolute(link, slide, at=(40, 0), interface_radius=2.5)
    rig.prismatic(ground, slide, at=(40, 0), axis=(1, 0, 0))
    return fm.Scene(rig), rig.force(on=slide, at=(40, 0), direction=(-1, 0)), 30.0
