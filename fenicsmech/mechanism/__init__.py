"""The description of a mechanism, as pure data.

- ``materials``: names and laws with their numbers
- ``shapes``: strips and their centrelines, outlines, STEP parts, meshes; interface regions, clamps
- ``parts``: links, joints, motors, forces, outputs, and their positions
- ``mechanism``: the builder that collects parts
- ``scene``: effects, configurations and names of units
- ``validation``: checks of the whole
"""

from fenicsmech.mechanism.materials import (
    ONYX,
    SMOOTH_SIL_950,
    Material,
)
from fenicsmech.mechanism.mechanism import Mechanism
from fenicsmech.mechanism.parts import (
    Drive,
    FlexibleLink,
    Force,
    Joint,
    Link,
    Motor,
    Output,
    PrescribedPart,
    RigidLink,
    in_dimension,
    same_place,
)
from fenicsmech.mechanism.scene import DRAWN, Configuration, Effect, Scene, Units
from fenicsmech.mechanism.shapes import (
    Arc,
    Centreline,
    Disc,
    Line,
    MeshPart,
    Outline,
    Rectangle,
    Region,
    Shape,
    StepPart,
    Strip,
    gmsh_mesh,
    outline,
    polygon,
    step_file,
    strip,
)
from fenicsmech.mechanism.validation import validate

__all__ = [
    "Arc",
    "Centreline",
    "Configuration",
    "DRAWN",
    "Disc",
    "Drive",
    "Effect",
    "FlexibleLink",
    "Force",
    "Joint",
    "PrescribedPart",
    "Line",
    "Link",
    "Material",
    "Mechanism",
    "MeshPart",
    "Motor",
    "ONYX",
    "Outline",
    "Output",
    "Rectangle",
    "Region",
    "RigidLink",
    "SMOOTH_SIL_950",
    "Scene",
    "Shape",
    "StepPart",
    "Strip",
    "Units",
    "gmsh_mesh",
    "in_dimension",
    "outline",
    "polygon",
    "same_place",
    "step_file",
    "strip",
    "validate",
]
