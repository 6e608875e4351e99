"""Whether an error about a scene that makes sense is true, judged without the solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import fenicsmech as fm

from .blueprint import Blueprint, Built, GravityPlan, SpringPlan
from .generator import bending_force
from .motions import body_modes, moved
from .potential import Potential
from .stability_check import eigenvalues

_STEP = 1e-30
_IMMOBILE = 1e-9
_SOFT = 0.1
_HUGE = 10.0
_UNREACHED = 1e3
_ROUNDED = 1e-14


def true_reason(blueprint: Blueprint, built: Built | None, failure: fm.FenicsmechError) -> str:
    """The reason why the error is right, empty if it is not."""
    if not isinstance(failure, fm.EquilibriumError):
        return ""
    if blueprint.control == "displacements" and failure.last is not None and immobile(blueprint, built, failure.last):
        return "the point cannot move that way"
    if blueprint.control == "displacements" and failure.last is not None:
        if abs(failure.last.force) > _UNREACHED * min(map(bending_force, blueprint.flexible)):
            return "links stretched straight: a thousand times and more what bends the softest"
    if drowned(blueprint):
        return "springs softer than the rounding of stiff links"
    if adrift(blueprint):
        return "nothing but the force holds the mechanism"
    if blueprint.control == "forces" and max(map(abs, blueprint.samples)) > _HUGE * min(
        map(bending_force, blueprint.flexible)
    ):
        return "a load ten times and more what bends the softest link"
    if failure.last is not None and at_limit(blueprint, built, failure.last):
        return "at a limit point"
    return ""


def adrift(blueprint: Blueprint) -> bool:
    """Whether a mechanism of mobility one has neither motor, clamp nor spring."""
    if blueprint.topology == "two-link arch" or blueprint.motors:
        return False
    held = any(joint.kind == "weld" for joint in blueprint.joints)
    return not held and not any(isinstance(plan, SpringPlan) for plan in blueprint.effects)


def drowned(blueprint: Blueprint) -> bool:
    """Whether a spring is softer than the rounding of what the stiffest link does to its joint.

    A link of width b and modulus E, in elements about as long as thick, has nodal stiffnesses of E b, each rounded to
    1e-16 of itself; a joint feels those of some thousand nodes at arms of the mechanism's length ℓ: k < 1e-14 E b ℓ².
    """
    stiffest = max(link.young * link.depth for link in blueprint.flexible)
    for plan in blueprint.effects:
        if isinstance(plan, SpringPlan):
            arm = 1.0 if blueprint.joint(plan.joint).kind == "prismatic" else blueprint.length
            if plan.stiffness < _ROUNDED * stiffest * arm**2:
                return True
    return False


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


def at_limit(blueprint: Blueprint, built: Built, frame: fm.Frame) -> bool:
    """Whether the last equilibrium has all but lost the stiffness of its softest mode, that of the unloaded scene."""
    share = frame.state.load_factor
    loaded = Potential.of(_scaled(blueprint, share), built.simulation)
    unloaded = Potential.of(_scaled(blueprint, 0.0), built.simulation)
    drawn = built.simulation.linkage.joints.drawn
    before = eigenvalues(unloaded, np.zeros(unloaded.mesh.nodes.size), drawn, 0.0)[0]
    return eigenvalues(loaded, frame.state.u, frame.state.poses, frame.force)[0] < _SOFT * before


def _scaled(blueprint: Blueprint, share: float) -> Blueprint:
    """With a share of all constant loads; springs wind up with it."""
    effects = []
    for plan in blueprint.effects:
        match plan:
            case SpringPlan():
                effects.append(replace(plan, rest=share * plan.rest))
            case GravityPlan():
                effects.append(replace(plan, density=share * plan.density))
            case _:
                effects.append(plan)
    forces = tuple(replace(force, magnitude=share * force.magnitude) for force in blueprint.forces)
    return replace(blueprint, effects=tuple(effects), forces=forces)
