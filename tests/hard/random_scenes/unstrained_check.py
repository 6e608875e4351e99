"""Whether loads, weights and springs balance along motions that deform no link.

Stiff links round their nodal forces by more than soft springs or small loads may exert, so that a residual as small as
rounding says nothing about these. The elastic energy does not change along motions that deform no link: there the work
of loads, weights, springs and compliant joints alone must vanish, and their rounding is their own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from .blueprint import CompliancePlan, EffectPlan, GravityPlan, PressurePlan, SpringPlan
from .closure import Place
from .draw import length
from .motions import STEP, body_modes, moved, null_motions
from .potential import Potential
from .thresholds import THRESHOLDS


@dataclass(frozen=True, eq=False)
class UnstrainedMotion:
    """An imaginary step along a motion that deforms no link.

    Attributes:
        du: change of nodal displacements, (n, dim).
        there: where bodies are then.
        deformed: where they are after what the motion deforms links all the same, as its singular value is not quite
            zero: the interfaces of each link as seen from the first one.
        opening: how fast joints open likewise.
    """

    du: np.ndarray
    there: list[Place]
    deformed: list[Place]
    opening: float


def unstrained_motions(potential: Potential, u: np.ndarray, places: list[Place]) -> Iterator[UnstrainedMotion]:
    """Motions that keep joints closed and deform no link.

    Args:
        potential: of the scene.
        u: displacement of all nodes, (n, dim).
        places: of all bodies.
    """
    mesh, length = potential.mesh, potential.blueprint.length
    groups = []
    for row in potential.rows.values():
        cells = mesh.link == row
        groups.append((np.unique(mesh.cells[cells]), [body for body in np.unique(mesh.body[cells]) if body >= 0]))

    def shapes(there: list[Place]) -> np.ndarray:
        """Invariants of unstrained motions: the interfaces of a link as seen from its first one."""
        rows = [np.zeros(0)]
        for _, (first, *others) in groups:
            back, at = there[first].turn.T, there[first].centre + there[first].shift
            for other in others:
                rows.append(back @ (there[other].centre + there[other].shift - at) / length)
                rows.append((back @ there[other].turn).ravel())
        return np.concatenate(rows)

    for motion in null_motions(potential, places, shapes, body_modes(potential, places)):
        there, du = moved(places, 1j * STEP * motion), np.zeros(u.shape, dtype=complex)
        deformed = list(places)
        for nodes, (first, *others) in groups:
            spin, dim = there[first].turn.imag @ places[first].turn.T, len(places[first].centre)
            slide, at = there[first].shift.imag, places[first].centre + places[first].shift
            du[nodes, :dim] = 1j * (slide + ((mesh.nodes + u)[nodes, :dim] - at) @ spin.T)
            for other in others:
                now = places[other]
                shift = there[other].shift.imag - slide - spin @ (now.centre + now.shift - at)
                turn = there[other].turn.imag - spin @ now.turn
                deformed[other] = replace(now, shift=now.shift + 1j * shift, turn=now.turn + 1j * turn)
        opening = float(np.abs(potential.closure.residual(there).imag).max(initial=0.0)) / STEP * length
        yield UnstrainedMotion(du, there, deformed, opening)


def unstrained_work(
    potential: Potential,
    magnitude: float,
    u: np.ndarray,
    p: np.ndarray | None,
    places: list[Place],
    *,
    floor: float,
    reaction: float,
) -> float:
    """Largest work of all that acts along a motion that deforms no link, over loads and torques times velocities.

    Loads count with the velocity of what moves fastest: in a dead centre their own points stand still. Close to one
    links are deformed a little, and their work counts, with that of pressures, which as strain balance on each link:
    what interfaces bear is the sum of both. What rounding does to springs' coordinates is left out, what it may do to
    the force where displacements are prescribed or followed to, which takes all that it leaves (``floor``), and the
    work of the largest ``reaction`` where joints open by rounding.
    """
    shares = []
    for motion in unstrained_motions(potential, u, places):
        there, whole = motion.there, potential.blueprint.length
        speeds = [np.abs(motion.du).max(), *(np.abs(body.shift.imag).max() for body in there)]
        speeds += [np.abs(body.turn.imag).max() * whole for body in there]
        fastest = float(max(speeds)) / STEP
        along, deformed = potential.nodal(u + motion.du, there), potential.nodal(u, motion.deformed)
        work = float(np.imag(potential.strain_energy(deformed, p))) / STEP
        size, grain = 0.0, reaction * (THRESHOLDS.opening * motion.opening + THRESHOLDS.rounded * fastest)
        for force, amount in potential.acting(magnitude):
            work -= amount * float(np.imag(potential.travel(force, along, there))) / STEP
            size += abs(amount) * fastest
        if potential.blueprint.control != "forces":
            grain += THRESHOLDS.rounding * floor * fastest
        for plan in potential.blueprint.effects:
            pressure = isinstance(plan, PressurePlan)
            at = deformed if pressure else along
            part = float(np.imag(potential.alone(plan).effect_energy(at, there))) / STEP
            work += part
            if not pressure:
                size += _held(potential, plan, places) * fastest
            grain += _grain(potential, plan, places, there, fastest)
        if size > 0.0:  # nothing balances where nothing acts
            shares.append(max(0.0, abs(work) - grain) / size)
    return max(shares, default=0.0)


def _held(potential: Potential, plan: EffectPlan, places: list[Place]) -> float:
    """The force of a spring, turned by the mechanism's length, of a joint that gives way, or the weight."""
    match plan:
        case SpringPlan(joint=name, stiffness=stiffness, rest=rest):
            joint = potential.blueprint.joint(name)
            turn = potential.closure.coordinate(joint, places).real - potential.load_factor * rest
            return float(abs(stiffness * turn)) / (1.0 if joint.kind == "prismatic" else potential.blueprint.length)
        case CompliancePlan(joint=name, compliance=compliance):
            gap = potential.closure.gap(potential.blueprint.joint(name), places).real
            return float(np.sqrt(np.sum(gap**2))) / compliance
        case GravityPlan():
            return potential.weight
    return 0.0


def _grain(potential: Potential, plan: EffectPlan, places: list[Place], there: list[Place], fastest: float) -> float:
    """Work at the edge of rounding: of a spring, a compliant joint, or the nodal forces of a pressure, which cancel.

    F = I + ∇u is rounded alike in all elements of a straight link, so that the errors of a pressure's forces add up.
    """
    whole = potential.blueprint.length
    match plan:
        case SpringPlan(joint=name, stiffness=stiffness):
            joint = potential.blueprint.joint(name)
            unit = whole if joint.kind == "prismatic" else 1.0
            turn = abs(potential.closure.coordinate(joint, places).real)
            speed = abs(potential.closure.coordinate(joint, there).imag) / STEP
            return float(stiffness * speed * THRESHOLDS.grain * (unit + turn))
        case CompliancePlan(joint=name, compliance=compliance):
            rate = potential.closure.gap(potential.blueprint.joint(name), there).imag
            return float(np.sqrt(np.sum(rate**2)) / STEP * THRESHOLDS.grain * whole / compliance)
        case PressurePlan(link=name, pressure=pressure):
            strip = potential.blueprint.link(name)
            around = 2.0 * abs(pressure) * strip.depth * length(strip)
            return float(THRESHOLDS.rounding * np.finfo(float).eps * around * fastest)
    return 0.0
