"""How wrong results of curves are, by kinds of error: of elements, and of plane stress."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from fenicsmech.elasticity import PLANE_STRESS
from fenicsmech.equilibrium import Iteration
from fenicsmech.estimates import DepthError, GoalError
from fenicsmech.mechanism import Output
from fenicsmech.model import MechanismModel
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.influence import Equilibrium, influence


class Estimates:
    """Error estimates at equilibria of one model (all methods are collective).

    Args:
        model: the discretised mechanism.
        newton: its solver for a controlled force and others that are constant.
    """

    def __init__(self, model: MechanismModel, newton: Callable[..., Iteration]) -> None:
        self._model, self._newton = model, newton

    def elements(self, curve: Curve, output: Output | None = None) -> np.ndarray:
        """What finer elements would add to what each frame leaves open (``curve.goal``), (frames,).

        Args:
            curve: of this model.
            output: whose displacement is asked for instead.
        """
        return self._of_frames([self._goal_error], curve, output)[:, 0]

    def depth(self, curve: Curve, output: Output | None = None) -> np.ndarray:
        """What a simulation in space would add to plane stress, (frames,); arguments as those of ``elements``.

        Raises:
            DescriptionError: the model is not plane stress.
        """
        return self._of_frames([self._depth_error], curve, output)[:, 0]

    def elements_and_depth(self, curve: Curve) -> tuple[np.ndarray, np.ndarray]:
        """What finer elements, and what space would add to plane stress, from one adjoint per frame, (frames,) each.

        Other models have no second part: it is zero.
        """
        if self._model.elastic.model is not PLANE_STRESS:
            return self.elements(curve), np.zeros(len(curve.frames))
        elements, depth = self._of_frames([self._goal_error, self._depth_error], curve, None).T
        return elements, depth

    def elements_at(self, newton: Iteration, at: Equilibrium) -> float:
        """What finer elements would add to what one equilibrium leaves open, found by ``newton``."""
        (error,) = self._of([self._goal_error], newton, at, None)
        return error

    def _of_frames(self, kinds: list[GoalError | DepthError], curve: Curve, output: Output | None) -> np.ndarray:
        newton = self._newton(curve.force_part, curve.others)
        rows = [self._of(kinds, newton, Equilibrium.on(curve, frame), output) for frame in curve.frames]
        return np.array(rows).reshape(len(curve.frames), len(kinds))

    def _of(
        self, kinds: list[GoalError | DepthError], newton: Iteration, at: Equilibrium, output: Output | None
    ) -> list[float]:
        """The errors of each kind, from one adjoint."""
        with self._model.clock.phase("estimate"), influence(self._model, newton, at) as adjoint:
            z = adjoint.on(output and self._model.point_load(output))
            return [kind.of(z) for kind in kinds]

    @cached_property
    def _goal_error(self) -> GoalError:
        return GoalError(self._model)

    @cached_property
    def _depth_error(self) -> DepthError:
        return DepthError(self._model)
