"""Goal-oriented error estimates of a displacement or force at an equilibrium, by kinds of error, from one adjoint.

Error of the elements: the difference from infinitely fine elements on the same outline. With the errors e_u of the
displacement and e_z of the adjoint z of the quantity Q, to first order

    Q(u) − Q(u_h) = ∫ ∇e_u : ∂²W/∂F∂F : ∇e_z dV.

Their gradients are estimated by recovery by averaging: G is the L² projection of the gradient to continuous
fields of the gradient's degree (at least 1) over deformable cells of the rest shape,

    ∇e ≈ c (G(∇u_h) − ∇u_h),

where only one half of the links is meshed with G₁₃ = G₂₃ = G₃₁ = G₃₂ = 0 on the mid-plane, by symmetry. Where
elements are mixed, Π(F, p) takes the place of W, and the other second derivatives follow, with the errors
e_p of p and e_q of its adjoint q:

    + ∫ e_p ∂²Π/∂p∂F : ∇e_z + e_q ∂²Π/∂p∂F : ∇e_u + e_p ∂²Π/∂p² e_q dV.

The gradient of the linear pressure p on the rest shape, recovered as a continuous linear field G and integrated along
the edges of each cell from its vertices, where p is most accurate, gives a quadratic p*. With w = p − ½ G · X and I w
its interpolation at the vertices, for p of higher degree likewise,

    e_p ≈ c (p* − p) = c (I w − w),

in straight cells ½ Σ λ_i λ_j (G_i − G_j) · (X_j − X_i) over the edges. Not included: with elements of order
1, the approximation of curved outlines by polygons.

Error of plane stress: there links contract across their depth b by h = F₃₃ − 1, each point for itself. In space
interfaces hold links all through their depth; and where h varies over the thickness, as in bending, links curl across
their depth (anticlastic bending), which stretches links that are curved along their length. With polynomials of the
lowest degree in the height z above the mid-plane, as in hierarchic models of plates, and moduli of small strain

    u₃ = z a,     u = u_ps − ½ (z² − b²/12) v,     a = 0 and v = 0 in interfaces,
    V = min over a, v of ½ ∫ E (a − h)² + μ b²/12 |∇a − Fᵀv|² + b⁴/720 G : C : G dV,     G = sym Fᵀ∇v,

C that of plane stress: one linear problem on the same mesh at every equilibrium. h of the elements jumps between them,
which a could not follow; its projection p to continuous fields, like that of recovered gradients, takes its place. Of
laws with directions E of the first term is that across the plane, the other moduli are typical ones. V is the energy
that 3D adds. It changes a quantity, to first order with its adjoint z,

    Q(space) − Q(plane stress) ≈ −∂V/∂u · z     at these a and v.

Where all contraction is blocked V = ½ ∫ E h² dV, to first order the difference between plane strain and plane stress.
h includes what prestrain in all directions adds to the depth, and V counts the elastic parts of a, v and gradients
(``ElasticBody.contraction_energy``). Pressure P on the whole boundary of a link also acts on the faces across its
depth, and adds ∫ P a det F dV of the rest shape to V.
A strip of thickness t bent from curvature κ₀ to κ stores, far from its ends and per length,

    V = ½ ν² E I (κ − κ₀)² β² / (60 + β²),     β = b² κ / t,

β Searle's parameter: strips are beams where it is small, plates where it is large. The closed form for such strips has
in place of β² / (60 + β²), which is up to 1.3 times as large,

    (1 − g) / (1 − ν² g),     g = (2/θ) (cosh θ − cos θ) / (sinh θ + sin θ),     θ⁴ = 3 (1 − ν²) β².

Measured, estimate over true difference: between a half and two for strips of depths from 1 to 30 and lengths from 10 to
30 thicknesses, clamped or pinned, straight or curved, bent by up to 1 rad, and for the demos' links as drawn and as
designed. Both models have to have the same outline, that of the exported part: a design on another mesh is a slightly
different shape, whose length alone decides how far the designed truss can be pulled straight. Not included: motion out
of the plane, and tension that flattens curled links.

c² was measured once, see ``Calibration``. Sources: Zienkiewicz & Zhu (doi:10.1002/nme.1620240206) for the recovery,
Oden & Prudhomme (doi:10.1016/S0898-1221(00)00317-5) for goal-oriented estimates, Oden & Vemaganti
(doi:10.1006/jcph.2000.6585) for those of modelling errors, Dauge, Faou & Yosibash, "Plates and shells: asymptotic
expansions and hierarchic models" (Encyclopedia of Computational Mechanics, 2004) for polynomials across the depth,
Lamb, "On the flexure of an elastic plate" (Proceedings of the London Mathematical Society 21, 1890) and Conway &
Nickola, "Anticlastic action of flat sheets in bending" (Experimental Mechanics 5, 1965) for strips.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from fenicsmech.compat import (
    add_blocks,
    add_ghosts,
    assemble_matrix,
    assemble_vector,
    cell_dofs,
    cellwise_space,
    compile_expression,
    compile_form,
    create_block_matrix,
    destroy_garbage,
    interpolation_points,
    owned_values,
    scalar_space,
    tensor_space,
    vector_space,
)
from fenicsmech.elasticity import PLANE_STRESS, ElasticBody, ElasticModel
from fenicsmech.equilibrium import (
    Adjoint,
    DisplacementControl,
    EquilibriumSolver,
    LoadControl,
    NotConverged,
    PointLoad,
    State,
    Unknown,
)
from fenicsmech.errors import DescriptionError, EquilibriumError
from fenicsmech.meshing import on_mid_plane
from fenicsmech.model import Design, MechanismModel


class ErrorKind(Enum):
    """Kinds of errors."""

    ELEMENTS = "elements"
    PLANE_STRESS = "plane stress"


@dataclass(frozen=True)
class Calibration:
    """Factors of the estimates, measured once.

    Attributes:
        displacement: c² of recovered gradients by the order of displacement elements, so that effectivities lie around
            1 (tests/estimates/test_element_error.py).
        mixed: the same of elements with a pressure (tests/estimates/test_mixed_error.py).
    """

    displacement: Mapping[int, float] = field(default_factory=lambda: {1: 1.3, 2: 1.6, 3: 2.6, 4: 3.5})
    mixed: Mapping[int, float] = field(default_factory=lambda: {2: 0.75, 3: 1.2, 4: 1.7})


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An equilibrium and the unknown of its curve.

    Attributes:
        state: the equilibrium.
        design: that it belongs to.
        unknown: the displacement under a prescribed force, or the force at a prescribed displacement.
    """

    state: State
    design: Design
    unknown: Unknown


