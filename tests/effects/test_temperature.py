"""Links that get warmer expand without stress, bend where they are of two materials, and are differentiated."""

from __future__ import annotations

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.stress import von_mises

from ..design.refusal import refused
from ..elasticity.single_link import interpolate
from .design_slope import assert_design_gradient

E, NU, ALPHA = 2000.0, 0.3, 8e-5
NYLON = fm.Material("nylon", E, NU, expansion=ALPHA)
LOW, HIGH = (1.0, 2000.0, 2e-5), (1.5, 1500.0, 1e-5)  # thickness, modulus and expansion of two leaves
DEEP = [pytest.param(space, marks=pytest.mark.thorough) for space in ("plane-strain", "3d-symmetric")]


def bar(space: str, *effects, bow: float = 0.0, material: fm.Material = NYLON, stands: bool = False):
    """A bar of 12 by 2 by 3 between two blocks, whose second one is free, or slides across; and a force on it."""
    rig = fm.Mechanism("bar")
    wall, block = rig.rigid("wall", fixed=True), rig.rigid("block")
    line = [(-1, 0), (6, bow), (13, 0)] if bow else [(-1, 0), (13, 0)]
    link = rig.flexible("bar", fm.strip(line, thickness=2.0, depth=3.0), material)
    for end, at in ((wall, (-1, 0)), (block, (13, 0))):
        rig.weld(end, link, at=at, region=fm.Rectangle(2.0, 8.0))
    if stands:
        rig.prismatic(wall, block, at=(12, 0), axis=(0, 1))
    push = rig.force(on=block, at=(12, 0), direction=(0, 1))
    return fm.Simulation(fm.Scene(rig, [effect(link) for effect in effects]), space=space, size=2.0), push


def stretched(space: str, gradient: np.ndarray, *effects):
    """The elastic body of a bar whose displacements have a uniform gradient; and its stresses away from interfaces."""
    model = bar(space, *effects)[0].model
    body = model.elastic
    interpolate(body.u, lambda x: x @ gradient[: body.model.dim, : body.model.dim].T)
    return body, von_mises(body.stress_samples()[0])[model.mesh.interface < 0]


@pytest.mark.parametrize("space", ["plane-stress", *DEEP[1:]])
def test_a_link_expands_by_its_coefficient_without_stress(space):
    warm, along, ratio = 1.0 + 500.0 * ALPHA, np.array([0.6, 0.8, 0.0]), 1.1
    tendon = np.eye(3) + (ratio - 1.0) * np.outer(along, along)
    heat = lambda link: fm.Temperature(500.0)  # noqa: E731
    pull = lambda link: fm.Prestrain(link, ratio, (0.6, 0.8))  # noqa: E731
    for effects, growth in (((heat,), warm * np.eye(3)), ((heat, pull), warm * tendon)):
        body, stresses = stretched(space, growth - np.eye(3), *effects)
        assert body.energy() == pytest.approx(0.0, abs=1e-20 * E)
        assert np.abs(body.residuals()).max() < 1e-10 * E
        assert stresses.max() < 1e-10 * E


@pytest.mark.thorough
def test_in_plane_strain_the_depth_is_pressed():
    """σ₃₃ = −E α ΔT alone, where the link is free to expand by (1 + ν) α ΔT in its plane."""
    body, stresses = stretched("plane-strain", 1e-6 * (1.0 + NU) * np.eye(3), lambda link: fm.Temperature(1e-6 / ALPHA))
    assert stresses == pytest.approx(1e-6 * E, rel=1e-4)
    assert np.abs(body.residuals()).max() < 1e-10 * E


def turn(space: str, length: float, change: float) -> float:
    """How far the free block turns that two leaves on each other, clamped at both ends, hold on a wall."""
    rig = fm.Mechanism("bimetal")
    wall, block = rig.rigid("wall", fixed=True), rig.rigid("block")
    for name, side, (thickness, modulus, expansion) in (("low", -0.5, LOW), ("high", 0.5, HIGH)):
        y, metal = side * thickness, fm.Material(name, modulus, NU, expansion=expansion)
        leaf = rig.flexible(name, fm.strip([(-1, y), (length + 1, y)], thickness=thickness, depth=1.0), metal)
        rig.clamp(wall, leaf, end="start", length=1.0)
        rig.clamp(block, leaf, end="end", length=1.0)
    idle = rig.force(on=block, at=(length, 0), direction=(0, 1))
    simulation = fm.Simulation(fm.Scene(rig, [fm.Temperature(change)]), space=space, size=0.5)
    (frame,) = simulation.load_displacement(idle, forces=[0.0]).frames
    return float(fm.Rotation(block).on(simulation.model).values(frame.state)[-1])


