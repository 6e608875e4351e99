"""Linear responses: how what the page draws changes with forces and motors, from the KKT matrix of an equilibrium.

    K y′ = r,     r of a unit of a force at any point, or of a motor's position

The picture is a function of y: its rate is the central difference along y′ over some ten-thousandth of the mechanism's
length, which is exact to its square. One factor serves all responses of an equilibrium.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from petsc4py import PETSc

from fenicsmech.equilibrium import EquilibriumSolver, Linearisation, LoadControl, NotConverged, State
from fenicsmech.mechanism import Force, Motor
from fenicsmech.model import MechanismModel
from fenicsmech.simulation import Frame, MechanismPlotter, gather

_REACH = 1e-4  # of the mechanism's length: to either side of the equilibrium

Cause = Callable[[Linearisation], PETSc.Vec]
"""The right-hand side r at an equilibrium."""


@dataclass(frozen=True, eq=False)
class Outlines:
    """Where the parts of a picture are, or how fast they move.

    Attributes:
        nodes: of each flexible link, (nodes, 2).
        rigid: joints, forces and outputs of each rigid link, (k, 2).
        pins: (joints, 2).
    """

    nodes: list[np.ndarray]
    rigid: list[np.ndarray]
    pins: np.ndarray

    def per(self, other: Outlines, distance: float) -> Outlines:
        """The rate from ``other`` to this one."""

        def rates(these: Sequence[np.ndarray], those: Sequence[np.ndarray]) -> list[np.ndarray]:
            return [(this - that) / distance for this, that in zip(these, those, strict=True)]

        return Outlines(
            rates(self.nodes, other.nodes), rates(self.rigid, other.rigid), (self.pins - other.pins) / distance
        )


def by_force(model: MechanismModel, force: Force) -> Cause:
    """A unit of a force, which need not be one of the mechanism."""
    return lambda at: at.travel_gradient(model.point_load(force))


def by_motor(model: MechanismModel, motor: Motor) -> Cause:
    """A unit of the position of a motor."""
    direction = model.linkage.joints.motor_values(lambda own: float(own == motor))
    return lambda at: at.motor_rate(direction)


def outlines(model: MechanismModel, plotter: MechanismPlotter, frame: Frame) -> Outlines:
    """Those of a frame."""
    snapshot = gather(model, frame)
    assert snapshot is not None, "there is one process"
    shape = plotter.shape(snapshot)
    nodes, pins = [own.points for own in shape.flexible], np.array([pin.at for pin in shape.pins]).reshape(-1, 2)
    return Outlines(nodes, plotter.rigid_points(snapshot), pins)


def responses(
    model: MechanismModel, plotter: MechanismPlotter, solver: EquilibriumSolver, frame: Frame, causes: Sequence[Cause]
) -> list[Outlines]:
    """The rates of what is drawn of a frame with each of some causes; none where the KKT matrix is singular.

    Args:
        model: of the mechanism.
        plotter: that draws it.
        solver: of the frame's equilibrium.
        frame: an equilibrium under dead loads.
        causes: forces and motors.
    """
    system, found = solver.system, []
    with model.shaped(frame.design):
        try:
            at = solver.linearise(frame.state, LoadControl(frame.state.force))
            steps = [at.step(at.solve(cause(at))) for cause in causes]
        except NotConverged:
            return []
        pairs = []
        for step in steps:
            distance = _REACH / max(system.size(step), 1e-300)
            states = [system.moved(frame.state, step.scaled(sign * distance)) for sign in (1.0, -1.0)]
            pairs.append((distance, states))
    for distance, states in pairs:
        after, before = (outlines(model, plotter, replace(frame, state=state)) for state in states)
        found.append(after.per(before, 2.0 * distance))
    return found


def displacement(model: MechanismModel, force: Force, frame: Frame, unloaded: State) -> float:
    """That of a force's point along it in a frame, whatever is prescribed there, from the unloaded configuration."""
    found = 0.0
    with model.shaped(frame.design):
        for state, sign in ((unloaded, -1.0), (frame.state, 1.0)):
            model.load(state)
            found += sign * model.travel(force, state)
    return found
