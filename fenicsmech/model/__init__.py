"""The discretised scene: its fidelity, and the meshed mechanism with its elastic links, bodies and loads.

- ``fidelity``: space, order and element sizes, as users give them
- ``model``: the discretised mechanism
"""

from fenicsmech.model.fidelity import SPACES, Fidelity, check_scene, fits, read_fidelity
from fenicsmech.model.model import MechanismModel, check_links, mesh_mechanism

__all__ = [
    "Fidelity",
    "MechanismModel",
    "SPACES",
    "check_links",
    "check_scene",
    "fits",
    "mesh_mechanism",
    "read_fidelity",
]
