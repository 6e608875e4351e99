"""Links that are images of each other: one drawn shape in two places, turned or mirrored.

    x′ = Q x + c,     Qᵀ Q = I,     det Q = 1, or −1 of a mirror image

Q and c follow from the joints, and where there is a single one from the centroid of the outline as well. Joints have to
coincide with joints whose interfaces have the same extent, outlines with outlines. Such links have meshes that are
images too: a mechanism that is symmetric as drawn is symmetric as meshed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fenicsmech.mechanism import Centreline, Disc, Outline, Shape, Strip
from fenicsmech.meshing.link_mesh import FREE, CurvedEdges, LinkMesh
from fenicsmech.meshing.link_mesher import InterfaceSite
from fenicsmech.meshing.outline import link_outline, sampled
from fenicsmech.polygons import distance_to, signed_area

_SAMPLED = 1e-5  # largest distance of an outline's polygon from its curves, over its extent
_EXACT = 1e-9  # misfit of images with one mesh, over the extent: the rounding of coordinates typed with ten digits


@dataclass(frozen=True, eq=False)
class Isometry:
    """A rigid motion of the plane, x′ = Q x + c; coordinates along z stay.

    Attributes:
        matrix: Q, (2, 2).
        offset: c, (2,).
    """

    matrix: np.ndarray
    offset: np.ndarray

    @classmethod
    def identity(cls) -> Isometry:
        """The motion that leaves all points where they are."""
        return cls(np.eye(2), np.zeros(2))

    @property
    def mirrors(self) -> bool:
        """Whether det Q = −1."""
        return bool(np.linalg.det(self.matrix) < 0.0)

    @property
    def inverse(self) -> Isometry:
        """The motion back."""
        return Isometry(self.matrix.T, -self.matrix.T @ self.offset)

    def points(self, x: np.ndarray) -> np.ndarray:
        """The images of points (…, dim)."""
        moved = self.vectors(x)
        moved[..., :2] += self.offset
        return moved

    def vectors(self, v: np.ndarray) -> np.ndarray:
        """The images of differences of points (…, dim)."""
        moved = np.array(v, dtype=float)
        moved[..., :2] = moved[..., :2] @ self.matrix.T
        return moved


@dataclass(frozen=True, eq=False)
class Figure:
    """The outline of a link and its interfaces.

    Attributes:
        polygon: vertices of the outline, (n, 2).
        sites: its interfaces.
    """

    polygon: np.ndarray
    sites: tuple[InterfaceSite, ...]

    @classmethod
    def of(cls, name: str, shape: Shape, sites: Sequence[InterfaceSite], *, dim: int) -> Figure:
        """That of a link; errors are those of ``link_outline``."""
        if dim == 2:
            sites = [replace(site, axis=(0.0, 0.0, 1.0)) for site in sites]
        if isinstance(shape, Strip):
            curve = Centreline(shape.centreline, part=f"link {name!r}")
            s = curve.samples(16)
            side = 0.5 * shape.thickness * curve.normal(s)
            return cls(np.concatenate([curve.evaluate(s) + side, (curve.evaluate(s) - side)[::-1]]), tuple(sites))
        curves = link_outline(name, shape, dim=dim)
        rough = sampled(curves, math.inf)
        return cls(sampled(curves, _SAMPLED * float(np.ptp(rough, axis=0).max())), tuple(sites))

    @cached_property
    def joints(self) -> np.ndarray:
        """The places of the joints in the plane, (sites, 2)."""
        return np.array([site.centre[:2] for site in self.sites]).reshape(-1, 2)

    @cached_property
    def extent(self) -> float:
        """The larger side of the box around the outline."""
        return float(np.ptp(self.polygon, axis=0).max())

    @cached_property
    def centroid(self) -> np.ndarray:
        """That of the area, (2,)."""
        x, middle = self.polygon - self.polygon[0], self.polygon[0]
        after = np.roll(x, -1, axis=0)
        cross = x[:, 0] * after[:, 1] - x[:, 1] * after[:, 0]
        return middle + (cross[:, None] * (x + after)).sum(axis=0) / (3.0 * cross.sum())


@dataclass(frozen=True, eq=False)
class Match:
    """A motion that brings a link close to another one.

    Attributes:
        isometry: the motion.
        sites: the other link's interface at the place of each of the link's own, (sites,).
        misfit: largest distance between outlines or joints.
    """

    isometry: Isometry
    sites: np.ndarray
    misfit: float


def matches(one: Figure, other: Figure, *, mirrored: bool) -> list[Match]:
    """The motions of ``one`` to ``other`` that bring interfaces to interfaces of the same extent.

    A symmetric link has several. Their order depends only on where both are drawn; translations come first.

    Args:
        one: a link.
        other: another one.
        mirrored: whether det Q = −1, else det Q = 1.
    """
    if len(one.sites) != len(other.sites) or not one.sites:
        return []
    arms, targets = one.joints - one.centroid, other.joints - other.centroid
    arm = arms[np.argmax(np.linalg.norm(arms, axis=1))]
    if np.linalg.norm(arm) < 1e-3 * one.extent:  # one joint, at the centroid
        arms, targets = (own.polygon - own.centroid for own in (one, other))
        arm = arms[np.argmax(np.linalg.norm(arms, axis=1))]
    found = []
    for target in targets[np.abs(np.linalg.norm(targets, axis=1) - np.linalg.norm(arm)) < 0.1 * one.extent]:
        turn = _turn(math.atan2(*arm[::-1]), math.atan2(*target[::-1]), mirrored)
        guess = Isometry(turn, other.centroid - turn @ one.centroid)
        away = np.linalg.norm(guess.points(one.joints)[:, None] - other.joints, axis=2)
        sites = np.argmin(away, axis=1)
        if len(set(sites.tolist())) < len(sites):
            continue
        if len(sites) > 1:
            isometry = _fitted(one.joints, other.joints[sites], mirrored)
        else:
            isometry = replace(guess, offset=other.joints[0] - turn @ one.joints[0])
        pairs = zip(one.sites, (other.sites[k] for k in sites), strict=True)
        if all(_falls_on(isometry, site, place, 1e-6 * one.extent) for site, place in pairs):
            found.append(Match(isometry, sites, _misfit(isometry, one, other, sites)))
    return sorted(found, key=lambda match: (-np.round(match.isometry.matrix, 6)).ravel().tolist())


def same_mesh(one: Figure, other: Figure) -> Match | None:
    """The motion of ``one`` to ``other`` if outlines agree to rounding, so that both can share a mesh; else None.

    If there are several, as for symmetric links, translations come first, then mirror images.
    """
    if abs(abs(signed_area(one.polygon)) - abs(signed_area(other.polygon))) > _EXACT * one.extent**2:
        return None
    turned, over = (
        [match for match in matches(one, other, mirrored=mirrored) if match.misfit <= _EXACT * one.extent]
        for mirrored in (False, True)
    )
    translations = [match for match in turned if np.allclose(match.isometry.matrix, np.eye(2), atol=_EXACT)]
    return next(iter([*translations, *over, *turned]), None)


def image_of(mesh: LinkMesh, isometry: Isometry, sites: np.ndarray) -> LinkMesh:
    """The image of a mesh, whose interface k is called ``sites[k]``; vertices and cells keep their order."""
    interface = np.where(mesh.interface == FREE, FREE, np.append(sites, FREE)[mesh.interface])
    curved = CurvedEdges(mesh.curved.ends.copy(), isometry.vectors(mesh.curved.bulges))
    return LinkMesh.from_cells(isometry.points(mesh.points), mesh.cells.copy(), interface, curved)


def has_plain_outline(shape: Shape) -> bool:
    """Whether outline and depth describe a shape completely; those of files have more."""
    return isinstance(shape, Strip | Outline)


def _turn(before: float, after: float, mirrored: bool) -> np.ndarray:
    """Q that turns the direction at one angle to that at the other."""
    angle = after + before if mirrored else after - before
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s], [s, -c]]) if mirrored else np.array([[c, -s], [s, c]])


def _fitted(before: np.ndarray, after: np.ndarray, mirrored: bool) -> Isometry:
    """The motion of points (n, 2) that comes closest to others (Kabsch 1976, doi:10.1107/S0567739476001873)."""
    here, there = before.mean(axis=0), after.mean(axis=0)
    left, _, right = np.linalg.svd((after - there).T @ (before - here))
    sign = np.linalg.det(left @ right) * (-1.0 if mirrored else 1.0)
    turn = left @ np.diag([1.0, np.sign(sign)]) @ right
    return Isometry(turn, there - turn @ here)


def _falls_on(isometry: Isometry, site: InterfaceSite, place: InterfaceSite, tolerance: float) -> bool:
    """Whether the image of an interface has the extent of another one, and its height and axis."""
    axis = isometry.vectors(np.array(site.axis, dtype=float))
    if np.linalg.norm(np.cross(axis, place.axis)) > 1e-6 or abs(site.centre[2] - place.centre[2]) > tolerance:
        return False
    if isinstance(site.region, Disc) or isinstance(place.region, Disc):
        both = isinstance(site.region, Disc) and isinstance(place.region, Disc)
        return both and abs(site.region.radius - place.region.radius) <= tolerance  # type: ignore[union-attr]
    if not (site.is_planar and place.is_planar):
        return False
    corners = [_corners(own) for own in (site, place)]
    away = np.linalg.norm(isometry.points(corners[0])[:, None] - corners[1], axis=2)
    return bool(away.min(axis=1).max() <= tolerance)


def _corners(site: InterfaceSite) -> np.ndarray:
    """Corners of a rectangle (4, 2)."""
    region = site.region
    assert not isinstance(region, Disc)
    c, s = math.cos(region.angle), math.sin(region.angle)
    half = 0.5 * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]) * (region.length, region.width)
    return site.centre[:2] + half @ np.array([[c, s], [-s, c]])


def _misfit(isometry: Isometry, one: Figure, other: Figure, sites: np.ndarray) -> float:
    moved = isometry.points(one.polygon)
    there = max(distance_to(other.polygon, point) for point in moved)
    back = max(distance_to(moved, point) for point in other.polygon)
    joints = np.linalg.norm(isometry.points(one.joints) - other.joints[sites], axis=1).max()
    return float(max(there, back, joints))
