"""Shape design of flexible links.

A ``DesignProblem`` is described as plain data (``description``), minimised by one of the ``optimisers`` in a ``run``,
and ends in a ``DesignResult``. Its ``objective`` is made of the targets' ``equilibria`` with their adjoint
``sensitivity``, and of ``regularisers``. The ``rest_shape`` of the links follows the parameters through ``shape``:
``spline``, ``handles`` that ride on it, ``weights`` by which handles move the mesh, the ``shape_map`` of these, and
the ``handle_optimum`` that makes the mesh ``quality`` best. ``characterisation`` fits Young's modulus to measurements.
"""

from fenicsmech.design.characterisation import Experiment, ModulusFit, fit_modulus
from fenicsmech.design.description import Bounds, SplineDesign, Target, shape_request
from fenicsmech.design.design_problem import DesignProblem
from fenicsmech.design.equilibria import Known, TargetEquilibria
from fenicsmech.design.objective import Objective, group_count, objective_error, split, target_errors, target_scales
from fenicsmech.design.optimisers.bfgs import BFGS
from fenicsmech.design.optimisers.levenberg_marquardt import LevenbergMarquardt, Resolution
from fenicsmech.design.optimisers.problem import (
    Evaluation,
    Infeasible,
    Iterate,
    Optimiser,
    Quadratic,
    Reason,
    Start,
    TooHigh,
)
from fenicsmech.design.regularisers import MeshQuality, Model, Regulariser, ShapeBounds, StayClose
from fenicsmech.design.rest_shape import DesignedLink, ParametricShape
from fenicsmech.design.result import DesignResult, LinkDesign, TargetResult
from fenicsmech.design.run import Checkpoint, DesignProgress, minimise_together
from fenicsmech.design.sensitivity import Gradient, Sensitivity
from fenicsmech.design.shape.handle_optimum import (
    HandleOptimum,
    MapDerivatives,
    ShapeError,
    by_positions,
    follow_spline,
)
from fenicsmech.design.shape.handles import BETWEEN, LinkHandles
from fenicsmech.design.shape.quality import Barrier, QualitySum
from fenicsmech.design.shape.shape_map import ShapeMap, ShapeRequest, shape_link, shape_links
from fenicsmech.design.shape.spline import LinkSpline, SplineSamples, fit_spline
from fenicsmech.design.shape.weights import insert, lumped_mass, pierced, solve_partition, stiffness

__all__ = [
    "BETWEEN",
    "BFGS",
    "Barrier",
    "Bounds",
    "Checkpoint",
    "DesignProblem",
    "DesignProgress",
    "DesignResult",
    "DesignedLink",
    "Evaluation",
    "Experiment",
    "Gradient",
    "HandleOptimum",
    "Infeasible",
    "Iterate",
    "Known",
    "LevenbergMarquardt",
    "LinkDesign",
    "LinkHandles",
    "LinkSpline",
    "MapDerivatives",
    "MeshQuality",
    "Model",
    "ModulusFit",
    "Objective",
    "Optimiser",
    "ParametricShape",
    "Quadratic",
    "QualitySum",
    "Reason",
    "Regulariser",
    "Resolution",
    "Sensitivity",
    "ShapeBounds",
    "ShapeError",
    "ShapeMap",
    "ShapeRequest",
    "SplineDesign",
    "SplineSamples",
    "Start",
    "StayClose",
    "Target",
    "TargetEquilibria",
    "TargetResult",
    "TooHigh",
    "by_positions",
    "fit_modulus",
    "fit_spline",
    "follow_spline",
    "group_count",
    "insert",
    "lumped_mass",
    "minimise_together",
    "objective_error",
    "pierced",
    "shape_link",
    "shape_links",
    "shape_request",
    "solve_partition",
    "split",
    "stiffness",
    "target_errors",
    "target_scales",
]
