"""The KKT matrix at an equilibrium and its factor LDLᵀ: rates along paths, stability, adjoints.

The equilibrium y solves F(y, p) = Gᵀ ∇L = 0. With the KKT matrix K = ∂F/∂y, the rate y′ with the value of a control
and the adjoint x of a quantity Q solve

    K y′ = r,      K x = ∂Q/∂y,     dQ/dp = −xᵀ ∂F/∂p

for any parameter p. Q is the travel a · u_P of a material point, or the controlled force f, which is one of the
unknowns y; the control stays as it is. Stability follows from the inertia of K: by Sylvester's law the signs of its
pivots are those of its eigenvalues.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
from petsc4py import PETSc

from fenicsmech.compat import destroy_garbage
from fenicsmech.equilibrium.border import PointLoad
from fenicsmech.equilibrium.control import Control, MotorControl, Stability
from fenicsmech.equilibrium.kkt import KktMatrix
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem, Residual
from fenicsmech.errors import OutOfMemoryError

_ACCURACY = 1e-10  # relative error that iterative solvers may leave
_LOST = 1e-2  # likewise of a solution, from which on it counts as rounding
_BACKWARD = 1e-13  # |K x − b| over |K| |x| + |b| above which a factor is inaccurate; it is about 1e-17 otherwise


@dataclass(frozen=True)
class Inertia:
    """Numbers of negative and zero pivots: Sylvester's law makes them those of the eigenvalues."""

    negative: int
    zero: int


class LinearSolver(ABC):
    """Solves with a matrix whose values change and whose pattern does not."""

    @abstractmethod
    def refactor(self) -> bool:
        """Factors the matrix's current values; whether this succeeded.

        Raises:
            OutOfMemoryError: memory does not suffice, whatever the values.
        """

    @abstractmethod
    def solve(self, right: PETSc.Vec, solution: PETSc.Vec, tolerance: float) -> bool:
        """Solves with the matrix last refactored, to a relative error of ``tolerance``; whether this succeeded."""

    @abstractmethod
    def inertia(self) -> Inertia:
        """Inertia of the matrix last refactored."""

    def known_inertia(self) -> Inertia:
        """Lower bound of the inertia, known from the last ``solve``; exact where a factor gives it."""
        return self.inertia()

    def solve_and_count(self, right: PETSc.Vec, solution: PETSc.Vec, tolerance: float) -> Inertia | None:
        """``solve`` and ``inertia``, in less than the time of both where that can be; None if the solve failed."""
        return self.inertia() if self.solve(right, solution, tolerance) else None


class LinearMethod(ABC):
    """A method for linear systems."""

    @abstractmethod
    def solver(self, system: EquilibriumSystem) -> LinearSolver:
        """The solver for the KKT matrix of ``system``, linearised once at least, shifted and softened."""


@dataclass(frozen=True)
class Direct(LinearMethod):
    """The factor LDLᵀ of the whole matrix: fastest up to some 80,000 unknowns on slender links."""

    def solver(self, system):
        return _KktFactor(system.kkt)


_MUMPS = {
    7: 2,  # ordering AMF: fewest operations on slender links (Debian's MUMPS has neither METIS nor SCOTCH)
    12: 2,  # order the graph compressed by likely 2 × 2 pivots
    13: 1,  # root front factored by one process: exact inertia in parallel
    24: 1,  # detect null pivots instead of failing on them
}
"""Controls ICNTL of MUMPS that differ from its own defaults."""

_SMALL_WORKSPACE = (-8, -9, -17, -20)
"""Values of INFOG(1): delayed pivots need more than the workspace, or a message more than the buffer."""

_OUT_OF_MEMORY = (*_SMALL_WORKSPACE, -5, -7, -13, -19)
"""Values of INFOG(1): an allocation failed, or memory beyond ICNTL(23) is needed."""


