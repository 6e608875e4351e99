"""The point of a link that the pointer holds, and the forces that it exerts there, beside that of a curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fenicsmech.equilibrium import LoadControl
from fenicsmech.live.responses import outlines
from fenicsmech.mechanism import FlexibleLink, Force, Link
from fenicsmech.simulation import Curve, CurveRequest, Frame, MechanismPlotter, Simulation


class Grip:
    """A point of a link, with forces along x and y.

    Args:
        simulation: of the mechanism, to which the forces do not belong.
        plotter: that draws it.
        start: the curve in whose last frame the point is held.
        link: that the point is on.
        place: where the point is in the frame, or a place that it is nearest to.

    Attributes:
        start: as given.
        forces: along x and y.
    """

    def __init__(
        self, simulation: Simulation, plotter: MechanismPlotter, start: Curve, link: Link, place: Sequence[float]
    ) -> None:
        self._simulation, self.start = simulation, start
        at = _drawn(simulation, plotter, start.frames[-1], link, np.array(place))
        along, across = (
            Force(link, at, way, f"push along {axis}") for axis, way in (("x", (1.0, 0.0)), ("y", (0.0, 1.0)))
        )
        self.forces = along, across

    def pulled(self, request: CurveRequest, by: Sequence[float]) -> CurveRequest:
        """The request of an equilibrium on a curve with a force ``by`` (2,) at the point."""
        (control,), (along, across) = request.controls, self.forces
        others = (*request.others, (request.part, control.prescribed), (across, by[1]))
        return CurveRequest(along, (LoadControl(by[0]),), request.configuration, others)  # type: ignore[arg-type]

    def release(self) -> None:
        """Gives the memory of its solvers back."""
        self._simulation.forget(self.forces[0])


def _drawn(
    simulation: Simulation, plotter: MechanismPlotter, frame: Frame, link: Link, place: np.ndarray
) -> tuple[float, float]:
    """Where the point of a link was drawn that is at, or nearest to, a ``place`` (2,) in a frame."""
    model = simulation.model
    if not isinstance(link, FlexibleLink):
        corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        points = [model.linkage.point(link, at).displacement(None, frame.state.poses)[:2] for at in corners]
        origin, *ends = corners + points
        x, y = np.linalg.solve(np.transpose([end - origin for end in ends]), place - origin)
        return float(x), float(y)
    at_rest = replace(frame.state, u=np.zeros_like(frame.state.u), poses=model.linkage.joints.drawn)
    number = model.mechanism.flexible_links.index(link)
    states = replace(frame, state=at_rest, design=model.design), frame
    drawn, now = (outlines(model, plotter, own).nodes[number] for own in states)
    x, y = drawn[np.argmin(np.linalg.norm(now - place, axis=1))]
    return float(x), float(y)
