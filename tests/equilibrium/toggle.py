"""A toggle that snaps through: a rigid bar between a vertical guide and a horizontal slide that a flexible bar holds.

The bars are straight, cannot bend and have ν = 0, so that they are stretched uniformly in any discretisation:
N = A E/2 (1/λ − λ) for a compression to λ of their length, and all else is geometry. The toggle at the height y has
its slide at x = √(L² − y²) from the guide:

    F = N(λ) y / x,    λ = 1 − (x − x₀) / ℓ

A second, soft bar stands on the guide between the toggle and the force; the more it gives, the more the force's point
turns back when the toggle snaps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.mechanism import Force, Output

RUN, RISE = 50.0, 5.0  # of the rigid bar, as drawn
BAR = float(np.hypot(RUN, RISE))
DEPTH = 10.0
SPRING, SPRING_WIDTH, SPRING_MODULUS = 100.0, 10.0, 100.0
STILT, STILT_WIDTH = 30.0, 12.0


@dataclass(frozen=True)
class Toggle:
    """A simulation, the force on the stilt's head, and how far the toggle has sunk."""

    simulation: fm.Simulation
    push: Force
    sunk: Output


def toggle(*, stilt_modulus: float, space: str = "plane-stress", comm: MPI.Comm = MPI.COMM_SELF) -> Toggle:
    """The toggle, its second bar of the given modulus; elements need no order to hold a uniform strain."""
    mechanism = fm.Mechanism("toggle")
    base = mechanism.rigid("base", fixed=True)
    apex, slide, head, bar = (mechanism.rigid(name) for name in ("apex", "slide", "head", "bar"))
    end, block = RUN + SPRING, 4.0
    shape = fm.strip([(RUN - block, 0), (end + block, 0)], thickness=SPRING_WIDTH, depth=DEPTH)
    spring = mechanism.flexible("spring", shape, fm.Material("spring", SPRING_MODULUS, 0.0))
    top = RISE + STILT
    shape = fm.strip([(0, RISE - block), (0, top + block)], thickness=STILT_WIDTH, depth=DEPTH)
    stilt = mechanism.flexible("stilt", shape, fm.Material("stilt", stilt_modulus, 0.0))
    mechanism.prismatic(base, apex, at=(0, RISE), axis=(0, 1))
    mechanism.prismatic(base, slide, at=(RUN, 0), axis=(1, 0))
    mechanism.prismatic(base, head, at=(0, top), axis=(0, 1))
    mechanism.revolute(apex, bar, at=(0, RISE))
    mechanism.revolute(bar, slide, at=(RUN, 0))
    mechanism.weld(slide, spring, at=(RUN - 0.5 * block, 0), region=fm.Rectangle(block, 1.5 * SPRING_WIDTH))
    mechanism.weld(base, spring, at=(end + 0.5 * block, 0), region=fm.Rectangle(block, 1.5 * SPRING_WIDTH))
    region = fm.Rectangle(1.5 * STILT_WIDTH, block)
    mechanism.weld(apex, stilt, at=(0, RISE - 0.5 * block), region=region)
    mechanism.weld(stilt, head, at=(0, top + 0.5 * block), region=region)
    push = mechanism.force(on=head, at=(0, top), direction=(0, -1), name="push")
    sunk = mechanism.output(on=apex, at=(0, RISE), direction=(0, -1), name="sunk")
    simulation = fm.Simulation(fm.Scene(mechanism), space=space, order=1, size=6.0, comm=comm)
    return Toggle(simulation, push, sunk)


def force(sunk: np.ndarray) -> np.ndarray:
    """The force under which the toggle has sunk so far."""
    height = RISE - sunk
    run = np.sqrt(BAR**2 - height**2)
    stretch = 1.0 - (run - RUN) / SPRING
    return 0.5 * SPRING_WIDTH * DEPTH * SPRING_MODULUS * (1.0 / stretch - stretch) * height / run


def displacement(sunk: np.ndarray, stilt_modulus: float) -> np.ndarray:
    """Displacement of the force's point: the stilt's λ solves 1/λ − λ = 2 F / A E."""
    half = force(sunk) / (STILT_WIDTH * DEPTH * stilt_modulus)
    return sunk + STILT * (1.0 - (np.sqrt(half**2 + 1.0) - half))
