"""Forces and moments about the origin that act on the links of a mechanism in equilibrium."""

from dataclasses import dataclass

import numpy as np

import fenicsmech as fm
from fenicsmech.mechanism import Link, in_dimension


@dataclass(frozen=True)
class Wrench:
    """A force (dim,) and its moment about the origin, (1,) in the plane or (3,) in space."""

    force: np.ndarray
    moment: np.ndarray

    @classmethod
    def at(cls, point: np.ndarray, force: np.ndarray, moment: np.ndarray | float = 0.0) -> "Wrench":
        """A force at ``point`` and a moment about it."""
        x, f = (np.append(v, 0.0)[:3] for v in (point, force))
        return cls(np.asarray(force), moment + np.cross(x, f)[3 - (3 if len(point) == 3 else 1) :])

    def __add__(self, other: "Wrench") -> "Wrench":
        return Wrench(self.force + other.force, self.moment + other.moment)

    def __neg__(self) -> "Wrench":
        return Wrench(-self.force, -self.moment)


def of_joints(simulation: fm.Simulation, frame: fm.Frame) -> dict[Link, Wrench]:
    """Forces and moments of the joints on each link, from the reported reactions."""
    mechanism, linkage = simulation.scene.mechanism, simulation.linkage
    dim, space = linkage.dim, linkage.joints.space
    totals = {link: Wrench(np.zeros(dim), np.zeros({2: 1, 3: 3}[dim])) for link in mechanism.links}
    for joint, connection in zip(mechanism.joints, linkage.joints.connections, strict=True):
        reaction, body = frame.reactions[joint.name], linkage.bodies[connection.b]
        drawn = np.array(connection.at)
        moved = drawn + space.displace(frame.state.poses[connection.b], (drawn - body.centre)[None])[0]
        wrench = Wrench.at(moved, reaction.force, reaction.moment)
        totals[joint.b] += wrench
        totals[joint.a] += -wrench
    return totals


def of_load(simulation: fm.Simulation, curve: fm.Curve, frame: fm.Frame) -> Wrench:
    """The curve's force, at its moved point."""
    load, model, dim = curve.part, simulation.model, simulation.linkage.dim
    model.load(frame.state)
    moved = np.array(in_dimension(load.at, dim)) + model.point(load).displacement(model.elastic.u, frame.state.poses)
    return Wrench.at(moved, frame.force * np.array(in_dimension(load.direction, dim)))
