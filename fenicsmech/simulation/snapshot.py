"""A state on one process: vertex displacements and cell stresses of the whole mesh, gathered for pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.compat import cell_nodes, original_cells, original_nodes
from fenicsmech.equilibrium import State
from fenicsmech.simulation.model import MechanismModel


@dataclass(frozen=True)
class Snapshot:
    """Fields of one state on the whole mesh, and the poses of all bodies.

    Attributes:
        displacement: of the mesh's vertices, (vertices, dim).
        von_mises: at the midpoints of the mesh's cells, (cells,).
        poses: (bodies, pose_size).
    """

    displacement: np.ndarray
    von_mises: np.ndarray
    poses: np.ndarray


def vertex_displacements(model: MechanismModel) -> np.ndarray:
    """Displacement of this rank's geometry nodes in the loaded state, (nodes, dim)."""
    mesh, u = model.mesh.mesh, model.elastic.u
    dim = model.linkage.dim
    values = u.x.array.reshape(-1, dim)
    displacement = np.zeros((len(mesh.geometry.x), dim))
    for nodes, cell in zip(cell_nodes(mesh), range(len(model.mesh.link)), strict=False):
        # the first DOFs of a Lagrange cell are its vertices, in the order of the geometry
        displacement[nodes] = values[u.function_space.dofmap.cell_dofs(cell)[: dim + 1]]
    return displacement


def gather(model: MechanismModel, state: State) -> Snapshot | None:
    """The snapshot of ``state``, on rank 0; None elsewhere (collective)."""
    mesh = model.mesh
    model.load(state)
    own = mesh.mesh.topology.index_map(mesh.mesh.topology.dim).size_local
    parts = mesh.mesh.comm.gather(
        (
            original_nodes(mesh.mesh),
            vertex_displacements(model),
            original_cells(mesh.mesh)[:own],
            model.elastic.von_mises()[:own],
        ),
        root=0,
    )
    if parts is None:
        return None
    displacement, stress = np.zeros_like(mesh.vertices), np.zeros(len(mesh.cells))
    for nodes, u, cells, values in parts:
        displacement[nodes] = u
        stress[cells] = values
    return Snapshot(displacement, stress, state.poses)
