"""The calls of dolfinx and PETSc that differ between versions (dolfinx 0.5.2, 0.9 and 0.11) or are missing from Python.

Forms are compiled into a cache on disk. FFCx marks a form as being compiled by its C file, and other processes wait
until it is finished. A process killed while compiling leaves an unfinished file, for which later ones would wait
indefinitely. Processes therefore compile under a shared lock on the folder; one that gets the exclusive lock removes
unfinished files.
"""

from __future__ import annotations

import ctypes
import fcntl
import hashlib
import logging
import math
import os
import platform
import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path

import basix
import dolfinx
import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem, io
from dolfinx import mesh as dmesh
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from fenicsmech.log import logger

_log = logger(__name__)

DOLFINX = dolfinx.__version__
"""The version of dolfinx."""

_VERSION = tuple(int(part) for part in DOLFINX.split(".")[:2])
_LEGACY = _VERSION < (0, 6)

if not _LEGACY:
    import basix.ufl

_KEPT = MPI.Comm.Create_keyval()  # marks communicators whose duplicate is kept

_ADD = (dolfinx.la.ScatterMode if _LEGACY else dolfinx.la.InsertMode).add

# Strict IEEE arithmetic (no -ffast-math, no fused products): energies rely on cancellation-free forms and on NaN where
# J ≤ 0. Code of FFCx, thousands of scalars in one block, gains nothing from -O2 or -O3, which compile for twice as
# long; most of that goes into the choice of registers, hence the limit.
_FLAGS = (
    "-O1 -march=native -ffp-contract=off -fno-math-errno -fno-trapping-math -g0 "
    "--param=lra-max-considered-reload-pseudos=10"
)


def _processor() -> str:
    """A short name for this processor's instruction set; kernels run only on the one they were compiled for."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        text = platform.processor()
    flags = next((line for line in text.splitlines() if line.startswith(("flags", "Features"))), text)
    return hashlib.sha256(flags.encode()).hexdigest()[:12]


_KERNELS = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "fenicsmech" / "kernels" / _processor()


def _options() -> dict:
    """FFCx's options, a new dictionary."""
    return {"cffi_extra_compile_args": _FLAGS.split(), "cache_dir": _KERNELS, "timeout": 300}


@contextmanager
def compiling(folder: Path = _KERNELS) -> Iterator[None]:
    """A context for code that may compile into ``folder``; the build tools' commands on the root logger are muted."""
    _remove_unfinished(folder)
    muted = logging.root.manager.disable  # by the application
    logging.disable(max(muted, logging.INFO))
    try:
        with _lock(folder, fcntl.LOCK_SH):
            yield
    finally:
        logging.disable(muted)


@contextmanager
def _lock(folder: Path, how: int) -> Iterator[bool]:
    """A context that holds the lock; yields False without it: some network and read-only file systems have none."""
    with ExitStack() as stack:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            fcntl.flock(stack.enter_context(open(folder / "lock", "w")), how)
            locked = True
        except OSError:
            locked = False
        yield locked


@cache
def _remove_unfinished(folder: Path) -> None:
    """Removes unfinished C files, once per process and unless another process compiles."""
    with _lock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB) as alone:
        for source in folder.glob("libffcx_*.c") if alone else ():
            if not source.with_suffix(".c.cached").exists():
                _log.warning("%s was left unfinished by a process that was stopped; it is compiled again", source.name)
                source.unlink(missing_ok=True)


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


def global_dofs(space: fem.FunctionSpace) -> np.ndarray:
    """Numbers over all ranks of this rank's nodes of a space, ghosts last."""
    index = space.dofmap.index_map
    return index.local_to_global(np.arange(index.size_local + index.num_ghosts, dtype=np.int32)).astype(np.int64)


