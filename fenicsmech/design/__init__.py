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

from fenicsmech.design.characterisation import Experiment, ModulusFit, fit_modulus
from fenicsmech.design.design_problem import DesignProblem
from fenicsmech.design.optimisers import Bfgs, LevenbergMarquardt
from fenicsmech.design.regularisers import MeshQuality, ShapeBounds, StayClose
from fenicsmech.design.result import DesignResult, LinkDesign, TargetResult
from fenicsmech.design.spline_design import SplineDesign, Target

__all__ = [
    "Bfgs",
    "DesignProblem",
    "DesignResult",
    "Experiment",
    "LevenbergMarquardt",
    "LinkDesign",
    "MeshQuality",
    "ModulusFit",
    "ShapeBounds",
    "SplineDesign",
    "StayClose",
    "Target",
    "TargetResult",
    "fit_modulus",
]
