"""Two-level solution of K x = b with the KKT matrix K: a factor for linear displacements, conjugate gradients beyond.

P holds the linear displacements and the whole border,

    P = D⁻¹ N G₁,     K₁ = Pᵀ K P,

with G₁ the map ∂u/∂(s, λ, f) of linear elements, interfaces included, N their values at the nodes of the displacement,
D the units of the unknowns. K₁ has an eighth of the unknowns or less, and is factored. What is left,

    W = {x : Pᵀ K x = 0},     In(K) = In(K₁) + In(K on W),

holds every constraint exactly, has no multipliers, and K is positive definite on it but for modes that linear
elements are too stiff to show. Conjugate gradients stay in W if the smoother S is followed by the coarse correction:

    x ← P K₁⁻¹ Pᵀ b,     then with the preconditioner  (I − P K₁⁻¹ Pᵀ K) S.

S is a polynomial of the stiffness A of free nodes that damps short waves, PETSc's Chebyshev iteration: with D the 3 × 3
(2 × 2 in the plane) diagonal blocks of A and λ the largest eigenvalue of D⁻¹A,

    S = q(D⁻¹A) D⁻¹,     1 − t q(t) = T_m((θ − t)/δ) / T_m(θ/δ),     θ, δ = (b ± a)/2,  a = ratio · b,  b ≥ λ:

errors with eigenvalues in [a, b] shrink alike. S is symmetric, positive definite even if A is not.

Directions p of conjugate gradients are conjugate, so that the number of negative pᵀ K p is that of the negative
eigenvalues they have met. For the inertia they start from random vectors, until one meets none in the complement of
those found. Those found are certain; that none is left is only as certain as the iteration has converged.

Sources: Tang, Nabben, Vuik & Erlangga on the preconditioner, A-DEF2 (doi:10.1007/s10915-009-9272-6); Adams et al. on
the smoother (doi:10.1016/S0021-9991(03)00194-3); Haynsworth (doi:10.1016/0024-3795(68)90050-5) on the inertia.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix, vstack

from fenicsmech.compat import interpolation_matrix, vector_space
from fenicsmech.equilibrium.linearisation import Direct, Factor, Inertia, LinearMethod, LinearSolver
from fenicsmech.equilibrium.system import EquilibriumSystem
from fenicsmech.equilibrium.unknowns import Numbering, UnknownMap
from fenicsmech.errors import DescriptionError, set_options


@dataclass(frozen=True, kw_only=True)
class TwoLevel(LinearMethod):
    """Conjugate gradients over a factor for linear displacements.

    Attributes:
        degree: m of the smoother, products with A that one application takes, plus one.
        ratio: a/b of the smoother; the claw's curve takes least time with these (benchmarks/large.py).
        safety: b over the estimate of λ, which is a lower bound: it takes many iterations to include single bad cells.
        iterations: maximum number of iterations of one solve; more would mean that the coarse level does not suit.
        probe: relative energy at which iterations from a random start end when counting the inertia.
        roundoff: of the solution, in units of the mean stiffness: residuals below are rounding.

    Raises:
        DescriptionError: a number is out of its range.
    """

    degree: int = 8
    ratio: float = 0.03
    safety: float = 1.3
    iterations: int = 300
    probe: float = 1e-6
    roundoff: float = 1e-15

    def __post_init__(self) -> None:
        set_options(self, "two levels", below_one=("ratio", "probe"), degree=1, iterations=1)

    @staticmethod
    def suits(system: EquilibriumSystem) -> bool:
        """Whether u has order 2 or more, all components of free nodes are unknown, and there are no pressures."""
        return system.elastic.order > 1 and system.numbering.whole_nodes

    def solver(self, system):
        if not self.suits(system):
            raise DescriptionError(
                "linear solver TwoLevel",
                "it needs displacements of order 2 or 3, all components of a node unknown, and no pressures",
                "Use order=2, or Direct()",
            )
        return TwoLevelSolver(system, self)


@dataclass(frozen=True)
class BySize(LinearMethod):
    """Two levels above ``limit`` unknowns in space, where they suit; the factor otherwise.

    In the plane a factor costs little at any size. Where two levels do not suit (order 1, the u–p formulation, the
    nodes of a mid-plane) the factor is all there is. In space, whole curves of a claw with their stability cost about
    as much either way near the limit, and two levels take less memory (benchmarks/large.py).

    Attributes:
        limit: number of unknowns.

    Raises:
        DescriptionError: it is not a whole number of at least 0.
    """

    limit: int = 80_000

    def __post_init__(self) -> None:
        set_options(self, "methods by size", limit=0)

    def solver(self, system):
        large = system.blocks.size > self.limit and system.joints.space.dim == 3 and TwoLevel.suits(system)
        return (TwoLevel() if large else Direct()).solver(system)


@dataclass(frozen=True)
class Direction:
    """p with K p and pᵀ K p."""

    p: PETSc.Vec
    image: PETSc.Vec
    curvature: float


class TwoLevelSolver(LinearSolver):
    """Solves with the KKT matrix of ``system``, of order 2 or more, and counts its inertia.

    Attributes:
        iterations: of each solve so far.
    """

    def __init__(self, system: EquilibriumSystem, options: TwoLevel) -> None:
        self._system, self._options = system, options
        self._coarse = CoarseLevel(system)
        self._smoother = _chebyshev(system.comm, options)
        self._sets = system.blocks.nodes.index_set(), system.blocks.border.index_set()
        self._stiffness, self._border, self._corner, self._matrix = (PETSc.Mat() for _ in range(4))
        # petsc4py destroys its objects late: none is created per iteration
        self._work, self._residual, self._z, self._image, self._p, self._q = (system.unknowns.zeros() for _ in range(6))
        self._rough, self._smoothed = PETSc.Vec(), PETSc.Vec()
        self._met = 0
        self.iterations: list[int] = []

    def refactor(self) -> bool:
        self._matrix.destroy()
        self._stiffness.destroy()
        self._stiffness, columns = self._system.kkt.nodal_stiffness(), self._system.kkt.border_columns()
        if not math.isfinite(self._stiffness.norm()):
            return False
        nodes, border = self._sets
        self._border = columns.createSubMatrix(nodes, None, self._border)
        self._corner = columns.createSubMatrix(border, None, self._corner)
        if not self._rough:
            self._rough, self._smoothed = self._stiffness.createVecs()
            self._transposed = PETSc.Mat().createTranspose(self._border)
        blocks = [[self._stiffness, self._border], [self._transposed, self._corner]]
        self._matrix = PETSc.Mat().createNest(blocks, self._sets, self._sets, comm=self._system.comm)
        self._smoother.setOperators(self._stiffness)
        self._smoother.setUp()
        return self._coarse.update()

    @property
    def memory(self) -> float:
        """Bytes of the factor of K₁ and of the blocked stiffness, on all ranks."""
        blocks = self._stiffness.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]
        size = self._stiffness.getBlockSize() ** 2
        return self._coarse.factor.memory + blocks * (8.0 + 4.0 / size)

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec, tolerance: float) -> bool:
        """Solves with the matrix last refactored; False if that takes too many iterations.

        The tolerance is of the energy norm of the error, relative to that of the error after one coarse correction.
        """
        self._start(right, solution)
        return self._iterate(solution, tolerance)

    def solve_and_count(self, right: PETSc.Vec, solution: PETSc.Vec, tolerance: float) -> Inertia | None:
        """``solve`` and ``inertia`` in one: a solve that starts from a random guess is a probe; None if not solved."""
        self._start(right, solution)
        error = abs(self._smooth(self._residual))
        self._randomise(self._work)
        self._smooth(self._work)
        self._project(())
        curvature = self._z.dot(self._image)
        if curvature > 0.0:
            # scaled to the energy of the error
            factor = math.sqrt(error / curvature)
            solution.axpy(factor, self._z)
            self._residual.axpy(-factor, self._image)
        if not self._iterate(solution, min(tolerance, self._options.probe)):
            return None
        probed = self._met or curvature <= 0.0 or error == 0.0  # nothing is solved for from a guess of no size
        return self.inertia() if probed else self._coarse.factor.inertia()

    def _start(self, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        """P K₁⁻¹ Pᵀ b and its residual."""
        self._coarse.correction(right, solution)
        self._matrix.mult(solution, self._residual)
        self._residual.aypx(-1.0, right)

    def _iterate(self, solution: PETSc.Vec, tolerance: float) -> bool:
        """Conjugate gradients from a ``solution`` with its residual; whether they reach the ``tolerance``."""
        least, iterations, self._met = self._options.roundoff * solution.norm(), 0, 0
        for energy, direction in self._conjugate(self._residual, tolerance, least=least):
            if iterations == self._options.iterations:
                return False
            iterations += 1
            solution.axpy(energy / direction.curvature, direction.p)
            # later ones may be copies of the first: long recurrences lose conjugacy
            self._met = max(self._met, int(direction.curvature < 0.0))
        self.iterations.append(iterations)
        return True

    def known_inertia(self) -> Inertia:
        """Lower bound: that of the coarse level, and one more if the last solve met a negative curvature."""
        coarse = self._coarse.factor.inertia()
        return Inertia(coarse.negative + self._met, coarse.zero)

    def inertia(self) -> Inertia:
        found: list[Direction] = []
        while (direction := self._probe(found)) is not None:
            found.append(direction)
        coarse = self._coarse.factor.inertia()
        return Inertia(coarse.negative + len(found), coarse.zero)

    def _probe(self, found: list[Direction]) -> Direction | None:
        """A direction of negative curvature conjugate to those ``found``, None if there seems to be none."""
        r, options = self._residual, self._options
        self._randomise(r)
        self._coarse.correction(r, self._work)
        self._matrix.mult(self._work, self._image)
        r.axpy(-1.0, self._image)
        for known in found:
            r.axpy(-known.p.dot(r) / known.curvature, known.image)
        for _, direction in islice(self._conjugate(r, options.probe, found), options.iterations):
            if direction.curvature < 0.0:
                return Direction(direction.p.copy(), direction.image.copy(), direction.curvature)
        return None

    def _conjugate(
        self, r: PETSc.Vec, tolerance: float, found: Sequence[Direction] = (), *, least: float = 0.0
    ) -> Iterator[tuple[float, Direction]]:
        """Conjugate directions for a residual r with Pᵀ r = 0: its energy rᵀ z, and the next direction.

        They end when the energy is ``least``² or has fallen by ``tolerance``². Each is valid until the next one.
        """
        z, image, p, q = self._z, self._image, self._p, self._q
        p.set(0.0)
        q.set(0.0)
        before, least = math.inf, least**2
        # rᵀ S r is the same but for rounding in Pᵀ r: if that ends here, no projection is needed
        while not abs(self._smooth(r)) <= least:
            self._project(found)
            energy = r.dot(z)
            if before == math.inf:
                least = max(tolerance**2 * abs(energy), least)
            if abs(energy) <= least:
                break
            p.aypx(energy / before, z)
            q.aypx(energy / before, image)
            curvature = p.dot(q)
            yield energy, Direction(p, q, curvature)
            r.axpy(-energy / curvature, q)
            before = energy

    def _smooth(self, r: PETSc.Vec) -> float:
        """z = S r, and rᵀ z."""
        nodes, z = self._system.blocks.nodes.local, self._z
        self._rough.array_w[:] = r.array_r[nodes]
        self._smoother.solve(self._rough, self._smoothed)
        z.set(0.0)
        z.array_w[nodes] = self._smoothed.array_r
        return r.dot(z)

    def _project(self, found: Sequence[Direction]) -> None:
        """Makes z conjugate to P and to the directions ``found``, and its image K z."""
        z, image = self._z, self._image
        self._matrix.mult(z, image)
        self._coarse.correction(image, self._work)
        z.axpy(-1.0, self._work)
        self._matrix.mult(z, image)
        for known in found:
            factor = -known.image.dot(z) / known.curvature
            z.axpy(factor, known.p)
            image.axpy(factor, known.image)

    def _randomise(self, r: PETSc.Vec) -> None:
        """Makes r random forces on free nodes."""
        nodes = self._system.blocks.nodes
        r.set(0.0)
        r.array_w[nodes.local] = np.random.default_rng(nodes.comm.rank).standard_normal(nodes.count)


def _chebyshev(comm: MPI.Comm, options: TwoLevel) -> PETSc.KSP:
    """The smoother S."""
    prefix = "fenicsmech_smoother_"
    database = PETSc.Options(prefix)
    database["ksp_chebyshev_esteig"] = f"0,{options.ratio * options.safety},0,{options.safety}"
    smoother = PETSc.KSP().create(comm)
    smoother.setOptionsPrefix(prefix)
    smoother.setType(PETSc.KSP.Type.CHEBYSHEV)
    smoother.setNormType(PETSc.KSP.NormType.NONE)
    smoother.setTolerances(max_it=options.degree)
    smoother.getPC().setType("pbjacobi")
    smoother.setFromOptions()
    return smoother


class CoarseLevel:
    """P and the ``factor`` of K₁, made by the first ``update``."""

    def __init__(self, system: EquilibriumSystem) -> None:
        self._system = system
        linear = vector_space(system.elastic.mesh, 1)
        self._design, self._interfaces = fem.Function(linear), system.interfaces.on(fem.Function(linear))
        numbering = Numbering(system.comm, self._interfaces, system.joints)
        units = np.full(len(numbering.free), system.unknowns.unit_u)
        self._map = UnknownMap(numbering, self._interfaces, system.joints, units, system.unknowns.scale)
        self._values = _values_at_nodes(system, numbering, linear)
        self._prolongation, self._mapped, self._matrix = PETSc.Mat(), PETSc.Mat(), PETSc.Mat()

    def update(self) -> bool:
        """Takes the values of the KKT matrix; whether K₁ could be factored."""
        system, unknowns, first = self._system, self._system.unknowns, not self._matrix
        self._design.interpolate(system.elastic.shape)  # at vertices, which bulges do not move
        self._interfaces.reshape(self._design.x.array.reshape(-1, system.joints.space.dim))
        self._map.turn(unknowns.poses)
        self._prolongation = self._values.matMult(self._map.map, result=self._prolongation)
        self._mapped = unknowns.map.matMult(self._prolongation, result=self._mapped)
        self._matrix = system.kkt.restricted(self._mapped, self._matrix)
        if first:
            self.factor = Factor(self._matrix)
            self._right, self._solution = self._matrix.createVecs()
        return self.factor.refactor()

    def correction(self, r: PETSc.Vec, x: PETSc.Vec) -> None:
        """x = P K₁⁻¹ Pᵀ r."""
        self._prolongation.multTranspose(r, self._right)
        self.factor.solve(self._right, self._solution)
        self._prolongation.mult(self._solution, x)


def _values_at_nodes(system: EquilibriumSystem, coarse: Numbering, linear: fem.FunctionSpace) -> PETSc.Mat:
    """D⁻¹ N: unknowns from displacements at vertices and the border."""
    blocks, elastic, border = system.blocks, system.elastic, system.blocks.border.count
    weights = interpolation_matrix(linear, elastic.u.function_space)[system.numbering.free]
    identity = csr_matrix(
        (np.ones(border), (np.arange(border), coarse.rows.border.first + np.arange(border))), (border, coarse.rows.size)
    )
    weights.resize(weights.shape[0], coarse.rows.size)
    local = vstack([weights, identity], format="csr")
    local.sort_indices()
    matrix = PETSc.Mat().createAIJ(
        [(blocks.local, blocks.size), (coarse.rows.local, coarse.rows.size)],
        csr=(local.indptr.astype(PETSc.IntType), local.indices.astype(PETSc.IntType), local.data),
        comm=system.comm,
    )
    units = system.unknowns.zeros()
    units.array_w[:] = 1.0 / system.unknowns.units
    matrix.diagonalScale(units)
    return matrix
