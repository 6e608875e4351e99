"""Whether a frame is an equilibrium: the total potential is stationary along admissible directions.

A direction moves free nodes at random, or bodies along the null space of their joints. The derivative of Π along it is
a difference along the imaginary axis, Im Π(s + i h v) / h, which loses no digits. Independent random directions tell
the norm of the whole residual: the mean of (∇Π · v)² is |∇Π|².
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

import fenicsmech as fm

from .blueprint import Blueprint, LinkPlan, PressurePlan, PrestrainPlan
from .closure import Place
from .motions import body_modes, moved
from .potential import Potential
from .strain_energy import REAL
from .thresholds import THRESHOLDS
from .unstrained_check import unstrained_work

_STEP = 1e-30


@dataclass(frozen=True)
class Residual:
    """Findings of the check.

    Attributes:
        gap: largest closure error of joints, motors and interfaces, relative to the mechanism's length.
        force: norm of the residual force.
        scale: largest load or reaction.
        floor: residual force from rounding of displacements alone.
        travel_error: how far the controlled displacement is off, relative to the length.
        energy_error: strain energy against the frame's, relative to it.
        unstrained_work: work along motions that deform no link, over the sum of its parts' sizes; 0 if there are none.
    """

    gap: float
    force: float
    scale: float
    floor: float
    travel_error: float
    energy_error: float
    unstrained_work: float

    @property
    def relative(self) -> float:
        """The residual over the largest load or reaction; 0 where nothing acts."""
        return self.force / self.scale if self.scale > 0.0 else float(self.force > 0.0)


def check(potential: Potential, frame: fm.Frame, origin: float, seed: int = 0) -> Residual:
    """The residual of a frame.

    Args:
        potential: of its simulation.
        frame: what was found.
        origin: travel of the force's point in the unloaded configuration.
        seed: of random directions.
    """
    state = frame.state
    u, p = potential.fields(state.u)
    places = potential.places(state.poses)
    followed = potential.nodal(u, places)
    length = potential.blueprint.length
    gaps = np.abs(potential.closure.residual(places))
    strayed = np.abs(followed - u).max(initial=0.0) / length
    modes = body_modes(potential, places)

    def slope(du: np.ndarray, moved: list[Place]) -> float:
        return float(np.imag(potential.value(potential.nodal(u + du, moved), moved, frame.force, p))) / _STEP

    rng = np.random.default_rng(seed)
    squares = [
        slope(1j * _STEP * rng.standard_normal(u.shape) * potential.free, places) ** 2
        for _ in range(THRESHOLDS.directions)
    ]
    if len(potential.free_pressures):
        squares = [square + _volume_slope(potential, followed, p, rng) ** 2 for square in squares]
    along = [slope(np.zeros(u.shape), moved(places, 1j * _STEP * mode)) for mode in modes]
    force = float(np.sqrt(np.mean(squares) + np.sum(np.square(along))))
    floor, scale = _floor(potential, u, places), _scale(potential, frame, u, p, places)
    travel = float(np.real(potential.led_travel(followed, places))) - origin
    energy = float(potential.strain_energy(followed, p))
    return Residual(
        gap=float(max(gaps.max(initial=0.0), strayed)),
        force=force,
        scale=scale,
        floor=floor,
        travel_error=abs(travel - frame.displacement) / length,
        energy_error=abs(energy - frame.strain_energy) / max(abs(frame.strain_energy), energy_digits(potential)),
        unstrained_work=unstrained_work(potential, frame.force, followed, p, places, floor=floor, reaction=scale),
    )


def fault(blueprint: Blueprint, frame: fm.Frame, sample: float | None, found: Residual) -> str:
    """The fault of a frame, empty if there is none; ``sample`` is what is prescribed."""
    if sample is not None:
        controlled = frame.force if blueprint.control == "forces" else frame.displacement
        size = abs(sample) if blueprint.control == "forces" else blueprint.length
        if abs(controlled - sample) > THRESHOLDS.reached * size:
            return "control missed"
    if found.gap > THRESHOLDS.closed:
        return "joints apart"
    if found.force > max(THRESHOLDS.residual * found.scale, THRESHOLDS.rounding * found.floor):
        return "no equilibrium"
    if found.unstrained_work > THRESHOLDS.balanced:
        return "motions that deform no link are out of balance"
    if not math.isnan(found.travel_error) and found.travel_error > THRESHOLDS.reached:
        return "displacement"
    if found.energy_error > THRESHOLDS.energy:
        return "strain energy"
    return ""


def _volume_slope(potential: Potential, u: np.ndarray, p: np.ndarray, rng: np.random.Generator) -> float:
    """∂Π/∂p along random pressures as large as those that displacements of one lead to: a force."""
    step, plans = np.zeros(p.shape), potential.blueprint.flexible
    size = max(link.young / link.size for link in plans if potential.blueprint.mixed(link))
    step[potential.free_pressures] = size * rng.standard_normal(len(potential.free_pressures))
    return float(np.imag(potential.strain_energy(u, p + 1j * _STEP * step))) / _STEP


def _scale(potential: Potential, frame: fm.Frame, u: np.ndarray, p: np.ndarray, places: list[Place]) -> float:
    """The largest force that acts: loads, those of effects, and what links exert on each body, by virtual work."""
    dim, forces = potential.blueprint.dim, [potential.weight]
    forces += [abs(size) for _, size in potential.acting(frame.force)]
    for plan in potential.blueprint.effects:
        match plan:
            case PressurePlan(link=name, pressure=pressure):
                link = potential.blueprint.link(name)
                forces.append(abs(pressure) * link.depth * link.thickness)
            case PrestrainPlan(link=name, stretch=stretch):
                link = potential.blueprint.link(name)
                forces.append(link.young * abs(stretch - 1.0) * link.depth * link.thickness)
    size = 3 if dim == 2 else 6
    for body in range(len(places)):
        for k in range(dim):
            velocity = np.zeros((len(places), size), dtype=complex)
            velocity[body, k] = 1j * _STEP
            there = moved(places, velocity)
            followed = potential.nodal(u + 0j, there)
            work = potential.strain_energy(followed, p) + potential.effect_energy(followed, there)
            forces.append(abs(np.imag(work)) / _STEP)
    return float(max(forces))


def _poisson(potential: Potential, link: LinkPlan) -> float:
    """ν of what displacements strain: changes of volume are resisted by a pressure where the link has one."""
    return 0.0 if potential.blueprint.mixed(link) else link.poisson


def _floor(potential: Potential, u: np.ndarray, places: list[Place]) -> float:
    """Residual from rounding alone, of what is checked and of the check.

    Displacements are rounded to 1e-16 of the largest one, all nodes independently. Here F = 1 + ∇u is rounded to half
    the ε of ``REAL`` whatever ∇u is, stresses by that much of the modulus, at all quadrature points independently. Both
    lead to nodal forces by the gradients of shape functions, which grow with their order (``Potential.rounding``).
    The ends of joints that give way are rounded as the poses of their bodies: to 1e-16 of the shift of its centre, and
    of what turning about that adds; the force that this makes acts on both of them.
    """
    squares = 0.0
    for link in potential.blueprint.flexible:
        modulus = link.young / (1 - 2 * _poisson(potential, link))
        by_node, by_point = potential.rounding(link)
        squares += (modulus * by_node * 1e-16 * np.abs(u).max()) ** 2
        squares += (modulus * by_point * 0.5 * float(np.finfo(REAL).eps)) ** 2
    for name, compliance in potential.closure.soft.items():
        joint = potential.blueprint.joint(name)
        at = np.array((*joint.at, 0.0)[: potential.blueprint.dim])
        ends = potential.closure.ends[name]
        for body in ends:
            shift = places[body].shift
            for part in (shift, places[body].displacement(at)[: len(shift)] - shift):
                squares += len(ends) * float(np.sum((part.real * 1e-16 / compliance) ** 2))
    return float(np.sqrt(squares))


def energy_digits(potential: Potential) -> float:
    """Cancellation error of textbook energies: 1e-16 of the modulus, times the volume; all but the last ``digits``."""
    volume = sum(link.young / (1 - 2 * _poisson(potential, link)) for link in potential.blueprint.flexible)
    thickest = max(link.depth for link in potential.blueprint.flexible) if potential.mesh.dim == 2 else 1.0
    return 1e-16 * volume * thickest * potential.volume * THRESHOLDS.digits
