"""A bistable four-bar: a rigid crank and coupler, and a flexible follower clamped to the ground.

Pushed through the line from its pivot to the follower's pin, the crank snaps to the mirror image of where it was, which
is free of strain as well: there the rigid four-bar's two assemblies meet the follower's rest shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

import fenicsmech as fm
from fenicsmech.mechanism import Force

from ..oracles import beam, centreline

RUN, RISE = 25.0, 8.0
KNEE, PIN, ROOT = np.array([RUN, RISE]), np.array([2.0 * RUN, 0.0]), np.array([2.0 * RUN, -40.0])
COUPLER = float(np.hypot(RUN, RISE))
THICKNESS, DEPTH, BLOCK = 2.0, 5.0, 4.0
SIZE = {"plane-stress": 1.0, "3d": THICKNESS}
PLASTIC = fm.Material("plastic", 2000.0, 0.3)
CORK = fm.Material("cork", 2000.0, 0.0)  # a clamp does not keep it from contracting, as none does a beam


@dataclass(frozen=True)
class FourBar:
    """A simulation and the force that pushes the knee down."""

    simulation: fm.Simulation
    push: Force


def four_bar(
    comm: MPI.Comm = MPI.COMM_SELF, *, space: str = "plane-stress", material: fm.Material = PLASTIC
) -> FourBar:
    """The four-bar as drawn."""
    mechanism = fm.Mechanism("bistable four-bar")
    base = mechanism.rigid("base", fixed=True)
    crank, coupler = mechanism.rigid("crank"), mechanism.rigid("coupler")
    shape = fm.strip([ROOT - (0.0, BLOCK), PIN], thickness=THICKNESS, depth=DEPTH)
    follower = mechanism.flexible("follower", shape, material)
    mechanism.revolute(base, crank, at=(0, 0))
    mechanism.revolute(crank, coupler, at=tuple(KNEE))
    mechanism.revolute(coupler, follower, at=tuple(PIN), interface_radius=0.5 * THICKNESS)
    region = fm.Rectangle(1.5 * THICKNESS, BLOCK)
    mechanism.weld(base, follower, at=tuple(ROOT - (0.0, 0.5 * BLOCK)), region=region)
    push = mechanism.force(on=crank, at=tuple(KNEE), direction=(0, -1), name="push")
    return FourBar(fm.Simulation(fm.Scene(mechanism), space=space, size=SIZE[space], comm=comm), push)


def forces(displacements: np.ndarray, material: fm.Material = PLASTIC) -> np.ndarray:
    """Forces of the four-bar with a beam for its follower.

    The knee A turns about the crank's pivot, the pin B about the knee. The coupler carries a force along itself only:
    that fixes B, and the moment about the crank's pivot the force, A × (F (0, −1) − P) = 0 with P on the follower.
    """
    section = beam.Section.rectangle(young=material.law.E, poisson=material.law.nu, thickness=THICKNESS, depth=DEPTH)
    line = centreline.through([tuple(ROOT), tuple(PIN)])
    line = line.trimmed(0.0, 0.5 * THICKNESS)
    follower = beam.Beam(line, section, end_pin=tuple(PIN))
    found, solution = [], None
    for displacement in displacements:
        height = RISE - displacement
        knee = np.array([np.sqrt(COUPLER**2 - height**2), height])

        def bent(angle: float, knee=knee, start=solution):
            pin = knee + COUPLER * np.array([np.cos(angle), np.sin(angle)])
            x, y = pin - PIN
            return beam.solve(follower, beam.CLAMPED, beam.End(x=x, y=y), initial=start)

        def across(angle: float, bent=bent) -> float:
            return float(np.dot(bent(angle).end.force, (-np.sin(angle), np.cos(angle))))

        level = -np.arcsin(height / COUPLER)  # of the coupler if its pin stays as high as drawn
        angle = brentq(across, level - 0.05, level + 0.05, xtol=1e-12)
        solution = bent(angle)
        pull = solution.end.force
        found.append(-(knee[0] * pull[1] - knee[1] * pull[0]) / knee[0])
    return np.array(found)
