"""The equilibrium of one simulation as a guess of that of another one of the same scene, such as 3D from plane stress.

Displacements of one mesh are read where the nodes of the other one are at rest, all through the depth of links where
that is another dimension:

    u(X, Y, Z) ≈ (u₁(X, Y), 0),     X = X₀ + c + d.

Points are compared at rest, not by reference coordinates X₀: on another mesh handles settle elsewhere along a link,
with the same outline. Displacements along Z and multipliers start at zero and come from the first step of Newton's
method; guesses of them would not save any steps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from fenicsmech.compat import cell_dofs
from fenicsmech.elasticity import ElasticBody
from fenicsmech.equilibrium import State
from fenicsmech.model import Design, MechanismModel
from fenicsmech.multibody import shape_functions

_NEAREST = 16  # cells with the nearest midpoints, among which a point is located
_CORRECTIONS = 8  # of coordinates in curved cells, each of which at least halves the error


@dataclass(frozen=True, eq=False)
class WholeState:
    """The equilibrium of a simulation, the same on all processes.

    Attributes:
        rest: X of the nodes of each cell, corners first, (cells, nodes, dim).
        link: index of the flexible link of each cell, (cells,).
        u: displacements of the nodes of each cell, (cells, nodes, dim).
        poses: of all bodies, (bodies, pose_size).
        force: magnitude of the controlled force.
        load_factor: of the constant loads and effects.
    """

    rest: np.ndarray
    link: np.ndarray
    u: np.ndarray
    poses: np.ndarray
    force: float
    load_factor: float


def whole_state(model: MechanismModel, state: State) -> WholeState:
    """The equilibrium ``state`` of a model that has the state's design, gathered on all processes of the model."""
    model.load(state)
    mesh, u = model.mesh.mesh, model.elastic.u
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    nodes, displacements = cell_dofs(u.function_space)[:owned], u.x.array.reshape(-1, model.interfaces.block)
    own = _rest(model)[nodes], model.mesh.link[:owned], displacements[nodes]
    rest, link, values = (np.concatenate(part) for part in zip(*model.mesh.comm.allgather(own), strict=True))
    return WholeState(rest, link, values, state.poses, state.force, state.load_factor)


def guess(model: MechanismModel, found: WholeState, like: State) -> State:
    """The guess of an equilibrium of ``model`` at its design from the one ``found`` in another simulation.

    Args:
        model: with the same flexible links and bodies.
        found: the other equilibrium.
        like: any state of the model in the same configuration.
    """
    owned, dim, points = model.interfaces.owned, found.rest.shape[2], _rest(model)
    u = np.zeros((owned, model.interfaces.block))
    shared = min(u.shape[1], dim)
    for index in np.unique(model.node_link[:owned]):
        nodes, cells = np.flatnonzero(model.node_link[:owned] == index), found.link == index
        places = np.zeros((len(nodes), dim))
        places[:, :shared] = points[nodes, :shared]
        u[nodes, :shared] = _read(found.rest[cells], found.u[cells], places)[:, :shared]
    state = replace(
        like,
        u=np.concatenate([u.ravel(), np.zeros(len(like.u) - u.size)]),
        poses=model.linkage.joints.space.converted(found.poses),
        multipliers=np.zeros_like(like.multipliers),
        force=found.force,
        load_factor=found.load_factor,
    )
    model.load(state)
    return replace(state, u=model.elastic.values())


def carried_design(model: MechanismModel, design: Design, other: MechanismModel) -> Design:
    """The ``design`` of a model on another one of the same drawing, read where that one's nodes are drawn."""
    elastic, mesh, dim = model.elastic, model.mesh.mesh, model.elastic.model.dim
    cells = cell_dofs(elastic.shape.function_space)[: mesh.topology.index_map(mesh.topology.dim).size_local]
    drawn, values = _drawn(elastic), design.field.reshape(-1, dim)
    own = drawn[cells], model.mesh.link[: len(cells)], values[cells]
    rest, link, field = (np.concatenate(part) for part in zip(*mesh.comm.allgather(own), strict=True))
    there, points = cell_dofs(other.elastic.shape.function_space), _drawn(other.elastic)[:, :dim]
    carried = np.zeros((len(points), other.elastic.model.dim))
    for index in np.unique(other.mesh.link):
        nodes = np.unique(there[other.mesh.link == index])
        carried[nodes, :dim] = _read(rest[link == index], field[link == index], points[nodes])
    return replace(design, field=carried.ravel())


def _drawn(elastic: ElasticBody) -> np.ndarray:
    """X₀ + c of this rank's nodes of the design field, ghosts last, (nodes, dim)."""
    dim = elastic.model.dim
    nodes = elastic.shape.function_space.tabulate_dof_coordinates()[:, :dim]
    return nodes + elastic.drawn_shape.reshape(-1, dim)


def _rest(model: MechanismModel) -> np.ndarray:
    """X of this rank's nodes of u, ghosts last, (nodes, dim)."""
    return model.elastic.drawn_nodes + model.design_nodes.values(model.elastic.design)


def _read(rest: np.ndarray, values: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Values at ``points`` (n, dim) of a field given at the nodes of cells (cells, nodes, dim) that lie at ``rest``."""
    corners = rest[:, : points.shape[1] + 1]
    near = cKDTree(corners.mean(axis=1)).query(points, k=min(_NEAREST, len(corners)))[1].reshape(len(points), -1)
    inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))

    def barycentric(cells: np.ndarray, offsets: np.ndarray, total: float) -> np.ndarray:
        within = np.einsum("...ij,...j->...i", inverse[cells], offsets)
        return np.concatenate([total - within.sum(axis=-1, keepdims=True), within], axis=-1)

    straight = barycentric(near, points[:, None] - corners[near, 0], 1.0)
    cells = near[np.arange(len(points)), straight.min(axis=2).argmax(axis=1)]
    found = barycentric(cells, points - corners[cells, 0], 1.0)
    for _ in range(_CORRECTIONS):
        reached = np.einsum("nk,nkd->nd", shape_functions(found, rest.shape[1]), rest[cells])
        found += barycentric(cells, points - reached, 0.0)
    return np.einsum("nk,nkd->nd", shape_functions(found, values.shape[1]), values[cells])