def interpolation_matrix(coarse: fem.FunctionSpace, fine: fem.FunctionSpace) -> csr_matrix:
    """Interpolation: this rank's owned DOFs of ``fine`` by all DOFs of ``coarse``, numbered over all ranks."""
    matrix = dolfinx.cpp.fem.petsc.interpolation_matrix(coarse._cpp_object, fine._cpp_object)
    matrix.assemble()
    starts, columns, values = matrix.getValuesCSR()
    shape = matrix.getLocalSize()[0], matrix.getSize()[1]
    matrix.destroy()  # objects on the communicator of a mesh are not collected
    values[np.abs(values) < 1e-12] = 0.0  # rounding
    found = csr_matrix((values, columns, starts), shape=shape)
    found.eliminate_zeros()
    return found


def scalar_space(mesh: dmesh.Mesh, degree: int) -> fem.FunctionSpace:
    """Continuous scalar fields of ``degree``."""
    return _space(mesh, "Lagrange", degree)


def vector_space(mesh: dmesh.Mesh, degree: int) -> fem.FunctionSpace:
    """Continuous vector fields of ``degree``."""
    return _space(mesh, "Lagrange", degree, rank=1)


def tensor_space(mesh: dmesh.Mesh, degree: int, size: int | None = None) -> fem.FunctionSpace:
    """Continuous fields of square tensors, of ``degree``; of the mesh's dimension unless a ``size`` is given."""
    return _space(mesh, "Lagrange", degree, rank=2, size=size)


def cellwise_space(mesh: dmesh.Mesh, degree: int = 0) -> fem.FunctionSpace:
    """Scalars that are polynomials of ``degree`` on each cell."""
    return _space(mesh, "DG", degree)


def quadrature_space(mesh: dmesh.Mesh, degree: int, size: int) -> fem.FunctionSpace:
    """Vectors of ``size`` at the points of the quadrature of ``degree``, in their order."""
    with compiling():
        if _LEGACY:
            element = ufl.VectorElement("Quadrature", mesh.ufl_cell(), degree, dim=size, quad_scheme="default")
            return fem.FunctionSpace(mesh, element, jit_params=_options())
        element = basix.ufl.quadrature_element(mesh.basix_cell(), value_shape=(size,), degree=degree)
        options = {"jit_options": _options()} if _VERSION < (0, 10) else {}
        return fem.functionspace(mesh, element, **options)


def lagrange_element(dim: int, nodes: int):
    """Basix's element of the scalar Lagrange fields with as many ``nodes`` in a cell, C(degree + dim, dim)."""
    kind = {2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}[dim]
    degree = {math.comb(degree + dim, dim): degree for degree in range(1, 5)}[nodes]
    return basix.create_element(basix.ElementFamily.P, kind, degree, basix.LagrangeVariant.gll_warped)


def lagrange_values(points: np.ndarray, nodes: int) -> np.ndarray:
    """Values of its basis at ``points`` of the reference cell (n, dim), (n, nodes)."""
    return lagrange_element(points.shape[1], nodes).tabulate(0, points)[0, ..., 0]


def _space(mesh: dmesh.Mesh, family: str, degree: int, *, rank: int = 0, size: int | None = None) -> fem.FunctionSpace:
    own = size or mesh.geometry.dim
    with compiling():
        if _LEGACY:
            element = (ufl.FiniteElement, ufl.VectorElement, ufl.TensorElement)[rank]
            sizes = ({}, {"dim": own}, {"shape": (own, own)})[rank]
            kind = element(family, mesh.ufl_cell(), degree, **sizes)
            return fem.FunctionSpace(mesh, kind, jit_params=_options())
        options = {"jit_options": _options()} if _VERSION < (0, 10) else {}
        shape = ((own,) * rank,) if rank else ()
        return fem.functionspace(mesh, (family, degree, *shape), **options)


def compile_form(form: ufl.Form):
    """``form`` compiled to machine code (cached on disk)."""
    with compiling():
        return fem.form(form, jit_params=_options()) if _LEGACY else fem.form(form, jit_options=_options())


def interpolation_points(V: fem.FunctionSpace) -> np.ndarray:
    """Points of the reference cell whose values make a function of ``V``, (points, dim)."""
    points = V.element.interpolation_points
    return points() if _VERSION < (0, 10) else points


