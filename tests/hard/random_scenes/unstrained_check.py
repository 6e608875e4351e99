"""Whether loads, weights and springs balance along motions that deform no link.

Stiff links round their nodal forces by more than soft springs or small loads may exert, so that a residual as small as
rounding says nothing about these. The elastic energy does not change along motions that deform no link: there the work
of loads, weights, springs and compliant joints alone must vanish, and their rounding is their own.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .blueprint import CompliancePlan, EffectPlan, GravityPlan, SpringPlan
from .closure import Place
from .motions import STEP, moved, null_motions
from .potential import Potential
from .thresholds import THRESHOLDS


def unstrained_motions(
    potential: Potential, u: np.ndarray, places: list[Place]
) -> Iterator[tuple[np.ndarray, list[Place], float]]:
    """Imaginary steps along motions that deform no link.

    Yields:
        The change of nodal displacements (n, dim), where bodies are then, and how fast joints open all the same:
        motions are those of singular values that are all but zero.

    Args:
        potential: of the scene.
        u: displacement of all nodes, (n, dim).
        places: of all bodies.
    """
    mesh = potential.mesh
    groups = []
    for row in potential.rows.values():
        cells = mesh.link == row
        groups.append((np.unique(mesh.cells[cells]), [body for body in np.unique(mesh.body[cells]) if body >= 0]))

    def stiff(there: list[Place]) -> np.ndarray:
        """Invariants of unstrained motions: joints, and the interfaces of a link as seen from its first one."""
        rows = [potential.closure.residual(there)]
        for _, (first, *others) in groups:
            back, at = there[first].turn.T, there[first].centre + there[first].shift
            for other in others:
                rows.append(back @ (there[other].centre + there[other].shift - at) / potential.blueprint.length)
                rows.append((back @ there[other].turn).ravel())
        return np.concatenate(rows)

    for motion in null_motions(potential, places, stiff):
        there, du = moved(places, 1j * STEP * motion), np.zeros(u.shape, dtype=complex)
        for nodes, (first, *_) in groups:
            spin, dim = there[first].turn.imag @ places[first].turn.T, len(places[first].centre)
            carried = (mesh.nodes + u)[nodes, :dim] - (places[first].centre + places[first].shift)
            du[nodes, :dim] = 1j * (there[first].shift.imag + carried @ spin.T)
        opening = float(np.abs(stiff(there).imag).max()) / STEP * potential.blueprint.length
        yield du, there, opening


def unstrained_work(
    potential: Potential, magnitude: float, u: np.ndarray, places: list[Place], *, floor: float, reaction: float
) -> float:
    """Largest work of all that acts along a motion that deforms no link, over loads and torques times velocities.

    Loads count with the velocity of what moves fastest: in a dead centre their own points stand still. What rounding
    does to springs' coordinates is left out, what it does to the force under displacement control, which takes all that
    it leaves (``floor``), and the work of the largest ``reaction`` where joints open by rounding.
    """
    shares = []
    for du, there, opening in unstrained_motions(potential, u, places):
        length = potential.blueprint.length
        speeds = [np.abs(du).max(), *(np.abs(body.shift.imag).max() for body in there)]
        speeds += [np.abs(body.turn.imag).max() * length for body in there]
        fastest = float(max(speeds)) / STEP
        work, size, grain = 0.0, 0.0, reaction * (THRESHOLDS.opening * opening + THRESHOLDS.rounded * fastest)
        for force, amount in potential.acting(magnitude):
            work -= amount * float(np.imag(potential.travel(force, u + du, there))) / STEP
            size += abs(amount) * fastest
        if potential.blueprint.control == "displacements":
            grain += floor * fastest
        for plan in potential.blueprint.effects:
            part = float(np.imag(potential.alone(plan).effect_energy(u + du, there))) / STEP
            work += part
            size += potential.weight * fastest if isinstance(plan, GravityPlan) else abs(part)
            grain += _grain(potential, plan, places, there) / STEP
        shares.append(max(0.0, abs(work) - grain) / max(size, 1e-300))
    return max(shares, default=0.0)


def _grain(potential: Potential, plan: EffectPlan, places: list[Place], there: list[Place]) -> float:
    """Work of a spring or a compliant joint at the edge of rounding."""
    length = potential.blueprint.length
    match plan:
        case SpringPlan(joint=name, stiffness=stiffness):
            joint = potential.blueprint.joint(name)
            unit = length if joint.kind == "prismatic" else 1.0
            turn = abs(potential.closure.coordinate(joint, places).real)
            return float(
                stiffness * abs(potential.closure.coordinate(joint, there).imag) * THRESHOLDS.grain * (unit + turn)
            )
        case CompliancePlan(joint=name, compliance=compliance):
            rate = potential.closure.gap(potential.blueprint.joint(name), there).imag
            return float(np.sqrt(np.sum(rate**2)) * THRESHOLDS.grain * length / compliance)
    return 0.0
