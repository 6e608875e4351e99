"""fenicsmech: flexible-link mechanisms on FEniCSx.

A ``Mechanism`` describes links, joints, motors and forces, a ``Scene`` the effects on it, a ``Simulation`` its
discretisation and load–displacement curves; a ``DesignProblem`` optimises the shapes of its links.
"""

from fenicsmech.collective import mpi_abort_on_error
from fenicsmech.continuation import (
    ArcSteps,
    ConstantPredictor,
    Critical,
    CriticalPoint,
    HermitePredictor,
    Predictor,
    TangentPredictor,
)
from fenicsmech.design import (
    BFGS,
    SQP,
    Correction,
    DesignProblem,
    DesignResult,
    Experiment,
    LevenbergMarquardt,
    LinkDesign,
    MeshQuality,
    ModulusFit,
    Number,
    NumberBounds,
    NumberDesign,
    Optimiser,
    PartValue,
    Regulariser,
    Scatter,
    SearchResult,
    ShapeBounds,
    SplineDesign,
    StartResult,
    StayClose,
    Target,
    TargetResult,
    fit_modulus,
)
from fenicsmech.effects import (
    Boundary,
    Contact,
    Cylinder,
    Faces,
    Gravity,
    HalfPlane,
    JointCompliance,
    JointSpring,
    LinkFields,
    Mass,
    Obstacle,
    Pressure,
    Prestrain,
)
from fenicsmech.elasticity import (
    DisplacementFormulation,
    ElasticModel,
    Formulation,
    MixedFormulation,
    Quadrature,
    Stretch,
)
from fenicsmech.equilibrium import (
    BySize,
    Control,
    Direct,
    EquilibriumMethod,
    EquilibriumPoint,
    EquilibriumSolver,
    EquilibriumSystem,
    LinearMethod,
    NotConverged,
    PrimalDualNewton,
    Reaction,
    State,
    TwoLevel,
    Unknown,
)
from fenicsmech.errors import (
    AssemblyError,
    DescriptionError,
    EquilibriumError,
    FenicsmechError,
    MeshingError,
    OutOfMemoryError,
)
from fenicsmech.estimates import Choice, DoubtOptions
from fenicsmech.files import read_csv
from fenicsmech.joints import JointKind, PlanarMarker, SpatialMarker
from fenicsmech.laws import (
    IsochoricNeoHookean,
    IsochoricSimoNeoHookean,
    Law,
    LogarithmicNeoHookean,
    NeoHookean,
    SplitLaw,
    Strain,
    Volumetric,
)
from fenicsmech.log import configure_logging, print_once
from fenicsmech.mechanism import (
    DRAWN,
    ONYX,
    SMOOTH_SIL_950,
    Arc,
    Basquin,
    Configuration,
    Disc,
    Drive,
    Effect,
    Face,
    Figure,
    FlexibleLink,
    Force,
    ForceGroup,
    Joint,
    Line,
    Material,
    MaterialCard,
    Mechanism,
    MeshPart,
    Motor,
    Outline,
    Output,
    Rectangle,
    RigidLink,
    Scene,
    Source,
    StepPart,
    Strength,
    Strip,
    Units,
    gmsh_mesh,
    in_dimension,
    material,
    material_card,
    material_names,
    outline,
    polygon,
    step_file,
    strip,
)
from fenicsmech.model import SPACES, Design, Fidelity
from fenicsmech.multibody import BodyPoint, Freedom, JointChange, Linkage, PlacedPoint, PosePotential
from fenicsmech.plot import CurveMark, CurveSeries, CurveTarget, Trace, plot_curve
from fenicsmech.quantities import (
    CentrelineLength,
    Component,
    Depth,
    Displacement,
    EffectNumber,
    ForceMagnitude,
    FormValue,
    JointAxis,
    JointForce,
    JointMoment,
    JointPosition,
    LawParameter,
    LinkMass,
    LinkVolume,
    Magnitude,
    ModelNumber,
    MotorOffset,
    MotorTorque,
    NumberKind,
    NumberTerms,
    Observable,
    Partial,
    PrescribedDisplacement,
    Quantity,
    RestObservable,
    Rotation,
    Sample,
    SpringRest,
    SpringStiffness,
    StrainEnergy,
    at,
    border_of,
)
from fenicsmech.report import Optimisation, Report, design_study, write_report
from fenicsmech.simulation import (
    Axis,
    BucklingPoint,
    Curve,
    Explanation,
    FollowedCurve,
    Frame,
    Hint,
    ModeShape,
    PathEvent,
    PinFriction,
    RestShape,
    Simulation,
    SoftMode,
    Until,
)

