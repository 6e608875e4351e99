"""The adjoint of a displacement or force: what forces anywhere on the links do to it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from fenicsmech.equilibrium import (
    DisplacementControl,
    EquilibriumSystem,
    Iteration,
    Linearisation,
    LoadControl,
    NotConverged,
    PointLoad,
    State,
)
from fenicsmech.errors import EquilibriumError
from fenicsmech.model import MechanismModel
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.goal import Goal


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An equilibrium and what is prescribed there.

    Attributes:
        state: the equilibrium.
        design: the rest shape it belongs to, this rank's values of the design field, flat.
        goal: the displacement under a prescribed force, or the force at a prescribed displacement.
    """

    state: State
    design: np.ndarray
    goal: Goal

    @staticmethod
    def on(curve: Curve, frame: Frame) -> Equilibrium:
        """That of a frame, under what the curve prescribes."""
        return Equilibrium(frame.state, frame.design, curve.goal)


class Influence:
    """Adjoints at one equilibrium, which the model holds."""

    def __init__(self, system: EquilibriumSystem, goal: Goal, at: Linearisation) -> None:
        self._system, self._goal, self._at = system, goal, at

    def on(self, output: PointLoad | None) -> np.ndarray:
        """z with δQ = z · δF while what is prescribed stays as it is (collective).

            KKT x = ∂Q/∂y,     z = ∂u/∂y x

        Q is the travel a · u_P of a point, or the force f, which is one of the unknowns y then.

        Args:
            output: the point; None: the goal of the equilibrium.

        Returns:
            this rank's owned values at the nodes of u, and of pressures behind them, flat.
        """
        at = self._at
        if output is None and self._goal is Goal.FORCE:
            # ∂f/∂y is the right-hand side of the rate with the displacement, but for its sign
            return -at.displacements(at.rate())
        return at.displacements(at.solve(at.travel_gradient(output or self._system.controlled)))


@contextmanager
def influence(model: MechanismModel, newton: Iteration, at: Equilibrium) -> Iterator[Influence]:
    """The adjoints of an equilibrium, for as long as the model holds it (collective).

    Args:
        model, newton: of a simulation.
        at: one of its equilibria.

    Raises:
        EquilibriumError: its tangent is singular.
    """
    system = newton.system
    with model.shaped(at.design):
        system.load(at.state)
        held = at.goal is Goal.FORCE
        control = DisplacementControl(system.load_displacement(at.state)) if held else LoadControl(at.state.force)
        try:
            yield Influence(system, at.goal, newton.linearise(at.state, control))
        except NotConverged as failure:
            raise EquilibriumError(
                f"equilibrium under {system.controlled.name!r}",
                f"its sensitivity cannot be told at force {at.state.force:g} ({failure.reason})",
                "Choose another equilibrium, or prescribe the displacement",
            ) from failure
