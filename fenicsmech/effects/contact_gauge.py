"""What a contact of a flexible link amounts to: its resultant force and the smallest gap."""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import assemble_vector, compile_form
from fenicsmech.effects.contact import Contact
from fenicsmech.effects.faces import Faces
from fenicsmech.effects.protocol import LinkFields


class ContactGauge:
    """Measures the contact of a flexible link in the state that its fields hold.

    Args:
        contact: of a flexible link.
        fields: of a simulation whose scene lists ``contact``.
    """

    def __init__(self, contact: Contact, fields: LinkFields) -> None:
        self._obstacle, self._fields = contact.obstacle, fields
        self._form = compile_form(-ufl.derivative(contact.energy(fields), fields.u))
        facets = fields.boundaries[Faces(contact.link)].facets
        V = fields.u.function_space
        self._design, self._forces = fem.Function(V), fem.Function(V)
        self._nodes = fem.locate_dofs_topological(V, fields.dim - 1, facets)

    def force(self) -> np.ndarray:
        """What the obstacle exerts on the link, (dim,) (collective)."""
        # shape functions sum up to one: so do nodal forces to the resultant
        force = assemble_vector(self._form, self._forces).reshape(-1, self._fields.dim).sum(axis=0)
        return self._fields.mesh.comm.allreduce(force, op=MPI.SUM)

    def gap(self) -> float:
        """The smallest gap at nodes of the link's boundary; where negative, the largest penetration (collective)."""
        fields = self._fields
        self._design.interpolate(fields.body.d)
        moved = fields.body.drawn_nodes + (self._design.x.array + fields.u.x.array).reshape(-1, fields.dim)
        gaps = self._obstacle.gap(moved[self._nodes])
        return fields.mesh.comm.allreduce(float(gaps.min(initial=np.inf)), op=MPI.MIN)
