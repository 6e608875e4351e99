"""Elements that are too long to bend with a thin link are named, where measured errors say so."""

from __future__ import annotations

import logging

import numpy as np
import pytest

import fenicsmech as fm

PLASTIC = fm.Material("plastic", 2000.0, 0.35)
THICK, LONG = 1.0, 40.0


def leaf(kind: str, thick: float = THICK, long: float = LONG) -> tuple[fm.Scene, fm.Force]:
    """A leaf between two welds, straight or a quarter of a circle, drawn as a strip or a polygon, bent by a third."""
    rig = fm.Mechanism("leaf spring")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    line = np.array([(0.0, 0.0), (long, 0.0)])
    if "bow" in kind:
        angles, radius = np.linspace(0.0, np.pi / 2.0, 9), 2.0 * long / np.pi
        line = radius * np.column_stack([np.sin(angles), 1.0 - np.cos(angles)])
    if "polygon" in kind:
        sides = np.array([(0.0, 0.5 * thick)])
        shape = fm.polygon([*map(tuple, line - sides), *map(tuple, (line + sides)[::-1])], depth=5.0)
    else:
        shape = fm.strip([*map(tuple, line)], thickness=thick, depth=5.0)
    link = rig.flexible("leaf", shape, PLASTIC)
    rig.weld(wall, link, at=tuple(line[0]), interface_radius=thick)
    rig.weld(hand, link, at=tuple(line[-1]), interface_radius=thick)
    return fm.Scene(rig), rig.force(on=hand, at=tuple(line[-1]), direction=(1, -1) if "bow" in kind else (0, 1))


def moved(kind: str, size: float, order: int, long: float) -> float:
    scene, push = leaf(kind, long=long)
    sim = fm.Simulation(scene, space="plane-stress", size=size, order=order)
    return float(sim.load_displacement(push, forces=[0.5 * (LONG / long) ** 2]).displacements[0])


def warnings_of(caplog) -> list[str]:
    """The warnings of elements that are too long."""
    return [record.message for record in caplog.records if "bend too little" in record.message]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("order", "longest", "longer", "long"),
    # elements grow from those at joints: longer ones need a longer leaf
    [(1, 0.1, 0.2, LONG), (2, 3.0, 6.0, LONG), (3, 8.0, 10.0, 2.0 * LONG)],
)
def test_elements_without_a_warning_bend_with_a_leaf_and_longer_ones_may_not(order, longest, longer, long, caplog):
    for kind in ("straight", "bow"):
        exact = moved(kind, 0.5, 3, long)
        with caplog.at_level(logging.WARNING, "fenicsmech"):
            assert abs(moved(kind, longest, order, long) / exact - 1.0) < 0.015
    assert not warnings_of(caplog)
    with caplog.at_level(logging.WARNING, "fenicsmech"):
        assert abs(moved("bow", longer, order, long) / exact - 1.0) > 0.03
    assert len(warnings_of(caplog)) == 1


@pytest.mark.parametrize("kind", ["straight", "straight polygon", "bow"])
def test_links_that_are_thinner_than_their_elements_are_warned_of_once(kind, caplog):
    scene, push = leaf(kind)
    with caplog.at_level(logging.WARNING, "fenicsmech"):
        sim = fm.Simulation(scene, space="plane-stress", size=4.0)
        curve = sim.load_displacement(push, forces=[0.1])
    warned = warnings_of(caplog)
    assert len(warned) == 1
    assert "'leaf' is drawn 1 mm thick at its thinnest, its elements 4 mm long" in warned[0] and "size=3 " in warned[0]
    hints = {hint.what: hint for hint in curve.explain().left_out}
    assert hints["length of elements"].text == warned[0] and hints["length of elements"].matters


def test_the_size_that_a_warning_advises_gives_none(caplog):
    scene, _ = leaf("straight", thick=1.25)
    with caplog.at_level(logging.WARNING, "fenicsmech"):
        fm.Simulation(scene, space="plane-stress", size=4.0)
        (warned,) = warnings_of(caplog)
        size = float(warned.split("size=")[1].split()[0])
        assert 3.5 < size <= 3.0 * 1.25
        fm.Simulation(scene, space="plane-stress", size=size)
    assert len(warnings_of(caplog)) == 1


def test_rounding_of_a_thickness_gives_no_warning(caplog):
    scene, _ = leaf("straight", thick=7.9999999997)
    with caplog.at_level(logging.WARNING, "fenicsmech"):
        fm.Simulation(scene, space="plane-stress", size=24.0)
    assert not warnings_of(caplog)


def test_thin_shapes_given_later_are_warned_of(caplog):
    scene, _ = leaf("straight", thick=2.0)
    thin, _ = leaf("straight polygon", thick=1.0)
    (link,), (other,) = scene.mechanism.flexible_links, thin.mechanism.flexible_links
    with caplog.at_level(logging.WARNING, "fenicsmech"):
        sim = fm.Simulation(scene, space="plane-stress", size=4.0)
        sim.with_shapes({})
        assert not warnings_of(caplog)
        sim.with_shapes({link: other.shape})
    (warned,) = warnings_of(caplog)
    assert "drawn 1 mm thick" in warned


def test_links_with_elements_short_enough_give_no_warning(caplog):
    scene, push = leaf("straight polygon")
    with caplog.at_level(logging.WARNING, "fenicsmech"):
        sim = fm.Simulation(scene, space="plane-stress", size=2.0)
    assert not caplog.records
    explanation = sim.load_displacement(push, forces=[0.1]).explain()
    assert "length of elements" not in [hint.what for hint in explanation.left_out]


def test_a_notch_shorter_than_the_elements_gives_no_warning(caplog):
    rig = fm.Mechanism("notched")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    below = [(0, -4), (18, -4), (19.5, -0.5), (20.5, -0.5), (22, -4), (40, -4)]
    hinge = rig.flexible("hinge", fm.polygon([*below, *((x, -y) for x, y in below[::-1])], depth=5.0), PLASTIC)
    rig.weld(wall, hinge, at=(0, 0), region=fm.Rectangle(6.0, 10.0))
    rig.weld(hand, hinge, at=(40, 0), region=fm.Rectangle(6.0, 10.0))
    with caplog.at_level(logging.WARNING, "fenicsmech"):
        fm.Simulation(fm.Scene(rig), space="plane-stress", size=4.0)
    assert not warnings_of(caplog)


def test_a_link_with_a_neck_that_cuts_its_medial_axis_is_simulated():
    rig = fm.Mechanism("notched")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    below = [(0, -4), (16, -4), (19, -0.1), (21, -0.1), (24, -4), (40, -4)]
    above = [(40, 4), (24.2, 4), (21.2, 0.1), (19.2, 0.1), (16.2, 4), (0, 4)]
    hinge = rig.flexible("hinge", fm.polygon(below + above, depth=5.0), PLASTIC)
    rig.weld(wall, hinge, at=(0, 0), region=fm.Rectangle(6.0, 10.0))
    rig.weld(hand, hinge, at=(40, 0), region=fm.Rectangle(6.0, 10.0))
    push = rig.force(on=hand, at=(40, 0), direction=(0, 1))
    sim = fm.Simulation(fm.Scene(rig), space="plane-stress", size=1.0)
    assert sim.load_displacement(push, forces=[1e-3]).displacements[0] > 0.0
