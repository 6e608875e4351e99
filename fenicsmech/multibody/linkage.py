"""Bodies and constraints of a described mechanism."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.joints import WELD, free_coordinate
from fenicsmech.mechanism import FlexibleLink, Joint, Link, Mechanism, in_dimension, same_place
from fenicsmech.multibody.constraints import Body, Connection, JointSystem


@dataclass(frozen=True)
class Linkage:
    """Bodies and constraints of a mechanism.

    Attributes:
        dim: 2 or 3.
        length: size of the mechanism, diagonal of the box around its joints and points.
        bodies: rigid links first, then the interfaces, link by link.
        interfaces: indices of the interface bodies of each flexible link.
        joints: constraints of the mechanism itself: interfaces of a flexible link are independent.
        rigid: the same with every flexible link welded into one rigid body.
    """

    dim: int
    length: float
    bodies: tuple[Body, ...]
    interfaces: dict[FlexibleLink, tuple[int, ...]]
    joints: JointSystem
    rigid: JointSystem

    def body_of(self, link: Link) -> int:
        """Index of the body that carries ``link``: itself if rigid, its first interface if flexible."""
        return next(i for i, body in enumerate(self.bodies) if body.link == link)


class JointCoordinate:
    """φ, the free coordinate of a ``joint`` that can have a motor: the angle or travel of its second link.

    Attributes:
        bodies: indices of both bodies.
    """

    def __init__(self, linkage: Linkage, joint: Joint) -> None:
        connection = next(c for c in linkage.joints.connections if c.name == joint.name)
        self.bodies = (connection.a, connection.b)
        self._drawn = connection.drawn(linkage.bodies)
        self._formula = free_coordinate(joint.kind, linkage.dim)

    def value(self, poses: np.ndarray) -> float:
        """φ, zero as drawn, from the ``poses`` of all bodies, (bodies, pose_size)."""
        return float(self._formula.value(*self._point(poses))[0])

    def gradient(self, poses: np.ndarray) -> np.ndarray:
        """∂φ/∂z of ``bodies``, one after the other, (2 pose_size,)."""
        return self._formula.gradient(*self._point(poses))[0]

    def hessian(self, poses: np.ndarray) -> np.ndarray:
        """∂²φ/∂z², (2 pose_size, 2 pose_size)."""
        return self._formula.hessian(*self._point(poses), np.ones(1))

    def _point(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return poses[list(self.bodies)].ravel(), self._drawn


def build_linkage(mechanism: Mechanism, dim: int) -> Linkage:
    """The bodies and constraints of ``mechanism`` in ``dim`` dimensions."""
    bodies = [Body(link.name, link, _centre(mechanism, link, dim), link.fixed) for link in mechanism.rigid_links]
    length = mechanism.length
    interfaces: dict[FlexibleLink, tuple[int, ...]] = {}
    for link in mechanism.flexible_links:
        first = len(bodies)
        for joint in mechanism.joints:
            known = any(same_place(body.centre, joint.at, dim=dim, length=length) for body in bodies[first:])
            if link in (joint.a, joint.b) and not known:
                region = joint.regions[(joint.a, joint.b).index(link)]
                axis = joint.axis if joint.kind.pin_along_axis else (0.0, 0.0, 1.0)
                at = in_dimension(joint.at, dim)
                bodies.append(Body(joint.name, link, at, False, region, axis))
        interfaces[link] = tuple(range(first, len(bodies)))

    def body(joint: Joint, link: Link) -> int:
        return next(
            i
            for i, body in enumerate(bodies)
            if body.link == link and (body.region is None or same_place(body.centre, joint.at, dim=dim, length=length))
        )

    driven = {motor.joint: motor for motor in mechanism.motors}
    connections = [
        Connection(
            joint.name,
            joint.kind,
            body(joint, joint.a),
            body(joint, joint.b),
            in_dimension(joint.at, dim),
            _triad(joint, dim),
            driven.get(joint),
        )
        for joint in mechanism.joints
    ]
    identity = tuple(map(tuple, np.eye(dim)))
    welds = [
        Connection(f"link {link.name!r}", WELD, group[0], other, bodies[other].centre, identity)
        for link, group in interfaces.items()
        for other in group[1:]
    ]
    return Linkage(
        dim=dim,
        length=length,
        bodies=tuple(bodies),
        interfaces=interfaces,
        joints=JointSystem(bodies, connections, dim=dim, length=length),
        rigid=JointSystem(bodies, [*connections, *welds], dim=dim, length=length),
    )


def _centre(mechanism: Mechanism, link: Link, dim: int) -> tuple[float, ...]:
    places = [in_dimension(joint.at, dim) for joint in mechanism.joints if link in (joint.a, joint.b)]
    return tuple(np.mean(places, axis=0)) if places else (0.0,) * dim


def _triad(joint: Joint, dim: int) -> tuple[tuple[float, ...], ...]:
    """Unit vectors of a joint as rows: in space the axis last, in the plane (axis, normal)."""
    axis = np.array(joint.axis)
    if dim == 2:
        first = axis[:2] if joint.kind.axis_in_plane else np.array([1.0, 0.0])
        return tuple(first), (-first[1], first[0])
    # the coordinate direction least aligned with the axis; the plane's x for axes along z
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    e1 = helper - (helper @ axis) * axis
    e1 /= np.linalg.norm(e1)
    return tuple(e1), tuple(np.cross(axis, e1)), tuple(axis)