@dataclass(frozen=True)
class BoundedError:
    """The correction η of a quantity.

    Attributes:
        error: η.
        bound: of |η| by Cauchy and Schwarz in each cell, ∑ ‖e_u‖ ‖e_z‖ in the norm of ∂²W/∂F∂F of what strains it, or
            |η_K| where that is larger; |η| in plane stress, whose estimate has no contributions of cells.
        unresolved: ‖e_z‖² / ‖∇z‖², the part of the adjoint's own energy that the elements miss.
    """

    error: float
    bound: float
    unresolved: float = 0.0


class Estimates:
    """Error estimates at equilibria of one model; forms are compiled when they are first needed."""

    def __init__(self, model: MechanismModel, calibration: Calibration | None = None) -> None:
        self._model, self._calibration = model, calibration or Calibration()

    def at(
        self,
        solver: EquilibriumSolver,
        equilibrium: Equilibrium,
        kinds: Sequence[ErrorKind] = (ErrorKind.ELEMENTS,),
        output: PointLoad | None = None,
        *,
        origin: Sequence[float] = (),
    ) -> list[float]:
        """Corrections of the quantity of an equilibrium, by kinds of error, from one adjoint.

        With an ``output``, those of the displacement of that point, under the same control. Displacements count from
        the drawing. Where the place that a prescribed one counts from has corrections, ``origin``, it moves with them.

        Raises:
            DescriptionError: ``kinds`` hold the error of plane stress and the model is another one.
            EquilibriumError: the KKT matrix is singular.
        """
        with self.shaped(equilibrium.design):
            adjoint = adjoint_at(solver, equilibrium, output)
            slope = adjoint.by_control() if origin and equilibrium.unknown is Unknown.FORCE else 0.0
            found = self.of(adjoint, kinds)
            return [own + slope * moved for own, moved in zip(found, origin or [0.0] * len(found), strict=True)]

    def of(self, adjoint: Adjoint, kinds: Sequence[ErrorKind] = (ErrorKind.ELEMENTS,)) -> list[float]:
        """Corrections of a quantity from its adjoint, at the state and design that the model holds.

        Raises:
            DescriptionError: ``kinds`` hold the error of plane stress and the model is another one.
        """
        errors = [self._element_error if kind is ErrorKind.ELEMENTS else self._plane_stress_error for kind in kinds]
        return [error.of(adjoint) for error in errors]

    def bounded(self, adjoint: Adjoint, kind: ErrorKind) -> BoundedError:
        """The correction of a quantity from its adjoint, and what bounds it. Raises as ``of``."""
        elements = self._element_error.bounded(adjoint)
        if kind is ErrorKind.ELEMENTS:
            return elements
        (error,) = self.of(adjoint, [kind])
        return replace(elements, error=error, bound=abs(error))

    @contextmanager
    def shaped(self, design: Design) -> Iterator[None]:
        """The model has the shape of ``design`` within, and the time counts as that of estimates."""
        with self._model.clock.phase("estimate"), self._model.shaped(design):
            yield

    @cached_property
    def _element_error(self) -> ElementError:
        return ElementError(self._model, self._calibration)

    @cached_property
    def _plane_stress_error(self) -> PlaneStressError:
        return PlaneStressError(self._model)


