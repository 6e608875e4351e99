"""Friction in hinges as bounds on the load, from a curve without friction.

Dry friction of a pin of radius r turns the force R on it into a moment of at most μ r |R| against its turning. While
the mechanism creeps along its curve, the power dissipated in the pins is that of the additional force:

    |Δf| |du| = Σ_j μ_j r_j |R_j| |dφ_j|,      f ∈ [f − Δf, f + Δf].

Within this band the mechanism sticks; loaded it moves along the upper bound, unloaded along the lower one.
Reactions are those without friction: bounds are of first order in μ. Source: Coulomb's law.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fenicsmech.checks import positive
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import Joint
from fenicsmech.multibody import JointCoordinate, Linkage
from fenicsmech.simulation.frame import Frame


@dataclass(frozen=True)
class PinFriction:
    """Dry friction in a hinge.

    Attributes:
        coefficient: Coulomb's μ.
        radius: of the pin.

    Raises:
        DescriptionError: one of them is not positive.
    """

    coefficient: float
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficient", positive("coefficient of friction", self.coefficient))
        object.__setattr__(self, "radius", positive("radius of a pin with friction", self.radius))


def friction_band(
    frames: Sequence[Frame], pins: Mapping[Joint, PinFriction], linkage: Linkage
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the force between which friction holds the mechanism, as ``Curve.friction_band``."""
    poses = [frame.state.poses for frame in frames]
    if len(poses) < 2:
        raise DescriptionError("friction band", "the curve has one frame only", "Ask for two forces or more")
    angles, moments = [], []
    for joint, pin in pins.items():
        is_hinge = joint.kind.motorised and not joint.kind.sliding
        if not is_hinge or joint.name not in frames[0].reactions:
            raise DescriptionError(
                "friction band", f"{joint.name!r} is not a hinge of this curve that turns", "Name its revolute joints"
            )
        coordinate = JointCoordinate(linkage, joint)
        turned = np.array([coordinate.value(z) for z in poses])
        forces = np.array([frame.reactions[joint.name].force for frame in frames])
        if linkage.dim == 3:
            turned = np.unwrap(turned, period=4.0 * np.pi)
            first, axis = coordinate.bodies[0], np.array(joint.axis)
            axes = np.array([linkage.joints.space.rotate(z[first], axis) for z in poses])
            forces = forces - np.sum(forces * axes, axis=1, keepdims=True) * axes
        angles.append(turned)
        moments.append(pin.coefficient * pin.radius * np.linalg.norm(forces, axis=1))
    arc = _arc(frames, linkage)
    order: Literal[1, 2] = 1 if len(poses) == 2 else 2
    loss = np.zeros_like(arc)
    for moment, turned in zip(moments, angles, strict=True):
        loss += moment * np.abs(np.gradient(turned, arc, edge_order=order))
    speed = np.abs(np.gradient([frame.displacement for frame in frames], arc, edge_order=order))
    surplus = np.divide(loss, speed, out=np.where(loss > 0.0, np.inf, 0.0), where=speed > 0.0)
    held = np.array([frame.force for frame in frames])
    return held - surplus, held + surplus


def _arc(frames: Sequence[Frame], linkage: Linkage) -> np.ndarray:
    """Length of the path of all bodies and the force's point, in lengths of the mechanism and rad, (frames,).

    Raises:
        DescriptionError: two frames are the same.
    """
    space = linkage.joints.space
    scale = np.concatenate([np.full(space.dim, linkage.length), np.ones(space.rotation_size)])
    motion = [np.append(frame.state.poses / scale, frame.displacement / linkage.length) for frame in frames]
    steps = np.linalg.norm(np.diff(motion, axis=0), axis=1)
    # frames closer than that, in lengths of the mechanism or rad, differ by the tolerance of their equilibria
    if not np.all(steps > 1e-8):
        raise DescriptionError("friction band", "two frames of the curve are the same", "Ask for different samples")
    return np.concatenate([[0.0], np.cumsum(steps)])
