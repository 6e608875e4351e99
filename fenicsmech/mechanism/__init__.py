"""The description of a mechanism, as pure data.

- ``shapes``: strips and their centrelines, outlines, STEP parts, meshes; interface regions, clamps
- ``units``, ``strength``: units of a scene, strength of a material
- ``cards``: materials from cards, plain data with its public sources
- ``parts``: materials, links, joints, motors, forces, outputs, and their positions
- ``mechanism``: the builder that collects parts
- ``scene``: effects, configurations, names of units, and checks of the whole
"""

from fenicsmech.mechanism.cards import (
    ONYX,
    SMOOTH_SIL_950,
    Figure,
    MaterialCard,
    Source,
    material,
    material_card,
    material_names,
)
from fenicsmech.mechanism.mechanism import Mechanism
from fenicsmech.mechanism.parts import (
    Drive,
    FlexibleLink,
    Force,
    ForceGroup,
    Joint,
    Link,
    Material,
    MaterialPoint,
    Motor,
    Output,
    PrescribedPart,
    RigidLink,
    in_dimension,
    same_place,
)
from fenicsmech.mechanism.scene import DRAWN, Configuration, Effect, Scene, check_loads, check_units, validate
from fenicsmech.mechanism.shapes import (
    Arc,
    Centreline,
    Disc,
    Face,
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
from fenicsmech.mechanism.strength import Allowable, Basquin, Strength, goodman
from fenicsmech.mechanism.units import Units
