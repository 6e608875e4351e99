"""Differences between the supported versions of dolfinx (0.5.2, 0.9 and 0.11) and their companions."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from contextlib import contextmanager

import dolfinx
import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem, io
from dolfinx import mesh as dmesh
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from fenicsmech.kernel_cache import compiling, options

_VERSION = tuple(int(part) for part in dolfinx.__version__.split(".")[:2])
_LEGACY = _VERSION < (0, 6)


if not _LEGACY:
    import basix.ufl

# Marks communicators whose duplicate is kept in the list while the process lives. An attribute would hold the duplicate
# itself, but is deleted too late for PETSc to free it.
_KEPT = MPI.Comm.Create_keyval()
_DUPLICATES: list[PETSc.Comm] = []

_ADD = (dolfinx.la.ScatterMode if _LEGACY else dolfinx.la.InsertMode).add


@contextmanager
def _compiling():
    """A context for compiling forms, without the commands that its build tools log on the root logger."""
    logging.disable(logging.INFO)
    try:
        with compiling():
            yield
    finally:
        logging.disable(logging.NOTSET)


def create_mesh(comm: MPI.Comm, cells: np.ndarray, points: np.ndarray) -> dmesh.Mesh:
    """A distributed mesh of affine triangles or tetrahedra; only one rank need pass ``cells`` and ``points``."""
    dim = points.shape[1]
    shape = {2: "triangle", 3: "tetrahedron"}[dim]
    if _LEGACY:
        domain = ufl.Mesh(ufl.VectorElement("Lagrange", ufl.Cell(shape, geometric_dimension=dim), 1))
        partitioner = dolfinx.cpp.mesh.create_cell_partitioner()
        return dmesh.create_mesh(comm, cells, points, domain, dmesh.GhostMode.none, partitioner)
    # dolfinx 0.10 takes the largest number of cells at a facet
    facets = () if _VERSION < (0, 10) else (2,)
    partitioner = dmesh.create_cell_partitioner(dmesh.GhostMode.none, *facets)
    domain = ufl.Mesh(basix.ufl.element("Lagrange", shape, 1, shape=(dim,)))
    return dmesh.create_mesh(comm, cells, x=points, e=domain, partitioner=partitioner)


def original_cells(mesh: dmesh.Mesh) -> np.ndarray:
    """Position in the input of every cell on this rank, ghosts last."""
    return np.asarray(mesh.topology.original_cell_index)


def original_nodes(mesh: dmesh.Mesh) -> np.ndarray:
    """Position in the input of every geometry node on this rank."""
    return np.asarray(mesh.geometry.input_global_indices)


def cell_nodes(mesh: dmesh.Mesh) -> np.ndarray:
    """Local geometry nodes of every cell on this rank, (cells, vertices)."""
    if _LEGACY:
        return mesh.geometry.dofmap.array.reshape(-1, mesh.topology.dim + 1)
    return np.asarray(mesh.geometry.dofmap if _VERSION < (0, 10) else mesh.geometry.dofmaps[0])


def cell_dofs(space: fem.FunctionSpace) -> np.ndarray:
    """Local nodes of a space in every cell on this rank, in the reference cell's order, (cells, nodes per cell)."""
    dofmap = space.dofmap
    return dofmap.list.array.reshape(-1, dofmap.dof_layout.num_dofs) if _LEGACY else np.asarray(dofmap.list)


def interpolation_matrix(coarse: fem.FunctionSpace, fine: fem.FunctionSpace) -> csr_matrix:
    """Interpolation of functions on ``coarse`` by functions on ``fine``.

    Returns:
        This rank's owned DOFs of ``fine`` by all DOFs of ``coarse``, numbered over all ranks.
    """
    matrix = dolfinx.cpp.fem.petsc.interpolation_matrix(coarse._cpp_object, fine._cpp_object)
    matrix.assemble()
    starts, columns, values = matrix.getValuesCSR()
    shape = matrix.getLocalSize()[0], matrix.getSize()[1]
    matrix.destroy()  # objects on the communicator of a mesh are not collected
    values[np.abs(values) < 1e-12] = 0.0  # rounding
    found = csr_matrix((values, columns, starts), shape=shape)
    found.eliminate_zeros()
    return found


def vector_space(mesh: dmesh.Mesh, degree: int) -> fem.FunctionSpace:
    """Continuous vector fields of ``degree``."""
    if _LEGACY:
        return _space(mesh, ufl.VectorElement("Lagrange", mesh.ufl_cell(), degree))
    return _space(mesh, ("Lagrange", degree, (mesh.geometry.dim,)))


def scalar_space(mesh: dmesh.Mesh, degree: int) -> fem.FunctionSpace:
    """Continuous scalar fields of ``degree``."""
    return _space(mesh, ("Lagrange", degree))


def tensor_space(mesh: dmesh.Mesh, degree: int) -> fem.FunctionSpace:
    """Continuous fields of square tensors, of ``degree``."""
    if _LEGACY:
        return _space(mesh, ufl.TensorElement("Lagrange", mesh.ufl_cell(), degree))
    return _space(mesh, ("Lagrange", degree, (mesh.geometry.dim, mesh.geometry.dim)))


