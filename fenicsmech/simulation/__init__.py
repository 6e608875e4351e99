"""Simulations of a scene, and the curves they give.

- ``simulation``: the entry point, which computes curves
- ``discretisation``: the meshed and compiled parts that simulations of several designs share
- ``request``, ``curves``, ``tracer``: what a curve is asked for, and how it is traced
- ``idle_balance``: whether loads balance along motions that deform no link
- ``leading``: a force or a motor that changes along a curve
- ``until``, ``follower``, ``followed``: curves that are followed wherever they lead, and their events
- ``unloaded``: where points are while motors move
- ``frame``, ``curve``: the results, and what can be asked of them
- ``buckling``: buckling loads, buckling positions and soft modes of an equilibrium
- ``friction``: how far friction in hinges holds a curve's load
- ``explanation``: what is simulated and left out, in words
- ``fields``, ``picture``: states gathered, written, drawn
"""

from fenicsmech.simulation.buckling import BucklingLoad, BucklingPosition, ModeShape, SoftMode
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.explanation import Explanation, ExplanationOptions, weight_influence
from fenicsmech.simulation.fields import gather, rest_vertices
from fenicsmech.simulation.followed import FollowedCurve, PathEvent
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.friction import PinFriction
from fenicsmech.simulation.picture import MechanismPlotter
from fenicsmech.simulation.request import CurveRequest, read_request
from fenicsmech.simulation.simulation import Simulation
from fenicsmech.simulation.until import Until

__all__ = [
    "BucklingLoad",
    "BucklingPosition",
    "Curve",
    "CurveRequest",
    "Explanation",
    "ExplanationOptions",
    "FollowedCurve",
    "Frame",
    "MechanismPlotter",
    "ModeShape",
    "PathEvent",
    "PinFriction",
    "Simulation",
    "SoftMode",
    "Until",
    "gather",
    "read_request",
    "rest_vertices",
    "weight_influence",
]
