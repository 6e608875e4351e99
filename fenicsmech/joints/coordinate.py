"""The free coordinate of a joint as a function of both its bodies' poses: value, gradient, Hessian.

    revolute   in the plane   φ = θ_b − θ_a
               in space       φ = 2 atan2(e · v, w)   with   (w, v) = q̄_a q_b   and   e the axis as drawn
    prismatic                 φ = (x_b − x_a) · R_a e

The half angle makes φ smooth for |φ| < 2π: quaternions follow their bodies without a jump of sign. At ±2π it jumps
by 4π. In the plane it counts full turns. Where the joint is not quite closed, φ is the turn about e alone (the twist).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import sympy

from fenicsmech.joints.kind import JointKind
from fenicsmech.joints.spatial_space import RIGID_SPACES


@dataclass(frozen=True)
class Coordinate:
    """Compiled coordinate of one joint kind in one dimension.

    Every function takes (z (2 pose_size,), anchors (2, dim), triad (dim, dim)) as those of a ``Constraint`` do.

    Attributes:
        value: φ, rad or length, zero as drawn.
        gradient: ∂φ/∂z, (2 pose_size,).
        hessian: ∂²φ/∂z², (2 pose_size, 2 pose_size).
    """

    value: Callable[..., float]
    gradient: Callable[..., np.ndarray]
    hessian: Callable[..., np.ndarray]


@cache
def free_coordinate(kind: JointKind, dim: int) -> Coordinate:
    """The coordinate that a motor of a revolute or prismatic ``kind`` would prescribe."""
    size = RIGID_SPACES[dim].pose_size
    z = sympy.symbols(f"z0:{2 * size}", real=True)
    offsets = sympy.symbols(f"p0:{2 * dim}", real=True)
    axes = sympy.symbols(f"e0:{dim * dim}", real=True)
    triad = sympy.Matrix(dim, dim, axes)
    if kind.sliding:
        phi = _travel(dim, (z[:size], z[size:]), (offsets[:dim], offsets[dim:]), triad)
    else:
        phi = _angle(dim, (z[:size], z[size:]), triad)
    gradient = [sympy.diff(phi, zi) for zi in z]
    lower = [[sympy.diff(g, z[j]) if j <= i else sympy.S.Zero for j in range(2 * size)] for i, g in enumerate(gradient)]

    def compile_(expressions, shape):
        flat = sympy.lambdify((z, offsets, axes), list(sympy.flatten(expressions)), "math", cse=True)

        def evaluate(poses, anchors, triad):
            numbers = flat(poses.tolist(), anchors.ravel().tolist(), triad.ravel().tolist())
            return np.array(numbers, dtype=float).reshape(shape)

        return evaluate

    value, half = compile_([phi], ()), compile_(lower, (2 * size, 2 * size))

    def hessian(*point):
        below = half(*point)
        return below + np.tril(below, -1).T

    return Coordinate(lambda *point: float(value(*point)), compile_(gradient, (2 * size,)), hessian)


def _angle(dim: int, pose, triad: sympy.Matrix) -> sympy.Expr:
    a, b = pose
    if dim == 2:
        return b[2] - a[2]
    (wa, wb), (va, vb) = (a[3], b[3]), (sympy.Matrix(a[4:]), sympy.Matrix(b[4:]))
    axis = triad[2, :].T
    return 2 * sympy.atan2((wa * vb - wb * va - va.cross(vb)).dot(axis), wa * wb + va.dot(vb))


def _travel(dim: int, pose, anchor, triad: sympy.Matrix) -> sympy.Expr:
    turns = [RIGID_SPACES[dim].symbolic_rotation(list(z[dim:])) for z in pose]
    # both origins are counted from where the joint was drawn, which needs R − I only
    a, b = (
        sympy.Matrix(z[:dim]) + (turn - sympy.eye(dim)) * sympy.Matrix(offset)
        for z, turn, offset in zip(pose, turns, anchor, strict=True)
    )
    axis = triad[0 if dim == 2 else 2, :].T
    return (b - a).dot(turns[0] * axis)
