"""Elastic bodies of one link and one material, on small meshes, and their fields as functions of position."""

from collections.abc import Callable

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import create_mesh
from fenicsmech.elasticity import ElasticBody, ElasticModel, Quadrature
from fenicsmech.laws import Law, NeoHookean
from fenicsmech.mechanism import Material

from ..plot.grids import box, rectangle


def single_link(
    points: np.ndarray,
    cells: np.ndarray,
    *,
    model: ElasticModel,
    law: Law | type[Law] | None = None,
    order: int = 2,
    young: float = 1.9,
    poisson: float = 0.4,
    depth: float = 1.0,
    quadrature: Quadrature | None = None,
    mixed: bool = False,
    comm: MPI.Comm = MPI.COMM_SELF,
) -> ElasticBody:
    """The mesh (points, cells), the same on every rank of ``comm``, as one link that deforms everywhere.

    ``young`` and ``poisson`` are numbers of a law that is given as a class.
    """
    if comm.rank > 0:
        points, cells = points[:0], cells[:0]
    mesh = create_mesh(comm, cells.astype(np.int64), points)
    index = mesh.topology.index_map(model.dim)
    count = index.size_local + index.num_ghosts
    return ElasticBody(
        mesh,
        link=np.zeros(count, dtype=int),
        free=np.ones(count, dtype=bool),
        materials=[Material("test", law=law if isinstance(law, Law) else (law or NeoHookean)(young, poisson))],
        depths=[depth],
        model=model,
        order=order,
        quadrature=quadrature or Quadrature.for_order(order, model.dim),
        mixed=[mixed],
    )


def distorted(dim: int, *, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """A unit square or cube of few cells, no two alike; its sides stay straight."""
    points, cells = rectangle(3, 2, 1.0, 1.0) if dim == 2 else box(2, 2, 2, (1.0, 1.0, 1.0))
    shift = np.random.default_rng(seed).uniform(-0.1, 0.1, points.shape)
    on_side = (points < 1e-9) | (points > 1.0 - 1e-9)
    return points + np.where(on_side, 0.0, shift), cells


def nodes(function: fem.Function) -> np.ndarray:
    """Positions of the nodes of a field, (n, dim)."""
    space = function.function_space
    return space.tabulate_dof_coordinates()[:, : space.mesh.geometry.dim]


def components(body: ElasticBody, where: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Indices into u.x.array of all components at the nodes that ``where`` of positions (n, dim) selects."""
    return np.flatnonzero(np.repeat(where(nodes(body.u)), body.model.dim))


def rest_shape(body: ElasticBody) -> np.ndarray:
    """X = X₀ + d at the nodes of u, (n, dim)."""
    design = fem.Function(body.u.function_space)
    design.interpolate(body.shape)
    return nodes(body.u) + design.x.array.reshape(-1, body.model.dim)


def forces(body: ElasticBody) -> np.ndarray:
    """∂E/∂u, as u.x.array; on one rank."""
    return body.assembled(body.residual_forms[0])


def stiffness_matrix(body: ElasticBody) -> np.ndarray:
    """∂²E/∂u², dense; on one rank."""
    matrix = fem.petsc.create_matrix(body.stiffness_forms[0][0])
    body.add_stiffness(matrix)
    matrix.assemble()
    values = matrix[:, :]
    matrix.destroy()
    return values


def interpolate(function: fem.Function, field: Callable[[np.ndarray], np.ndarray]) -> None:
    """Sets the nodal values of a vector field from ``field`` of positions (n, dim), (n, dim)."""
    function.x.array[:] = field(nodes(function)).ravel()


def wave(dim: int, amplitude: float, *, seed: int) -> Callable[[np.ndarray], np.ndarray]:
    """A smooth field without symmetry."""
    random = np.random.default_rng(seed)
    wavenumbers, phases = random.uniform(0.5, 2.0, (dim, dim)), random.uniform(0.0, 6.0, dim)
    return lambda x: amplitude * np.sin(x @ wavenumbers.T + phases)
