"""Shapes of pictures from states of a mechanism."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenicsmech.mechanism import Force, Link, in_dimension
from fenicsmech.model import MechanismModel
from fenicsmech.plot import (
    Arrow,
    FlexibleShape,
    MechanismShape,
    Pin,
    RigidShape,
    plan_view,
    rigid_outline,
)
from fenicsmech.simulation.fields import Snapshot


class MechanismPlotter:
    """Draws states of one mechanism in plan view; the triangles are those of the undeformed mesh.

    Args:
        model: of the mechanism.
    """

    def __init__(self, model: MechanismModel) -> None:
        self._mechanism, self._linkage, self._mesh = model.mechanism, model.linkage, model.mesh
        self._width = 0.03 * model.linkage.length
        self._faces = [self._visible(index) for index in range(len(model.mechanism.flexible_links))]

    def shape(self, snapshot: Snapshot, *, stress: bool) -> MechanismShape:
        """The mechanism in the state of ``snapshot``, links optionally coloured by von Mises stress."""
        positions = (snapshot.rest + snapshot.displacement)[:, :2]
        flexible = tuple(
            FlexibleShape(positions, triangles, snapshot.von_mises[cells] if stress else None, name=link.name)
            for (triangles, cells), link in zip(self._faces, self._mechanism.flexible_links, strict=True)
        )
        return MechanismShape(flexible, self.rigid(snapshot.poses), self._pins(snapshot.poses))

    def rigid(self, poses: np.ndarray) -> tuple[RigidShape, ...]:
        """The rigid links at ``poses`` (bodies, pose_size)."""
        return tuple(
            RigidShape(rigid_outline(self._places(link, poses), self._width), link.name, link.fixed)
            for link in self._mechanism.rigid_links
        )

    def arrow(self, force: Force, magnitude: float, snapshot: Snapshot, *, label: str) -> Arrow:
        """The arrow of a force on a rigid link in the state of ``snapshot``."""
        at = self.position(force.on, force.at, snapshot.poses)
        return Arrow(at, magnitude * np.array(force.direction[:2]), label=label)

    def position(self, link: Link, at: Sequence[float], poses: np.ndarray) -> np.ndarray:
        """Position of the point drawn at ``at`` of ``link``, (2,); a flexible link moves with its first interface."""
        return self._moved(self._linkage.body_of(link), in_dimension(tuple(at), self._linkage.dim), poses)

    def _places(self, link: Link, poses: np.ndarray) -> np.ndarray:
        """Current positions of the joints, forces and outputs of a rigid link, (k, 2)."""
        joints = [joint.at for joint in self._mechanism.joints if link in (joint.a, joint.b)]
        points = [part.at for part in (*self._mechanism.forces, *self._mechanism.outputs) if part.on == link]
        return np.array([self.position(link, at, poses) for at in (*joints, *points)])

    def _pins(self, poses: np.ndarray) -> tuple[Pin, ...]:
        return tuple(
            Pin(self._moved(each.a, each.at, poses), welded=each.kind.clamps)
            for each in self._linkage.joints.connections
        )

    def _moved(self, body: int, at: Sequence[float], poses: np.ndarray) -> np.ndarray:
        """Position of the point drawn at ``at`` of a body, (2,)."""
        offset = np.array(at) - np.array(self._linkage.bodies[body].centre)
        return (np.array(at) + self._linkage.joints.space.displace(poses[body], offset[None])[0])[:2]

    def _visible(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Triangles of a link seen from above, and the cell each belongs to."""
        cells = np.flatnonzero(self._mesh.link_of_cell == index)
        if self._mesh.vertices.shape[1] == 2:
            return self._mesh.cells[cells], cells
        view = plan_view(self._mesh.vertices, self._mesh.cells[cells])
        return view.triangles, cells[view.cells]
