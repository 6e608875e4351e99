"""Simulations of a scene and their curves.

- ``simulation``: the entry point, which computes curves
- ``discretisation``: the meshed and compiled parts that simulations of several designs share
- ``stepping``: curves at prescribed values
- ``following``: curves along a path until an end, with its events
- ``frame``, ``curve``: results and their evaluation
- ``fields``: gathering, pictures and files of states
- ``omitted_effects``: assumptions as text, hints where they matter, and friction in hinges
"""

from fenicsmech.simulation.curve import Axis, Curve
from fenicsmech.simulation.fields import MechanismPlotter, gather, joint_points, rest_geometry, rest_vertices
from fenicsmech.simulation.following import FollowedCurve, PathEvent, Until
from fenicsmech.simulation.frame import BucklingPoint, Frame, ModeShape, SoftMode
from fenicsmech.simulation.omitted_effects import Explanation, Hint, PinFriction, weight_influence
from fenicsmech.simulation.simulation import RestShape, Simulation
from fenicsmech.simulation.stepping import CurveRequest, read_request
