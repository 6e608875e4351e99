"""The mechanism as bodies and constraints.

- ``points``: interface nodes of the mesh as functions of body poses, the design field at nodes, material points
- ``places``: the places of joints in the drawn configuration, which designs change
- ``linkage``: bodies and the constraints between them
- ``potentials``: potentials of poses, those of dead loads too, and the free coordinate of a joint
- ``spins``: idle spins, turns of bodies about the line through two ball joints, which nothing resists
- ``assembly``: the rigid assembly of a configuration, and the motions that joints, motors and springs leave
- ``rest_pose``: the pose that loads prefer where nothing else holds the mechanism
"""

from fenicsmech.multibody.assembly import (
    Assembly,
    Freedom,
    Motion,
    assemble,
    assemble_before_strain,
    count_freedom,
    free_motions,
    is_held,
    stiff_motions,
)
from fenicsmech.multibody.linkage import Body, Connection, JointSystem, Linkage, build_linkage
from fenicsmech.multibody.places import JointChange, JointPlaces
from fenicsmech.multibody.points import (
    BodyPoint,
    DesignAtNodes,
    InterfaceMap,
    LinkPoint,
    PlacedPoint,
    link_point,
    shape_functions,
)
from fenicsmech.multibody.potentials import DeadLoad, JointCoordinate, PosePotential, TravelSpring, spring_potentials
from fenicsmech.multibody.rest_pose import RestEnding, RestSearch, RestTurn
from fenicsmech.multibody.spins import Spin, spins
