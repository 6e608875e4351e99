"""Simulations whose meshes are refined without changing their outline: triangles are cut in four."""

from __future__ import annotations

import fenicsmech as fm
from fenicsmech import model


def refine(monkeypatch, levels: int) -> None:
    """Makes the simulations made from now on use meshes refined ``levels`` times."""
    plain = model.mesh_links

    def mesh_links(*arguments):
        meshes = plain(*arguments)
        for _ in range(levels):
            meshes = [mesh.quartered() for mesh in meshes]
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
