"""One elastic link under pressure, on small structured meshes, its supports prescribed (mm, N, MPa)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.compat import create_mesh
from fenicsmech.effects import LinkFields, Pressure, find_boundaries
from fenicsmech.elasticity import ElasticBody, ElasticModel, Quadrature
from fenicsmech.mechanism import FlexibleLink

YOUNG, POISSON = 100.0, 0.3


class PressedBody:
    """The mesh (points, cells) as one link under ``pressure``.

    Attributes:
        body: the elastic body, the pressure's energy included.
        effect: the pressure.
        fields: what its energy is written in.
    """

    def __init__(
        self,
        points: np.ndarray,
        cells: np.ndarray,
        model: ElasticModel,
        pressure: float,
        *,
        where: Callable[[np.ndarray], np.ndarray] | None = None,
        about: tuple[float, ...] | None = None,
        order: int = 2,
    ) -> None:
        mesh = create_mesh(MPI.COMM_SELF, cells.astype(np.int64), points)
        count = mesh.topology.index_map(model.dim).size_local
        # its shape is that of the mesh, whatever is written here
        link = FlexibleLink("ring", fm.strip([(0, 0), (1, 0)], thickness=1.0, depth=1.0), fm.Material("rubber", 1, 0))
        self.effect = Pressure(link, pressure, where, about)
        found = find_boundaries(mesh, [link], np.zeros(count, dtype=int), self.effect.faces)
        self.body = ElasticBody(
            mesh,
            link=np.zeros(count, dtype=int),
            free=np.ones(count, dtype=bool),
            materials=[fm.Material("rubber", YOUNG, POISSON)],
            depths=[1.0],
            model=model,
            order=order,
            quadrature=Quadrature.for_order(order, model.dim),
            effects=[lambda body: self.effect.link_energy(self.fields_of(body))],
        )
        self._found, self._link = found, link

    def fields_of(self, body: ElasticBody) -> LinkFields:
        return LinkFields((self._link,), body, self._found)

    @property
    def fields(self) -> LinkFields:
        return self.fields_of(self.body)
