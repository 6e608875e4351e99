"""Goal-oriented error estimates of a displacement or force at an equilibrium, by kinds of error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property

import numpy as np

from fenicsmech.equilibrium import (
    Adjoint,
    DisplacementControl,
    Iteration,
    LoadControl,
    NotConverged,
    PointLoad,
    Quantity,
    State,
)
from fenicsmech.errors import EquilibriumError
from fenicsmech.estimates.element_error import ElementError
from fenicsmech.estimates.plane_stress_error import PlaneStressError
from fenicsmech.model import MechanismModel


class ErrorKind(Enum):
    """Kinds of errors."""

    ELEMENTS = "elements"
    PLANE_STRESS = "plane stress"


@dataclass(frozen=True)
class Calibration:
    """Factors of the estimates, measured once.

    Attributes:
        displacement: c² of recovered gradients by the order of displacement elements, so that effectivities lie around
            1 (tests/estimates/test_element_error.py).
        mixed: the same of elements with a pressure (tests/estimates/test_mixed_error.py).
        decay: c of the contraction that pins block: estimates are 0.6 to 1.4 times the error of plane stress of
            cantilever, arch, truss, claw and Klann leg.
    """

    displacement: Mapping[int, float] = field(default_factory=lambda: {1: 1.3, 2: 1.6, 3: 2.6})
    mixed: Mapping[int, float] = field(default_factory=lambda: {2: 0.75, 3: 1.2})
    decay: float = 0.2


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An equilibrium and its prescribed quantity.

    Attributes:
        state: the equilibrium.
        design: the rest shape it belongs to, this rank's values of the design field, flat.
        quantity: the displacement under a prescribed force, or the force at a prescribed displacement.
    """

    state: State
    design: np.ndarray
    quantity: Quantity


class Estimates:
    """Error estimates at equilibria of one model; forms are compiled when they are first needed.

    Args:
        model: the discretised mechanism.
        calibration: factors of the estimates.
    """

    def __init__(self, model: MechanismModel, calibration: Calibration | None = None) -> None:
        self._model, self._calibration = model, calibration or Calibration()

    def at(
        self,
        solver: Iteration,
        equilibrium: Equilibrium,
        kinds: Sequence[ErrorKind] = (ErrorKind.ELEMENTS,),
        output: PointLoad | None = None,
    ) -> list[float]:
        """Corrections of the quantity of an equilibrium, by kinds of error, from one adjoint.

        Args:
            solver: the solver that found it.
            equilibrium: of this model.
            kinds: of errors.
            output: a point whose travel is estimated instead, under the same control.

        Raises:
            DescriptionError: ``kinds`` hold the error of plane stress and the model is another one.
            EquilibriumError: the tangent is singular.
        """
        errors = [self._element_error if kind is ErrorKind.ELEMENTS else self._plane_stress_error for kind in kinds]
        with self._model.clock.phase("estimate"), self._model.shaped(equilibrium.design):
            adjoint = adjoint_at(solver, equilibrium, output)
            return [error.of(adjoint) for error in errors]

    @cached_property
    def _element_error(self) -> ElementError:
        return ElementError(self._model, self._calibration.displacement, self._calibration.mixed)

    @cached_property
    def _plane_stress_error(self) -> PlaneStressError:
        return PlaneStressError(self._model, self._calibration.decay)


def adjoint_at(solver: Iteration, equilibrium: Equilibrium, output: PointLoad | None = None) -> Adjoint:
    """The adjoint of the quantity of an equilibrium, or of the travel of ``output``; the model keeps the state.

    Args:
        solver: the solver that found it.
        equilibrium: of a model that has its rest shape.
        output: a point.

    Raises:
        EquilibriumError: the tangent is singular.
    """
    system, state, force = solver.system, equilibrium.state, equilibrium.quantity is Quantity.FORCE
    system.load(state)
    control = DisplacementControl(system.load_displacement(state)) if force else LoadControl(state.force)
    try:
        at = solver.linearise(state, control)
        return Adjoint.of_force(at) if force and output is None else Adjoint.of_travel(at, output or system.controlled)
    except NotConverged as failure:
        raise EquilibriumError(
            f"equilibrium under {system.controlled.name!r}",
            f"its sensitivity is not defined at force {state.force:g} ({failure.reason})",
            "Choose another equilibrium, or prescribe the displacement",
        ) from failure
