"""Shape design of flexible links.

How a link's shape follows its parameters, in the order of their use
    ``spline``            centreline and thickness as a cubic Hermite spline; ``spline_fit`` finds the first one
    ``handles``           where the spline takes hold of the mesh; ``transforms`` what a handle does around it,
                          ``handle_placement`` where handles go
    ``weights``           bounded biharmonic weights; on the ``plan`` of an extruded link, with handles as vertices
                          (``insertion``), from a ``laplacian`` and a quadratic program (``partition``)
    ``link_shape``        all of these for one link
    ``shape_map``         parameters and handle positions → design field on the distributed mesh, and its transpose
    ``quality``           aspect ratios of cells, their sum as a form
    ``handle_optimum``    handle positions that make the mesh best, and their derivative by the parameters; one Newton
                          step in ``handle_step``, Hessians between handles in ``moment_hessian``

Derivatives of the mechanism
    ``sensitivity``       adjoint derivatives of displacements by design field, moduli and force

What is minimised
    ``spline_design``     which links may change, and what is wanted: plain data
    ``penalties``         closeness to the start, bounds of fabrication at ``spline_samples``, by a ``barrier``
    ``objective``         distances from targets plus penalties, with derivatives
    ``optimisers``        Levenberg–Marquardt, BFGS
"""

from fenicsmech.design.handle_optimum import HandleOptimum, Placement, ShapeError
from fenicsmech.design.link_shape import LinkShape, ShapeRequest, shape_links
from fenicsmech.design.quality import QualitySum
from fenicsmech.design.sensitivity import Adjoint, Gradient
from fenicsmech.design.shape_map import ShapeMap
from fenicsmech.design.spline import LinkSpline

__all__ = [
    "Adjoint",
    "Gradient",
    "HandleOptimum",
    "LinkShape",
    "LinkSpline",
    "Placement",
    "QualitySum",
    "ShapeError",
    "ShapeMap",
    "ShapeRequest",
    "shape_links",
]
