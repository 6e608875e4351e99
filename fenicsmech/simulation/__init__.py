"""Simulations of a scene, and the curves they give.

- ``simulation``: the entry point, which computes curves
- ``discretisation``: the meshed and compiled parts that simulations of several designs share
- ``request``: what is prescribed and asked for
- ``tracing``, ``following``: curves computed sample by sample, or along the path with its events
- ``frame``, ``curve``: the results, and what can be asked of them
- ``buckling``: buckling loads, buckling positions and soft modes of an equilibrium
- ``friction``: how far friction in hinges holds a curve's load
- ``explanation``: what is simulated and left out, in words
- ``fields``, ``picture``: states gathered, written, drawn
"""

from fenicsmech.simulation.buckling import BucklingLoad, BucklingPosition, ModeShape, SoftMode
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.explanation import Explanation, Hint, weight_influence
from fenicsmech.simulation.fields import gather, rest_vertices
from fenicsmech.simulation.following import FollowedCurve, PathEvent
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.friction import PinFriction
from fenicsmech.simulation.picture import MechanismPlotter
from fenicsmech.simulation.request import Axis, CurveRequest, Until, read_request
from fenicsmech.simulation.simulation import RestShape, Simulation

__all__ = [
    "Axis",
    "BucklingLoad",
    "BucklingPosition",
    "Curve",
    "CurveRequest",
    "Explanation",
    "FollowedCurve",
    "Frame",
    "Hint",
    "MechanismPlotter",
    "ModeShape",
    "PathEvent",
    "PinFriction",
    "RestShape",
    "Simulation",
    "SoftMode",
    "Until",
    "gather",
    "read_request",
    "rest_vertices",
    "weight_influence",
]
