"""Links from CAD files, outlines and mesh files behave as the same link described as a strip."""

from __future__ import annotations

from math import cos, pi, sin
from pathlib import Path

import numpy as np
import pytest

import fenicsmech as fm

MESHES = Path(__file__).parents[2] / "meshes"
PLASTIC = fm.Material("plastic", 2000.0, 0.35)


def pulled(shape, *, radius: float, space: str, size: float, force: float = 5.0) -> float:
    """Displacement along x of the far pin of a link from (0, 0) to (60, 0) under ``force``."""
    mechanism = fm.Mechanism("bench")
    ground, slide = mechanism.rigid("ground", fixed=True), mechanism.rigid("slide")
    link = mechanism.flexible("link", shape, PLASTIC)
    mechanism.revolute(ground, link, at=(0, 0), interface_radius=radius)
    mechanism.revolute(link, slide, at=(60, 0), interface_radius=radius)
    mechanism.prismatic(ground, slide, at=(60, 0), axis=(1, 0))
    pull = mechanism.force(on=slide, at=(60, 0), direction=(1, 0))
    curve = fm.Simulation(fm.Scene(mechanism), space=space, size=size).load_displacement(pull, forces=[force])
    return curve.frames[-1].displacement


def arc(n: int = 41) -> list[tuple[float, float]]:
    """The centreline of the CAD part: radius 50 through both pins."""
    half = np.arcsin(30.0 / 50.0)
    angles = np.linspace(pi / 2 + half, pi / 2 - half, n)
    return [(30.0 + 50.0 * cos(a), 50.0 * sin(a) - 40.0) for a in angles]


def test_section_of_a_cad_part_bends_like_the_strip_it_was_drawn_as():
    # both are rigid within 4 mm of the pins; the holes lie inside
    part = fm.step_file(MESHES / "curved_link.step", depth=10.0)
    same = fm.strip(arc(), thickness=3.0, depth=10.0)
    options = {"space": "plane-stress", "size": 0.75}
    drawn = pulled(part, radius=3.5, **options)
    assert drawn == pytest.approx(pulled(same, radius=3.0, **options), rel=0.06)


@pytest.mark.thorough
def test_solid_cad_part_lies_between_plane_stress_and_plane_strain():
    part = fm.step_file(MESHES / "curved_link.step", depth=10.0)
    stress, strain = (pulled(part, radius=3.5, space=s, size=1.0) for s in ("plane-stress", "plane-strain"))
    solid = pulled(part, radius=3.5, space="3d", size=2.5)
    assert strain < solid < stress


def test_outline_of_lines_and_arcs_equals_the_strip_of_the_same_shape():
    inner, outer = 48.5, 51.5
    half = np.arcsin(30.0 / 50.0)

    def at(radius, angle):
        return (30.0 + radius * cos(angle), radius * sin(angle) - 40.0)

    left, right = pi / 2 + half, pi / 2 - half
    # the strip's flat ends pass through the pins, its eyes are discs of radius 3 there: draw the eyes as arcs
    start, end = arc()[0], arc()[-1]
    corners = {
        key: _on_eye(pin, radius)
        for key, pin, radius in (("a", start, outer), ("b", end, outer), ("c", end, inner), ("d", start, inner))
    }
    shape = fm.outline(
        corners["a"],
        [
            fm.Arc(at(outer, pi / 2), corners["b"]),
            fm.Arc((end[0] + 3.0 * cos(right - pi / 2), end[1] + 3.0 * sin(right - pi / 2)), corners["c"]),
            fm.Arc(at(inner, pi / 2), corners["d"]),
            fm.Arc((start[0] + 3.0 * cos(left + pi / 2), start[1] + 3.0 * sin(left + pi / 2)), corners["a"]),
        ],
        depth=10.0,
    )
    options = {"radius": 2.9, "space": "plane-stress", "size": 0.75}
    assert pulled(shape, **options) == pytest.approx(
        pulled(fm.strip(arc(), thickness=3.0, depth=10.0), **options), rel=2e-3
    )


def _on_eye(pin, radius) -> tuple[float, float]:
    """Point at which the circle of ``radius`` about (30, −40) crosses the eye of radius 3 about ``pin``, inwards."""
    centre, pin = np.array([30.0, -40.0]), np.array(pin)
    apart = np.linalg.norm(pin - centre)
    along = (apart**2 + radius**2 - 9.0) / (2.0 * apart)
    aside = np.sqrt(radius**2 - along**2)
    direction = (pin - centre) / apart
    across = np.array([-direction[1], direction[0]]) * (1.0 if pin[0] > 30.0 else -1.0)
    return tuple(centre + along * direction + aside * across)


@pytest.mark.parametrize(("name", "space"), [("strip2d.msh", "plane-stress"), ("strip3d.msh", "3d")])
def test_mesh_file_gives_what_meshing_the_strip_gives(name, space):
    # straight: stretched, so that the answer is not that of a beam in bending
    part = fm.gmsh_mesh(MESHES / name, depth=10.0)
    same = fm.strip([(0, 0), (60, 0)], thickness=3.0, depth=10.0)
    assert pulled(part, radius=3.0, space=space, size=3.0) == pytest.approx(
        pulled(same, radius=3.0, space=space, size=3.0), rel=5e-3
    )