class Factor(LinearSolver):
    """MUMPS LDLᵀ of a matrix whose pattern does not change: the symbolic analysis is reused.

    Args:
        matrix: of any values.
        workspace: per cent beyond the estimate of MUMPS, for delayed pivots; it grows where that does not suffice.

    Attributes:
        remedy: where memory does not suffice.
    """

    remedy = "Use larger elements, or more memory"

    def __init__(self, matrix: PETSc.Mat, workspace: int = 60) -> None:
        self._matrix, self._workspace, self._factored = matrix, workspace, 0  # factored so often since the analysis
        self._solver = PETSc.KSP()
        self._analyse()

    def refactor(self) -> bool:
        status = self._numeric()
        if self._factored > 1 and not (status >= 0 and self.inertia().zero == 0):
            # the analysis pairs unknowns by their present values: in later ones a pair may be zero, the matrix regular
            self._analyse()
            status = self._numeric()
        for _ in range(3):
            if status not in _SMALL_WORKSPACE:
                break
            # twice as much as before; PETSc repeats no factorisation that failed so
            self._workspace = 2 * self._workspace + 100
            self._analyse()
            status = self._numeric()
        if status in _OUT_OF_MEMORY:
            raise OutOfMemoryError(
                f"factor of a matrix of {self._matrix.size[0]} unknowns",
                f"MUMPS has too little memory (INFOG(1) = {status})",
                self.remedy,
            )
        return status >= 0

    def _analyse(self) -> None:
        """A new solver, which orders and pairs the unknowns by the first values it factors."""
        self._solver.destroy()
        # the only way that reaches all of MUMPS's controls, the ordering among them
        prefix = "fenicsmech_kkt_"
        options = PETSc.Options(prefix)
        for number, value in {**_MUMPS, 14: self._workspace}.items():
            options[f"mat_mumps_icntl_{number}"] = value
        self._solver = PETSc.KSP().create(self._matrix.comm)
        self._solver.setOptionsPrefix(prefix)
        self._solver.setType(PETSc.KSP.Type.PREONLY)
        self._solver.setOperators(self._matrix)
        pc = self._solver.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
        self._solver.setFromOptions()
        self._factored = 0

    def _numeric(self) -> int:
        """Factors the present values; INFOG(1) of MUMPS, the same on all ranks, negative where that failed."""
        self._matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self._solver.setOperators(self._matrix)
        self._solver.getPC().setUp()
        self._factored += 1
        return self._solver.getPC().getFactorMatrix().getMumpsInfog(1)

    def inertia(self) -> Inertia:
        mumps = self._solver.getPC().getFactorMatrix()
        return Inertia(mumps.getMumpsInfog(12), mumps.getMumpsInfog(28))

    @property
    def memory(self) -> float:
        """Bytes the factorisation took, on all ranks."""
        return 1e6 * self._solver.getPC().getFactorMatrix().getMumpsInfog(22)

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec, tolerance: float = 0.0) -> bool:
        """Solves with the last factor, to its roundoff."""
        self._solver.solve(right, solution)
        return True

    def solve_and_count(self, right, solution, tolerance):
        """Likewise, by another analysis where the factor is inaccurate: the one of earlier values scales and pairs
        unknowns by these."""
        self.solve(right, solution)
        if self._factored > 1 and not self._is_accurate(right, solution):
            self._analyse()
            if not self.refactor():
                return None
            self.solve(right, solution)
        return self.inertia()

    def _is_accurate(self, right: PETSc.Vec, solution: PETSc.Vec) -> bool:
        """Whether |K x − b| ≤ 1e-13 (|K| |x| + |b|)."""
        left = right.duplicate()
        self._matrix.mult(solution, left)
        left.axpy(-1.0, right)
        size = self._matrix.norm(PETSc.NormType.FROBENIUS) * solution.norm() + right.norm()
        return left.norm() <= _BACKWARD * size


class _KktFactor(Factor):
    """The factor of the whole KKT matrix, formed on demand."""

    remedy = (
        "Use larger elements, more memory or machines, or PrimalDualNewton(linear=TwoLevel()) with elements of order "
        "2 or 3 in space"
    )

    def __init__(self, kkt: KktMatrix) -> None:
        self._kkt = kkt
        super().__init__(kkt.matrix())

    def refactor(self):
        self._kkt.matrix()
        return super().refactor()


class NotConverged(Exception):
    """The iteration ended without an equilibrium; ``reason`` says why."""

    def __init__(self, reason: str, iterations: int = 0) -> None:
        super().__init__(reason)
        self.reason, self.iterations = reason, iterations


class InvertedGuess(NotConverged):
    """Elements are inverted in the first guess of an equilibrium."""

    def __init__(self) -> None:
        super().__init__("elements are inverted in the predicted state")


