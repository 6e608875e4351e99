"""A slender clamped link under a small tip load, and how far beam theory lets it move."""

from dataclasses import dataclass

import fenicsmech as fm
from benchmarks.work_precision import Quantity

YOUNG, LENGTH, THICKNESS, LOAD = 1000.0, 12.0, 1.0, 1e-3


@dataclass(frozen=True)
class Cantilever:
    """The scene, the tip's displacement, and its value with bending and shear of a beam (ν = 0)."""

    scene: fm.Scene
    tip: Quantity
    expected: float


def cantilever() -> Cantilever:
    """The link from x = 0 to LENGTH, as deep as thick, between blocks that clamp it outside of that."""
    mechanism = fm.Mechanism("cantilever")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    shape = fm.strip([(-THICKNESS, 0), (LENGTH + THICKNESS, 0)], thickness=THICKNESS, depth=THICKNESS)
    material = fm.Material("rubber", YOUNG, 0.0)
    beam = mechanism.flexible("beam", shape, material)
    clamp = fm.Rectangle(THICKNESS, 1.5 * THICKNESS)
    mechanism.weld(base, beam, at=(-0.5 * THICKNESS, 0), region=clamp)
    mechanism.weld(beam, hand, at=(LENGTH + 0.5 * THICKNESS, 0), region=clamp)
    force = mechanism.force(on=hand, at=(LENGTH, 0), direction=(0, 1), name="tip load")
    # the hand is free to turn: w = P L³ / 3EI + 6/5 P L / GA
    inertia, area, shear = THICKNESS**4 / 12.0, THICKNESS**2, YOUNG / 2.0
    expected = LOAD * LENGTH**3 / (3.0 * YOUNG * inertia) + 1.2 * LOAD * LENGTH / (shear * area)
    return Cantilever(fm.Scene(mechanism), Quantity(force, LOAD), expected)
