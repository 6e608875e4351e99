"""Whether motors can take the rigid links of a planar mechanism where they are to, by least squares of its own."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import least_squares

from .blueprint import Blueprint, CompliancePlan, JointPlan

_STEPS = 60  # from the drawn positions to the prescribed ones


def smallest_gap(blueprint: Blueprint) -> float:
    """Gap of joints that is left at the prescribed positions, over the mechanism's length; angles in rad.

    Motors go there in steps, each from where the last one ended. Joints that give way may be apart, and a flexible link
    takes any shape: each of its joints is a body.
    """
    names = sorted({_body(blueprint, name, joint) for joint in blueprint.joints for name in (joint.a, joint.b)})
    soft = {plan.joint for plan in blueprint.effects if isinstance(plan, CompliancePlan)}
    poses = np.zeros(3 * len(names))
    for share in np.linspace(0.0, 1.0, _STEPS + 1)[1:]:

        def residual(poses: np.ndarray, share: float = share) -> np.ndarray:
            at = {name: poses[3 * k : 3 * k + 3] for k, name in enumerate(names)}
            at |= {link.name: np.zeros(3) for link in blueprint.links if link.fixed}
            rows = [_rows(blueprint, joint, at, share, soft) for joint in blueprint.joints]
            return np.array([row for found in rows for row in found])

        poses = least_squares(residual, poses, xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=200).x
    return float(np.abs(residual(poses)).max())


def _rows(
    blueprint: Blueprint, joint: JointPlan, poses: dict[str, np.ndarray], share: float, soft: set[str]
) -> list[float]:
    """Residuals of a joint and its motor; poses are (x, y, angle), lengths in the mechanism's."""
    bodies = (_body(blueprint, name, joint) for name in (joint.a, joint.b))
    (a, angle), (b, other) = (_placed(blueprint, poses[body], joint) for body in bodies)
    gap, turn = b - a, other - angle
    target = next((share * motor.position for motor in blueprint.motors if motor.joint == joint.name), None)
    if joint.kind == "prismatic":
        c, s = math.cos(angle), math.sin(angle)
        x, y = np.array(joint.axis[:2]) / np.linalg.norm(joint.axis[:2])
        along = np.array([c * x - s * y, s * x + c * y])
        rows = [turn, along[0] * gap[1] - along[1] * gap[0]]
        return rows if target is None else [*rows, gap @ along - target / blueprint.length]
    rows = [] if joint.name in soft else list(gap)
    if joint.kind == "weld":
        return [*rows, turn]
    return rows if target is None else [*rows, turn - target]


def _body(blueprint: Blueprint, link: str, joint: JointPlan) -> str:
    return f"{link} at {joint.name}" if blueprint.link(link).centreline else link


def _placed(blueprint: Blueprint, pose: np.ndarray, joint: JointPlan) -> tuple[np.ndarray, float]:
    """Where a link's pose takes the joint's point, in lengths of the mechanism, and the link's angle."""
    at, angle = np.array(joint.at[:2]) / blueprint.length, pose[2]
    c, s = math.cos(angle), math.sin(angle)
    return pose[:2] + np.array([c * at[0] - s * at[1], s * at[0] + c * at[1]]), angle