@dataclass(frozen=True, eq=False)
class EquilibriumPoint:
    """A converged equilibrium.

    Attributes:
        state: the equilibrium.
        control: under which it was found.
        tangent: rate of the state with the control's value; with an arc length, the path's direction of norm one.
        conjugate_rate: that of the control's conjugate along it, or of the conjugate of the value that is followed.
        stability: from the inertia of K.
        iterations: KKT systems factored and solved on the way.
        residuals: relative residual before each iteration and at the end.
        linearisation: K, last factored on the way, of which stability and tangent are.
        touching: whether each of this rank's points touches an obstacle, (n,); empty where none may.
    """

    state: State
    control: Control
    tangent: Step
    conjugate_rate: float
    stability: Stability
    iterations: int
    residuals: tuple[float, ...]
    linearisation: Linearisation
    touching: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))

    @property
    def unstable_modes(self) -> int:
        """Number of directions in which the energy has a maximum, under dead loads."""
        return self.stability.under_load

    @property
    def unstable_under_control(self) -> int:
        """The same number with the controlled quantity held; along a path, the displacement of the force's point."""
        return self.stability.under(self.control)

    @property
    def contractions(self) -> int:
        """Number of iterations but for a last one that lowers the residual to no less than a quarter: it only shows
        that this is rounding."""
        idle = len(self.residuals) > 1 and self.residuals[-1] > 0.25 * self.residuals[-2]
        return max(self.iterations - int(idle), 1)

    def scaled(self, factor: float) -> EquilibriumPoint:
        """The same equilibrium with ``factor`` times its tangent."""
        return replace(self, tangent=self.tangent.scaled(factor), conjugate_rate=factor * self.conjugate_rate)


class Linearisation:
    """The KKT matrix K at one state under one control, factored by ``linear`` just before.

    Valid until another matrix is assembled or factored; methods raise RuntimeError afterwards.
    """

    def __init__(
        self, system: EquilibriumSystem, linear: LinearSolver, state: State, control: Control, residual: Residual
    ) -> None:
        self.state, self.control, self.residual = state, control, residual
        self._system, self._linear, self._version = system, linear, system.kkt.version

    def solve(self, right: PETSc.Vec) -> PETSc.Vec:
        """x with K x = ``right``; raises ``NotConverged`` if an iterative solver stalled."""
        self._check()
        x = right.duplicate()
        with self._system.clock.phase("solve"):
            if not self._linear.solve(right, x, _ACCURACY):
                raise NotConverged("the linear solver stalled")
        return x

    def missed(self, start: State, back: State, missing: PETSc.Vec, rounding: float) -> float:
        """|y₀ − ŷ₀| / |δ|, 0 within rounding: how far one step back from here misses the guess, much across a fold.

            δ = K⁻¹ r,     ŷ₀ = y + δ.

        Args:
            start: the guess y₀.
            back: this equilibrium y, in the coordinates of y₀.
            missing: r, the residual at y₀.
            rounding: misses up to this part of the mechanism's length, or rad, count as none.
        """
        system = self._system
        step = system.unknowns.step(self.solve(missing))
        miss = system.size(system.difference(start, system.moved(back, step)))
        return 0.0 if miss <= rounding else miss / max(system.size(step), 1e-300)

    def _counted(self, right: PETSc.Vec, tolerance: float, iterations: int = 0) -> tuple[PETSc.Vec, Inertia]:
        """x with K x = ``right``, and the inertia of K; raises as ``solve``."""
        self._check()
        x = right.duplicate()
        with self._system.clock.phase("solve"):
            inertia = self._linear.solve_and_count(right, x, tolerance)
        if inertia is None:
            raise NotConverged("the linear solver stalled", iterations)
        return x, inertia

    def rate(self) -> PETSc.Vec:
        """x′ of the scaled unknowns x with the control's value."""
        return self.solve(self.control_rate())

    def control_rate(self) -> PETSc.Vec:
        """r, the right-hand side of the rate."""
        self._turn()
        return self.control.rate(self._system, self.state)

    @property
    def drowns_modes(self) -> bool:
        """Whether rounding of K, 1e-16 of the stiffest links, exceeds what resists some motion in the rate x,

            |K⁻¹ K x − x| > 1e-2 |x|,

        or leaves a pivot that counts as zero.
        """
        x, inertia = self._counted(self.control_rate(), _ACCURACY)
        if inertia.zero > 0:
            return True
        image = x.duplicate()
        self._system.kkt.matrix().mult(x, image)
        lost = self.solve(image) - x
        return not lost.norm() <= _LOST * x.norm()

    def motor_rate(self, direction: np.ndarray) -> PETSc.Vec:
        """The right-hand side of the rate with motors that move by ``direction``, (connections,)."""
        self._turn()
        return MotorControl(0.0, direction).rate(self._system, self.state)

    def point(self, residuals: Sequence[float], iterations: int, *, tolerance: float = _ACCURACY) -> EquilibriumPoint:
        """The equilibrium at this state, with its tangent and stability, from one solve; raises as ``solve``.

        Its multipliers contain no self-stress: that is due to rounding, and predictions would amplify it.
        """
        self._turn()
        system, control = self._system, self.control
        destroy_garbage(system.comm)
        right = control.rate(system, self.state)
        x, inertia = self._counted(right, tolerance, iterations)
        tangent, rate = control.rates(system, right, x)
        stability = control.stability(inertia.negative - system.negative_where_stable, tangent, rate)
        unstable = stability.under(control) > 0
        state = replace(system.without_self_stress(self.state), unstable=unstable)
        touching = system.touching(self.state)
        return EquilibriumPoint(state, control, tangent, rate, stability, iterations, tuple(residuals), self, touching)

    def travel_gradient(self, load: PointLoad) -> PETSc.Vec:
        """∂(a · u_P)/∂x of a load's travel."""
        self._turn()
        return self._system.travel_gradient(load, self.state)

    def controlled_slopes(self) -> np.ndarray:
        """The gradient of the controlled load's travel by this rank's (u, p), (owned dofs,)."""
        return self._system.travel_slopes(self._system.controlled, self.state)[0]

    def transpose(self, links: np.ndarray, border: np.ndarray) -> PETSc.Vec:
        """Gᵀ of a gradient with respect to this rank's (u, p), (owned dofs,), and to (z, λ, f), (border,)."""
        self._turn()
        return self._system.unknowns.apply_transpose(links, border)

    def displacements(self, x: PETSc.Vec) -> np.ndarray:
        """∂u/∂x · x of all nodes, as in ``State.u``, (owned dofs,)."""
        self._turn()
        return self._system.unknowns.apply(x)

    def step(self, x: PETSc.Vec) -> Step:
        """The change of state that x stands for."""
        return self._system.unknowns.step(x)

    def left_by(self, start: State, control: Control) -> bool:
        """Whether K is still the matrix last factored, and that of ``start`` under ``control`` too.

        It depends on the control by what that prescribes, not by the value. Local.
        """
        state = self.state
        same_state = start.u is state.u and start.poses is state.poses and np.array_equal(start.motors, state.motors)
        same_loads = start.load_factor == state.load_factor and start.minimum_shift == state.minimum_shift
        same_matrix = self._version == self._system.kkt.version and control.constrained == self.control.constrained
        return same_state and same_loads and same_matrix

    def _check(self) -> None:
        if self._version != self._system.kkt.version:
            raise RuntimeError("this linearisation is out of date: another matrix was made or factored since")

    def _turn(self) -> None:
        """Brings the map from x to displacements back to this state."""
        if self._system.unknowns.poses is not self.state.poses:
            self._system.unknowns.turn(self.state.poses)


