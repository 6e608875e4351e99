"""The design objective: how far simulated displacements are from their targets, with derivatives.

    O(p) = Σ ½ (u_k(p) − ū_k)² + R(p),    k over targets (the paper's equation 5 and section V-A).

Each evaluation places the handles, reshapes the links, finds the equilibria of all targets from those of the last
accepted design, and pulls their adjoint sensitivities back to p.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenicsmech.design.handle_optimum import HandleOptimum, Placement, ShapeError
from fenicsmech.design.optimisers import Evaluation, Infeasible
from fenicsmech.design.penalties import Penalty
from fenicsmech.design.sensitivity import Adjoint
from fenicsmech.design.shape_map import ShapeMap
from fenicsmech.design.spline_design import Target
from fenicsmech.equilibrium import LoadControl, NotConverged, Solution, State
from fenicsmech.errors import EquilibriumError
from fenicsmech.linkage import assemble
from fenicsmech.simulation import Simulation


class Objective:
    """O(p) of one simulation.

    Args:
        simulation: how displacements are computed.
        shape: from p to the design field.
        optimum: best handle positions.
        targets: what is wanted.
        penalty: R.

    Attributes:
        reached: displacement of each target at the last evaluation.
    """

    def __init__(
        self,
        simulation: Simulation,
        shape: ShapeMap,
        optimum: HandleOptimum,
        targets: Sequence[Target],
        penalty: Penalty,
    ) -> None:
        self._simulation, self._shape, self._optimum = simulation, shape, optimum
        self._targets, self._penalty = tuple(targets), penalty
        self._adjoints = {
            part: Adjoint(simulation.model, simulation.newton(part)) for part in {t.force_part for t in targets}
        }
        self._placement: Placement | None = None
        self._states: dict[Target, State] = {}
        self._origins: dict[tuple, float] = {}
        self.reached = np.full(len(self._targets), np.nan)

    def evaluate(self, parameters: np.ndarray) -> Evaluation:
        """O and its derivatives (collective).

        Raises:
            Infeasible: cells invert, or a target's equilibrium is not found or is unstable.
        """
        clock = self._simulation.clock
        try:
            with clock.phase("handles"):
                placement = self._optimum.solve(parameters, self._placement)
        except ShapeError as error:
            raise Infeasible(str(error)) from error
        self.reshape()
        states, reached, fields = {}, [], []
        for target in self._targets:
            adjoint = self._adjoints[target.force_part]
            state, displacement = self._equilibrium(target)
            states[target] = state
            reached.append(displacement)
            system = self._simulation.newton(target.force_part).system
            fields.append(adjoint.gradients(state, [system.controlled])[0].design)
        with clock.phase("handles"):
            nodal = np.array(fields).reshape(len(fields), self._shape.owned, -1)
            by_p, by_theta = self._shape.pull(parameters, placement.theta, nodal)
            jacobian = self._optimum.total_gradient(placement, by_p, by_theta)
        self._placement, self._states = placement, states
        self.reached = np.array(reached)
        penalty = self._penalty.at(parameters)
        return Evaluation(
            parameters=np.array(parameters),
            residuals=self.reached - np.array([target.displacement for target in self._targets]),
            jacobian=jacobian,
            penalty=penalty.value,
            penalty_gradient=penalty.gradient,
            penalty_curvature=penalty.curvature,
        )

    def reshape(self) -> None:
        """Gives the links the shape that the design field holds (collective)."""
        adjoint = next(iter(self._adjoints.values()))
        adjoint.reshape(self._simulation.model.elastic.d.x.array)

    def _equilibrium(self, target: Target) -> tuple[State, float]:
        """The equilibrium of a target, from that of the last design if there is one, and its displacement."""
        if target in self._states:
            newton = self._simulation.newton(target.force_part)
            try:
                solution = newton.solve(self._states[target], LoadControl(target.force))
                return self._checked(target, solution)
            except NotConverged:
                pass
        try:
            curve = self._simulation.load_displacement(
                target.force_part, forces=[target.force], configuration=target.configuration
            )
        except EquilibriumError as error:
            raise Infeasible(str(error)) from error
        frame = curve.frames[-1]
        if not frame.stable:
            raise Infeasible(f"the equilibrium at {target.force:g} is unstable")
        return frame.state, frame.displacement

    def _checked(self, target: Target, solution: Solution) -> tuple[State, float]:
        system = self._simulation.newton(target.force_part).system
        if solution.unstable_modes:
            raise Infeasible(f"the equilibrium at {target.force:g} is unstable")
        origin = self._origin(target)
        system.load(solution.state)
        return solution.state, system.load_displacement(solution.state) - origin

    def _origin(self, target: Target) -> float:
        """Where displacements of a target count from: the rigid assembly, the same for all designs (collective)."""
        key = (target.force_part, target.configuration)
        if key not in self._origins:
            linkage, model = self._simulation.linkage, self._simulation.model
            poses = assemble(linkage, target.configuration).poses
            state = model.assembled_state(poses, linkage.joints.motor_values(target.configuration.position))
            model.load(state)
            self._origins[key] = model.travel(target.force_part, state)
        return self._origins[key]
