"""Fields of frames: gathered on one process and drawn in plan view, or written as an XDMF time series for ParaView."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.collective import from_one, on_all, on_one
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
from fenicsmech.mechanism import Force, Link, Output
from fenicsmech.meshing import CurvedEdges, node_ends
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import Linkage
from fenicsmech.plot import FlexibleShape, MechanismShape, Pin, RigidShape, plan_view, rigid_outline
from fenicsmech.simulation.frame import Frame


@dataclass(frozen=True)
class Snapshot:
    """Fields of one frame on the whole mesh, and the poses of all bodies.

    Attributes:
        rest: vertices of the unloaded links, (vertices, dim).
        displacement: from there, (vertices, dim).
        von_mises: at the midpoints of the mesh's cells, (cells,).
        poses: (bodies, pose_size).
        joints: points of each connection on both of its bodies, in the plane, (connections, 2, 2).
    """

    rest: np.ndarray
    displacement: np.ndarray
    von_mises: np.ndarray
    poses: np.ndarray
    joints: np.ndarray


def joint_points(linkage: Linkage, poses: np.ndarray) -> np.ndarray:
    """Points of each connection at ``poses`` on both of its bodies, in the plane, (connections, 2, 2)."""
    system = linkage.joints
    pairs = [[system.place(k, body, poses)[:2] for body in (c.a, c.b)] for k, c in enumerate(system.connections)]
    return np.array(pairs).reshape(-1, 2, 2)


def at_vertices(model: MechanismModel, field: fem.Function) -> np.ndarray:
    """Values of a Lagrange field (d, u or p) at this rank's geometry nodes, (nodes, components)."""
    mesh, dim, components = model.mesh.mesh, model.elastic.model.dim, field.function_space.dofmap.index_map_bs
    values = field.x.array.reshape(-1, components)
    vertices = np.zeros((len(mesh.geometry.x), components))
    # the first DOFs of a Lagrange cell are its vertices, in the order of the geometry
    vertices[cell_nodes(mesh)] = values[cell_dofs(field.function_space)[:, : dim + 1]]
    return vertices


def _gathered(comm: MPI.Comm, numbers: np.ndarray, values: np.ndarray, count: int) -> np.ndarray | None:
    """The values of all ``count`` vertices or cells on rank 0, from those of this rank with their numbers."""
    parts = comm.gather((numbers, values), root=0)
    if parts is None:
        return None
    whole = np.zeros((count, *values.shape[1:]))
    for places, part in parts:
        whole[places] = part
    return whole


def rest_vertices(model: MechanismModel) -> np.ndarray | None:
    """Vertices of the present rest shape on rank 0, (vertices, dim); None elsewhere."""
    mesh, drawn = model.mesh.mesh, model.mesh.vertices
    # which bulges do not move
    design = _gathered(mesh.comm, original_nodes(mesh), at_vertices(model, model.elastic.shape), len(drawn))
    return None if design is None else drawn + design


def rest_geometry(model: MechanismModel) -> tuple[np.ndarray, CurvedEdges] | None:
    """Vertices (vertices, dim) and curved edges of the present rest shape on rank 0; None elsewhere."""
    elastic, vertices = model.elastic, rest_vertices(model)
    ends, nodes = node_ends(elastic.shape.function_space), elastic.shape.x.array.reshape(-1, elastic.model.dim)
    between = ends[:, 0] != ends[:, 1]
    parts = model.mesh.comm.gather((ends[between], nodes[between]), root=0)
    if parts is None or vertices is None:
        return None
    ends, nodes = (np.concatenate(part) for part in zip(*parts, strict=True))
    return vertices, CurvedEdges.through(vertices, ends, model.mesh.vertices[ends].mean(axis=1) + nodes)


def gather(model: MechanismModel, frame: Frame) -> Snapshot | None:
    """The snapshot of ``frame``, on rank 0; None elsewhere."""
    mesh, elastic = model.mesh.mesh, model.elastic
    own = mesh.topology.index_map(mesh.topology.dim).size_local
    with model.shaped(frame.design):
        model.load(frame.state)
        u, stress = at_vertices(model, elastic.u), elastic.von_mises()[:own]
        rest, joints = rest_vertices(model), joint_points(model.linkage, frame.state.poses)
    displacement = _gathered(mesh.comm, original_nodes(mesh), u, len(model.mesh.vertices))
    von_mises = _gathered(mesh.comm, original_cells(mesh)[:own], stress, len(model.mesh.cells))
    if rest is None or displacement is None or von_mises is None:
        return None
    return Snapshot(rest, displacement, von_mises, frame.state.poses, joints)


