"""The softest modes of the KKT matrix at an equilibrium, and the loads at which it becomes singular, by SLEPc.

With the KKT matrix K and the identity M of the coordinates s (0 for multipliers and force), the stiffnesses μ of the
softest modes under the constraints are

    K φ = μ M φ,      K⁻¹ M φ = φ / μ.

Let K′ and K″ be the derivatives of K by the path's parameter along the path y + Δ ẏ + ½ Δ² ÿ, K ÿ = −K′ ẏ. How far to
go until K is singular is a quadratic eigenvalue problem, linear in v = φ / Δ:

    (K + Δ K′ + ½ Δ² K″) φ = 0,      −K⁻¹ (K′ v + ½ K″ φ) = v / Δ,   v = φ / Δ.

Slender links need K″: as a link bends, its modes must bend with it to stay free of strain, which costs them no energy
only in second order. All use Newton's factor of K; derivatives are symmetric differences. Source: Wriggers, Nonlinear
Finite Element Methods (doi:10.1007/978-3-540-71001-1), chapter 7, for the linear problem; Tisseur & Meerbergen
(doi:10.1137/S0036144500381988) for the quadratic one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc
from slepc4py import SLEPc

from fenicsmech.equilibrium import EquilibriumSolver, EquilibriumSystem, FollowedControl, NotConverged, State, Step


@dataclass(frozen=True)
class Mode:
    """An eigenvalue and its mode, scaled to a largest displacement of the mechanism's length, or one rad."""

    value: float
    step: Step


def softest_modes(solver: EquilibriumSolver, held: FollowedControl, state: State, *, count: int) -> list[Mode]:
    """The ``count`` modes with the stiffnesses μ nearest to zero under the control ``held``, nearest first.

    Stiffnesses are in units of the mean stiffness of the links; negative ones are unstable.
    """
    at = solver.linearise(state, held.at(held.value(solver.system, state)))
    mask = solver.system.unknowns.coordinates_mask()

    def apply(x: np.ndarray) -> np.ndarray:
        right = mask.duplicate()
        right.array_w[:] = mask.array_r * x
        return at.solve(right).array_r.copy()

    return _largest(solver.system, mask.local_size, apply, count)


def critical_changes(solver: EquilibriumSolver, held: FollowedControl, state: State, *, count: int) -> list[Mode]:
    """The ``count`` changes Δ of a control's value that make the KKT matrix singular, nearest first.

    Both senses count. Exact to second order in Δ.

    Raises:
        NotConverged: the value moves nothing.
    """
    system = solver.system
    control = held.at(held.value(system, state))
    x = solver.linearise(state, control).rate()
    rate = control.tangent(system.unknowns.step(x))
    if not held.moves(system, rate):
        raise NotConverged("it moves nothing")
    size = system.size(rate)
    unit = 1e-2 / size  # the change that eigenvalues are measured in; motions in lengths of the mechanism, or rad
    amount = 1e-5 / size
    later, earlier = (_kkt_matrix(solver, control, system.moved(state, rate.scaled(t))) for t in (amount, -amount))
    first = _combined([(0.5 * unit / amount, later), (-0.5 * unit / amount, earlier)])
    at = solver.linearise(state, control)
    curvature = x.duplicate()
    first.mult(x, curvature)
    curvature.scale(-1.0 / unit)
    curvature = at.step(at.solve(curvature))
    amount = 1e-3 / size
    later, here, earlier = (
        _kkt_matrix(solver, control, system.moved(state, rate.scaled(t) + curvature.scaled(0.5 * t * t)))
        for t in (amount, 0.0, -amount)
    )
    weight = 0.5 * (unit / amount) ** 2
    second = _combined([(weight, later), (-2.0 * weight, here), (weight, earlier)])
    at = solver.linearise(state, control)

    def apply(values: np.ndarray) -> np.ndarray:
        v, shape = x.duplicate(), x.duplicate()
        v.array_w[:], shape.array_w[:] = np.split(values, 2)
        right = first * v + second * shape
        right.scale(-1.0)
        return np.concatenate([at.solve(right).array_r, v.array_r])

    modes = _largest(system, 2 * x.local_size, apply, count)
    return [Mode(unit * mode.value, mode.step) for mode in modes]


def _kkt_matrix(solver: EquilibriumSolver, control: FollowedControl, state: State) -> PETSc.Mat:
    """A copy of K at a loaded state."""
    solver.system.linearise(state, control, solver.system.residual(state, control))
    return solver.system.kkt.matrix().copy()


def _combined(terms: Sequence[tuple[float, PETSc.Mat]]) -> PETSc.Mat:
    """Σ weight · matrix, in the first of them."""
    (weight, total), *others = terms
    total.scale(weight)
    for weight, matrix in others:
        total.axpy(weight, matrix, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    return total


class _Operator:
    """A linear map of this rank's values, for SLEPc."""

    def __init__(self, apply: Callable[[np.ndarray], np.ndarray]) -> None:
        self._apply = apply

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        y.array_w[:] = self._apply(x.array_r)


def _largest(system: EquilibriumSystem, size: int, apply: Callable[[np.ndarray], np.ndarray], count: int) -> list[Mode]:
    """Modes with the values 1 / θ, θ the ``count`` real eigenvalues of a map that are largest in size.

    The map, ``apply``, has ``size`` values on this rank; the unknowns of a mode are the last ones of an eigenvector.
    """
    comm = system.comm
    total = comm.allreduce(size)
    with ExitStack() as own:  # at the end of the process it is too late to destroy what an error left
        operator = PETSc.Mat().createPython(((size, total), (size, total)), _Operator(apply), comm=comm)
        own.callback(operator.destroy)
        solver = SLEPc.EPS().create(comm)
        own.callback(solver.destroy)
        solver.setOperators(operator)
        solver.setProblemType(SLEPc.EPS.ProblemType.NHEP)
        solver.setWhichEigenpairs(SLEPc.EPS.Which.LARGEST_MAGNITUDE)
        wanted = count + 2  # a pair may be complex
        solver.setDimensions(nev=wanted, ncv=min(total, 2 * wanted + 20))
        solver.setTolerances(tol=1e-10, max_it=200)
        solver.solve()
        modes, vector, shape = [], operator.createVecRight(), system.unknowns.control_row()
        for index in range(solver.getConverged()):
            theta = solver.getEigenpair(index, vector)
            if theta != 0.0 and abs(theta.imag) <= 1e-6 * abs(theta):  # rounding may make a real one complex
                shape.array_w[:] = vector.array_r[-shape.local_size :]
                step = system.unknowns.step(shape)
                largest = system.size(step)
                if largest > 0.0:
                    modes.append(Mode(1.0 / theta.real, step.scaled(1.0 / largest)))
    return sorted(modes, key=lambda mode: abs(mode.value))[:count]
