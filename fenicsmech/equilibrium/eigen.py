"""The softest modes of the tangent at an equilibrium, and the loads at which it becomes singular, by SLEPc.

With the KKT matrix K and the identity M of the coordinates s (0 for multipliers and force), the stiffnesses μ of the
softest modes under the constraints are

    K φ = μ M φ,      K⁻¹ M φ = φ / μ.

Let K′ and K″ be the derivatives of K by the path's parameter along the path y + Δ ẏ + ½ Δ² ÿ, K ÿ = −K′ ẏ. How far to
go until K is singular is a quadratic eigenvalue problem, linear in v = φ / Δ:

    (K + Δ K′ + ½ Δ² K″) φ = 0,      −K⁻¹ (K′ v + ½ K″ φ) = v / Δ,   v = φ / Δ.

Slender links need K″: as a link bends, its modes must bend with it to stay free of strain, which costs them no energy
only in second order. All use the factor of K that Newton's method uses; derivatives are symmetric differences.
Source: Wriggers, Nonlinear Finite Element Methods (doi:10.1007/978-3-540-71001-1), chapter 7, for the linear problem;
Tisseur & Meerbergen (doi:10.1137/S0036144500381988) for the quadratic one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc
from slepc4py import SLEPc

from fenicsmech.equilibrium.lead import Heading, Lead
from fenicsmech.equilibrium.solver import Iteration, NotConverged
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem

_FIRST, _SECOND = 1e-5, 1e-3  # of the mechanism's length, or rad: half the spans of the differences for K′ and K″
_UNIT = 1e-2  # likewise: the change that eigenvalues are measured in
_TOLERANCE = 1e-10  # relative, of eigenvalues
_REAL = 1e-6  # imaginary over absolute value of an eigenvalue that rounding made complex


@dataclass(frozen=True)
class Mode:
    """An eigenvalue and its mode, scaled to a largest displacement of the mechanism's length, or one rad."""

    value: float
    step: Step


def softest_modes(newton: Iteration, lead: Lead, state: State, *, count: int) -> list[Mode]:
    """The ``count`` modes with the stiffnesses μ nearest to zero while the lead is held, nearest first (collective).

    Stiffnesses are in units of the mean stiffness of the links; negative ones are unstable.
    """
    at = newton.linearise(state, lead.holding(state))
    mask = newton.system.unknowns.coordinates_mask()
    own = len(mask.array_r)

    def apply(x: np.ndarray, y: np.ndarray) -> None:
        right = mask.duplicate()
        right.array_w[:] = mask.array_r * x
        y[:] = at.solve(right).array_r

    return _largest(newton.system, own, lambda x: x, apply, count)


def critical_changes(newton: Iteration, lead: Lead, state: State, *, count: int) -> list[Mode]:
    """The ``count`` changes Δ of the lead's parameter that make the tangent singular, nearest first (collective).

    Both senses count. Exact to second order in Δ.

    Raises:
        NotConverged: the parameter moves nothing.
    """
    system = newton.system
    control = lead.holding(state)
    x = newton.linearise(state, control).rate()
    rate = lead.heading(system.unknowns.step(x), control)
    if not lead.moves(system, rate):
        raise NotConverged("it moves nothing", 0)
    size = system.size(rate.step)
    unit = _UNIT / size
    later, earlier = (_tangent(newton, lead, state, rate.scaled(sign * _FIRST / size)) for sign in (1.0, -1.0))
    first = _combined([(0.5 * unit * size / _FIRST, later), (-0.5 * unit * size / _FIRST, earlier)])
    at = newton.linearise(state, control)
    bend = x.duplicate()
    first.mult(x, bend)
    bend.scale(-1.0 / unit)
    bend = Heading(system.unknowns.step(at.solve(bend)), 0.0)
    amount = _SECOND / size
    later, here, earlier = (
        _tangent(newton, lead, state, rate.scaled(t) + bend.scaled(0.5 * t * t)) for t in (amount, 0.0, -amount)
    )
    weight = 0.5 * (unit / amount) ** 2
    second = _combined([(weight, later), (-2.0 * weight, here), (weight, earlier)])
    at = newton.linearise(state, control)
    own = len(x.array_r)

    def apply(x: np.ndarray, y: np.ndarray) -> None:
        v, shape = template.duplicate(), template.duplicate()
        v.array_w[:], shape.array_w[:] = x[:own], x[own:]
        right = first * v + second * shape
        right.scale(-1.0)
        y[:own], y[own:] = at.solve(right).array_r, v.array_r

    template = system.unknowns.control_row()
    values = _largest(system, 2 * own, lambda x: x[own:], apply, count)
    return [Mode(unit * mode.value, mode.step) for mode in values]


def _tangent(newton: Iteration, lead: Lead, state: State, change: Heading) -> PETSc.Mat:
    """A copy of K after a change of state."""
    moved = lead.moved(newton.system, state, change)
    control = lead.holding(moved)
    newton.system.linearise(moved, control, newton.system.residual(moved, control))
    return newton.system.kkt.matrix().copy()


def _combined(terms: Sequence[tuple[float, PETSc.Mat]]) -> PETSc.Mat:
    """Σ weight · matrix, in the first of them."""
    (weight, total), *others = terms
    total.scale(weight)
    for weight, matrix in others:
        total.axpy(weight, matrix, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    return total


class _Operator:
    """A linear map of this rank's values, as SLEPc sees it."""

    def __init__(self, apply: Callable[[np.ndarray, np.ndarray], None]) -> None:
        self._apply = apply

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        self._apply(x.array_r, y.array_w)


def _largest(
    system: EquilibriumSystem,
    size: int,
    part: Callable[[np.ndarray], np.ndarray],
    apply: Callable[[np.ndarray, np.ndarray], None],
    count: int,
) -> list[Mode]:
    """Modes with the values 1 / θ, θ the ``count`` real eigenvalues of a map that are largest in size (collective).

    Args:
        system: whose scaled unknowns are the ``part`` of an eigenvector.
        size: of the map on this rank.
        part: takes the unknowns from this rank's values of an eigenvector.
        apply: the map.
        count: how many.
    """
    comm = system.comm
    total = comm.allreduce(size)
    operator = PETSc.Mat().createPython(((size, total), (size, total)), _Operator(apply), comm=comm)
    solver = SLEPc.EPS().create(comm)
    solver.setOperators(operator)
    solver.setProblemType(SLEPc.EPS.ProblemType.NHEP)
    solver.setWhichEigenpairs(SLEPc.EPS.Which.LARGEST_MAGNITUDE)
    wanted = count + 2  # a pair may be complex
    solver.setDimensions(nev=wanted, ncv=min(total, 2 * wanted + 20))
    solver.setTolerances(tol=_TOLERANCE, max_it=200)
    solver.solve()
    modes, vector, shape = [], operator.createVecRight(), system.unknowns.control_row()
    for index in range(solver.getConverged()):
        theta = solver.getEigenpair(index, vector)
        if theta != 0.0 and abs(theta.imag) <= _REAL * abs(theta):
            shape.array_w[:] = part(vector.array_r)
            step = system.unknowns.step(shape)
            largest = system.size(step)
            if largest > 0.0:
                modes.append(Mode(1.0 / theta.real, step.scaled(1.0 / largest)))
    solver.destroy()
    operator.destroy()
    return sorted(modes, key=lambda mode: abs(mode.value))[:count]
