"""Rigid assembly of a configuration: every link moved as a rigid body until all joints close.

    C(z, φ) = 0,  motors moved from φ = 0 (as drawn) to the wanted position,

by Gauss–Newton steps of least norm, z ← z − A⁺ C, which stay defined where A loses rank (redundant loops,
dead centres). Freedoms that motors leave minimise the energy of springs, by Newton steps with the absolute
eigenvalues of its curvature (``mobility``), which descend. The assembled state carries no elastic energy in the links
and starts every equilibrium.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.errors import AssemblyError
from fenicsmech.mechanism import Configuration
from fenicsmech.multibody.constraints import JointSystem
from fenicsmech.multibody.linkage import Linkage
from fenicsmech.multibody.mobility import SpringPotential, free_motions


@dataclass(frozen=True)
class AssemblyOptions:
    """Steps and tolerances of the assembly; lengths are in those of the mechanism, angles in rad.

    Attributes:
        closed: largest scaled constraint residual of a closed assembly: some hundred roundings.
        largest_step: motor motion in one step; far below the turns at which a loop has several assemblies.
        smallest_step: part of the first step at which the motion ends: motors strain the mechanism there.
        stray: largest distance from the extrapolation, over the motion in the step, on one branch.
        relaxed: length of a step towards least energy of springs at which such steps end: rounding.
        largest_turn: of such a step, within which the energy is about quadratic.
        curved: part of the largest curvature above which a free motion counts as held by springs.
        before_strain: fraction of the strain-free motion at which ``assemble_before_strain`` ends.
    """

    closed: float = 1e-13
    largest_step: float = 0.1
    smallest_step: float = 1e-4
    stray: float = 0.2
    relaxed: float = 1e-14
    largest_turn: float = 0.3
    curved: float = 1e-9
    before_strain: float = 0.98


_DEFAULT = AssemblyOptions()


@dataclass(frozen=True)
class Assembly:
    """Poses of all bodies in a configuration.

    Attributes:
        poses: (bodies, pose_size).
        fraction: fraction of the motor motion possible without deforming flexible links; 1 unless the motors strain
            the mechanism.
    """

    poses: np.ndarray
    fraction: float


def assemble(
    linkage: Linkage,
    configuration: Configuration,
    springs: Sequence[SpringPotential] = (),
    options: AssemblyOptions = _DEFAULT,
) -> Assembly:
    """The rigid assembly of ``configuration``.

    If the motion strains flexible links, the assembly stops at the last position free of strain.

    Args:
        linkage: bodies and constraints.
        configuration: motor positions.
        springs: their potentials.
        options: steps and tolerances.

    Raises:
        AssemblyError: a loop does not close even with freely deformable links.
    """
    poses, fraction, _ = _Assembler(linkage.rigid, springs, options).follow(configuration)
    if fraction < 1.0:
        _, closing, worst = _Assembler(linkage.joints, (), options).follow(configuration)
        if closing < 1.0:
            raise AssemblyError(
                f"configuration {configuration.name!r}",
                f"the loop through {_loop(linkage.joints, worst)} does not close: "
                f"the motors get {math.floor(1e3 * closing) / 10:.1f}% of the way",  # rounded down
                "Check motor positions and link lengths",
            )
    return Assembly(poses, fraction)


def assemble_before_strain(
    linkage: Linkage,
    configuration: Configuration,
    springs: Sequence[SpringPotential] = (),
    options: AssemblyOptions = _DEFAULT,
) -> Assembly:
    """As ``assemble``, but a little before the last position free of strain where motors strain the links.

    That one is a dead centre as a rule, where the tangent is not unique and freedoms count twice.

    Raises:
        AssemblyError: as ``assemble``.
    """
    assembly = assemble(linkage, configuration, springs, options)
    if assembly.fraction == 1.0:
        return assembly
    fraction = options.before_strain * assembly.fraction
    poses, _, _ = _Assembler(linkage.rigid, springs, options).follow(configuration, fraction)
    return Assembly(poses, fraction)


@dataclass(frozen=True)
class _Assembler:
    """Moves the motors of one set of constraints."""

    system: JointSystem
    springs: Sequence[SpringPotential]
    options: AssemblyOptions

    def follow(self, configuration: Configuration, part: float = 1.0) -> tuple[np.ndarray, float, int]:
        """Moves the motors ``part`` of the way to ``configuration``.

        Returns:
            Poses, the fraction reached, and the row with the largest residual where the motion ends early.
        """
        system, options = self.system, self.options
        target = part * system.motor_values(configuration.position)
        travel = system.travel(target)
        largest = 1.0 if travel <= options.largest_step else options.largest_step / travel
        poses, residual = self._close(system.drawn, np.zeros_like(target))
        if not self._is_closed(residual):
            return poses, 0.0, int(np.argmax(np.abs(residual)))
        before, fraction, step, last_step, worst = system.drawn, 0.0, largest, 0.0, 0
        while travel > 0.0 and fraction < 1.0:
            step = min(step, 1.0 - fraction)
            here = system.unknowns(poses)
            guess = here + (here - system.unknowns(before)) * (step / last_step if last_step > 0.0 else 0.0)
            motors = (fraction + step) * target
            trial, residual = self._relax(*self._close(system.with_unknowns(poses, guess), motors), motors)
            there = system.unknowns(trial)
            astray = np.linalg.norm((there - guess) / system.pose_scale)
            onward = np.linalg.norm((there - here) / system.pose_scale)
            shortest = step < options.smallest_step * largest
            if not self._is_closed(residual):
                worst = int(np.argmax(np.abs(residual)))
                if shortest:
                    return poses, fraction, worst
                step *= 0.5
            elif last_step > 0.0 and astray > options.stray * onward and not shortest:
                step *= 0.5
            else:
                before, poses, last_step = poses, trial, step
                fraction = 1.0 if fraction + step >= 1.0 - 1e-12 else fraction + step
                step = min(largest, 2.0 * step)
        return poses, 1.0, worst

    def _is_closed(self, residual: np.ndarray) -> bool:
        return np.max(np.abs(residual), initial=0.0) <= self.options.closed

    def _close(self, poses: np.ndarray, motors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gauss–Newton from ``poses``; returns the best poses and their scaled residual."""
        system = self.system
        residual = system.row_scale * system.value(poses, motors)
        for _ in range(25):
            if np.max(np.abs(residual), initial=0.0) <= 1e-15 or not system.rows:
                break
            scaled = system.row_scale[:, None] * system.gradient(poses, motors) * system.pose_scale
            step = system.pose_scale * np.linalg.lstsq(scaled, -residual, rcond=1e-10)[0]
            trial = system.with_unknowns(poses, system.unknowns(poses) + step)
            new = system.row_scale * system.value(trial, motors)
            if np.linalg.norm(new) >= np.linalg.norm(residual) and self._is_closed(residual):
                break
            poses, residual = trial, new
        return poses, residual

    def _relax(self, poses: np.ndarray, residual: np.ndarray, motors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The closed assembly near ``poses`` where the energy of springs is least, and its residual."""
        system, options = self.system, self.options
        for _ in range(30 if self.springs else 0):
            if not self._is_closed(residual):
                break
            free = free_motions(system, poses, motors, self.springs)
            stiffness, modes = np.linalg.eigh(free.curvature)
            kept = np.abs(stiffness) > options.curved * np.max(np.abs(stiffness), initial=0.0)
            step = -((modes.T @ free.slope)[kept] / np.abs(stiffness[kept])) @ modes[:, kept].T @ free.motions
            size = float(np.max(np.abs(step), initial=0.0))
            if size <= options.relaxed:
                break
            moved = system.unknowns(poses) + system.pose_scale * step * min(1.0, options.largest_turn / size)
            trial, missed = self._close(system.with_unknowns(poses, moved), motors)
            if not self._is_closed(missed):
                break
            poses, residual = trial, missed
        return poses, residual


def _loop(system: JointSystem, row: int) -> str:
    """Names the links of the loop that the constraint ``row`` closes."""
    name = system.row_names[row]
    closing = next((c for c in system.connections if c.name == name), None)
    if closing is None:
        return name
    paths = {closing.a: [closing.a]}
    frontier = [closing.a]
    while frontier and closing.b not in paths:
        body = frontier.pop(0)
        for c in system.connections:
            if c is not closing and body in (c.a, c.b):
                other = c.b if body == c.a else c.a
                if other not in paths:
                    paths[other] = [*paths[body], other]
                    frontier.append(other)
    links = dict.fromkeys(system.bodies[i].link.name for i in paths.get(closing.b, [closing.a, closing.b]))
    return f"{name!r} ({' – '.join(links)})"