class Unknown(Enum):
    """The unknown of a load–displacement curve: a displacement under a prescribed force, or the other way round."""

    DISPLACEMENT = "displacement"
    FORCE = "force"


@dataclass(frozen=True, eq=False)
class Adjoint:
    """The adjoint of one quantity.

    Attributes:
        at: the linearisation it was solved with.
        x: in the scaled unknowns of the system.
        nodal: ∂u/∂y x, so that forces δF on the links change Q by nodal · δF: this rank's owned values at the nodes of
            u, then those of pressures, flat.
        poses: ∂z/∂y x of the bodies' poses z, (size,).
        multipliers: the part of the multipliers λ, (rows,).
        load: the part of the controlled force.
    """

    at: Linearisation
    x: PETSc.Vec
    nodal: np.ndarray
    poses: np.ndarray
    multipliers: np.ndarray
    load: float

    @staticmethod
    def of(at: Linearisation, right: PETSc.Vec) -> Adjoint:
        """The adjoint of a quantity whose derivative is ``right``, as ``Linearisation.transpose`` gives it."""
        return Adjoint._of(at, at.solve(right))

    def by_control(self) -> float:
        """dQ/dv by the value v of the control."""
        return self.x.dot(self.at.control_rate())

    def by_motors(self, direction: np.ndarray) -> float:
        """dQ/dφ by motors that move by ``direction``, (connections,)."""
        return self.x.dot(self.at.motor_rate(direction))

    @property
    def imbalance(self) -> float:
        """Σ |x_i r_i|, a bound of what the residual r that the equilibrium is left with changes Q by."""
        own = float(np.abs(self.x.array_r * self.at.residual.vector.array_r).sum())
        return self.x.comm.tompi4py().allreduce(own)

    @staticmethod
    def of_force(at: Linearisation) -> Adjoint:
        """The adjoint of the controlled force under displacement control."""
        # ∂f/∂y is the right-hand side of the rate with the prescribed displacement, but for its sign
        x = at.rate()
        x.scale(-1.0)
        return Adjoint._of(at, x)

    @staticmethod
    def _of(at: Linearisation, x: PETSc.Vec) -> Adjoint:
        step = at.step(x)
        return Adjoint(at, x, at.displacements(x), step.z, step.multipliers, step.force)
