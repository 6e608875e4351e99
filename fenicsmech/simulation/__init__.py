"""What users run: a scene at some fidelity, and the curves it gives.

- ``simulation``: the entry point, which computes curves
- ``postprocessing``: what it tells of them
- ``dial``: how finely it is computed to reach the accuracy asked for
- ``discretisation``: a scene at one fidelity, with the discretised mechanism behind it
- ``request``: what a curve is asked for
- ``curves``, ``tracing``, ``following``: how it is computed, sample by sample or along the path, with its events
- ``frame``, ``curve``: what comes out
- ``buckling``, ``mode_shape``: buckling loads, buckling positions and soft modes of an equilibrium
- ``goal``, ``estimates``, ``influence``: how wrong displacements and forces are, by an adjoint: of elements
  (``goal_error`` by ``recovery``, ``pressure_error``), of plane stress (``depth_error``)
- ``explanation``: what is simulated and left out, in words
- ``friction``: how far friction in hinges holds a curve's load
- ``snapshot``, ``picture``, ``export``: a state gathered, drawn, written
"""

from fenicsmech.estimates import PressureError, Recovery
from fenicsmech.model import SPACES, MechanismModel, check_scene, fits
from fenicsmech.simulation.buckling import BucklingLoad, BucklingPosition, SoftMode
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.dial import Dial, Outcome, Rung, Trial, corrections, family
from fenicsmech.simulation.explanation import PLASTIC_WEIGHT, weight_influence
from fenicsmech.simulation.following import FollowedCurve, PathEvent
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.friction import PinFriction, friction_band
from fenicsmech.simulation.goal import Goal
from fenicsmech.simulation.influence import Equilibrium
from fenicsmech.simulation.mode_shape import ModeShape
from fenicsmech.simulation.picture import Draughtsman
from fenicsmech.simulation.request import CurveRequest, Until, read_request
from fenicsmech.simulation.simulation import Simulation
from fenicsmech.simulation.snapshot import gather, rest_vertices

__all__ = [
    "BucklingLoad",
    "BucklingPosition",
    "Curve",
    "CurveRequest",
    "Dial",
    "Draughtsman",
    "Equilibrium",
    "FollowedCurve",
    "Frame",
    "Goal",
    "MechanismModel",
    "ModeShape",
    "Outcome",
    "PLASTIC_WEIGHT",
    "PathEvent",
    "PinFriction",
    "PressureError",
    "Recovery",
    "Rung",
    "SPACES",
    "Simulation",
    "SoftMode",
    "Trial",
    "Until",
    "check_scene",
    "corrections",
    "family",
    "fits",
    "friction_band",
    "gather",
    "read_request",
    "rest_vertices",
    "weight_influence",
]
