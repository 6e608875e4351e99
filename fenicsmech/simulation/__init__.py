"""Simulations of a scene and their curves.

- ``simulation``: the entry point, which computes curves
- ``discretisation``: the meshed and compiled parts that simulations of several designs share
- ``request``: the prescribed part of a curve, and its samples or ends
- ``tracing``, ``following``: curves computed sample by sample, or along the path with its events
- ``frame``, ``curve``: results and their evaluation
- ``buckling``: buckling loads, buckling positions and soft modes of an equilibrium
- ``friction``: bounds of a curve's load by friction in hinges
- ``explanation``: assumptions of a simulation as text
- ``fields``, ``picture``: gathering, files and pictures of states
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
