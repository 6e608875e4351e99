"""Whether an error about a scene that makes sense is true, told without the solver."""

from __future__ import annotations

import numpy as np

import fenicsmech as fm

from .blueprint import Blueprint, Built
from .potential import Potential
from .residual_check import body_modes, moved

_STEP = 1e-30
_IMMOBILE = 1e-9


def true_reason(blueprint: Blueprint, built: Built | None, failure: fm.FenicsmechError) -> str:
    """Why the error is right, empty if it is not."""
    if not isinstance(failure, fm.EquilibriumError):
        return ""
    if blueprint.control == "displacements" and failure.last is not None and immobile(blueprint, built, failure.last):
        return "the point cannot move that way"
    return ""


def immobile(blueprint: Blueprint, built: Built, frame: fm.Frame) -> bool:
    """Whether no admissible motion takes the force's point along its direction, by the geometry of joints alone."""
    potential = Potential.of(blueprint, built.simulation)
    force, places = blueprint.forces[0], potential.places(frame.state.poses)
    u = potential.nodal(np.array(frame.state.u).reshape(potential.mesh.nodes.shape), places)
    if force.on in potential.rows:
        free = (potential.held < 0)[:, None] * np.ones(u.shape)
        if abs(potential.travel(force, u + 1j * _STEP * free, places).imag) > 0.0:
            return False
    rates = [
        potential.travel(force, potential.nodal(u, there), there).imag / _STEP
        for there in (moved(places, 1j * _STEP * mode) for mode in body_modes(potential, places))
    ]
    return float(np.linalg.norm(rates)) < _IMMOBILE
