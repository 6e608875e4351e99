"""Shape design of flexible links.

How a link's shape follows its parameters, in the order of their use
    ``spline``            centreline and thickness as a cubic Hermite spline; ``spline_fit`` finds the first one
    ``handles``           where the spline takes hold of the mesh; ``transforms`` what a handle does around it,
                          ``handle_placement`` where handles go
    ``weights``           bounded biharmonic weights; on the plan of an extruded link, with handles as vertices
                          (``insertion``), from a ``laplacian`` and a quadratic program (``partition``)
    ``link_shape``        all of these for one link
    ``shape_map``         parameters and handle positions → design field on the distributed mesh, and its transpose
    ``quality``           aspect ratios of cells, their sum as a form
    ``handle_optimum``    handle positions that make the mesh best, and their derivative by the parameters; one Newton
                          step in ``handle_step``, Hessians between handles in ``moment_hessian``

    ``rest_shape``        the rest shape as a function of p alone, handles at their best

Derivatives of the mechanism
    ``sensitivity``       adjoint derivatives of displacements by design field, moduli and force

What is minimised
    ``spline_design``     which links may change, and what is wanted: plain data
    ``regularisers``      closeness to the start, bounds of fabrication at ``spline_samples``, mesh quality, by a
                          ``barrier``
    ``equilibria``        the targets' equilibria, followed from design to design
    ``objective``         distances from targets plus regularisers, with derivatives
    ``objective_error``   how wrong it is because elements are not infinitely fine
    ``groups``, ``team``  targets spread over groups of processes; one process decides
    ``optimisers``        Levenberg–Marquardt, BFGS

    ``characterisation``  Young's modulus from measurements

What a user sees
    ``design_problem``    the entry point, with its ``problem_checks``; ``progress`` and ``checkpoint`` while it runs,
                          ``conclusion`` at its end
    ``result``            designs as plain data; ``link_files`` pictures and solids of them
"""

from fenicsmech.design.barrier import Barrier
from fenicsmech.design.characterisation import Experiment, ModulusFit, fit_modulus
from fenicsmech.design.checkpoint import Checkpoint
from fenicsmech.design.design_problem import DesignProblem
from fenicsmech.design.equilibria import Known, TargetEquilibria
from fenicsmech.design.groups import group_count, split
from fenicsmech.design.handle_optimum import HandleOptimum, ShapeError
from fenicsmech.design.handle_step import LinkDerivatives, choose_sides, follow_spline
from fenicsmech.design.handles import BETWEEN, LinkHandles
from fenicsmech.design.insertion import insert, pierced
from fenicsmech.design.laplacian import lumped_mass, stiffness
from fenicsmech.design.link_shape import ShapeRequest, shape_link, shape_links
from fenicsmech.design.objective import Objective, target_errors, target_scales
from fenicsmech.design.objective_error import objective_error
from fenicsmech.design.optimisers import (
    BFGS,
    Evaluation,
    Infeasible,
    Iterate,
    LevenbergMarquardt,
    Optimiser,
    Quadratic,
    Reason,
    Start,
    TooHigh,
)
from fenicsmech.design.optimisers.resolution import Resolution
from fenicsmech.design.partition import solve_partition
from fenicsmech.design.progress import DesignProgress
from fenicsmech.design.quality import QualitySum
from fenicsmech.design.regularisers import MeshQuality, Model, Regulariser, ShapeBounds, StayClose
from fenicsmech.design.rest_shape import DesignedLink, RestShape
from fenicsmech.design.result import DesignResult, LinkDesign, TargetResult
from fenicsmech.design.sensitivity import Adjoint, Gradient
from fenicsmech.design.shape_map import ShapeMap
from fenicsmech.design.spline import LinkSpline
from fenicsmech.design.spline_design import Bounds, SplineDesign, Target, bounds_of, shape_request
from fenicsmech.design.spline_fit import fit_spline
from fenicsmech.design.spline_samples import SplineSamples
from fenicsmech.design.team import minimise_together

__all__ = [
    "Adjoint",
    "BETWEEN",
    "Barrier",
    "BFGS",
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
    "LinkDerivatives",
    "LinkDesign",
    "LinkHandles",
    "LinkSpline",
    "MeshQuality",
    "Optimiser",
    "Model",
    "ModulusFit",
    "Objective",
    "Quadratic",
    "QualitySum",
    "Reason",
    "Regulariser",
    "Resolution",
    "RestShape",
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
    "bounds_of",
    "choose_sides",
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
