"""Linear responses: how what the page draws changes with forces and motors, from the KKT matrix of an equilibrium.

    K y′ = r,     r of a unit of a force at any point, or of a motor's position

The picture is a function of y: its rate is the central difference along y′ over some ten-thousandth of the mechanism's
length, which is exact to its square. One factor serves all responses of an equilibrium.

Load–displacement curves change with the direction and the point of a dead force f a at P by the adjoint x of the
displacement a · u_P,

    K x = ∂(a · u_P)/∂y,     d(a · u_P)/dv = ∂(a · u_P)/∂v + f x · ∂²(a · u_P)/∂y∂v,     v the angle of a or P.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from petsc4py import PETSc

from fenicsmech.equilibrium import EquilibriumSolver, Linearisation, LoadControl, NotConverged, State
from fenicsmech.mechanism import Force, Motor
from fenicsmech.model import MechanismModel
from fenicsmech.simulation import Curve, Frame, MechanismPlotter, gather

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


@dataclass(frozen=True)
class LoadChange:
    """How a force changes with a number v, as the difference of two unit forces.

        ∂(a · u_P)/∂v = (a₊ · u_P₊ − a₋ · u_P₋) / span

    Attributes:
        force: that changes.
        more, less: the unit forces a₊ at P₊ and a₋ at P₋.
        span: of v between them, rad or length.
    """

    force: Force
    more: Force
    less: Force
    span: float


def turned(force: Force) -> LoadChange:
    """A unit of the angle of a force in the plane; exact."""
    x, y = (-force.direction[1], force.direction[0])
    more, less = (Force(force.on, force.at, (s * x, s * y), force.name, force.region) for s in (1.0, -1.0))
    return LoadChange(force, more, less, 2.0)


def shifted(force: Force, axis: int, step: float) -> LoadChange:
    """A unit of the place of a force along an ``axis``: exact on rigid links, within an element on flexible ones."""

    def at(shift: float) -> Force:
        place = tuple(part + shift * (k == axis) for k, part in enumerate(force.at))
        return Force(force.on, place, force.direction, force.name)

    return LoadChange(force, at(step), at(-step), 2.0 * step)


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


def curve_slopes(
    model: MechanismModel,
    solver: EquilibriumSolver,
    curve: Curve,
    frames: Sequence[Frame],
    changes: Sequence[LoadChange],
    *,
    held: bool,
) -> np.ndarray | None:
    """Derivatives of the displacement in frames of the curve of a force, or of the force where displacements are held.

    Args:
        model: of the mechanism.
        solver: of the curve's equilibria.
        curve: of a force, with constant ones.
        frames: of the curve, of one design.
        changes: of its forces; those of others change nothing.
        held: whether displacements are.

    Returns:
        (frames, changes); None where the KKT matrix is singular.
    """
    part, constant = curve.part, dict(curve.others)
    assert isinstance(part, Force), "a group of forces acts at no single point"

    def travels(state: State) -> np.ndarray:
        """∂(a · u_P)/∂v of the curve's force."""
        both = [[model.travel(end, state) for end in (own.more, own.less)] for own in changes]
        own = [change.force == part for change in changes]
        return np.where(
            own, [(more - less) / change.span for (more, less), change in zip(both, changes, strict=True)], 0.0
        )

    found = np.zeros((len(frames), len(changes)))
    with model.shaped(frames[0].design):
        model.load(curve.unloaded)
        unloaded = travels(curve.unloaded)
        for row, frame in zip(found, frames, strict=True):
            try:
                at = solver.linearise(frame.state, LoadControl(frame.state.force))
                gradient = at.travel_gradient(model.point_load(part))
                x = at.solve(gradient)
            except NotConverged:
                return None
            row += travels(frame.state) - unloaded
            for k, own in enumerate(changes):
                force = frame.state.force if own.force == part else constant.get(own.force, 0.0)
                more, less = (x.dot(at.travel_gradient(model.point_load(end))) for end in (own.more, own.less))
                row[k] += force * (more - less) / own.span
            if held:  # at a held displacement u(f, v): df/dv = −∂u/∂v / ∂u/∂f
                row /= -x.dot(gradient)
    return found


def displacement(model: MechanismModel, force: Force, frame: Frame, unloaded: State) -> float:
    """That of a force's point along it in a frame, whatever is prescribed there, from the unloaded configuration."""
    found = 0.0
    with model.shaped(frame.design):
        for state, sign in ((unloaded, -1.0), (frame.state, 1.0)):
            model.load(state)
            found += sign * model.travel(force, state)
    return found
