"""Displacements of points and rotations of bodies, both from the unloaded configuration.

    u = t + (R − I)(P − c) on a body,     u = Σ N_i(P) u_i on a flexible link,     φ = θ,  in space 2 atan2(a · v, w)

with the pose (t, θ), or (t, (w, v)) in space, of a body. In space φ is the twist about the axis a.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.equilibrium import PointLoad
from fenicsmech.errors import DescriptionError, direction, expect, point, point_text, set_fields
from fenicsmech.mechanism import FlexibleLink, Force, Joint, Link, Output, RigidLink, in_dimension
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import Linkage, LinkPoint
from fenicsmech.quantities.quantity import Observable, Partial, Quantity, border_of


@dataclass(frozen=True)
class Displacement(Quantity):
    """The displacement of a material point from the unloaded configuration.

    Attributes:
        part: a force or an output, whose displacement along its direction is meant; or a link.
        at: the drawn point of a link, 2 or 3 coordinates; its displacement is a vector. See ``Component`` for one
            along a direction.

    Raises:
        DescriptionError: the part has no displacement, or a link comes without a point.
    """

    part: Force | Output | Link
    at: tuple[float, ...] | None = None
    from_unloaded = True

    def __post_init__(self) -> None:
        if isinstance(self.part, Force | Output):
            if self.at is not None:
                raise DescriptionError(
                    f"displacement of {self.part.name!r}", "it has a point already", "Give a link with at=…"
                )
        elif not isinstance(self.part, RigidLink | FlexibleLink):
            raise DescriptionError(
                "displacement", f"{self.part!r} has none", "Give a link and at=…, a force or an output"
            )
        elif self.at is None:
            raise DescriptionError(f"displacement of {self.part.name!r}", "no point is given", "Give at=(x, y)")
        else:
            set_fields(self, at=point(f"point of {self.part.name!r}", self.at))

    @property
    def name(self):
        where = "" if self.at is None else f" at {point_text(self.at)}"
        return f"displacement of {self.part.name!r}{where}"

    def unit(self, units):
        return units.length

    @property
    def material_points(self):
        return () if self.at is None else ((self.part, self.at, None),)

    def size(self, dim):
        return 1 if self.at is None else dim

    def on(self, model):
        if isinstance(self.part, Force | Output):
            return _Travels([model.point_load(self.part)], model)
        axes = np.eye(model.linkage.dim)
        parts = [Output(self.part, self.at or (), tuple(axis), f"{self.name}, {k}") for k, axis in enumerate(axes)]
        return _Travels([model.point_load(part) for part in parts], model)


class _Travels(Observable):
    """Travels of point loads of magnitude one."""

    def __init__(self, loads: list[PointLoad], model: MechanismModel) -> None:
        self._loads, self._model, self.size = loads, model, len(loads)
        self.on_link = any(isinstance(point, LinkPoint) for load in loads for point, _ in load.acting)

    def values(self, state):
        return np.array([load.travel(self._model.elastic.u, state.poses) for load in self._loads])

    def partials(self, system, state):
        return [Partial(*system.travel_slopes(load, state)) for load in self._loads]


@dataclass(frozen=True)
class Rotation(Quantity):
    """The rotation of a rigid link, or of a flexible one at a joint, from the unloaded configuration, rad.

    Attributes:
        link: the link.
        joint: one of its joints, for a flexible link.
        about: axis in space; there it is the twist about this axis, within a full turn.

    Raises:
        DescriptionError: the link or joint is something else, or a flexible link comes without a joint.
    """

    link: Link
    joint: Joint | None = None
    about: tuple[float, ...] = (0.0, 0.0, 1.0)
    from_unloaded = True

    def __post_init__(self) -> None:
        expect("rotation", self.link, RigidLink | FlexibleLink, "a link", "Give a link")
        expect(f"rotation of {self.link.name!r}", self.joint, Joint | None, "a joint", "Give a joint of the mechanism")
        if isinstance(self.link, FlexibleLink) and self.joint is None:
            raise DescriptionError(
                f"rotation of {self.link.name!r}", "the link bends", "Give joint=…, at which it is to be known"
            )
        set_fields(self, about=direction(f"axis of the {self}", self.about))

    @property
    def name(self):
        return f"rotation of {self.link.name!r}{'' if self.joint is None else f' at {self.joint.name!r}'}"

    def unit(self, units):
        return "rad"

    def check(self, scene, dim):
        super().check(scene, dim)
        if self.joint is not None and self.link not in (self.joint.a, self.joint.b):
            raise DescriptionError(self.name, "the joint does not hold the link", "Name one of its joints")
        if dim == 2 and abs(in_dimension(self.about, 3)[2]) != 1.0:
            raise DescriptionError(self.name, f"its axis is {self.about}", "Turn about z in the plane")

    def on(self, model):
        return _Turn(model, self._body(model.linkage), np.array(in_dimension(self.about, 3)))

    def _body(self, linkage: Linkage) -> int:
        if self.joint is None:
            return linkage.body_of(self.link)
        connection = linkage.joints.connections[linkage.connection_of(self.joint)]
        return next(i for i in (connection.a, connection.b) if linkage.bodies[i].link == self.link)


class _Turn(Observable):
    """The angle of one body about an axis."""

    def __init__(self, model: MechanismModel, body: int, axis: np.ndarray) -> None:
        self._joints, self._body, self._axis = model.linkage.joints, body, axis

    def values(self, state):
        pose = state.poses[self._body]
        if self._joints.space.dim == 2:
            return np.array([self._axis[2] * pose[2]])
        return np.array([2.0 * np.arctan2(self._axis @ pose[4:], pose[3])])

    def partials(self, system, state):
        pose, columns = state.poses[self._body], self._joints.columns.get(self._body)
        if columns is None:  # a fixed body
            return [Partial()]
        if self._joints.space.dim == 2:
            return [Partial(border=border_of(system, poses=(columns[2:], self._axis[2])))]
        w, along = pose[3], self._axis @ pose[4:]
        slopes = 2.0 * np.append(-along, w * self._axis) / (w**2 + along**2)
        return [Partial(border=border_of(system, poses=(columns[3:], slopes)))]
