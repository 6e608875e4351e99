"""fenicsmech: flexible-link mechanisms on FEniCSx.

Describe a mechanism (``Mechanism``), say what acts on it (``Scene``) and how finely it is computed
(``Simulation``), and ask for load–displacement curves; or say which links may change and what is wanted
(``DesignProblem``), and ask for their shapes.
"""

from fenicsmech.design import (
    Bfgs,
    DesignProblem,
    DesignResult,
    Experiment,
    LevenbergMarquardt,
    MeshQuality,
    ModulusFit,
    ShapeBounds,
    SplineDesign,
    StayClose,
    Target,
    fit_modulus,
)
from fenicsmech.effects import Gravity, Mass
from fenicsmech.errors import AssemblyError, DescriptionError, EquilibriumError, FenicsmechError, MeshingError
from fenicsmech.mechanism import (
    DRAWN,
    ONYX,
    SMOOTH_SIL_950,
    Arc,
    Configuration,
    Disc,
    IsochoricNeoHookean,
    IsochoricSimoNeoHookean,
    Line,
    LogarithmicNeoHookean,
    Material,
    Mechanism,
    NeoHookean,
    Rectangle,
    Scene,
    Units,
    gmsh_mesh,
    outline,
    polygon,
    step,
    strip,
)
from fenicsmech.simulation import Curve, Frame, Simulation

__version__ = "0.1.0"

__all__ = [
    "DRAWN",
    "ONYX",
    "SMOOTH_SIL_950",
    "Arc",
    "AssemblyError",
    "Bfgs",
    "Configuration",
    "Curve",
    "DescriptionError",
    "DesignProblem",
    "DesignResult",
    "Disc",
    "EquilibriumError",
    "Experiment",
    "FenicsmechError",
    "Frame",
    "Gravity",
    "IsochoricNeoHookean",
    "IsochoricSimoNeoHookean",
    "LevenbergMarquardt",
    "Line",
    "LogarithmicNeoHookean",
    "Mass",
    "Material",
    "Mechanism",
    "MeshQuality",
    "MeshingError",
    "ModulusFit",
    "NeoHookean",
    "Rectangle",
    "Scene",
    "ShapeBounds",
    "Simulation",
    "SplineDesign",
    "StayClose",
    "Target",
    "Units",
    "fit_modulus",
    "gmsh_mesh",
    "outline",
    "polygon",
    "step",
    "strip",
]
