"""Whether a frame is an equilibrium: the total potential is stationary along admissible directions.

A direction moves free nodes at random, or bodies along the null space of their joints. The derivative of Π along it is
a difference along the imaginary axis, Im Π(s + i h v) / h, which loses no digits. Independent random directions tell
the norm of the whole residual: the mean of (∇Π · v)² is |∇Π|².
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import fenicsmech as fm

from .closure import Place
from .potential import Potential

_STEP = 1e-30
_RANDOM = 8


@dataclass(frozen=True)
class Residual:
    """What was found.

    Attributes:
        gap: largest closure error of joints, motors and interfaces, relative to the mechanism's length.
        force: norm of the residual force.
        scale: largest load or reaction.
        floor: residual force from rounding of displacements alone.
        travel_error: how far the controlled displacement is off, relative to the length.
        energy_error: strain energy against the frame's, relative to it.
    """

    gap: float
    force: float
    scale: float
    floor: float
    travel_error: float
    energy_error: float

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
    mesh, state = potential.mesh, frame.state
    u = np.array(state.u).reshape(mesh.nodes.shape)
    places = potential.places(state.poses)
    followed = potential.nodal(u, places)
    length = potential.blueprint.length
    gaps = np.abs(potential.closure.residual(places))
    strayed = np.abs(followed - u).max(initial=0.0) / length
    modes = body_modes(potential, places)

    def slope(du: np.ndarray, moved: list[Place]) -> float:
        return float(np.imag(potential.value(potential.nodal(u + du, moved), moved, frame.force))) / _STEP

    rng = np.random.default_rng(seed)
    free = (potential.held < 0)[:, None]
    squares = [slope(1j * _STEP * rng.standard_normal(u.shape) * free, places) ** 2 for _ in range(_RANDOM)]
    along = [slope(np.zeros(u.shape), moved(places, 1j * _STEP * mode)) for mode in modes]
    force = float(np.sqrt(np.mean(squares) + np.sum(np.square(along))))
    first = potential.blueprint.forces[0]
    travel = float(np.real(potential.travel(first, followed, places))) - origin
    energy = float(potential.strain_energy(followed))
    return Residual(
        gap=float(max(gaps.max(initial=0.0), strayed)),
        force=force,
        scale=_scale(potential, frame, u, places),
        floor=_floor(potential, u),
        travel_error=abs(travel - frame.displacement) / length,
        energy_error=abs(energy - frame.strain_energy) / max(abs(frame.strain_energy), _energy_digits(potential)),
    )


def body_modes(potential: Potential, places: list[Place]) -> np.ndarray:
    """Velocities of all bodies that keep joints closed, angles times length: (modes, bodies, 3 or 6)."""
    count, size, length = len(places), (3 if potential.mesh.dim == 2 else 6), potential.blueprint.length
    scale = np.array([1.0] * potential.mesh.dim + [1.0 / length] * (size - potential.mesh.dim))
    columns, names = [], [i for i in range(count) if not potential.fixed[i]]
    for body in names:
        for k in range(size):
            velocity = np.zeros((count, size), dtype=complex)
            velocity[body, k] = 1j * _STEP * scale[k]
            rates = potential.closure.residual(moved(places, velocity)).imag / _STEP * length
            columns.append(rates.astype(float))
    jacobian = np.array(columns).T.reshape(-1, len(columns))
    _, values, right = np.linalg.svd(jacobian, full_matrices=True)
    null = right[int(np.sum(values > 1e-9 * max(values.max(initial=0.0), 1.0))) :]
    modes = np.zeros((len(null), count, size))
    modes[:, names] = null.reshape(len(null), len(names), size) * scale
    return modes


def moved(places: list[Place], velocities: np.ndarray) -> list[Place]:
    """All places after infinitesimal motions (bodies, 3 or 6)."""
    return [body.moved(velocity) for body, velocity in zip(places, velocities, strict=True)]


def _scale(potential: Potential, frame: fm.Frame, u: np.ndarray, places: list[Place]) -> float:
    """The largest force that acts: loads, weights, and what links exert on each body, by virtual work."""
    dim, forces = potential.mesh.dim, [potential.weight]
    forces += [abs(size) for _, size in potential.acting(frame.force)]
    size = 3 if dim == 2 else 6
    for body in range(len(places)):
        for k in range(dim):
            velocity = np.zeros((len(places), size), dtype=complex)
            velocity[body, k] = 1j * _STEP
            there = moved(places, velocity)
            work = potential.strain_energy(potential.nodal(u + 0j, there)) + potential.body_potential(u + 0j, there)
            forces.append(abs(np.imag(work)) / _STEP)
    return float(max(forces))


def _stiffness(potential: Potential) -> float:
    """Largest stiffness of a node: E times depth (plane) or cell size (space)."""
    plans = potential.blueprint.flexible
    widths = [link.depth if potential.mesh.dim == 2 else link.size for link in plans]
    return max(link.young * width / (1 - 2 * link.poisson) for link, width in zip(plans, widths, strict=True))


def _floor(potential: Potential, u: np.ndarray) -> float:
    """Displacements are rounded to 1e-16 of the largest one, all nodes independently."""
    return 1e-16 * _stiffness(potential) * np.abs(u).max() * np.sqrt(potential.mesh.nodes.size)


def _energy_digits(potential: Potential) -> float:
    """What textbook energies lose by cancellation: 1e-16 of the modulus, times the volume; kept below a millionth."""
    volume = sum(link.young / (1 - 2 * link.poisson) for link in potential.blueprint.flexible)
    thickest = max(link.depth for link in potential.blueprint.flexible) if potential.mesh.dim == 2 else 1.0
    return 1e-16 * volume * thickest * potential.volume * 1e6
