"""Whether an error about a scene that makes sense is true, judged without the solver."""

from __future__ import annotations

import numpy as np

import fenicsmech as fm

from .blueprint import Blueprint, Built, SpringPlan
from .draw import bending_force
from .motions import body_modes, moved
from .potential import Potential
from .stability_check import eigenvalues
from .thresholds import THRESHOLDS

_STEP = 1e-30


def true_reason(blueprint: Blueprint, built: Built | None, failure: fm.FenicsmechError) -> str:
    """The reason why the error is right, empty if it is not."""
    if not isinstance(failure, fm.EquilibriumError):
        return ""
    displaced = blueprint.control in ("displacements", "path")
    if displaced and failure.last is not None and immobile(blueprint, built, failure.last):
        return "the point cannot move that way"
    if displaced and failure.last is not None:
        if abs(failure.last.force) > THRESHOLDS.unreached * min(map(bending_force, blueprint.flexible)):
            return "links stretched straight: a thousand times and more what bends the softest"
    if drowned(blueprint):
        return "springs softer than the rounding of stiff links"
    if adrift(blueprint):
        return "nothing but the force holds the mechanism"
    if blueprint.control == "forces" and max(map(abs, blueprint.samples)) > THRESHOLDS.huge * min(
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
            if plan.stiffness < THRESHOLDS.drowned * stiffest * arm**2:
                return True
    return False


def immobile(blueprint: Blueprint, built: Built, frame: fm.Frame) -> bool:
    """Whether no admissible motion takes the force's point along its direction, by the geometry of joints alone."""
    potential = Potential.of(blueprint, built.simulation)
    places = potential.places(frame.state.poses)
    u = potential.nodal(potential.fields(frame.state.u)[0], places)
    if abs(potential.led_travel(u + 1j * _STEP * potential.free, places).imag) > 0.0:
        return False
    rates = [
        potential.led_travel(potential.nodal(u, there), there).imag / _STEP
        for there in (moved(places, 1j * _STEP * mode) for mode in body_modes(potential, places))
    ]
    return float(np.linalg.norm(rates)) < THRESHOLDS.immobile


def at_limit(blueprint: Blueprint, built: Built, frame: fm.Frame) -> bool:
    """Whether the last equilibrium has all but lost the stiffness of its softest mode, that of the unloaded scene."""
    loaded = Potential.of(blueprint, built.simulation, frame.state.load_factor)
    unloaded = Potential.of(blueprint, built.simulation, 0.0)
    drawn = built.simulation.linkage.joints.drawn
    before = eigenvalues(unloaded, np.zeros(unloaded.mesh.nodes.size), drawn, 0.0)[0]
    return eigenvalues(loaded, frame.state.u, frame.state.poses, frame.force)[0] < THRESHOLDS.soft * before
