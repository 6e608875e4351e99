"""What users run: a scene at some fidelity, and the curves it gives.

- ``simulation``: the entry point
- ``model``: the discretised mechanism behind it
- ``frame``, ``curve``: what comes out
"""

from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.simulation import SPACES, Simulation

__all__ = ["SPACES", "Curve", "Frame", "Simulation"]