def position(model: MechanismModel, part: Force | Output, frame: Frame) -> np.ndarray:
    """Position of the point of a force or output in ``frame``, (dim,)."""
    with model.shaped(frame.design):
        model.load(frame.state)
        return model.position(part, frame.state)


class MechanismPlotter:
    """Draws states of one mechanism in plan view; the triangles are those of the undeformed mesh."""

    def __init__(self, model: MechanismModel) -> None:
        self._mechanism, self._linkage, self._mesh = model.mechanism, model.linkage, model.mesh
        self._width = 0.03 * model.linkage.length
        self._faces = [self._visible(index) for index in range(len(model.mechanism.flexible_links))]

    def shape(self, snapshot: Snapshot, *, stress: bool) -> MechanismShape:
        """The mechanism in the state of ``snapshot``, links optionally coloured by von Mises stress."""
        positions = (snapshot.rest + snapshot.displacement)[:, :2]
        flexible = tuple(
            FlexibleShape(positions, triangles, snapshot.von_mises[cells] if stress else None, name=link.name)
            for (triangles, cells), link in zip(self._faces, self._mechanism.flexible_links, strict=True)
        )
        pins = tuple(
            Pin(points[0], welded=each.kind.clamps)
            for each, points in zip(self._linkage.joints.connections, snapshot.joints, strict=True)
        )
        return MechanismShape(flexible, self.rigid(snapshot.poses, snapshot.joints), pins)

    def rigid(self, poses: np.ndarray, joints: np.ndarray) -> tuple[RigidShape, ...]:
        """The rigid links at ``poses`` (bodies, pose_size), with the points of ``joints`` there."""
        return tuple(
            RigidShape(rigid_outline(self._places(link, poses, joints), self._width), link.name, link.fixed)
            for link in self._mechanism.rigid_links
        )

    def _places(self, link: Link, poses: np.ndarray, joints: np.ndarray) -> np.ndarray:
        """Positions of the joints, forces and outputs of a rigid link, (k, 2)."""
        body, connections = self._linkage.body_of(link), self._linkage.joints.connections
        held = [
            point
            for each, points in zip(connections, joints, strict=True)
            for own, point in zip((each.a, each.b), points, strict=True)
            if own == body
        ]
        parts = [part.at for part in (*self._mechanism.forces, *self._mechanism.outputs) if part.on == link]
        moved = [np.array(at[:2]) + self._linkage.point(link, at).displacement(None, poses)[:2] for at in parts]
        return np.array([*held, *moved])

    def _visible(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Triangles of a link seen from above, and the cell each belongs to."""
        cells = np.flatnonzero(self._mesh.link_of_cell == index)
        if self._mesh.vertices.shape[1] == 2:
            return self._mesh.cells[cells], cells
        triangles, owners = plan_view(self._mesh.vertices, self._mesh.cells[cells])
        return triangles, cells[owners]


def write_xdmf(path: str | Path, model: MechanismModel, frames: Sequence[Frame]) -> None:
    """Writes vertex displacements, von Mises stress and pressure of ``frames`` of one design; time is the force.

    Pressures are written where links are in u–p form, with zero in all others. The files appear when they are complete.
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

    def new_folder() -> Path:
        target.parent.mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.stem}-"))

    def move_up() -> None:
        """Moves the heavy data first, so that the light file never refers to a missing file."""
        for suffix in (".h5", ".xdmf"):
            os.replace(folder / target.with_suffix(suffix).name, target.with_suffix(suffix))

    forces = np.array([frame.force for frame in frames])
    x, drawn = mesh.geometry.x, mesh.geometry.x.copy()
    with model.shaped(frames[0].design):
        rest = at_vertices(model, elastic.shape)
    folder = from_one(comm, new_folder)
    # only here the coordinates of a mesh change: dolfinx writes functions with their own mesh
    try:
        x[:, : elastic.model.dim] += rest
        series = {**nodal, "von Mises stress": stress}
        on_all(comm, lambda: write_series(folder / target.name, mesh, series, forces, update, comm))
        on_one(comm, move_up)  # all have closed the file
    finally:
        x[:] = drawn
        if comm.rank == 0:
            shutil.rmtree(folder, ignore_errors=True)