@pytest.mark.parametrize("space", ["plane-stress", *DEEP])
def test_two_leaves_bend_as_the_bimetal_of_timoshenko(space):
    """κ = 6 (α₁ − α₂) ΔT (1 + m)² / h (3 (1 + m)² + (1 + m n) (m² + 1 / m n)), in plane strain 1 + ν times as much.

    Leaves that bend into concentric arcs stay on each other, bonded or not; the axial forces bend them by the square of
    their angle. Clamps add the same to either length. Source: Timoshenko, Analysis of bi-metal thermostats
    (doi:10.1364/JOSA.11.000233).
    """
    change = 5.0
    (t1, e1, a1), (t2, e2, a2) = LOW, HIGH
    m, n = t1 / t2, e1 / e2
    bend = 6.0 * (a1 - a2) * change * (1 + m) ** 2 / (3.0 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1.0 / (m * n)))
    curvature = bend / (t1 + t2) * (1.0 + NU if space == "plane-strain" else 1.0)
    found = (turn(space, 24.0, change) - turn(space, 12.0, change)) / 12.0
    assert found == pytest.approx(curvature, rel=1e-4)


@pytest.mark.thorough
def test_displacements_of_a_warm_link_are_differentiated_by_the_design_field():
    simulation, push = bar("plane-stress", lambda link: fm.Temperature(800.0), bow=2.0, stands=True)
    assert_design_gradient(simulation, push, 1.0)


def test_links_are_warmed_as_named():
    a, b = (fm.FlexibleLink(name, fm.strip([(0, 0), (9, 0)], thickness=1.0, depth=1.0), NYLON) for name in "ab")
    assert fm.Temperature(5.0).changes([a, b]) == {a: 5.0, b: 5.0}
    assert fm.Temperature(5.0, b).changes([a, b]) == {b: 5.0}
    each = fm.Temperature({a: 5.0, b: -3.0})
    assert each.changes([b, a]) == {a: 5.0, b: -3.0}
    assert each == fm.Temperature((5.0, -3.0), [a, b])
    assert hash(each) == hash(fm.Temperature((5.0, -3.0), (a, b)))
    assert each.explain() == "free thermal expansion of a by +5 K, b by -3 K"


def test_invalid_temperatures_are_refused():
    simulation, push = bar("plane-stress")
    mechanism = simulation.scene.mechanism
    (link,) = mechanism.flexible_links

    def simulate(*effects, material: fm.Material = NYLON):
        return lambda: bar("plane-stress", *(lambda link, own=own: own for own in effects), material=material)

    refused(
        simulate(fm.Temperature(5.0), material=fm.ONYX),
        part="material 'Onyx'",
        problem="expansion is not known, and the temperature of link 'bar'",
        remedy="expansion=",
    )
    other = fm.FlexibleLink("other", link.shape, NYLON)
    refused(simulate(fm.Temperature(5.0, other)), part="temperature", problem="not a flexible link of", remedy="Name")
    refused(simulate(fm.Temperature(-13000.0)), part="'bar'", problem="leave no length", remedy="smaller")
    refused(
        lambda: fm.Temperature(5.0, mechanism.rigid_links), part="temperature", problem="not a flex", remedy="rigid"
    )
    refused(lambda: fm.Temperature(5.0, [link, link]), part="temperature", problem="'bar', 'bar'", remedy="once")
    refused(lambda: fm.Temperature((5.0, 6.0), link), part="temperature", problem="5.0, 6.0", remedy="{link: change")
    refused(lambda: fm.Temperature({link: 5.0}, link), part="temperature", problem="given twice", remedy="alone")
    refused(lambda: fm.Temperature({link: "hot"}), part="'bar'", problem="'hot' is not a number", remedy="finite")
    twice, push = bar("plane-stress", *[lambda link: fm.Temperature(5.0, link)] * 2)
    refused(
        lambda: twice.load_displacement(push, forces=[0.0]),
        part="'bar'",
        problem="Temperature is given twice",
        remedy="one",
    )
