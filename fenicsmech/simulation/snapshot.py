"""A frame on one process: vertices and cell stresses of the whole mesh, gathered for pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem

from fenicsmech.compat import cell_dofs, cell_nodes, original_cells, original_nodes
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
    """Vertices of the present rest shape on rank 0, (vertices, dim); None elsewhere (collective)."""
    mesh = model.mesh
    parts = mesh.mesh.comm.gather((original_nodes(mesh.mesh), at_vertices(model, model.elastic.d)), root=0)
    if parts is None:
        return None
    rest = mesh.vertices.copy()
    for nodes, design in parts:
        rest[nodes] = mesh.vertices[nodes] + design
    return rest


def gather(model: MechanismModel, frame: Frame) -> Snapshot | None:
    """The snapshot of ``frame``, on rank 0; None elsewhere (collective)."""
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
    if parts is None:
        return None
    displacement, stress = np.zeros_like(mesh.vertices), np.zeros(len(mesh.cells))
    for nodes, u, cells, values in parts:
        displacement[nodes] = u
        stress[cells] = values
    return Snapshot(rest, displacement, stress, frame.state.poses)
