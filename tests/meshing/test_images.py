"""Meshes of links that are images of each other are images too, with curved edges and interfaces."""

from __future__ import annotations

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.meshing import Figure, InterfaceSite, cell_measures, image_of, matches, mesh_link, same_mesh

BENT = np.array([(0.0, 0.0), (9.0, 6.0), (20.0, 7.0)])
CORNERS = np.array([(0.0, 0.0), (20.0, 0.0), (20.0, 6.0), (8.0, 4.0), (0.0, 8.0)])
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])
MOVES = {
    "translation": (np.eye(2), (30.0, -4.0)),
    "quarter turn": (QUARTER, (3.0, 1.0)),
    "mirror": (np.diag([-1.0, 1.0]), (-1.0, 0.0)),
    "glide": (QUARTER @ np.diag([1.0, -1.0]), (0.3, 2.0)),
}


def strip(points: np.ndarray) -> tuple[fm.Strip, list[InterfaceSite]]:
    shape = fm.strip(points, thickness=2.0, depth=4.0)
    return shape, [InterfaceSite(tuple(points[0]), fm.Disc(1.8)), InterfaceSite(tuple(points[-1]), fm.Disc(2.2))]


def plate(points: np.ndarray) -> tuple[fm.Outline, list[InterfaceSite]]:
    direction = points[1] - points[0]
    at, angle = points[0] + 0.5 * direction, float(np.arctan2(direction[1], direction[0]))
    return fm.polygon(points, depth=4.0), [InterfaceSite(tuple(at), fm.Rectangle(4.0, 3.0, angle))]


@pytest.mark.parametrize("name", MOVES)
@pytest.mark.parametrize(("draw", "points"), [(strip, BENT), (plate, CORNERS)])
@pytest.mark.parametrize("dim", [2, 3])
def test_the_motion_between_images_is_found_and_carries_the_mesh(name, draw, points, dim):
    turn, offset = MOVES[name]
    (shape, sites), (moved, others) = draw(points), draw(points @ turn.T + offset)
    one, other = (Figure.of("link", *own, dim=dim) for own in ((shape, sites), (moved, others[::-1])))
    match = same_mesh(one, other)
    # joints are exact; with one of them the outline gives the direction, whose coordinates are rounded to ten digits
    exact = 1e-12 if draw is strip else 1e-9
    assert match.isometry.matrix == pytest.approx(turn, abs=exact)
    assert match.isometry.offset == pytest.approx(offset, abs=20.0 * exact)
    mesh = mesh_link("link", shape, sites, dim=dim, size=1.5)
    image = image_of(mesh, match.isometry, match.sites)
    assert np.all(cell_measures(image.points, image.cells) > 0.0)
    assert image.points[:, :2] == pytest.approx(mesh.points[:, :2] @ turn.T + offset, abs=20.0 * exact)
    assert len(image.curved.ends) == len(mesh.curved.ends) and (draw is plate or len(mesh.curved.ends))
    for number, site in enumerate(others[::-1]):
        inside = image.points[np.unique(image.cells_of(number)), :2]
        assert len(inside) and np.all(site.contains(inside, 1e-6))


def test_figures_that_differ_have_no_motion():
    one = Figure.of("link", *strip(BENT), dim=2)
    shape, sites = strip(BENT)
    wider = [InterfaceSite(site.at, fm.Disc(2.5)) for site in sites]
    assert matches(one, Figure.of("link", shape, wider, dim=2), mirrored=False) == []
    assert matches(one, Figure.of("link", shape, sites[:1], dim=2), mirrored=False) == []
    thick = Figure.of("link", fm.strip(BENT, thickness=2.2, depth=4.0), sites, dim=2)
    assert min(match.misfit for match in matches(one, thick, mirrored=False)) == pytest.approx(0.1, rel=0.05)
    assert same_mesh(one, thick) is None


def test_links_that_are_images_have_one_mesh_whatever_the_order_of_their_description():
    def heights(names: tuple[str, str]) -> list[np.ndarray]:
        mechanism = fm.Mechanism("frame")
        ground, top = mechanism.rigid("ground", fixed=True), mechanism.rigid("top")
        for name in names:
            points = BENT * (1.0 if name == "right" else -1.0, 1.0)
            link = mechanism.flexible(name, fm.strip(points, thickness=2.0, depth=4.0), fm.ONYX)
            mechanism.weld(ground, link, at=points[0] + 0.0, interface_radius=1.8)
            mechanism.weld(top, link, at=points[-1], interface_radius=1.8)
        mesh = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=1.5).model.mesh
        links = [np.unique(mesh.cells[mesh.link_of_cell == k]) for k in (0, 1)]
        return [np.sort(mesh.vertices[own, 1]) for own in links]

    first, second = heights(("left", "right")), heights(("right", "left"))
    assert first[0] == pytest.approx(first[1], abs=1e-12)
    assert first[0] == pytest.approx(second[0], abs=1e-12)
