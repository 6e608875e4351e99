"""How wrong the displacements of curves are, estimated for each force by an adjoint of its own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fenicsmech.equilibrium import Iteration
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.depth_error import DepthError
from fenicsmech.simulation.goal_error import GoalError
from fenicsmech.simulation.model import MechanismModel


class Estimates:
    """Error estimates of the curves of one model (all methods are collective).

    Args:
        model: the discretised mechanism.
        newton: its solver for a controlled force and others that are constant.
    """

    def __init__(self, model: MechanismModel, newton: Callable[..., Iteration]) -> None:
        self._model, self._newton = model, newton
        self._elements: dict[tuple, GoalError] = {}
        self._depth: dict[tuple, DepthError] = {}

    def elements(self, curve: Curve) -> np.ndarray:
        """What finer elements would add to the displacement of each frame, (frames,)."""
        key = (curve.force_part, curve.others)
        if key not in self._elements:
            self._elements[key] = GoalError(self._model, self._newton(*key))
        return np.array([self._elements[key].estimate(frame, curve.freedom) for frame in curve.frames])

    def depth(self, curve: Curve) -> np.ndarray:
        """What a simulation in space would add to displacements in plane stress, (frames,).

        Raises:
            DescriptionError: the model is not plane stress.
        """
        key = (curve.force_part, curve.others)
        if key not in self._depth:
            self._depth[key] = DepthError(self._model, self._newton(*key))
        return np.array([self._depth[key].estimate(frame, curve.freedom) for frame in curve.frames])
