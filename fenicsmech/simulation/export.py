"""States of a mechanism as an XDMF time series for ParaView."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh

from fenicsmech.collective import from_one, on_one
from fenicsmech.compat import cell_dofs, cell_nodes, cellwise_space, scalar_space, vector_space, write_series
from fenicsmech.errors import DescriptionError
from fenicsmech.model import MechanismModel
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.snapshot import at_vertices


def write_xdmf(path: str | Path, model: MechanismModel, frames: Sequence[Frame]) -> None:
    """Writes vertex displacements and von Mises stress of ``frames`` of one design; time is the force (collective).

    And pressures at vertices, where links have some of their own: zero in all other links. The files appear when they
    are complete.

    Raises:
        DescriptionError: the path does not end in .xdmf.
        OSError: nothing can be written there.
    """
    path = Path(path)
    if path.suffix != ".xdmf":
        raise DescriptionError(f"file {str(path)!r}", "only XDMF is written", "Give a name that ends in .xdmf")
    comm = model.mesh.mesh.comm
    displacement = fem.Function(vector_space(model.mesh.mesh, 1))
    stress = fem.Function(cellwise_space(model.mesh.mesh))
    fields = {"displacement": displacement, "von Mises stress": stress}
    nodal = {displacement: model.elastic.u}
    if model.elastic.pressure is not None:
        fields["pressure"] = fem.Function(scalar_space(model.mesh.mesh, 1))
        nodal[fields["pressure"]] = model.elastic.pressure.p

    def update(index: int) -> None:
        with model.shaped(frames[index].design):
            model.load(frames[index].state)
            for written, field in nodal.items():
                vertices = at_vertices(model, field)
                values = written.x.array.reshape(-1, vertices.shape[1])
                values[cell_dofs(written.function_space)] = vertices[cell_nodes(model.mesh.mesh)]
            von_mises = model.elastic.von_mises()
            stress.x.array[: len(von_mises)] = von_mises

    folder = from_one(comm, lambda: _folder_beside(path))
    forces = np.array([frame.force for frame in frames])
    with _mesh_of(model, frames[0].design) as mesh:
        write_series(folder / path.name, mesh, fields, forces, update, comm)
    comm.barrier()  # all have closed the file
    on_one(comm, lambda: _move_up(folder, path))


def _folder_beside(path: Path) -> Path:
    """A new folder next to ``path``."""
    path.parent.mkdir(parents=True, exist_ok=True)
    return Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.stem}-"))


def _move_up(folder: Path, path: Path) -> None:
    """Both files out of ``folder``, the heavy data first: the light file that names it must never point at nothing."""
    for suffix in (".h5", ".xdmf"):
        os.replace(folder / path.with_suffix(suffix).name, path.with_suffix(suffix))
    folder.rmdir()


@contextmanager
def _mesh_of(model: MechanismModel, design: np.ndarray) -> Iterator[dmesh.Mesh]:
    """The mesh with its nodes where ``design`` puts them: files show the links at rest."""
    mesh, drawn = model.mesh.mesh, model.mesh.mesh.geometry.x.copy()
    with model.shaped(design):
        mesh.geometry.x[:, : model.elastic.model.dim] += at_vertices(model, model.elastic.d)
    try:
        yield mesh
    finally:
        mesh.geometry.x[:] = drawn
