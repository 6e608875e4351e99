"""PETSc's SNES on the KKT equations, with the same residual, matrix and linear solver as the default solver.

The unknowns are scaled increments from the last iterate, so that rotations are put back on their manifold once per
iteration, as they are by the other solvers. States that invert elements have an infinite residual. Source: the PETSc
manual (doi:10.2172/2205494), chapter on nonlinear solvers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from petsc4py import PETSc

from fenicsmech.equilibrium import (
    Control,
    EquilibriumMethod,
    EquilibriumPoint,
    EquilibriumSolver,
    EquilibriumSystem,
    NotConverged,
    State,
)
from fenicsmech.errors import DescriptionError

_PREFIX = "fenicsmech_"
_FIRST_RADIUS = 0.1  # of the trust region: mean motion over the mechanism's length
_REASONS = {
    getattr(PETSc.SNES.ConvergedReason, name): name.removeprefix("DIVERGED_").lower().replace("_", " ")
    for name in vars(PETSc.SNES.ConvergedReason)
    if name.startswith("DIVERGED_")
}


class Globalisation(Enum):
    """The globalisations of SNES, which bound its steps."""

    BACKTRACKING = "bt"
    SECANT = "l2"
    CRITICAL_POINT = "cp"
    TRUST_REGION = "newtontr"


@dataclass(frozen=True, kw_only=True)
class SNES(EquilibriumMethod):
    """Newton's method of PETSc's SNES on the KKT equations.

    Attributes:
        iterations: maximum number of iterations.
        globalisation: one of SNES's line searches, or its trust region.
    """

    iterations: int = 50
    globalisation: Globalisation = Globalisation.BACKTRACKING

    def solver(self, system: EquilibriumSystem) -> SNESSolver:
        return SNESSolver(system, self)


class SNESSolver(EquilibriumSolver):
    """The solver, with the linear solver it keeps between solves."""

    options: SNES

    def iterate(self, start: State, control: Control) -> EquilibriumPoint:
        if control.along_path:
            raise DescriptionError(
                "solver", "SNES corrects no arc-length steps", "Follow paths with PrimalDualNewton()"
            )
        equations = _Equations(self, start, control)
        if self.converged(equations.residual):  # there is nothing that a line search could lower
            equations.test(None, 0, (0.0, 0.0, equations.residual.norm))
            equations.setUp(None)
            return self.accept(start, control, equations.residual, equations.residuals, 1)
        x = equations.residual.vector.duplicate()
        snes = self._create(equations)
        snes.solve(None, x)
        reason, iterations = snes.getConvergedReason(), snes.getLinearSolveIterations()
        snes.destroy()
        if not equations.evaluate(x):
            raise NotConverged("elements are inverted", iterations)
        if equations.factored and self.converged(equations.residual):
            return self.accept(equations.state, control, equations.residual, equations.residuals, iterations)
        failure = NotConverged(f"SNES stops: {_REASONS.get(reason, f'reason {reason}')}", iterations)
        return self.accept_best(equations.state, equations.residual, control, equations.residuals, failure)

    def _create(self, equations: _Equations) -> PETSc.SNES:
        system, chosen = self.system, self.options.globalisation
        snes = PETSc.SNES().create(system.comm)
        options = PETSc.Options(_PREFIX)
        options["snes_linesearch_type"] = "basic" if chosen is Globalisation.TRUST_REGION else chosen.value
        options["snes_tr_delta0"] = _FIRST_RADIUS * system.unknowns.unit * math.sqrt(equations.residual.vector.size)
        snes.setOptionsPrefix(_PREFIX)
        snes.setType("newtontr" if chosen is Globalisation.TRUST_REGION else "newtonls")
        snes.setFunction(equations.function, equations.residual.vector.duplicate())
        snes.setJacobian(equations.jacobian, equations.matrix)
        snes.setUpdate(equations.rebase)
        snes.setConvergenceTest(equations.test)
        snes.setTolerances(max_it=self.options.iterations)
        ksp = snes.getKSP()
        ksp.setType(PETSc.KSP.Type.PREONLY)
        ksp.getPC().setType(PETSc.PC.Type.PYTHON)
        ksp.getPC().setPythonContext(equations)
        snes.setFromOptions()
        return snes


class _Equations:
    """The callbacks of SNES: residual, matrix, factor and convergence test at x, an increment from ``base``.

    Attributes:
        state, residual: where they were evaluated last.
        matrix: the KKT matrix.
        factored: whether its last values could be.
        residuals: relative residual of each iterate.
        norm: of the last iterate's residual.
    """

    def __init__(self, solver: SNESSolver, base: State, control: Control) -> None:
        self._solver, self._system, self._base = solver, solver.system, base
        self._control = control
        self.state, self.residual = base, self._system.residual(base, control)
        self._system.linearise(base, control, self.residual)
        self.matrix = self._system.kkt.matrix()
        self.factored = False
        self.residuals: list[float] = []
        self.norm = math.inf

    def evaluate(self, x: PETSc.Vec) -> bool:
        """Brings ``state`` and ``residual`` to x; False, with both as they were, if elements are inverted there."""
        self.state = self._system.moved(self._base, self._system.unknowns.step(x))
        if not math.isfinite(self._system.elastic_energy()):
            return False
        self.residual = self._system.residual(self.state, self._control)
        return True

    def function(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        if self.evaluate(x):
            self.residual.vector.copy(f)
        else:
            f.set(math.inf)

    def jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, matrix: PETSc.Mat, preconditioner: PETSc.Mat) -> None:
        self.evaluate(x)
        self._system.linearise(self.state, self._control, self.residual)
        self._system.kkt.matrix()  # the same object, with its new values

    def rebase(self, snes: PETSc.SNES, iteration: int) -> None:
        """Counts x from the present iterate."""
        x = snes.getSolution()
        self.evaluate(x)
        self._base = self.state
        x.set(0.0)

    def test(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int:
        """Convergence as the other solvers see it."""
        before, self.norm = self.norm, self.residual.norm
        self.residuals.append(self._solver.relative(self.residual))
        if not math.isfinite(norms[2]):
            return PETSc.SNES.ConvergedReason.DIVERGED_FNORM_NAN
        if iteration > 0 and self._solver.converged(self.residual, before):
            return PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE
        return PETSc.SNES.ConvergedReason.ITERATING

    def setUp(self, pc: PETSc.PC) -> None:
        self.factored = self._solver.factor(self._base.minimum_shift)

    def apply(self, pc: PETSc.PC, right: PETSc.Vec, x: PETSc.Vec) -> None:
        accuracy = self._solver.step_accuracy(self.residual)
        solution = self._solver.try_solve(right, accuracy) if self.factored else None
        if solution is None:
            x.set(math.nan)
        else:
            solution.copy(x)
