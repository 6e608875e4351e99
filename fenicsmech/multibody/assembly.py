"""Rigid assembly of a configuration: every link moved as a rigid body until all joints close.

    C(z, φ) = 0,  motors led from φ = 0 (as drawn) to the wanted position,

by Gauss–Newton steps of least norm, z ← z − A⁺ C, which stay defined where A loses rank (redundant loops,
dead centres). Freedoms that motors leave go where springs want them, by Newton steps with the absolute eigenvalues of
the curvature (``holding``), so that they descend. The assembled state carries no elastic energy in the links and
starts every equilibrium.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.errors import AssemblyError
from fenicsmech.mechanism import Configuration
from fenicsmech.multibody.build import Linkage
from fenicsmech.multibody.holding import Holding, free_motions
from fenicsmech.multibody.system import JointSystem

_CLOSED = 1e-13  # scaled constraint residual of a closed assembly
_LARGEST_STEP = 0.1  # rad, or mechanism lengths, of motor motion at once
_SMALLEST_STEP = 1e-4
_RELAXED = 1e-14  # rad, or mechanism lengths: steps towards the rest of springs that are this short end there
_LARGEST_TURN = 0.3  # of such a step
_CURVED = 1e-9  # of the curvature along the stiffest free motion: along others springs want nothing
_SHORT = 0.98  # of the way to where links start to strain
_STRAY = 0.2  # of the motion in a step: how far it may end from its extrapolation


@dataclass(frozen=True)
class Assembly:
    """Poses of all bodies in a configuration.

    Attributes:
        poses: (bodies, pose_size).
        fraction: how much of the motor motion was possible without deforming flexible links; 1 unless the
            motors strain the mechanism.
    """

    poses: np.ndarray
    fraction: float


def assemble(linkage: Linkage, configuration: Configuration, holding: Sequence[Holding] = ()) -> Assembly:
    """The rigid assembly of ``configuration``.

    If flexible links must deform for the motors to get there, the assembly stops at the last position
    that is free of strain.

    Args:
        linkage: bodies and constraints.
        configuration: where motors are.
        holding: potentials of springs.

    Raises:
        AssemblyError: some loop does not close even if every flexible link could deform at will.
    """
    target = linkage.rigid.motor_values(configuration.position)
    poses, fraction, _ = _follow(linkage.rigid, target, holding)
    if fraction < 1.0:
        _, closing, worst = _follow(linkage.joints, linkage.joints.motor_values(configuration.position), ())
        if closing < 1.0:
            raise AssemblyError(
                f"configuration {configuration.name!r}",
                f"the loop through {_loop(linkage.joints, worst)} does not close: "
                f"the motors get {math.floor(1e3 * closing) / 10:.1f}% of the way",  # never 100% of what fails
                "Check motor positions and link lengths",
            )
    return Assembly(poses, fraction)


def assemble_before_strain(linkage: Linkage, configuration: Configuration, holding: Sequence[Holding] = ()) -> Assembly:
    """As ``assemble``, but a little before the last position free of strain where motors strain the links.

    That one is a dead centre as a rule, where no tangent tells which way to go on and freedoms count twice.

    Raises:
        AssemblyError: as ``assemble``.
    """
    assembly = assemble(linkage, configuration, holding)
    if assembly.fraction == 1.0:
        return assembly
    fraction = _SHORT * assembly.fraction
    poses, _, _ = _follow(linkage.rigid, fraction * linkage.rigid.motor_values(configuration.position), holding)
    return Assembly(poses, fraction)


def _follow(system: JointSystem, target: np.ndarray, holding: Sequence[Holding]) -> tuple[np.ndarray, float, int]:
    """Leads the motors to ``target`` (per connection); returns poses, reached fraction, worst row."""
    travel = system.travel(target)
    largest = 1.0 if travel <= _LARGEST_STEP else _LARGEST_STEP / travel
    poses, fraction, step, worst = system.drawn, 0.0, largest, 0
    before = poses
    poses, residual = _close(system, poses, np.zeros_like(target))
    if np.max(np.abs(residual), initial=0.0) > _CLOSED:
        return poses, 0.0, int(np.argmax(np.abs(residual)))
    last_step = 0.0
    while travel > 0.0 and fraction < 1.0:
        step = min(step, 1.0 - fraction)
        here = system.unknowns(poses)
        guess = here + (here - system.unknowns(before)) * (step / last_step if last_step > 0.0 else 0.0)
        motors = (fraction + step) * target
        trial, residual = _relax(system, *_close(system, system.with_unknowns(poses, guess), motors), motors, holding)
        there = system.unknowns(trial)
        astray = np.linalg.norm((there - guess) / system.pose_scale)
        onward = np.linalg.norm((there - here) / system.pose_scale)
        shortest = step < _SMALLEST_STEP * largest
        if np.max(np.abs(residual)) > _CLOSED:
            worst = int(np.argmax(np.abs(residual)))
            if shortest:
                return poses, fraction, worst
            step *= 0.5
        elif last_step > 0.0 and astray > _STRAY * onward and not shortest:
            # far from where the motion was heading: perhaps another branch, or across a gap that cannot be crossed
            step *= 0.5
        else:
            before, poses, last_step = poses, trial, step
            fraction = 1.0 if fraction + step >= 1.0 - 1e-12 else fraction + step
            step = min(largest, 2.0 * step)
    return poses, 1.0, worst


def _close(system: JointSystem, poses: np.ndarray, motors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gauss–Newton from ``poses``; returns poses and the scaled residual, best so far."""
    residual = system.row_scale * system.value(poses, motors)
    for _ in range(25):
        if np.max(np.abs(residual), initial=0.0) <= 1e-15 or not system.rows:
            break
        scaled = system.row_scale[:, None] * system.gradient(poses, motors) * system.pose_scale
        step = system.pose_scale * np.linalg.lstsq(scaled, -residual, rcond=1e-10)[0]
        trial = system.with_unknowns(poses, system.unknowns(poses) + step)
        new = system.row_scale * system.value(trial, motors)
        if np.linalg.norm(new) >= np.linalg.norm(residual) and np.max(np.abs(residual)) <= _CLOSED:
            break
        poses, residual = trial, new
    return poses, residual


def _relax(
    system: JointSystem, poses: np.ndarray, residual: np.ndarray, motors: np.ndarray, holding: Sequence[Holding]
) -> tuple[np.ndarray, np.ndarray]:
    """The closed assembly near ``poses`` where springs are least wound up, and its residual."""
    for _ in range(30 if holding else 0):
        if np.max(np.abs(residual), initial=0.0) > _CLOSED:
            break
        free = free_motions(system, poses, motors, holding)
        stiffness, modes = np.linalg.eigh(free.curvature)
        kept = np.abs(stiffness) > _CURVED * np.max(np.abs(stiffness), initial=0.0)
        step = -((modes.T @ free.slope)[kept] / np.abs(stiffness[kept])) @ modes[:, kept].T @ free.motions
        size = float(np.max(np.abs(step), initial=0.0))
        if size <= _RELAXED:
            break
        moved = system.unknowns(poses) + system.pose_scale * step * min(1.0, _LARGEST_TURN / size)
        trial, missed = _close(system, system.with_unknowns(poses, moved), motors)
        if np.max(np.abs(missed), initial=0.0) > _CLOSED:
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
