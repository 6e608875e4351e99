"""fenicsmech: flexible-link mechanisms on FEniCSx.

Describe a mechanism (``Mechanism``), say what acts on it (``Scene``) and how finely it is computed
(``Simulation``), and ask for load–displacement curves.
"""

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
    "Configuration",
    "Curve",
    "DescriptionError",
    "Disc",
    "EquilibriumError",
    "FenicsmechError",
    "Frame",
    "IsochoricNeoHookean",
    "IsochoricSimoNeoHookean",
    "Line",
    "LogarithmicNeoHookean",
    "Material",
    "Mechanism",
    "MeshingError",
    "NeoHookean",
    "Rectangle",
    "Scene",
    "Simulation",
    "Units",
    "gmsh_mesh",
    "outline",
    "polygon",
    "step",
    "strip",
]
