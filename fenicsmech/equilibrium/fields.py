"""A state in the finite-element fields, where energies and their derivatives are assembled from."""

from __future__ import annotations

from fenicsmech.elasticity import ElasticBody
from fenicsmech.equilibrium.state import State
from fenicsmech.multibody import InterfaceMap


def load_fields(elastic: ElasticBody, interfaces: InterfaceMap, state: State) -> None:
    """Makes the fields of ``elastic`` hold ``state``, with interface nodes on their bodies (collective)."""
    elastic.take(state.u)
    elastic.share.value = state.load_factor
    elastic.update()
    interfaces.place(state.poses)
