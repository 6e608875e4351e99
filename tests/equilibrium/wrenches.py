"""What acts on each link of a mechanism in equilibrium, summed up from the reactions of its joints."""

import numpy as np

import fenicsmech as fm
from fenicsmech.linkage.build import in_dimension
from fenicsmech.mechanism import Link


def cross(lever: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Moment (1,) in the plane, (3,) in space."""
    return np.atleast_1d(np.cross(lever, force)) if len(lever) == 3 else np.array(
        [lever[0] * force[1] - lever[1] * force[0]]
    )


def sums(simulation: fm.Simulation, curve: fm.Curve, frame: fm.Frame) -> dict[Link, tuple[np.ndarray, np.ndarray]]:
    """Force and moment about the origin on every link: of the joints and, of the curve's force, at the moved point."""
    mechanism, linkage, model = simulation.scene.mechanism, simulation.linkage, simulation.model
    dim, space, poses = linkage.dim, linkage.joints.space, frame.state.poses
    model.load(frame.state)
    totals = {link: [np.zeros(dim), np.zeros({2: 1, 3: 3}[dim])] for link in mechanism.links}

    def add(link: Link, sign: float, at: np.ndarray, force: np.ndarray, moment: np.ndarray) -> None:
        totals[link][0] += sign * force
        totals[link][1] += sign * (moment + cross(at, force))

    connections = {connection.name: connection for connection in linkage.joints.connections}
    for joint in mechanism.joints:
        connection, reaction = connections[joint.name], frame.reactions[joint.name]
        centre, pose = np.array(linkage.bodies[connection.b].centre), poses[connection.b]
        drawn = np.array(connection.at)
        at = drawn + space.displace(pose, (drawn - centre)[None])[0]
        add(joint.b, 1.0, at, reaction.force, reaction.moment)
        add(joint.a, -1.0, at, reaction.force, reaction.moment)
    load = curve.force_part
    at = np.array(in_dimension(load.at, dim)) + model.point(load).displacement(model.elastic.u, poses)
    pull = frame.force * np.array(in_dimension(load.direction, dim))
    add(load.on, 1.0, at, pull, np.zeros({2: 1, 3: 3}[dim]))
    return {link: (force, moment) for link, (force, moment) in totals.items()}