def adjoint_at(solver: EquilibriumSolver, equilibrium: Equilibrium, output: PointLoad | None = None) -> Adjoint:
    """The adjoint of the quantity of an equilibrium, or of the displacement of ``output``; the model keeps the state.

    Raises:
        EquilibriumError: the KKT matrix is singular.
    """
    system, state, force = solver.system, equilibrium.state, equilibrium.unknown is Unknown.FORCE
    system.load(state)
    control = DisplacementControl(system.load_displacement(state)) if force else LoadControl(state.force)
    try:
        at = solver.linearise(state, control)
        if force and output is None:
            return Adjoint.of_force(at)
        return Adjoint.of(at, at.travel_gradient(output or system.controlled))
    except NotConverged as failure:
        raise EquilibriumError(
            f"equilibrium under {system.controlled.name!r}",
            f"its sensitivity is not defined at force {state.force:g} ({failure.reason})",
            "Choose another equilibrium, or prescribe the displacement",
        ) from failure


class ElementError:
    """Discretisation errors of quantities of one model, which holds the equilibrium in question."""

    def __init__(self, model: MechanismModel, calibration: Calibration) -> None:
        self._elastic, self._comm = model.elastic, model.mesh.comm
        elastic, order = model.elastic, model.elastic.order
        degree = max(order - 1, 1)  # of the recovered gradient
        squares = [(calibration.mixed if mixed else calibration.displacement)[order] for mixed in model.mixed]
        self._scale = elastic.cellwise([math.sqrt(square) for square in squares])  # c of each cell's link
        names = ("adjoint", "adjoint_pressure")
        self._adjoint = [
            fem.Function(field.function_space, name=name) for field, name in zip(elastic.fields, names, strict=False)
        ]
        tensors = tensor_space(elastic.mesh, degree)
        self._recovered = [fem.Function(tensors, name=name) for name in ("recovered_gradient", "recovered_adjoint")]
        self._sums = fem.Function(tensors)
        self._recovery = Recovery(model, degree)
        self._pressures = []
        if elastic.pressure is not None:
            linear = self._recovery if degree == 1 else Recovery(model, 1)
            fields = (elastic.pressure.p, self._adjoint[1])
            self._pressures = [PressureError(elastic, field, linear) for field in fields]
        gradients = [elastic.gradient(elastic.u), elastic.gradient(self._adjoint[0])]
        test = ufl.TestFunction(tensors)
        volume, measure = self._recovery.volume, elastic.free(2 * degree)
        self._right_hand_sides = [compile_form(ufl.inner(H, test) * volume * measure) for H in gradients]
        self._contributions = fem.Function(cellwise_space(elastic.mesh))
        self._error = compile_form(self._second_derivatives(2 * degree))

    @cached_property
    def _squares(self) -> list:
        """Compiled: ‖e_u‖², ‖e_z‖² and ‖∇z‖² of each cell, in the norm of ∂²W/∂F∂F, of what strains it.

        Rotations, whose part has the sign of the stress, are left out: F⁻ᵀ sym(Fᵀ H) in place of H.
        """
        (e_u, e_z), z = self._errors(), self._elastic.gradient(self._adjoint[0])
        F = ufl.Identity(self._elastic.model.dim) + self._elastic.gradient(self._elastic.u)
        e_u, e_z, z = (ufl.dot(ufl.inv(F).T, ufl.sym(ufl.dot(F.T, H))) for H in (e_u, e_z, z))
        degree = 2 * max(self._elastic.order - 1, 1)
        return [compile_form(self._elastic.curvature(self._cell * H, H, degree=degree)) for H in (e_u, e_z, z)]

    @property
    def _cell(self):
        """The test function that is one in a cell, symbolic."""
        return ufl.TestFunction(self._contributions.function_space)

    def _errors(self) -> list:
        """∇e_u and ∇e_z, symbolic."""
        elastic = self._elastic
        fields = (elastic.u, self._adjoint[0])
        return [self._scale * (G - elastic.gradient(field)) for G, field in zip(self._recovered, fields, strict=True)]

    def of(self, adjoint: Adjoint) -> float:
        """Q(u) − Q(u_h), from the adjoint of Q."""
        return float(self._comm.allreduce(self._cellwise(adjoint).sum()))

    def bounded(self, adjoint: Adjoint) -> BoundedError:
        """Q(u) − Q(u_h), from the adjoint of Q, and what bounds it."""
        own = self._cellwise(adjoint).copy()
        # laws may be indefinite where a cell is compressed or stretched much
        e_u, e_z, z = (np.abs(assemble_vector(form, self._contributions)) for form in self._squares)
        bounds = np.maximum(np.sqrt(e_u * e_z), np.abs(own))
        error, bound, missed, energy = self._comm.allreduce(np.array([own.sum(), bounds.sum(), e_z.sum(), z.sum()]))
        return BoundedError(float(error), float(bound), float(missed / energy) if energy else 0.0)

    def _cellwise(self, adjoint: Adjoint) -> np.ndarray:
        """The contributions of this rank's cells; a view."""
        elastic, dim = self._elastic, self._elastic.model.dim
        for part, values in zip(self._adjoint, elastic.split(adjoint.nodal), strict=True):
            owned_values(part)[:] = values
            part.x.scatter_forward()
        odd = [(k // dim == 2) != (k % dim == 2) for k in range(dim**2)]
        self._recovery.update()
        for recovered, form in zip(self._recovered, self._right_hand_sides, strict=True):
            self._recovery.project(form, recovered, self._sums, odd)
        for pressure in self._pressures:
            pressure.update()
        destroy_garbage(self._comm)
        return assemble_vector(self._error, self._contributions)

    def _second_derivatives(self, degree: int) -> ufl.Form:
        """The sum of all second derivatives of the energy, in the directions of the errors, of each cell."""
        elastic, cell = self._elastic, self._cell
        A, B = self._errors()
        A = cell * A
        form = elastic.curvature(A, B, degree=degree)
        if elastic.pressure is None:
            return form
        p, (e_p, e_q) = elastic.pressure.p, (self._scale * pressure.error for pressure in self._pressures)
        e_p = cell * e_p
        H = ufl.variable(elastic.gradient(elastic.u))
        for work, measure in elastic.densities(H):
            dx, stress = measure(metadata={"quadrature_degree": degree}), ufl.diff(work, H)
            form += ufl.derivative(ufl.inner(stress, B) * dx, p, e_p)
            form += ufl.derivative(ufl.inner(stress, A) * dx, p, e_q)
            form += ufl.derivative(ufl.derivative(work * dx, p, e_p), p, e_q)
        return form


class Recovery:
    """The projection to continuous fields of one ``degree`` over the deformable cells of a model, on its rest shape."""

    def __init__(self, model: MechanismModel, degree: int) -> None:
        self._elastic, self._comm = model.elastic, model.mesh.comm
        V = scalar_space(self._elastic.mesh, degree)
        test, trial = ufl.TestFunction(V), ufl.TrialFunction(V)
        self._product = compile_form(test * trial * self.volume * self._elastic.free(2 * degree))
        self._mid_plane = np.zeros(0, dtype=PETSc.IntType)  # this rank's owned nodes there
        if self._elastic.model.half:
            points = V.tabulate_dof_coordinates()[: V.dofmap.index_map.size_local]
            self._mid_plane = np.flatnonzero(on_mid_plane(points, V.mesh.comm)).astype(PETSc.IntType)
        self._shape: np.ndarray | None = None
        self._solvers: list[PETSc.KSP] = []
        self.update()

    @property
    def volume(self):
        """det ∇X, symbolic: cells count by their size in the rest shape, which designs change."""
        return ufl.det(self._elastic.rest_gradient)

    def update(self) -> None:
        """Takes the present rest shape."""
        shape = self._elastic.shape.x.array
        same = self._shape is not None and np.array_equal(shape, self._shape)
        if self._comm.allreduce(same, op=MPI.LAND):
            return
        for solver in self._solvers:
            solver.destroy()
        self._shape = shape.copy()
        self._mass = assemble_matrix(self._product, self._comm)
        diagonal = self._mass.getDiagonal()
        # vertices inside interfaces, where nothing deforms
        diagonal.array_w[diagonal.array_r == 0.0] = 1.0
        self._mass.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
        self._mass.setDiagonal(diagonal)
        self._solvers = [_solver_of(self._mass)]
        if self._elastic.model.half:
            vanishing = self._mass.copy()
            vanishing.zeroRowsColumns(self._mass.getOwnershipRange()[0] + self._mid_plane)
            self._solvers.append(_solver_of(vanishing))

    def project(self, right_hand_side, field: fem.Function, work: fem.Function, odd: Sequence[bool]) -> None:
        """Sets ``field``, of any number of components, to the projection with a compiled right-hand side.

        Sums are made in ``work``, on the same space. Components ``odd`` across the mid-plane vanish there where only
        one half is meshed.
        """
        right = assemble_vector(right_hand_side, work)
        values, part = self._mass.createVecs()
        for k, vanishes in enumerate(odd):
            part.array_w[:] = right[k :: len(odd)]
            if vanishes:
                part.array_w[self._mid_plane] = 0.0
            self._solvers[-1 if vanishes else 0].solve(part, values)
            owned_values(field)[k :: len(odd)] = values.array_r
        field.x.scatter_forward()


def _solver_of(mass: PETSc.Mat) -> PETSc.KSP:
    solver = PETSc.KSP().create(mass.comm)
    solver.setOperators(mass)
    solver.setType("cg")
    solver.getPC().setType("jacobi")
    solver.setTolerances(rtol=1e-8)
    return solver


class PressureError:
    """The symbolic ``error`` e_p of a pressure, or of its adjoint, of its values at the last ``update``.

    Its ``recovery`` is of degree 1.
    """

    def __init__(self, elastic: ElasticBody, field: fem.Function, recovery: Recovery) -> None:
        self._recovery, self._dim = recovery, elastic.model.dim
        self._gradient = fem.Function(vector_space(elastic.mesh, 1), name=f"recovered_gradient_of_{field.name}")
        self._sums = fem.Function(self._gradient.function_space)
        test = ufl.TestFunction(self._gradient.function_space)
        recovered = ufl.inner(elastic.gradient(field), test)
        self._right_hand_side = compile_form(recovered * recovery.volume * elastic.free(2))
        w = field - 0.5 * ufl.dot(self._gradient, elastic.rest)
        V = scalar_space(elastic.mesh, 1)
        self._interpolated = fem.Function(V, name=f"interpolated_{field.name}")
        self._expression = compile_expression(w, interpolation_points(V), elastic.mesh.comm)
        self.error = self._interpolated - w

    def update(self) -> None:
        """Recovers the present values of the field."""
        self._recovery.update()
        self._recovery.project(self._right_hand_side, self._gradient, self._sums, [k == 2 for k in range(self._dim)])
        self._interpolated.interpolate(self._expression)
        self._interpolated.x.scatter_forward()


def check_plane_stress(model: ElasticModel) -> None:
    """Raises a DescriptionError unless a ``model`` with an error of plane stress is in question."""
    if model is not PLANE_STRESS:
        raise DescriptionError(
            "modelling error",
            f"only plane stress has one that is known, and space={model.name!r}",
            "Simulate in plane stress, or in 3D",
        )


class PlaneStressError:
    """Errors of plane stress relative to 3D, for quantities of one model, which holds the equilibrium in question.

    Raises:
        DescriptionError: the simulation is not in plane stress.
    """

    def __init__(self, model: MechanismModel) -> None:
        self._elastic = elastic = model.elastic
        check_plane_stress(elastic.model)
        V, smooth = (scalar_space(elastic.mesh, order) for order in (elastic.order, max(elastic.order - 1, 1)))
        a, v = fem.Function(V, name="contraction"), fem.Function(elastic.u.function_space, name="curling")
        p, q = (fem.Function(smooth, name=name) for name in ("free_contraction", "blocked_contraction"))
        self._fields, self._projected = (a, v), (p, q)
        pressures = [
            sum(effect.pressure_across_depth.get(link, 0.0) for effect in model.effects)
            for link in model.mechanism.flexible_links
        ]
        energy = elastic.contraction_energy(a, v, p, q, pressures, degree=2 * elastic.order)
        by_a, by_v, by_p, by_q, by_u = (ufl.derivative(energy, part) for part in (a, v, p, q, elastic.u))
        self._by_a, self._by_p, self._by_q, self._force = (compile_form(row) for row in (by_a, by_p, by_q, by_u))
        self._mass = compile_form(ufl.derivative(by_p, p))
        self._stiffness = [[compile_form(ufl.derivative(row, part)) for part in (a, v)] for row in (by_a, by_v)]
        held = fem.Function(V)
        held.x.array[cell_dofs(V)[model.mesh.interface >= 0]] = 1.0
        # a node may touch an interface cell only on another rank
        add_ghosts(held)
        unknown = np.concatenate([owned_values(held) == 0.0, model.interfaces.unknown.ravel()])
        self._unknown = np.flatnonzero(unknown).astype(PETSc.IntType)

    def of(self, adjoint: Adjoint) -> float:
        """Q(space) − Q(plane stress), from the adjoint of Q."""
        (a, v), (p, q), comm = self._fields, self._projected, self._elastic.mesh.comm
        for part in (a, v, p, q):
            part.x.array[:] = 0.0
        mass = assemble_matrix(self._mass, comm)
        projection = _solver_of(mass)
        self._project(projection, self._by_q, p)
        self._solve()
        self._project(projection, self._by_p, q)
        projection.destroy()
        mass.destroy()
        return -comm.allreduce(float(self._elastic.assembled(self._force) @ adjoint.nodal))

    @staticmethod
    def _project(solver: PETSc.KSP, negative, field: fem.Function) -> None:
        """Sets ``field`` to the solution with a compiled right-hand side, given with the opposite sign."""
        right, values = solver.getOperators()[0].createVecs()
        right.array_w[:] = -assemble_vector(negative, fem.Function(field.function_space))
        solver.solve(right, values)
        owned_values(field)[:] = values.array_r
        field.x.scatter_forward()
        right.destroy()
        values.destroy()

    def _solve(self) -> None:
        """Sets a and v to those of least energy at p."""
        a, v = self._fields
        pull = assemble_vector(self._by_a, fem.Function(a.function_space))
        right = np.concatenate([-pull, np.zeros(len(owned_values(v)))])
        whole = create_block_matrix(self._stiffness)
        add_blocks(whole, self._stiffness)
        whole.assemble()
        rows = PETSc.IS().createGeneral(whole.getOwnershipRange()[0] + self._unknown, comm=whole.comm)
        matrix = whole.createSubMatrix(rows, rows)
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        solver = PETSc.KSP().create(matrix.comm)
        solver.setOperators(matrix)
        solver.setType("preonly")
        solver.getPC().setType("cholesky")
        solver.getPC().setFactorSolverType("mumps")
        solution, load = matrix.createVecs()
        load.array_w[:] = right[self._unknown]
        solver.solve(load, solution)
        right[:] = 0.0
        right[self._unknown] = solution.array_r
        for part, values in zip(self._fields, np.split(right, [len(pull)]), strict=True):
            owned_values(part)[:] = values
            part.x.scatter_forward()
        for used in (solver, solution, load, matrix, rows, whole):
            used.destroy()
