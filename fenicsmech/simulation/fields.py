"""Fields of frames: gathered on one process for pictures, or written as an XDMF time series for ParaView."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from dolfinx import fem

from fenicsmech.collective import from_one, on_one
from fenicsmech.compat import (
    cell_dofs,
    cell_nodes,
    cellwise_space,
    original_cells,
    original_nodes,
    scalar_space,
    vector_space,
    write_series,
)
from fenicsmech.errors import DescriptionError
from fenicsmech.model import MechanismModel
from fenicsmech.simulation.frame import Frame


@dataclass(frozen=True)
class Snapshot:
    """Fields of one frame on the whole mesh, and the poses of all bodies.

    Attributes:
        rest: vertices of the unloaded links, (vertices, dim).
        displacement: from there, (vertices, dim).
        von_mises: at the midpoints of the mesh's cells, (cells,).
        poses: (bodies, pose_size).
    """

    rest: np.ndarray
    displacement: np.ndarray
    von_mises: np.ndarray
    poses: np.ndarray


def at_vertices(model: MechanismModel, field: fem.Function) -> np.ndarray:
    """Values of a Lagrange field (d, u or p) at this rank's geometry nodes, (nodes, components)."""
    mesh, dim, components = model.mesh.mesh, model.elastic.model.dim, field.function_space.dofmap.index_map_bs
    values = field.x.array.reshape(-1, components)
    vertices = np.zeros((len(mesh.geometry.x), components))
    # the first DOFs of a Lagrange cell are its vertices, in the order of the geometry
    vertices[cell_nodes(mesh)] = values[cell_dofs(field.function_space)[:, : dim + 1]]
    return vertices


def rest_vertices(model: MechanismModel) -> np.ndarray | None:
    """Vertices of the present rest shape on rank 0, (vertices, dim); None elsewhere."""
    mesh = model.mesh
    parts = mesh.mesh.comm.gather((original_nodes(mesh.mesh), at_vertices(model, model.elastic.d)), root=0)
    if parts is None:
        return None
    rest = mesh.vertices.copy()
    for nodes, design in parts:
        rest[nodes] = mesh.vertices[nodes] + design
    return rest


def gather(model: MechanismModel, frame: Frame) -> Snapshot | None:
    """The snapshot of ``frame``, on rank 0; None elsewhere."""
    mesh = model.mesh
    own = mesh.mesh.topology.index_map(mesh.mesh.topology.dim).size_local
    with model.shaped(frame.design):
        model.load(frame.state)
        rest = rest_vertices(model)
        parts = mesh.mesh.comm.gather(
            (
                original_nodes(mesh.mesh),
                at_vertices(model, model.elastic.u),
                original_cells(mesh.mesh)[:own],
                model.elastic.von_mises()[:own],
            ),
            root=0,
        )
    if parts is None or rest is None:
        return None
    displacement, stress = np.zeros_like(mesh.vertices), np.zeros(len(mesh.cells))
    for nodes, u, cells, values in parts:
        displacement[nodes] = u
        stress[cells] = values
    return Snapshot(rest, displacement, stress, frame.state.poses)


def write_xdmf(path: str | Path, model: MechanismModel, frames: Sequence[Frame]) -> None:
    """Writes vertex displacements, von Mises stress and pressure of ``frames`` of one design; time is the force.

    There are pressures where elements are mixed, zero in all other links. The files appear when they are complete.

    Raises:
        DescriptionError: the path does not end in .xdmf.
        OSError: nothing can be written there.
    """
    target = Path(path)
    if target.suffix != ".xdmf":
        raise DescriptionError(f"file {str(path)!r}", "only XDMF is written", "Give a name that ends in .xdmf")
    elastic, mesh, comm = model.elastic, model.mesh.mesh, model.mesh.mesh.comm
    stress, nodal = fem.Function(cellwise_space(mesh)), {"displacement": fem.Function(vector_space(mesh, 1))}
    if elastic.pressure is not None:
        nodal["pressure"] = fem.Function(scalar_space(mesh, 1))

    def update(index: int) -> None:
        with model.shaped(frames[index].design):
            model.load(frames[index].state)
            for written, field in zip(nodal.values(), elastic.fields, strict=True):
                vertices = at_vertices(model, field)
                values = written.x.array.reshape(-1, vertices.shape[1])
                values[cell_dofs(written.function_space)] = vertices[cell_nodes(mesh)]
            von_mises = elastic.von_mises()
            stress.x.array[: len(von_mises)] = von_mises

    def move_up() -> None:
        """Moves the heavy data first, so that the light file never refers to a missing file."""
        for suffix in (".h5", ".xdmf"):
            os.replace(folder / target.with_suffix(suffix).name, target.with_suffix(suffix))
        folder.rmdir()

    folder = from_one(comm, lambda: _folder_beside(target))
    forces = np.array([frame.force for frame in frames])
    with _at_rest(model, frames[0].design):
        write_series(folder / target.name, mesh, {**nodal, "von Mises stress": stress}, forces, update, comm)
    comm.barrier()  # all have closed the file
    on_one(comm, move_up)


def _folder_beside(path: Path) -> Path:
    """A new folder next to ``path``."""
    path.parent.mkdir(parents=True, exist_ok=True)
    return Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.stem}-"))


@contextmanager
def _at_rest(model: MechanismModel, design: np.ndarray) -> Iterator[None]:
    """A context in which the mesh has the rest shape of ``design``, as in files.

    The only place where the coordinates of a ``MechanismMesh`` change: dolfinx writes functions with their own mesh.
    """
    x = model.mesh.mesh.geometry.x
    drawn = x.copy()
    with model.shaped(design):
        x[:, : model.elastic.model.dim] += at_vertices(model, model.elastic.d)
    try:
        yield
    finally:
        x[:] = drawn
