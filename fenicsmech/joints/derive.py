"""From a joint's equations to numbers: value, gradient and Hessian, derived symbolically once per kind.

With the poses z = (z_a, z_b) of both bodies and the value φ of a motor,

    C(z, φ),    A = ∂C/∂z,    Σ_k λ_k ∂²C_k/∂z²,    ∂C/∂φ,    Σ_k λ_k ∂²C_k/∂z∂φ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import sympy

from fenicsmech.joints.kind import JointKind, PlanarMarker, SpatialMarker
from fenicsmech.joints.spatial_space import RIGID_SPACES


@dataclass(frozen=True)
class Constraint:
    """Compiled equations of one joint kind in one dimension.

    Every function takes (z (2 pose_size,), anchors (2, dim), triad (dim, dim), φ); anchors are the joint's
    position minus the centres of the two bodies, the triad's rows are its unit vectors, both as drawn.

    Attributes:
        rows: number of equations; a motor's is the last.
        value: C, shape (rows,).
        gradient: ∂C/∂z, shape (rows, 2 pose_size).
        hessian: takes λ (rows,) last; Σ_k λ_k ∂²C_k/∂z², shape (2 pose_size, 2 pose_size).
        rate: ∂C/∂φ, shape (rows,).
        twist: takes λ (rows,) last; Σ_k λ_k ∂²C_k/∂z∂φ, shape (2 pose_size,).
    """

    rows: int
    value: Callable[..., np.ndarray]
    gradient: Callable[..., np.ndarray]
    hessian: Callable[..., np.ndarray]
    rate: Callable[..., np.ndarray]
    twist: Callable[..., np.ndarray]


def _spatial_equations(kind: JointKind, driven: bool, pose, anchor, triad, value) -> list[sympy.Expr]:
    def marker(z, offset):
        rotation = RIGID_SPACES[3].symbolic_rotation(z[3:])
        e1, e2, e3 = (rotation * triad[k, :].T for k in range(3))
        return SpatialMarker(sympy.Matrix(z[:3]) + (rotation - sympy.eye(3)) * offset, e1, e2, e3)

    # both origins are counted from where the joint was drawn, which needs R − I only
    a, b = (marker(z, offset) for z, offset in zip(pose, anchor, strict=True))
    return kind.equations(a, b) + ([kind.motor(a, b, value)] if driven else [])


def _planar_equations(kind: JointKind, driven: bool, pose, anchor, triad, value) -> list[sympy.Expr]:
    def marker(z, offset):
        rotation = RIGID_SPACES[2].symbolic_rotation(z[2:])
        axis, normal = (rotation * triad[k, :].T for k in range(2))
        return PlanarMarker(sympy.Matrix(z[:2]) + (rotation - sympy.eye(2)) * offset, axis, normal, z[2])

    a, b = (marker(z, offset) for z, offset in zip(pose, anchor, strict=True))
    return kind.planar_equations(a, b) + ([kind.planar_motor(a, b, value)] if driven else [])


_EQUATIONS = {2: _planar_equations, 3: _spatial_equations}


@cache
def constraint(kind: JointKind, dim: int, driven: bool) -> Constraint:
    """The compiled equations of ``kind`` in ``dim`` dimensions, with its motor if ``driven``."""
    size = RIGID_SPACES[dim].pose_size
    z = sympy.symbols(f"z0:{2 * size}", real=True)
    offsets = sympy.symbols(f"p0:{2 * dim}", real=True)
    axes = sympy.symbols(f"e0:{dim * dim}", real=True)
    value = sympy.Symbol("phi", real=True)
    pose = (list(z[:size]), list(z[size:]))
    anchor = (sympy.Matrix(offsets[:dim]), sympy.Matrix(offsets[dim:]))
    equations = _EQUATIONS[dim](kind, driven, pose, anchor, sympy.Matrix(dim, dim, axes), value)
    rows = len(equations)
    multipliers = sympy.symbols(f"l0:{rows}", real=True)
    arguments = (z, offsets, axes, value)

    gradient = [[sympy.diff(c, zi) for zi in z] for c in equations]
    pull = [
        sum((m * row[i] for m, row in zip(multipliers, gradient, strict=True)), sympy.S.Zero) for i in range(2 * size)
    ]
    hessian = [
        [sympy.diff(pull[i], z[j]) if j <= i else sympy.S.Zero for j in range(2 * size)] for i in range(2 * size)
    ]

    def compile_(expressions, shape, extra=()):
        flat = sympy.lambdify((*arguments, *extra), list(sympy.flatten(expressions)), "math", cse=True)

        def evaluate(poses, anchors, triad, phi, *more):
            numbers = flat(poses.tolist(), anchors.ravel().tolist(), triad.ravel().tolist(), phi, *more)
            return np.array(numbers, dtype=float).reshape(shape)

        return evaluate

    mixed = compile_([sympy.diff(p, value) for p in pull], (2 * size,), (multipliers,))
    lower = compile_(hessian, (2 * size, 2 * size), (multipliers,))

    def full_hessian(poses, anchors, triad, phi, lam):
        half = lower(poses, anchors, triad, phi, lam.tolist())
        return half + np.tril(half, -1).T

    return Constraint(
        rows=rows,
        value=compile_(equations, (rows,)),
        gradient=compile_(gradient, (rows, 2 * size)),
        hessian=full_hessian,
        rate=compile_([sympy.diff(c, value) for c in equations], (rows,)),
        twist=lambda *point: mixed(*point[:-1], point[-1].tolist()),
    )
