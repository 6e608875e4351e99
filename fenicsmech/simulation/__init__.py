"""What users run: a scene at some fidelity, and the curves it gives.

- ``simulation``: the entry point
- ``model``: the discretised mechanism behind it
- ``request``, ``tracer``: what a curve is asked for, and how it is traced
- ``frame``, ``curve``: what comes out
- ``until``, ``follower``, ``followed``: curves that are followed wherever they lead, and their events
- ``friction``: how far friction in hinges holds a curve's load
- ``snapshot``, ``picture``, ``export``: a state gathered, drawn, written
"""

from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.followed import FollowedCurve, PathEvent
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.friction import PinFriction, friction_band
from fenicsmech.simulation.simulation import SPACES, Simulation
from fenicsmech.simulation.until import Until

__all__ = [
    "SPACES",
    "Curve",
    "FollowedCurve",
    "Frame",
    "PathEvent",
    "PinFriction",
    "Simulation",
    "Until",
    "friction_band",
]
