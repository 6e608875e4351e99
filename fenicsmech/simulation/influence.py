"""The adjoint of a displacement: what a force anywhere on the links does to the travel of one point."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from fenicsmech.equilibrium import IDLE_STIFFNESS, Iteration, LoadControl
from fenicsmech.linkage import Freedom
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.model import MechanismModel


@contextmanager
def influence(model: MechanismModel, newton: Iteration, frame: Frame, freedom: Freedom) -> Iterator[np.ndarray]:
    """z with δQ = z · δF at the frame's equilibrium, Q the travel of the point of ``newton``'s force (collective).

        KKT x = ∂(a · u_P)/∂y,     z = ∂u/∂y x

    Inside the block the model holds the frame.

    Args:
        model, newton: of a simulation.
        frame: one of its equilibria.
        freedom: mobility of its configuration.

    Returns:
        this rank's owned values at the nodes of u, flat.
    """
    system, control = newton.system, LoadControl(frame.force)
    with model.shaped(frame.design):
        system.load(frame.state)
        balance = system.balance(frame.state, control)
        newton.factor(frame.state, control, balance, IDLE_STIFFNESS if freedom.idle else 0.0)
        z, _ = system.expand(newton.solve_linear(system.travel_gradient(system.controlled, frame.state)))
        yield z
