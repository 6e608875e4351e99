"""Rigid coordinates of the mechanism: u = u(s) for interface nodes, points that ride on bodies or links.

- ``interfaces``: interface nodes of the mesh as functions of body poses, and the transposes of that map
- ``interpolation``: the design field at the nodes of the displacement field
- ``points``: material points: position, gradient and Hessian with respect to the state
"""

from fenicsmech.bodies.interfaces import InterfaceMap
from fenicsmech.bodies.interpolation import DesignAtNodes
from fenicsmech.bodies.points import BodyPoint, LinkPoint, MaterialPoint, body_point, link_point

__all__ = ["BodyPoint", "DesignAtNodes", "InterfaceMap", "LinkPoint", "MaterialPoint", "body_point", "link_point"]