def cellwise_space(mesh: dmesh.Mesh) -> fem.FunctionSpace:
    """Scalars, one per cell."""
    return _space(mesh, ("DG", 0))


def _space(mesh: dmesh.Mesh, element) -> fem.FunctionSpace:
    with _compiling():
        if _LEGACY:
            return fem.FunctionSpace(mesh, element, jit_params=options())
        if _VERSION < (0, 10):
            return fem.functionspace(mesh, element, jit_options=options())
        return fem.functionspace(mesh, element)


def compile_form(form: ufl.Form):
    """``form`` compiled to machine code (cached on disk)."""
    with _compiling():
        return fem.form(form, jit_params=options()) if _LEGACY else fem.form(form, jit_options=options())


def interpolation_points(V: fem.FunctionSpace) -> np.ndarray:
    """Points of the reference cell whose values make a function of ``V``, (points, dim)."""
    points = V.element.interpolation_points
    return points() if _VERSION < (0, 10) else points


def compile_expression(expression, points: np.ndarray, comm: MPI.Comm) -> fem.Expression:
    """``expression`` compiled for evaluation at ``points`` of the reference cell."""
    with _compiling():
        if _LEGACY:
            return fem.Expression(expression, points, jit_params=options())
        return fem.Expression(expression, points, comm=comm, jit_options=options())


def evaluate_expression(expression: fem.Expression, mesh: dmesh.Mesh, cells: np.ndarray) -> np.ndarray:
    """Values of a compiled expression in ``cells``, (cells, points × components)."""
    if _LEGACY:
        return expression.eval(cells)
    values = expression.eval(mesh, cells)
    return values.reshape(len(cells), math.prod(values.shape[1:]))  # a rank may have no cells


def owned_values(function: fem.Function) -> np.ndarray:
    """This rank's owned values of a function, flat; a view."""
    dofmap = function.function_space.dofmap
    return function.x.array[: dofmap.index_map.size_local * dofmap.index_map_bs]


def add_ghosts(function: fem.Function) -> None:
    """Adds the ghost values of all ranks to their owners'."""
    function.x.scatter_reverse(_ADD)


def assemble_vector(form, work: fem.Function) -> np.ndarray:
    """A compiled linear form, this rank's owned values, flat.

    Args:
        form: the form.
        work: on the space of its test function; holds the result until it is used again.
    """
    work.x.array[:] = 0.0
    fem.assemble_vector(work.x.array, form)
    add_ghosts(work)
    return owned_values(work)


def assemble_matrix(form, comm: MPI.Comm) -> PETSc.Mat:
    """A compiled bilinear form as a new matrix, on ``comm`` as ``destroy_garbage`` requires."""
    own = fem.petsc.assemble_matrix(form)
    own.assemble()
    matrix = PETSc.Mat().createAIJ(own.getSizes(), csr=own.getValuesCSR(), bsize=own.getBlockSize(), comm=comm)
    matrix.setLGMap(*own.getLGMap())
    own.destroy()
    return matrix


def create_block_matrix(forms) -> PETSc.Mat:
    """An empty matrix for compiled bilinear ``forms``, a list of rows; per rank, the owned values of each space."""
    return fem.petsc.create_matrix_block(forms) if _VERSION < (0, 10) else fem.petsc.create_matrix(forms)


def add_blocks(matrix: PETSc.Mat, forms) -> None:
    """Adds ``forms`` into a matrix made by ``create_block_matrix``, which it leaves unassembled."""
    assemble = fem.petsc.assemble_matrix_block if _VERSION < (0, 10) else fem.petsc.assemble_matrix
    assemble(matrix, forms)


def destroy_garbage(comm: MPI.Comm) -> None:
    """Destroys the PETSc objects on ``comm`` that no Python object refers to any more.

    petsc4py only queues them (3.18 on one process too), because processes may drop them in different orders. Meshes
    have communicators of their own, and objects queued there when a mesh is deleted are lost: matrices, vectors and
    solvers belong on the communicator that the mesh was made with.

    Call it before the first such object is made. PETSc works on a duplicate of ``comm``, which it makes collectively if
    there is none and frees with the last object on it. Processes drop that object at different times, or never where a
    traceback holds it; one would then make a duplicate while another does not. So the first duplicate is kept.
    """
    if comm.Get_attr(_KEPT) is None:
        comm.Set_attr(_KEPT, True)
        _DUPLICATES.append(PETSc.Comm(comm).duplicate())
    PETSc.garbage_cleanup(comm)


def write_series(path, mesh: dmesh.Mesh, functions: Mapping[str, fem.Function], steps, update, comm: MPI.Comm) -> None:
    """Writes an XDMF time series for ParaView.

    Args:
        path: the .xdmf file.
        mesh: the mesh of all functions.
        functions: name → function, P1 or cellwise.
        steps: the time of each step.
        update: called with the step's index before it is written, sets the functions.
        comm: communicator of the mesh.
    """
    with io.XDMFFile(comm, str(path), "w") as file:
        file.write_mesh(mesh)
        for index, time in enumerate(steps):
            update(index)
            for name, function in functions.items():
                function.name = name
                file.write_function(function, float(time))
