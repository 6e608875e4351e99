"""Interface regions: which points lie inside, and the CAD body that cuts them out of a link."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import singledispatch

import numpy as np

from fenicsmech.mechanism import Disc, Rectangle, Region
from fenicsmech.meshing.gmsh_session import gmsh
from fenicsmech.meshing.interface_site import InterfaceSite, axis_frame

DimTag = tuple[int, int]


@singledispatch
def contains(region: Region, offsets: np.ndarray, tolerance: float) -> np.ndarray:
    """Which of ``offsets`` ((n, 2), from the region's centre) lie in ``region`` or within ``tolerance`` of it."""
    raise TypeError(f"{type(region).__name__} is not an interface region")


@contains.register
def _(region: Disc, offsets: np.ndarray, tolerance: float) -> np.ndarray:
    return np.hypot(*offsets.T) <= region.radius + tolerance


@contains.register
def _(region: Rectangle, offsets: np.ndarray, tolerance: float) -> np.ndarray:
    c, s = math.cos(region.angle), math.sin(region.angle)
    lengthwise, crosswise = np.array([[c, s], [-s, c]]) @ offsets.T
    return (np.abs(lengthwise) <= 0.5 * region.length + tolerance) & (
        np.abs(crosswise) <= 0.5 * region.width + tolerance
    )


@singledispatch
def _face(region: Region, corners: Sequence[float]) -> DimTag:
    """The region as a plane face around the origin, a disc with vertices at the angles ``corners``."""
    raise TypeError(f"{type(region).__name__} is not an interface region")


@_face.register
def _(region: Disc, corners: Sequence[float]) -> DimTag:
    occ, radius = gmsh.model.occ, region.radius
    disc = 2, occ.addDisk(0.0, 0.0, 0.0, radius, radius)
    occ.rotate([disc], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, corners[0])
    points = [(0, occ.addPoint(radius * math.cos(a), radius * math.sin(a), 0.0)) for a in corners[1:]]
    return next(piece for piece in occ.fragment([disc], points)[0] if piece[0] == 2) if points else disc


@_face.register
def _(region: Rectangle, corners: Sequence[float]) -> DimTag:
    corner = -0.5 * region.length, -0.5 * region.width, 0.0
    face = 2, gmsh.model.occ.addRectangle(*corner, region.length, region.width)
    gmsh.model.occ.rotate([face], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, region.angle)
    return face


@singledispatch
def _prism(region: Region, reach: float) -> DimTag:
    """The region swept along z from −``reach`` to ``reach``, in the current gmsh model."""
    raise TypeError(f"{type(region).__name__} is not an interface region")


@_prism.register
def _(region: Disc, reach: float) -> DimTag:
    return 3, gmsh.model.occ.addCylinder(0.0, 0.0, -reach, 0.0, 0.0, 2.0 * reach, region.radius)


@_prism.register
def _(region: Rectangle, reach: float) -> DimTag:
    corner = -0.5 * region.length, -0.5 * region.width, -reach
    box = 3, gmsh.model.occ.addBox(*corner, region.length, region.width, 2.0 * reach)
    gmsh.model.occ.rotate([box], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, region.angle)
    return box


def region_face(site: InterfaceSite, *, corners: Sequence[float] = (0.0,), height: float = 0.0) -> DimTag:
    """The site's region as a face of the plane z = ``height`` in the current gmsh model.

    Args:
        site: the site; its axis must be along z.
        corners: angles (rad) from x at which the outline of a disc has vertices.
        height: z of the face.
    """
    face = _face(site.region, corners)
    x, y, _ = site.centre
    gmsh.model.occ.translate([face], x, y, height)
    return face


def region_prism(site: InterfaceSite, reach: float) -> DimTag:
    """The site's region swept along its axis by ``reach`` to either side of its centre, in the current model."""
    occ = gmsh.model.occ
    prism = _prism(site.region, reach)
    x, y, z = axis_frame(site.axis)[2]
    # rotation e_z → axis about e_z × axis
    occ.rotate([prism], 0.0, 0.0, 0.0, -y, x, 0.0 if (x or y) else 1.0, math.acos(min(z, 1.0)))
    occ.translate([prism], *site.centre)
    return prism


def solid_reach(solids: Sequence[DimTag], site: InterfaceSite) -> float:
    """A distance from the site beyond which none of ``solids`` reaches."""
    boxes = np.array([gmsh.model.occ.getBoundingBox(*solid) for solid in solids]).reshape(-1, 2, 3)
    return 1.1 * float(np.linalg.norm(np.abs(boxes - site.centre).max(axis=(0, 1))))
