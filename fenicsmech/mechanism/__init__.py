"""What the user describes, as pure data.

- ``materials``: names and laws with their numbers
- ``shapes``: strips, outlines, STEP parts, meshes; interface regions
- ``parts``: links, joints, motors, forces, outputs
- ``mechanism``: the builder that collects parts
- ``scene``: effects and configurations; ``effect``: what effects have in common; ``units``: labels
- ``places``: positions in a dimension, and which are one place
- ``validation``: checks of the whole; ``checks``: checks of single values
"""

from fenicsmech.mechanism.effect import Effect
from fenicsmech.mechanism.materials import (
    ONYX,
    SMOOTH_SIL_950,
    Material,
)
from fenicsmech.mechanism.mechanism import Mechanism
from fenicsmech.mechanism.parts import Drive, FlexibleLink, Force, Joint, Leader, Link, Motor, Output, RigidLink
from fenicsmech.mechanism.places import in_dimension, mechanism_length, same_place
from fenicsmech.mechanism.scene import DRAWN, Configuration, Scene
from fenicsmech.mechanism.shapes import (
    Arc,
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
    step,
    strip,
)
from fenicsmech.mechanism.units import Units
from fenicsmech.mechanism.validation import validate

__all__ = [
    "Arc",
    "Configuration",
    "DRAWN",
    "Disc",
    "Drive",
    "Effect",
    "FlexibleLink",
    "Force",
    "Joint",
    "Leader",
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
    "mechanism_length",
    "outline",
    "polygon",
    "same_place",
    "step",
    "strip",
    "validate",
]
