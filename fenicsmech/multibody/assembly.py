"""Rigid assembly of a configuration, and the motions that it leaves.

Every link is moved as a rigid body until all joints close,

    C(z, φ + φ₀) = 0,  motors moved from φ = −φ₀ (as drawn) to the wanted position, φ₀ their offsets,

by Gauss–Newton steps of least norm, z ← z − A⁺ C, which stay defined where A loses rank (redundant loops,
dead centres). The assembled state carries no elastic energy in the links and starts every equilibrium.

Motions that joints and locked motors leave, and constraints that depend on each other, follow from the rank of
A = ∂C/∂z; flexible links taken as rigid,

    mobility = unknowns − rank A,     redundancy = rows − rank A.

Motions without effect (a two-ball link spinning about itself) count as mobility, dependent equations (a planar loop
of spatial hinges) as redundancy.

Springs are potentials V(z). Along the null space N of A they have the slope and the curvature

    Nᵀ ∂V/∂z,     Nᵀ (∂²V/∂z² − Σ λ_k ∂²C_k/∂z²) N,     Aᵀλ = ∂V/∂z,

and hold the motions along which this curvature is not zero. The others are the zero-energy modes. Motors may hold
springs wound up: their forces pass through joints, λ ≠ 0, and their stiffness has no part in any free motion, so that
what should cancel along it leaves the rounding of ∂V/∂z and ∂²V/∂z², not that of the curvatures left. In an assembly
the energy of springs is least. It is found by Newton steps with the absolute eigenvalues of the curvature, which
always descend.

Where flexible links are bent, but move as rigid bodies, a link with the velocity v of a point x₀ and the spin ω takes
its bodies along:

    ẋ_i = v + ω × (x_i − x₀),     ṙ_i = (∂r/∂ω)(r_i) ω,     A ż = 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order

from fenicsmech.errors import AssemblyError
from fenicsmech.joints import across
from fenicsmech.log import logger
from fenicsmech.mechanism import Configuration
from fenicsmech.multibody.linkage import RANK, JointSystem, Linkage
from fenicsmech.multibody.potentials import PosePotential
from fenicsmech.multibody.spins import Spin

_log = logger(__name__)


@dataclass(frozen=True)
class Assembly:
    """``poses`` of all bodies in a configuration, (bodies, pose_size).

    ``fraction`` of the motor motion is possible without deforming flexible links; 1 unless motors strain the mechanism.
    """

    poses: np.ndarray
    fraction: float


def assemble(
    linkage: Linkage, configuration: Configuration, springs: Sequence[PosePotential] = (), soft: tuple[int, ...] = ()
) -> Assembly:
    """The rigid assembly of ``configuration``; it stops at the last position free of strain of flexible links, and of
    joints that give way.

    Without springs, each is found once for the present places of joints and offsets of motors.

    Args:
        linkage: the mechanism.
        configuration: to which its motors move.
        springs: potentials of the poses.
        soft: rows of the constraints of joints that give way.

    Raises:
        AssemblyError: a loop does not close even with freely deformable links, and joints that give way apart.
        EquilibriumError: the motors take a spring beyond the poses that it holds for.
    """
    if springs:
        return _assembled(linkage, configuration, springs, soft)
    places = linkage.joints.key, linkage.rigid.key, soft
    if places not in linkage.assembled:
        linkage.assembled.clear()
        linkage.assembled[places] = {}
    found = linkage.assembled[places]
    if configuration not in found:
        found[configuration] = _assembled(linkage, configuration, springs, soft)
    return found[configuration]


def _assembled(
    linkage: Linkage, configuration: Configuration, springs: Sequence[PosePotential], soft: tuple[int, ...]
) -> Assembly:
    poses, fraction, _ = Assembler(linkage.rigid, springs).move(configuration)
    if fraction < 1.0:
        _, closing, worst = Assembler(linkage.joints).move(configuration)
        if closing < 1.0:
            where, loop = f"configuration {configuration.name!r}", f"the loop through {_loop(linkage.joints, worst)}"
            share = f"{math.floor(1e3 * closing) / 10:.1f}%"  # rounded down
            if not soft or Assembler(linkage.joints, soft=soft).move(configuration)[1] < 1.0:
                raise AssemblyError(
                    where,
                    f"{loop} does not close: the motors get {share} of the way",
                    "Check motor positions and link lengths",
                )
            _log.warning("%s: from %s of the motors' way on, %s is open in joints that give way", where, share, loop)
    poses.setflags(write=False)  # shared
    return Assembly(poses, fraction)


def assemble_before_strain(
    linkage: Linkage, configuration: Configuration, springs: Sequence[PosePotential] = (), soft: tuple[int, ...] = ()
) -> Assembly:
    """As ``assemble``, but 98 % of the way to the last position free of strain where motors strain the links.

    That one is a dead centre as a rule, where paths cross and freedoms count twice.
    """
    assembly = assemble(linkage, configuration, springs, soft)
    if assembly.fraction == 1.0:
        return assembly
    fraction = 0.98 * assembly.fraction
    poses, _, _ = Assembler(linkage.rigid, springs).move(configuration, fraction)
    return Assembly(poses, fraction)


@dataclass(frozen=True)
class Assembler:
    """Motion of the motors of one set of constraints; lengths are in that of the mechanism, angles in rad.

    Attributes:
        system: the constraints.
        springs: potentials of the poses.
        soft: rows of constraints that are left open, in ``system``.
        closed: largest scaled constraint residual of a closed assembly: some hundred roundings.
        largest_step: motor motion in one step; far below the turns at which a loop has several assemblies.
        smallest_step: part of the first step at which the motion ends: motors strain the mechanism there.
        deviation: largest distance from the extrapolation, over the motion in the step, on one branch.
        relaxed: length of a step towards least energy of springs at which such steps end: rounding.
        largest_turn: of such a step, within which the energy is about quadratic.
        curved: part of the largest curvature above which a free motion counts as held by springs.
    """

    system: JointSystem
    springs: Sequence[PosePotential] = ()
    soft: tuple[int, ...] = ()
    closed: float = 1e-13
    largest_step: float = 0.1
    smallest_step: float = 1e-4
    deviation: float = 0.2
    relaxed: float = 1e-14
    largest_turn: float = 0.3
    curved: float = 1e-9

    def move(self, configuration: Configuration, limit: float = 1.0) -> tuple[np.ndarray, float, int]:
        """Poses at the fraction ``limit`` of the way to ``configuration``, the part of that reached, and the row with
        the largest residual where the motion ends early."""
        system = self.system
        start, target = (system.on_the_way(configuration.position, part) for part in (0.0, limit))
        travel = system.travel(target - start)
        largest = 1.0 if travel <= self.largest_step else self.largest_step / travel
        poses, residual = self.close(system.drawn, start)
        if not self.is_closed(residual):
            return poses, 0.0, int(np.argmax(np.abs(residual)))
        before, fraction, step, last_step, worst = system.drawn, 0.0, largest, 0.0, 0
        while travel > 0.0 and fraction < 1.0:
            step = min(step, 1.0 - fraction)
            here = system.unknowns(poses)
            guess = here + (here - system.unknowns(before)) * (step / last_step if last_step > 0.0 else 0.0)
            motors = start + (fraction + step) * (target - start)
            trial, residual = self.relax(*self.close(system.with_unknowns(poses, guess), motors), motors)
            there = system.unknowns(trial)
            missed = np.linalg.norm((there - guess) / system.pose_scale)
            moved = np.linalg.norm((there - here) / system.pose_scale)
            shortest = step < self.smallest_step * largest
            if not self.is_closed(residual):
                worst = int(np.argmax(np.abs(residual)))
                if shortest:
                    return poses, fraction, worst
                step *= 0.5
            elif last_step > 0.0 and missed > self.deviation * moved and not shortest:
                step *= 0.5
            else:
                for spring in self.springs:
                    spring.check_step(poses, trial)
                before, poses, last_step = poses, trial, step
                fraction = 1.0 if fraction + step >= 1.0 - 1e-12 else fraction + step
                step = min(largest, 2.0 * step)
        return poses, 1.0, worst

    def is_closed(self, residual: np.ndarray) -> bool:
        """Whether joints are closed, from their scaled residual."""
        return np.max(np.abs(residual), initial=0.0) <= self.closed

    def close(self, poses: np.ndarray, motors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gauss–Newton from ``poses``; returns the best poses and their scaled residual."""
        system, kept = self.system, np.ones(self.system.rows)
        kept[list(self.soft)] = 0.0
        scale = kept * system.row_scale
        residual = scale * system.value(poses, motors)
        for _ in range(25):
            if np.max(np.abs(residual), initial=0.0) <= 1e-15 or not system.rows:
                break
            scaled = kept[:, None] * system.scaled_gradient(poses, motors)
            step = system.pose_scale * np.linalg.lstsq(scaled, -residual, rcond=1e-10)[0]
            trial = system.with_unknowns(poses, system.unknowns(poses) + step)
            new = scale * system.value(trial, motors)
            if np.linalg.norm(new) >= np.linalg.norm(residual) and self.is_closed(residual):
                break
            poses, residual = trial, new
        return poses, residual

    def relax(self, poses: np.ndarray, residual: np.ndarray, motors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The closed assembly near ``poses`` where the energy of springs is least, and its residual."""
        system = self.system
        for _ in range(30 if self.springs else 0):
            if not self.is_closed(residual):
                break
            free = free_motions(system, poses, motors, self.springs)
            stiffness, modes = np.linalg.eigh(free.curvature)
            largest = np.max(np.abs(stiffness), initial=0.0)
            kept = np.abs(stiffness) > max(self.curved * largest, free.rounding)
            step = -((modes.T @ free.slope)[kept] / np.abs(stiffness[kept])) @ modes[:, kept].T @ free.motions
            size = float(np.max(np.abs(step), initial=0.0))
            if size <= self.relaxed:
                break
            moved = system.unknowns(poses) + system.pose_scale * step * min(1.0, self.largest_turn / size)
            trial, missed = self.close(system.with_unknowns(poses, moved), motors)
            if not self.is_closed(missed):
                break
            poses, residual = trial, missed
        return poses, residual


def _loop(system: JointSystem, row: int) -> str:
    """Names the links of the loop that the constraint ``row`` closes."""
    name = system.row_names[row]
    closing = next((c for c in system.connections if c.name == name), None)
    if closing is None:
        return name
    others = np.array([(c.a, c.b) for c in system.connections if c is not closing], dtype=int).reshape(-1, 2)
    graph = csr_matrix((np.ones(len(others)), others.T), shape=(len(system.bodies),) * 2)
    _, previous = breadth_first_order(graph, closing.a, directed=False)
    path = [closing.b]
    while previous[path[-1]] >= 0:
        path.append(previous[path[-1]])
    links = dict.fromkeys(system.bodies[i].link.name for i in (closing.a, *reversed(path)))
    return f"{name!r} ({' – '.join(links)})"


@dataclass(frozen=True)
class FreeMotions:
    """Slope (n,) and curvature (n, n) of the potential of springs along the motions N that joints and motors leave.

    ``motions`` are orthonormal rows, (n, size), in units of ``JointSystem.pose_scale``. Curvatures of at most
    ``rounding`` are none.
    """

    motions: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray
    rounding: float


def free_motions(
    system: JointSystem, poses: np.ndarray, motors: np.ndarray, springs: Sequence[PosePotential]
) -> FreeMotions:
    """Slope and curvature of all ``springs`` at ``poses`` (bodies, pose_size), motors at ``motors``."""
    scale, size = system.pose_scale, system.space.pose_size
    scaled = system.scaled_gradient(poses, motors)
    motions = _null_space(scaled)
    slope, curvature = np.zeros(system.size), np.zeros((system.size, system.size))
    units = np.outer(scale, scale)
    for spring in springs:
        # fixed bodies have no columns
        own = np.repeat([body in system.columns for body in spring.bodies], size)
        columns = [column for body in spring.bodies for column in system.columns.get(body, ())]
        slope[columns] += spring.gradient(poses)[own]
        curvature[np.ix_(columns, columns)] += spring.hessian(poses)[np.ix_(own, own)]
    rounding = 1e-12 * float(np.linalg.norm(units * curvature) + np.linalg.norm(scale * slope))
    multipliers = system.row_scale * np.linalg.lstsq(scaled.T, scale * slope, rcond=RANK)[0]
    for rows, columns, block in system.hessian_blocks(poses, motors, multipliers):
        curvature[np.ix_(rows, columns)] -= block
    along = motions @ (units * curvature) @ motions.T
    return FreeMotions(motions, motions @ (scale * slope), 0.5 * (along + along.T), rounding)


@dataclass(frozen=True)
class Freedom:
    """Mobility and redundancy of one configuration.

    Attributes:
        mobility: number of free directions left.
        mobile: names of the links that can move.
        zero_energy: names of the links that move in zero-energy modes, idle spins left out; empty if springs hold all.
        redundancy: number of dependent constraint equations.
        redundant: names of the joints whose equations depend on each other.
    """

    mobility: int
    mobile: tuple[str, ...]
    zero_energy: tuple[str, ...]
    redundancy: int
    redundant: tuple[str, ...]


def count_freedom(
    system: JointSystem,
    poses: np.ndarray,
    motors: np.ndarray,
    springs: Sequence[PosePotential] = (),
    idle: Sequence[Spin] = (),
) -> Freedom:
    """Mobility and redundancy at ``poses`` (bodies, pose_size), motors at ``motors`` (connections,)."""
    dependent = _null_space(system.scaled_gradient(poses, motors).T)
    free = free_motions(system, poses, motors, springs)
    curvatures, modes = np.linalg.eigh(free.curvature)
    flat = np.abs(curvatures) <= free.rounding

    def moving(motions: np.ndarray) -> tuple[str, ...]:
        moves = _takes_part(motions)
        names = [system.bodies[body].link.name for body in system.free_bodies if moves[system.columns[body]].any()]
        return tuple(dict.fromkeys(names))

    return Freedom(
        mobility=len(free.motions),
        mobile=moving(free.motions),
        zero_energy=moving(_without(modes[:, flat].T @ free.motions, [spin.motion(system, poses) for spin in idle])),
        redundancy=len(dependent),
        redundant=tuple(dict.fromkeys(np.array(system.row_names)[_takes_part(dependent)].tolist())),
    )


def is_held(system: JointSystem, poses: np.ndarray, motors: np.ndarray, rate: np.ndarray, rows: np.ndarray) -> bool:
    """Whether a function of the poses with the gradient ``rate`` (size,) is constant in every motion that the
    constraints ``rows`` leave."""
    scaled = system.scaled_gradient(poses, motors)[rows]
    wanted = rate * system.pose_scale
    left = wanted - scaled.T @ np.linalg.lstsq(scaled.T, wanted, rcond=RANK)[0]
    return bool(np.linalg.norm(left) <= RANK * np.linalg.norm(wanted))


@dataclass(frozen=True)
class Motion:
    """Velocities of the pose unknowns ``z`` (size,), of bodies' centres (bodies, dim), and spins (bodies, 1 or 3)."""

    z: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray

    def at(self, body: int, offsets: np.ndarray) -> np.ndarray:
        """Velocities of points at ``offsets`` (n, dim) from the centre of a body, as placed now."""
        return self.velocity[body] + across(self.spin[body], offsets)

    def fastest(self, length: float) -> float:
        """The largest velocity of a body's centre, or of a point at the distance ``length`` from it."""
        spins = np.linalg.norm(self.spin, axis=1) * length
        return float(max(np.max(np.linalg.norm(self.velocity, axis=1)), np.max(spins)))


def stiff_motions(linkage: Linkage, poses: np.ndarray, motors: np.ndarray, rows: np.ndarray) -> list[Motion]:
    """A basis of the motions that leave constraint ``rows`` as they are at ``poses`` (bodies, pose_size) and deform no
    link.

    Velocities are of the order of the mechanism's length or below, spins of the order of one.
    """
    joints, dim, space = linkage.joints, linkage.dim, linkage.joints.space
    rigid = [i for i, body in enumerate(linkage.bodies) if body.region is None and not body.fixed]
    places = np.array([body.centre for body in linkage.bodies]) + poses[:, :dim]
    turns = space.freedoms - dim
    basis = []
    for bodies in [*((i,) for i in rigid), *linkage.interfaces.values()]:
        for direction in np.diag([linkage.length] * dim + [1.0] * turns):
            slide, turn = direction[:dim], direction[dim:]
            z, velocity, spin = np.zeros(joints.size), np.zeros((len(poses), dim)), np.zeros((len(poses), turns))
            for body in bodies:
                spin[body] = turn
                velocity[body] = slide + across(turn, places[body] - places[bodies[0]])
                z[joints.columns[body]] = np.concatenate([velocity[body], space.rotation_rates(poses[body]) @ turn])
            basis.append((z, velocity, spin))
    parts = [np.array(part) for part in zip(*basis, strict=True)]
    rates = (joints.row_scale[:, None] * (joints.gradient(poses, motors) @ parts[0].T))[rows]
    return [Motion(*(np.tensordot(weights, part, 1) for part in parts)) for weights in _null_space(rates)]


def _without(modes: np.ndarray, motions: Sequence[np.ndarray]) -> np.ndarray:
    """An orthonormal basis of the part of the span of ``modes`` (n, size), orthonormal, normal to some ``motions``."""
    if not len(modes) or not motions:
        return modes
    return _null_space(np.array(motions) @ modes.T) @ modes


def _null_space(matrix: np.ndarray) -> np.ndarray:
    """Orthonormal rows that span the null space of a matrix whose rows and unknowns are scaled to one."""
    _, values, right = np.linalg.svd(matrix, full_matrices=True)
    return right[int(np.sum(values > RANK)) :]


def _takes_part(vectors: np.ndarray) -> np.ndarray:
    """Mask of the entries that exceed rounding in any of some unit vectors, (n, size)."""
    return (np.abs(vectors) > 1e-6).any(axis=0)
