"""Fields of frames: gathered on one process and drawn in plan view, or written as an XDMF time series for ParaView."""

from __future__ import annotations

import math
import os
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from dolfinx import fem

from fenicsmech.collective import from_one, gathered, on_all, on_one
from fenicsmech.compat import (
    cell_dofs,
    cell_nodes,
    lagrange_values,
    original_cells,
    original_nodes,
    scalar_space,
    tensor_space,
    vector_space,
    write_series,
)
from fenicsmech.errors import DescriptionError, with_error
from fenicsmech.mechanism import Force, Link, Output
from fenicsmech.meshing import CurvedEdges, node_ends
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import Linkage
from fenicsmech.plot import (
    FlexibleShape,
    MechanismShape,
    PeakMark,
    Pin,
    RigidShape,
    outer_faces,
    plan_view,
    rigid_outline,
)
from fenicsmech.polygons import divided_triangle
from fenicsmech.simulation.frame import Frame
from fenicsmech.stress import Safety, StressPeak, StressRecovery

_PARTS = 4  # of each side of a cell's face in a picture: bending varies within cells
_MOST = 40_000  # small triangles of a link


@dataclass(frozen=True)
class Snapshot:
    """Fields of one frame on the whole mesh, and the poses of all bodies.

    Attributes:
        rest: vertices of the unloaded links, (vertices, dim).
        displacement: from there, (vertices, dim).
        drawn: vertices of the reference mesh, (vertices, dim).
        cells: vertices of each cell, in the order of its nodes, (cells, dim + 1).
        shape, u: at the nodes of each cell, from the reference mesh to rest and from there, (cells, nodes, dim).
        poses: (bodies, pose_size).
        joints: points of each connection on both of its bodies, in the plane, (connections, 2, 2).
    """

    rest: np.ndarray
    displacement: np.ndarray
    drawn: np.ndarray
    cells: np.ndarray
    shape: np.ndarray
    u: np.ndarray
    poses: np.ndarray
    joints: np.ndarray

    def places(self, cells: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points of cells (k,) with barycentric coordinates (k, p, dim + 1), at rest and moved, (k, p, dim) each."""
        flat = corners.reshape(-1, corners.shape[2])[:, 1:]
        shape, u = (
            lagrange_values(flat, nodal.shape[1]).reshape(*corners.shape[:2], -1) @ nodal[cells]
            for nodal in (self.shape, self.u)
        )
        rest = corners @ self.drawn[self.cells[cells]] + shape
        return rest, rest + u


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


def rest_vertices(model: MechanismModel) -> np.ndarray | None:
    """Vertices of the present rest shape on rank 0, (vertices, dim); None elsewhere."""
    mesh, drawn = model.mesh.mesh, model.mesh.vertices
    # which bulges do not move
    design = gathered(mesh.comm, original_nodes(mesh), at_vertices(model, model.elastic.shape), len(drawn))
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
    mesh, elastic, drawn = model.mesh.mesh, model.elastic, model.mesh.vertices
    own = mesh.topology.index_map(mesh.topology.dim).size_local

    def of_cells(values: np.ndarray) -> np.ndarray | None:
        return gathered(mesh.comm, original_cells(mesh)[:own], values[:own], len(model.mesh.cells))

    def at_nodes(field: fem.Function) -> np.ndarray | None:
        return of_cells(field.x.array.reshape(-1, elastic.model.dim)[cell_dofs(field.function_space)])

    with model.shaped(frame.design):
        model.load(frame.state)
        displacement = gathered(mesh.comm, original_nodes(mesh), at_vertices(model, elastic.u), len(drawn))
        rest, joints = rest_vertices(model), joint_points(model.linkage, frame.state.poses)
        cells = of_cells(original_nodes(mesh)[cell_nodes(mesh)])
        shape, u = at_nodes(elastic.shape), at_nodes(elastic.u)
    if rest is None or displacement is None or cells is None or shape is None or u is None:
        return None
    return Snapshot(rest, displacement, drawn, cells, shape, u, frame.state.poses, joints)


def position(model: MechanismModel, part: Force | Output, frame: Frame) -> np.ndarray:
    """Position of the point of a force or output in ``frame``, (dim,)."""
    with model.shaped(frame.design):
        model.load(frame.state)
        return model.position(part, frame.state)


@dataclass(frozen=True, eq=False)
class SurfaceTriangles:
    """Faces of cells in small triangles: what is seen of a link from above, or the whole surface of all links.

    Attributes:
        cells: of each face, (k,).
        corners: barycentric coordinates of points in these, (k, p, dim + 1).
        numbers: of the points, the same where faces share one, (k, p).
        triangles: of points of all faces, (m, 3), below k p.
    """

    cells: np.ndarray
    corners: np.ndarray
    numbers: np.ndarray
    triangles: np.ndarray

    @classmethod
    def of(cls, faces: np.ndarray, owners: np.ndarray, cells: np.ndarray, parts: int) -> SurfaceTriangles:
        """From the vertices of faces (k, 3), their cells (k,), and the vertices of all cells (cells, dim + 1)."""
        parts = max(1, min(parts, math.isqrt(_MOST // len(faces))))
        shares, small = divided_triangle(parts)
        # faces share points with equal shares of equal vertices
        keys = np.where(shares > 0, (parts + 1) * faces[:, None, :] + shares, -1)
        _, numbers = np.unique(np.sort(keys.reshape(-1, 3), axis=1), axis=0, return_inverse=True)
        corner_of = (cells[owners][:, None, :] == faces[:, :, None]).astype(float)  # (k, 3, dim + 1)
        triangles = (len(shares) * np.arange(len(faces))[:, None, None] + small).reshape(-1, 3)
        return cls(owners, (shares / parts) @ corner_of, numbers.reshape(len(faces), -1), triangles)


def outer_surface(model: MechanismModel, cells: np.ndarray, parts: int) -> SurfaceTriangles:
    """The surface of all flexible links in space, without the mid-plane where half is meshed.

    Args:
        model: of the mechanism.
        cells: vertices of each cell, (cells, 4).
        parts: of each side of a cell's face.
    """
    faces, owners = outer_faces(model.mesh.vertices, cells)
    if model.elastic.model.half:
        heights = np.abs(model.mesh.vertices[:, 2])
        kept = heights[faces].max(axis=1) > 1e-9 * heights.max()
        faces, owners = faces[kept], owners[kept]
    return SurfaceTriangles.of(faces, owners, cells, parts)


class MechanismPlotter:
    """Draws states of one mechanism in plan view; the triangles are those of the undeformed mesh.

    Args:
        model: of the mechanism.
        parts: of each side of a cell's face.

    Attributes:
        width: of rigid links.
    """

    def __init__(self, model: MechanismModel, *, parts: int = _PARTS) -> None:
        self._mechanism, self._linkage, self._mesh = model.mechanism, model.linkage, model.mesh
        self.width, self._parts = 0.03 * model.linkage.length, parts
        self._faces: list[SurfaceTriangles] = []

    def faces(self, snapshot: Snapshot) -> list[SurfaceTriangles]:
        """What is seen of each flexible link."""
        if not self._faces:
            indices = range(len(self._mechanism.flexible_links))
            self._faces = [
                SurfaceTriangles.of(*self._visible(snapshot, index), snapshot.cells, self._parts) for index in indices
            ]
        return self._faces

    def places(self, snapshot: Snapshot) -> tuple[np.ndarray, np.ndarray]:
        """Where ``shape`` needs stresses: cells (k,), and barycentric coordinates in these, (k, p, dim + 1).

        Links of smaller triangles have the last of their points several times.
        """
        faces = self.faces(snapshot)
        most = max(own.corners.shape[1] for own in faces)
        corners = [np.pad(own.corners, ((0, 0), (0, most - own.corners.shape[1]), (0, 0)), "edge") for own in faces]
        return np.concatenate([own.cells for own in faces]), np.concatenate(corners)

    def shape(self, snapshot: Snapshot, stress: np.ndarray | None = None) -> MechanismShape:
        """The mechanism in the state of ``snapshot``, links coloured by ``stress`` at ``places``, (k, p), if given."""
        flexible, start = [], 0
        for own, link in zip(self.faces(snapshot), self._mechanism.flexible_links, strict=True):
            moved, values = snapshot.places(own.cells, own.corners)[1][..., :2].reshape(-1, 2), None
            points = np.zeros((own.numbers.max() + 1, 2))
            points[own.numbers.ravel()] = moved
            if stress is not None:
                held = stress[start : start + len(own.cells), : own.corners.shape[1]]
                values = held.ravel()[own.triangles]
            start += len(own.cells)
            flexible.append(FlexibleShape(points, own.numbers.ravel()[own.triangles], values, name=link.name))
        pins = tuple(
            Pin(points[0], welded=each.kind.clamps)
            for each, points in zip(self._linkage.joints.connections, snapshot.joints, strict=True)
        )
        return MechanismShape(tuple(flexible), self.rigid(snapshot.poses, snapshot.joints), pins)

    def rigid(self, poses: np.ndarray, joints: np.ndarray) -> tuple[RigidShape, ...]:
        """The rigid links at ``poses`` (bodies, pose_size), with the points of ``joints`` there."""
        return tuple(
            RigidShape(rigid_outline(self._places(link, poses, joints), self.width), link.name, link.fixed)
            for link in self._mechanism.rigid_links
        )

    def rigid_points(self, snapshot: Snapshot) -> list[np.ndarray]:
        """Positions of the joints, forces and outputs of each rigid link in a snapshot, (k, 2)."""
        return [self._places(link, snapshot.poses, snapshot.joints) for link in self._mechanism.rigid_links]

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

    def _visible(self, snapshot: Snapshot, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Vertices of the faces of a link seen from above, (k, 3), and the cell each belongs to, (k,)."""
        cells = np.flatnonzero(self._mesh.link_of_cell == index)
        if snapshot.drawn.shape[1] == 2:
            return snapshot.cells[cells], cells
        triangles, owners = plan_view(snapshot.drawn, snapshot.cells[cells])
        return triangles, cells[owners]


def peak_mark(
    snapshot: Snapshot, stresses: StressRecovery, peak: StressPeak, safety: Safety | None, unit: str
) -> PeakMark:
    """The peak in the picture of a state, with its link's factor of safety if known. Local, on the first process."""
    surface = stresses.surface
    assert surface is not None, "on the first process"
    links, cells, corners = surface.points
    own = links == list(stresses.materials).index(peak.link)
    rest, moved = snapshot.places(cells[own], corners[own])
    place = np.array(peak.place)
    place[2:] = np.abs(place[2:])  # where half is meshed, it is the upper one
    offsets = rest[:, 0] - (place if surface.mirrored else np.array(peak.place))
    at = moved[np.argmin(np.linalg.norm(offsets, axis=1)), 0, :2]
    lines = [f"{with_error(peak.value, peak.error)} {unit}", peak.link]
    lines += [f"safety {own.factor:.3g}" for own in (safety.links if safety else ()) if own.link == peak.link]
    return PeakMark(at, peak.value, "\n".join(lines))


def write_xdmf(path: str | Path, model: MechanismModel, frames: Sequence[Frame]) -> None:
    """Writes displacements, recovered stresses and strains, and pressures of ``frames`` of one design, at vertices.

    Time is the force. Pressures are written where links are in u–p form, with zero in all others. The files appear when
    they are complete.
    """
    target = Path(path)
    if target.suffix != ".xdmf":
        raise DescriptionError(f"file {str(path)!r}", "only XDMF is written", "Give a name that ends in .xdmf")
    elastic, mesh, comm = model.elastic, model.mesh.mesh, model.mesh.mesh.comm
    nodal = {"displacement": fem.Function(vector_space(mesh, 1))}
    if elastic.pressure is not None:
        nodal["pressure"] = fem.Function(scalar_space(mesh, 1))
    recovered = {
        "von Mises stress": fem.Function(scalar_space(mesh, 1)),
        "largest principal strain": fem.Function(scalar_space(mesh, 1)),
        "stress": fem.Function(tensor_space(mesh, 1, 3)),
        "strain": fem.Function(tensor_space(mesh, 1)),
    }

    def take(written: fem.Function, vertices: np.ndarray) -> None:
        """Takes values at this rank's geometry nodes, (nodes, components)."""
        values = written.x.array.reshape(-1, vertices.shape[1])
        values[cell_dofs(written.function_space)] = vertices[cell_nodes(mesh)]

    def update(index: int) -> None:
        frame = frames[index]
        with model.shaped(frame.design):
            model.load(frame.state)
            for written, field in zip(nodal.values(), elastic.fields, strict=True):
                take(written, at_vertices(model, field))
        found = frame.stresses.field(frame.state, frame.design)
        own = None if found is None else (found.von_mises, found.principal_strain, found.stress, found.strain)
        for written, values in zip(recovered.values(), comm.bcast(own, root=0), strict=True):
            take(written, values.reshape(len(values), -1)[original_nodes(mesh)])

    def new_folder() -> Path:
        target.parent.mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.stem}-"))

    def move_up() -> None:
        """Moves the heavy data first, so that the light file never refers to a missing file."""
        for suffix in (".h5", ".xdmf"):
            os.replace(folder / target.with_suffix(suffix).name, target.with_suffix(suffix))

    # dolfinx keeps one field for each time
    forces = np.array([frame.force for frame in frames])
    times = forces if len(np.unique(forces)) == len(forces) else np.arange(float(len(forces)))
    x, drawn = mesh.geometry.x, mesh.geometry.x.copy()
    with model.shaped(frames[0].design):
        rest = at_vertices(model, elastic.shape)
    folder = from_one(comm, new_folder)
    # only here the coordinates of a mesh change: dolfinx writes functions with their own mesh
    try:
        x[:, : elastic.model.dim] += rest
        series = {**nodal, **recovered}
        on_all(comm, lambda: write_series(folder / target.name, mesh, series, times, update, comm))
        on_one(comm, move_up)  # all have closed the file
    finally:
        x[:] = drawn
        if comm.rank == 0:
            shutil.rmtree(folder, ignore_errors=True)
