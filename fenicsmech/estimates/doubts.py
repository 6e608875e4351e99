"""Reasons why an estimate of an error may be off by more than a factor of two.

Estimates η are of first order, sums over cells, and of quantities that converge. Each of these may fail:

- η is above a tenth of the largest value of its curve.
- The compliance c = du/df of the controlled force changes much over the error itself: with its derivative c′ by the
  displacement u along the path, |η c′ / c| > 0.4. Where a limit point is at the distance d in u, c ~ 1/d, and the
  error is d − √(d² − 2 d η): twice η at η = d/2, and beyond it finer elements have no equilibrium near. c′ is a
  difference over a small part of η along the tangent.
- Contributions of cells cancel: |η| < ½ Σ |η_K|, those of the unloaded configuration, from which displacements count,
  included. Then errors of a quarter in those of either sign make one of a half in η.
- The force acts at a point of a flexible link, whose displacement has no limit (``point_forces``).
"""

from __future__ import annotations

from dataclasses import dataclass

from fenicsmech.equilibrium import Adjoint, EquilibriumSolver, LoadControl, NotConverged, Unknown
from fenicsmech.errors import set_options
from fenicsmech.estimates.estimates import Equilibrium, adjoint_at
from fenicsmech.model import MechanismModel


@dataclass(frozen=True)
class DoubtOptions:
    """When estimates are in doubt.

    Attributes:
        compliance: largest change of the compliance over the error, relative, to first order.
        step: displacement over the estimate for differences of the compliance.
        cancelled: least estimate over the sum of the absolute contributions of cells.
        growth: largest growth with each halving of the elements, by forces at points, over the estimate.

    Raises:
        DescriptionError: a number is not positive.
    """

    compliance: float = 0.4
    step: float = 0.05
    cancelled: float = 0.5
    growth: float = 0.2

    def __post_init__(self) -> None:
        set_options(self, "doubts of estimates")


def near_limit_point(
    model: MechanismModel, solver: EquilibriumSolver, equilibrium: Equilibrium, error: float, options: DoubtOptions
) -> bool:
    """Whether the compliance of the controlled force changes much where its displacement differs by ``error``.

    Forces at prescribed displacements are not examined.

    Raises:
        EquilibriumError: the KKT matrix of the equilibrium is singular.
    """
    if equilibrium.unknown is Unknown.FORCE or error == 0.0:
        return False
    state, system = equilibrium.state, solver.system
    with model.shaped(equilibrium.design):
        try:
            here = adjoint_at(solver, equilibrium)
            compliance = here.by_control()
            if compliance == 0.0:
                return False
            there = system.moved(state, here.at.tangent().scaled(options.step * error / compliance))
            beyond = solver.linearise(there, LoadControl(there.force))
            ratio = Adjoint.of(beyond, beyond.travel_gradient(system.controlled)).by_control() / compliance
        except NotConverged:  # singular within the error
            return True
        finally:
            system.load(state)
    return not abs(ratio - 1.0) < options.step * options.compliance
