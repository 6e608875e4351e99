"""Elements that are too long to bend with a thin link are told, where measured errors say so."""

from __future__ import annotations

import logging

import numpy as np
import pytest

import fenicsmech as fm

PLASTIC = fm.Material("plastic", 2000.0, 0.35)
THICK, LONG = 1.0, 40.0


def leaf(kind: str) -> tuple[fm.Scene, fm.Force]:
    """A leaf between two welds, straight or a quarter of a circle, drawn as a strip or a polygon, bent by a third."""
    rig = fm.Mechanism("leaf spring")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    line = np.array([(0.0, 0.0), (LONG, 0.0)])
    if "bow" in kind:
        angles, radius = np.linspace(0.0, np.pi / 2.0, 9), 2.0 * LONG / np.pi
        line = radius * np.column_stack([np.sin(angles), 1.0 - np.cos(angles)])
    if "polygon" in kind:
        sides = np.array([(0.0, 0.5 * THICK)])
        shape = fm.polygon([*map(tuple, line - sides), *map(tuple, (line + sides)[::-1])], depth=5.0)
    else:
        shape = fm.strip([*map(tuple, line)], thickness=THICK, depth=5.0)
    link = rig.flexible("leaf", shape, PLASTIC)
    rig.weld(wall, link, at=tuple(line[0]), interface_radius=THICK)
    rig.weld(hand, link, at=tuple(line[-1]), interface_radius=THICK)
    return fm.Scene(rig), rig.force(on=hand, at=tuple(line[-1]), direction=(1, -1) if "bow" in kind else (0, 1))


def moved(kind: str, size: float, order: int) -> float:
    scene, push = leaf(kind)
    sim = fm.Simulation(scene, space="plane-stress", size=size, order=order)
    return float(sim.load_displacement(push, forces=[0.5]).displacements[0])


@pytest.mark.parametrize(("order", "longest"), [(2, 3.0), (3, 6.0), pytest.param(1, 0.1, marks=pytest.mark.thorough)])
def test_elements_that_are_not_told_bend_with_a_leaf_and_those_twice_as_long_do_not(order, longest):
    for kind in ("straight", "bow"):
        exact = moved(kind, 0.5, 3)
        assert abs(moved(kind, longest, order) / exact - 1.0) < 0.015
    if order < 3:
        assert abs(moved("bow", 2.0 * longest, order) / exact - 1.0) > 0.03


@pytest.mark.parametrize("kind", ["straight", "straight polygon", "bow"])
def test_links_that_are_thinner_than_their_elements_are_told_once(kind, caplog):
    scene, push = leaf(kind)
    with caplog.at_level(logging.WARNING, "fenicsmech"):
        sim = fm.Simulation(scene, space="plane-stress", size=4.0)
        curve = sim.load_displacement(push, forces=[0.1])
        told = [record.message for record in caplog.records if "bend too little" in record.message]
    assert len(told) == 1
    assert "'leaf' is 1 mm thick at its thinnest and its elements 4 mm long" in told[0] and "size=3 " in told[0]
    hints = {hint.what: hint for hint in curve.explain().left_out}
    assert hints["length of elements"].text == told[0] and hints["length of elements"].matters


def test_links_with_elements_short_enough_are_not_told(caplog):
    scene, push = leaf("straight polygon")
    with caplog.at_level(logging.WARNING, "fenicsmech"):
        sim = fm.Simulation(scene, space="plane-stress", size=2.0)
    assert not caplog.records
    explanation = sim.load_displacement(push, forces=[0.1]).explain()
    assert "length of elements" not in [hint.what for hint in explanation.left_out]


def test_a_notch_shorter_than_the_elements_is_no_stretch_of_them(caplog):
    rig = fm.Mechanism("notched")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    below = [(0, -4), (18, -4), (19.5, -0.5), (20.5, -0.5), (22, -4), (40, -4)]
    hinge = rig.flexible("hinge", fm.polygon([*below, *((x, -y) for x, y in below[::-1])], depth=5.0), PLASTIC)
    rig.weld(wall, hinge, at=(0, 0), region=fm.Rectangle(6.0, 10.0))
    rig.weld(hand, hinge, at=(40, 0), region=fm.Rectangle(6.0, 10.0))
    with caplog.at_level(logging.WARNING, "fenicsmech"):
        fm.Simulation(fm.Scene(rig), space="plane-stress", size=4.0)
    assert not [record for record in caplog.records if "bend too little" in record.message]
