"""The softest modes of the tangent at an equilibrium, and the loads at which it becomes singular, by SLEPc.

With the KKT matrix K, the identity M of the coordinates s (0 for multipliers and force), and the rate K′ of the matrix
along a path, both by the factor of K that Newton's method uses:

    K φ = μ M φ              K⁻¹ M φ = φ / μ           stiffness μ of the softest modes, under the constraints
    (K + Δ K′) φ = 0         −K⁻¹ K′ φ = φ / Δ         Δ: how far to go along the path until K is singular

K′ is a symmetric difference. Source of the second: linear buckling at a prestressed state, e.g. Wriggers, Nonlinear
Finite Element Methods (doi:10.1007/978-3-540-71001-1), chapter 7.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from petsc4py import PETSc
from slepc4py import SLEPc

from fenicsmech.equilibrium.lead import Heading, Lead
from fenicsmech.equilibrium.newton import Newton, NotConverged
from fenicsmech.equilibrium.state import State, Step

_DIFFERENCE = 1e-5  # of the mechanism's length, or rad: half the span of the difference K′ is taken from
_TOLERANCE = 1e-10  # relative, of eigenvalues
_REAL = 1e-6  # imaginary over absolute value of an eigenvalue that rounding made complex


@dataclass(frozen=True)
class Mode:
    """An eigenvalue and its mode, scaled to a largest displacement of the mechanism's length, or one rad."""

    value: float
    step: Step


def softest_modes(newton: Newton, lead: Lead, state: State, *, floor: float, count: int) -> list[Mode]:
    """The ``count`` modes with the stiffnesses μ nearest to zero while the lead is held, nearest first (collective).

    Stiffnesses are in units of the mean stiffness of the links; negative ones are unstable.
    """
    _factor(newton, lead, state, floor)
    mask = newton.system.coordinates_mask()

    def times(x: PETSc.Vec, y: PETSc.Vec) -> None:
        y.pointwiseMult(mask, x)

    return _inverse_modes(newton, times, count)


def critical_changes(newton: Newton, lead: Lead, state: State, *, floor: float, count: int) -> list[Mode]:
    """The ``count`` changes Δ of the lead's parameter that make the tangent singular, nearest first (collective).

    Both senses count. Exact if the path is straight and the tangent linear along it, as for a column; else the better
    the smaller Δ is.
    """
    system = newton.system
    control = lead.holding(state)
    _factor(newton, lead, state, floor)
    rate = lead.heading(system.step(newton.solve_linear(control.rate(system, state))), control)
    change = _tangent_rate(newton, lead, state, rate)
    _factor(newton, lead, state, floor)

    def times(x: PETSc.Vec, y: PETSc.Vec) -> None:
        change.mult(x, y)
        y.scale(-1.0)

    return _inverse_modes(newton, times, count)


def _factor(newton: Newton, lead: Lead, state: State, floor: float) -> None:
    control = lead.holding(state)
    newton.system.load(state)
    newton.factor(state, control, newton.system.balance(state, control), floor)


def _tangent_rate(newton: Newton, lead: Lead, state: State, rate: Heading) -> PETSc.Mat:
    """K′ by the lead's parameter."""
    system = newton.system
    size = system.size(rate.step)
    if not size > 0.0:
        raise NotConverged("it moves nothing", 0)
    amount, ends = _DIFFERENCE / size, []
    for sign in (1.0, -1.0):
        moved = lead.moved(system, state, rate.scaled(sign * amount))
        control = lead.holding(moved)
        ends.append(system.kkt(moved, control, system.balance(moved, control)).copy())
    later, earlier = ends
    later.axpy(-1.0, earlier, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    later.scale(0.5 / amount)
    return later


class _Inverse:
    """x ↦ K⁻¹ (B x), as SLEPc sees it."""

    def __init__(self, newton: Newton, times) -> None:
        self._newton, self._times = newton, times

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        product = x.duplicate()
        self._times(x, product)
        self._newton.solve_linear(product).copy(y)


def _inverse_modes(newton: Newton, times, count: int) -> list[Mode]:
    """The eigenvalues θ of K⁻¹ B largest in size, as modes with the values 1 / θ."""
    system = newton.system
    template = system.control_row()
    size = template.getSizes()
    operator = PETSc.Mat().createPython((size, size), _Inverse(newton, times), comm=system.layout.comm)
    solver = SLEPc.EPS().create(system.layout.comm)
    solver.setOperators(operator)
    solver.setProblemType(SLEPc.EPS.ProblemType.NHEP)
    solver.setWhichEigenpairs(SLEPc.EPS.Which.LARGEST_MAGNITUDE)
    wanted = count + 2  # a pair may be complex
    solver.setDimensions(nev=wanted, ncv=min(size[1], 2 * wanted + 20))
    solver.setTolerances(tol=_TOLERANCE, max_it=200)
    solver.solve()
    modes, vector = [], template.duplicate()
    for index in range(solver.getConverged()):
        theta = solver.getEigenpair(index, vector)
        if theta != 0.0 and abs(theta.imag) <= _REAL * abs(theta):
            step = system.step(vector)
            size_of = system.size(step)
            if math.isfinite(size_of) and size_of > 0.0:
                modes.append(Mode(1.0 / theta.real, step.scaled(1.0 / size_of)))
    solver.destroy()
    operator.destroy()
    return sorted(modes, key=lambda mode: abs(mode.value))[:count]
