"""Error of plane stress: pins hold links all through their depth, so that near them links cannot contract there.

Blocked contraction stores the energy

    V = ½ ∫ w E (F₃₃ − 1)² dV,     w = exp(−r / (c b)),

r the distance from the nearest interface as drawn, b the depth of the link. With w = 1 and small strain it is the
difference between plane stress and plane strain. It changes a displacement, to first order with its adjoint z, by

    Q(space) − Q(plane stress) ≈ −∂V/∂u · z.

c was measured once, see ``Calibration``. Source for estimates of modelling errors by an adjoint: Oden &
Vemaganti (doi:10.1006/jcph.2000.6585). Not included: wide links that bend so sharply that they cannot bulge across
their depth (b² times the curvature over the thickness far above 1), and motion out of the plane.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem
from scipy.spatial import cKDTree

from fenicsmech.compat import cell_dofs, cell_nodes, compile_form, original_nodes, scalar_space
from fenicsmech.elasticity import PLANE_STRESS
from fenicsmech.equilibrium import Adjoint
from fenicsmech.errors import DescriptionError
from fenicsmech.model import MechanismModel


class PlaneStressError:
    """Errors of quantities in plane stress relative to a simulation in space.

    Args:
        model: the discretised mechanism, which holds the equilibrium in question.
        decay: c.

    Raises:
        DescriptionError: the simulation is not in plane stress.
    """

    def __init__(self, model: MechanismModel, decay: float) -> None:
        space = model.elastic.model
        if space is not PLANE_STRESS:
            raise DescriptionError(
                "modelling error",
                f"only plane stress has an estimate, and space={space.name!r}",
                "Simulate in plane stress, or in 3D",
            )
        self._model, self._decay = model, decay

    def of(self, adjoint: Adjoint) -> float:
        """Q(space) − Q(plane stress), from the adjoint of Q."""
        elastic = self._model.elastic
        return -elastic.mesh.comm.allreduce(float(elastic.assembled(self._force) @ adjoint.nodal))

    @cached_property
    def _force(self):
        """∂V/∂u, compiled."""
        elastic = self._model.elastic
        reach = elastic.cellwise([self._decay * link.shape.depth for link in self._model.mechanism.flexible_links])
        # w decays within a cell: of a high degree
        energy = elastic.contraction_energy(ufl.exp(-self._distance() / reach), degree=8)
        return compile_form(ufl.derivative(energy, elastic.u))

    def _distance(self) -> fem.Function:
        """r, linear in each cell."""
        mesh = self._model.mesh
        numbers = original_nodes(mesh.mesh)[cell_nodes(mesh.mesh)]
        held = np.concatenate(mesh.mesh.comm.allgather(np.unique(numbers[mesh.interface >= 0])))
        owner = np.empty(len(mesh.vertices), dtype=int)
        owner[mesh.cells] = mesh.link_of_cell[:, None]
        distance = np.empty(len(mesh.vertices))
        for link in np.unique(owner):
            mine = np.flatnonzero(owner == link)
            distance[mine] = cKDTree(mesh.vertices[held[owner[held] == link]]).query(mesh.vertices[mine])[0]
        field = fem.Function(scalar_space(mesh.mesh, 1), name="distance")
        field.x.array[cell_dofs(field.function_space)] = distance[numbers]
        return field