def compile_expression(expression, points: np.ndarray, comm: MPI.Comm) -> fem.Expression:
    """``expression`` compiled for evaluation at ``points`` of the reference cell."""
    with compiling():
        if _LEGACY:
            return fem.Expression(expression, points, jit_params=_options())
        return fem.Expression(expression, points, comm=comm, jit_options=_options())


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
    """A compiled linear form, this rank's owned values, flat; a view of ``work``, on the space of the test function."""
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


# petsc4py exposes the values of neither format, so functions of PETSc's library, to which it is linked, are called
_LIBRARY = ctypes.CDLL(PETSc.__file__)


def stored_values(matrix: PETSc.Mat) -> list[np.ndarray]:
    """This rank's values in an AIJ or BAIJ matrix as views: those in its own columns and in those of other ranks."""
    kind = matrix.getType().removeprefix("seq").removeprefix("mpi").upper()
    pointer = ctypes.c_void_p
    parts = [pointer(matrix.handle)]
    if matrix.comm.size > 1:
        parts = [pointer(), pointer()]
        # column numbers are not needed
        _call_petsc(f"MatMPI{kind}GetSeq{kind}", pointer(matrix.handle), *map(ctypes.byref, parts), None)
    found = []
    for part in parts:
        # MatInfo is ten doubles, nz_used the third; 1 is MAT_LOCAL
        info, values = (ctypes.c_double * 10)(), ctypes.POINTER(ctypes.c_double)()
        _call_petsc("MatGetInfo", part, ctypes.c_int(1), info)
        _call_petsc(f"MatSeq{kind}GetArray", part, ctypes.byref(values))
        count = int(info[2])
        found.append(np.ctypeslib.as_array(values, (count,)) if count else np.empty(0))
    return found


def _call_petsc(name: str, *arguments) -> None:
    if code := getattr(_LIBRARY, name)(*arguments):
        raise RuntimeError(f"{name} of PETSc failed with code {code}")


def destroy_garbage(comm: MPI.Comm) -> None:
    """Destroys the PETSc objects on ``comm`` that no Python object refers to any more.

    petsc4py only queues them (3.18 on one process too), because processes may drop them in different orders. Meshes
    have communicators of their own, and objects queued there when a mesh is deleted are lost: matrices, vectors and
    solvers belong on the communicator that the mesh was made with.

    Call it before the first such object is made. PETSc works on a duplicate of ``comm``, which it makes collectively if
    there is none and frees with the last object on it. Processes drop that object at different times, or never where a
    traceback holds it; one would then make a duplicate while another does not. So the first duplicate is kept, even
    when Python ends: PetscFinalize destroys garbage where a process has a duplicate of the world, and would wait for a
    process that has none.
    """
    if comm.Get_attr(_KEPT) is None:
        comm.Set_attr(_KEPT, True)
        duplicate = PETSc.Comm(comm).duplicate()
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(duplicate))  # never deleted; PetscFinalize frees that of the world
    PETSc.garbage_cleanup(comm)


def ignore_broken_pipes() -> None:
    """Undoes what PETSc does with SIGPIPE, which writing to a process or a page that has just gone raises.

    PETSc ends the program there, and crashes while it reports that. Python ignores the signal and raises
    ``BrokenPipeError``. Without effect outside the main thread.
    """
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)


def write_series(path, mesh: dmesh.Mesh, functions: Mapping[str, fem.Function], steps, update, comm: MPI.Comm) -> None:
    """Writes an XDMF time series of named functions, P1 or cellwise, for ParaView.

    ``steps`` holds the time of each step. ``update`` sets the functions to a step; it is called with the index of each.
    """
    with io.XDMFFile(comm, str(path), "w") as file:
        file.write_mesh(mesh)
        for index, time in enumerate(steps):
            update(index)
            for name, function in functions.items():
                function.name = name
                file.write_function(function, float(time))