__version__ = "0.1.0"

# fmt: off
__all__ = [
    # description: a mechanism, its parts, shapes and interfaces, and the scene
    "Mechanism", "RigidLink", "FlexibleLink", "Joint", "Motor", "Drive", "Force", "ForceGroup", "Output", "strip",
    "polygon", "outline", "Line", "Arc", "step_file", "gmsh_mesh", "Strip", "Outline", "StepPart", "MeshPart", "Disc",
    "Rectangle", "Face", "Scene", "Configuration", "DRAWN", "Units",
    # materials and laws; Law, SplitLaw, Strain and Volumetric for laws of your own
    "Material", "material", "material_names", "material_card", "MaterialCard", "Figure", "Source", "Strength",
    "Basquin", "ONYX", "SMOOTH_SIL_950", "NeoHookean", "LogarithmicNeoHookean", "IsochoricNeoHookean",
    "IsochoricSimoNeoHookean", "Law", "SplitLaw", "Strain", "Volumetric",
    # joint kinds of your own
    "JointKind", "PlanarMarker", "SpatialMarker",
    # effects; Effect and those after it for effects of your own
    "Gravity", "Mass", "Pressure", "Prestrain", "JointSpring", "JointCompliance", "Contact", "HalfPlane", "Cylinder",
    "Effect", "Faces", "LinkFields", "Obstacle", "PosePotential", "Stretch", "Boundary", "ElasticModel", "Linkage",
    "BodyPoint", "in_dimension",
    # simulation, its curves and their results
    "Simulation", "SPACES", "Fidelity", "Quadrature", "Choice", "Predictor", "HermitePredictor", "TangentPredictor",
    "ConstantPredictor", "DoubtOptions",
    "RestShape", "Curve", "Frame", "Axis", "Unknown", "Freedom", "Reaction", "Explanation", "Hint", "PinFriction",
    "write_report", "Report", "plot_curve", "CurveSeries", "CurveMark", "CurveTarget", "Trace", "read_csv",
    "print_once", "configure_logging", "mpi_abort_on_error",
    # quantities of equilibria; those from Observable on for quantities of your own
    "Sample", "at", "PrescribedDisplacement", "Quantity", "Displacement", "Rotation", "ForceMagnitude", "MotorTorque",
    "JointForce", "JointMoment", "StrainEnergy", "LinkMass", "LinkVolume", "CentrelineLength", "Component", "Magnitude",
    "Observable", "RestObservable", "Partial", "FormValue", "border_of",
    # path following, stability and buckling
    "FollowedCurve", "ArcSteps", "Critical", "Until", "PathEvent", "CriticalPoint", "BucklingPoint", "SoftMode",
    "ModeShape",
    # formulations and solvers; those from EquilibriumMethod on for solvers of your own
    "Formulation", "DisplacementFormulation", "MixedFormulation", "PrimalDualNewton", "LinearMethod", "BySize",
    "Direct", "TwoLevel", "EquilibriumMethod", "EquilibriumSystem", "EquilibriumPoint", "Control", "State",
    "EquilibriumSolver", "NotConverged",
    # design and characterisation
    "DesignProblem", "SplineDesign", "ShapeBounds", "Target", "StayClose", "MeshQuality", "Regulariser",
    "LevenbergMarquardt", "BFGS", "SQP", "Optimiser", "Correction", "DesignResult", "LinkDesign", "TargetResult",
    "PartValue", "Scatter", "SearchResult", "StartResult", "Optimisation", "design_study", "Experiment", "ModulusFit",
    "fit_modulus", "Design",
    # numbers that designs change in addition to shapes; NumberKind for kinds of your own
    "Number", "Depth", "LawParameter", "SpringStiffness", "SpringRest", "MotorOffset", "JointPosition", "JointAxis",
    "NumberBounds", "NumberDesign", "NumberKind", "ModelNumber", "EffectNumber", "NumberTerms",
    "JointChange", "PlacedPoint",
    # errors
    "FenicsmechError", "DescriptionError", "MeshingError", "AssemblyError", "EquilibriumError",
    "OutOfMemoryError",
]
# fmt: on
