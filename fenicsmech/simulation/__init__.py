"""Simulations of a scene and their curves.

- ``simulation``: the entry point, which computes curves
- ``discretisation``: the meshed and compiled parts that simulations of several designs share
- ``request``: what is asked for, checked before anything is meshed
- ``stepping``: curves at prescribed values
- ``balance``: whether loads balance along motions that deform no link
- ``rest_start``: where curves start
- ``following``: curves along a path until an end, with its events
- ``safe_range``: the range of a force that links bear
- ``frame``, ``frame_series``, ``curve``: results and their evaluation
- ``curve_errors``: errors of a curve's values; ``recomputed``: its frames in another discretisation
- ``transfer``: the equilibrium of one simulation as a guess of that of another one
- ``fields``: gathering, pictures and files of states
- ``omitted_effects``: assumptions as text, hints where they matter, and friction in hinges
"""

from fenicsmech.simulation.balance import Balance
from fenicsmech.simulation.curve import Axis, Curve
from fenicsmech.simulation.curve_errors import CheckedErrors
from fenicsmech.simulation.fields import (
    MechanismPlotter,
    gather,
    joint_points,
    outer_surface,
    rest_geometry,
    rest_vertices,
)
from fenicsmech.simulation.following import FollowedCurve, PathEvent, Until
from fenicsmech.simulation.frame import BucklingPoint, Frame, ModeShape, SoftMode
from fenicsmech.simulation.frame_series import FrameSeries
from fenicsmech.simulation.omitted_effects import Explanation, Hint, PinFriction, weight_influence
from fenicsmech.simulation.request import CurveRequest, read_request
from fenicsmech.simulation.safe_range import SafeLimit, SafeRange, SafeRangeOptions
from fenicsmech.simulation.simulation import RestShape, Simulation
from fenicsmech.simulation.transfer import WholeState, guess, whole_state
