"""Shape design of flexible links.

A ``DesignProblem`` is described as plain data (``description``), minimised by one of the ``optimisers`` in a ``run``,
round by round with a ``correction`` that brings values near the truth, and ends in a ``DesignResult``; a ``search``
from scattered starts ends in several. Its ``objective`` compares the quantities of each ``target`` at its
``equilibria`` with the wanted values, and adds ``regularisers``. The ``rest_shape`` of the links follows the parameters
through ``shape``: ``spline``, ``handles`` on it, ``weights`` by which handles move the mesh, the ``shape_map`` of
these, and the ``handle_optimum`` of the mesh ``quality``; ``numbers`` of parts may change in addition.
``law_fit`` fits parameters of laws to tests of specimens, ``characterisation`` those of several materials to
load–displacement curves too, with the intervals of ``regression``.
"""

from fenicsmech.design.characterisation import (
    Experiment,
    ModulusFit,
    ParameterFit,
    ParameterFitOptions,
    fit_modulus,
    fit_parameters,
)
from fenicsmech.design.correction import Correction
from fenicsmech.design.description import Bounds, SplineDesign, shape_request, with_followers
from fenicsmech.design.design_problem import DEFAULT_REGULARISER, DesignLinearisation, DesignProblem
from fenicsmech.design.equilibria import DesignEquilibria, SampleEquilibria
from fenicsmech.design.law_fit import LawFit, LawFitOptions, SpecimenTest, fit_law
from fenicsmech.design.numbers import Number, NumberDesign, ScaledNumbers
from fenicsmech.design.objective import Objective, group_count, sample_numbers, split
from fenicsmech.design.optimisers.bfgs import BFGS
from fenicsmech.design.optimisers.levenberg_marquardt import LevenbergMarquardt, Resolution
from fenicsmech.design.optimisers.problem import (
    Deferred,
    Evaluation,
    Inequalities,
    Infeasible,
    Iterate,
    Optimiser,
    Plain,
    Problem,
    Quadratic,
    Reason,
    Start,
    TooHigh,
)
from fenicsmech.design.optimisers.sqp import SQP
from fenicsmech.design.regularisers import (
    MeshQuality,
    Model,
    NumberBounds,
    Regulariser,
    ShapeBounds,
    StayClose,
    Weighted,
)
from fenicsmech.design.rest_shape import DesignedLink, ParametricShape
from fenicsmech.design.result import DesignResult, LinkDesign, PartValue, TargetResult, rest_meshes
from fenicsmech.design.run import Checkpoint, DesignIterate, DesignProgress, Round, minimise_together
from fenicsmech.design.search import Scatter, Search, SearchResult, StartResult
from fenicsmech.design.shape.edges import MidEdgeNodes, edge_weights
from fenicsmech.design.shape.handle_optimum import (
    HandleOptimum,
    HandleOptions,
    HandlePlacement,
    ShapeError,
    crowding,
    follow_spline,
    motion,
)
from fenicsmech.design.shape.handles import BETWEEN, LinkHandles
from fenicsmech.design.shape.quality import Barrier, QualitySum
from fenicsmech.design.shape.shape_map import LinkParameters, ShapeMap, ShapeRequest, shape_link, shape_links
from fenicsmech.design.shape.spline import ControlLayout, LinkSpline, SplineSamples, fit_spline, lay_out
from fenicsmech.design.shape.weights import insert, lumped_mass, pierced, solve_partition, stiffness
from fenicsmech.design.target import Comparison, Target, limits
