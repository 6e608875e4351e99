"""The mesh of a link from its shape, and the checks that every link mesh passes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from fenicsmech.checks import point_text, positive
from fenicsmech.errors import DescriptionError, MeshingError
from fenicsmech.log import logger
from fenicsmech.mechanism import Arc, Outline, Shape, Strip
from fenicsmech.meshing.link_mesh import FREE, LinkMesh, cell_measures, count_pieces
from fenicsmech.meshing.request import LEAST_SEGMENTS, InterfaceSite, MeshRequest, check_shape, holds, mesh_shape
from fenicsmech.meshing.strip import clamp_defect
from fenicsmech.polygons import signed_area

_log = logger(__name__)


def mesh_link(
    name: str,
    shape: Shape,
    sites: Sequence[InterfaceSite] = (),
    *,
    dim: int,
    size: float,
    layers: int | None = None,
    segments: int = LEAST_SEGMENTS,
    half: bool = False,
) -> LinkMesh:
    """Meshes one link so that the cells of each interface fill the region where its joint holds the link.

    The same input gives the same arrays. Lengths have no preferred unit, except that STEP files are read in mm.

    Args:
        name: the link's name, for messages.
        shape: the link's shape.
        sites: of its interfaces, in the order of ``LinkMesh.interface``.
        dim: 2 (triangles) or 3 (tetrahedra).
        size: target edge length, in the plane for links that are extruded.
        layers: layers through the depth of an extruded link; None: one per two element sizes.
        segments: least number of segments of the circle around a pin.
        half: mesh the half above the mid-plane z = 0 only; ``layers`` are those of the half.

    Raises:
        MeshingError: the link cannot be meshed as described, a joint is not on the link or holds no cell, or the
            regions of two joints touch.
        DescriptionError: an argument is out of its range, or ``half`` is set for a shape without mirror symmetry.
    """
    request = _request(name, sites, dim, size, layers, segments, half)
    check_shape(shape, request)
    mesh = mesh_shape(shape, request)
    _check_volumes(mesh, request)
    _check_connected(mesh, request)
    for number, site in enumerate(request.sites):
        _check_held(mesh, request, number, site)
    _check_apart(mesh, request)
    _check_flexible(mesh, request)
    return mesh


def check_link(
    name: str,
    shape: Shape,
    sites: Sequence[InterfaceSite],
    points: Mapping[str, Sequence[float]],
    *,
    dim: int,
    size: float,
    layers: int | None = None,
    segments: int = LEAST_SEGMENTS,
    half: bool = False,
) -> None:
    """Checks a link before it is meshed; arguments as in ``mesh_link``.

    A warning is logged for rectangles that do not hold a strip as a clamp across it would.

    Args:
        points: further points that must be on the link, by name: where forces act and displacements are read.

    Raises:
        MeshingError: as ``mesh_link``, or one of ``points`` is not on the link.
        DescriptionError: as ``mesh_link``.
    """
    request = _request(name, sites, dim, size, layers, segments, half)
    check_shape(shape, request)
    for site in request.sites:
        if isinstance(shape, Strip) and (defect := clamp_defect(shape, site)):
            _log.warning("%s: %s. %s", request.part_at(site), *defect)
    for part, at in points.items():
        if not holds(shape, request, tuple(at)):
            raise MeshingError(
                f"{part!r}", f"the point {point_text(at)} is not on link {name!r}", "Move it onto the link"
            )


def typical_thickness(shape: Shape, part: str) -> float:
    """The thickness of a strip, or t = 2 A / P of the long strip with the area A and the perimeter P of an outline.

    Args:
        shape: of the link.
        part: its name, for messages.

    Raises:
        DescriptionError: the shape is known from a file only.
    """
    match shape:
        case Strip():
            return shape.thickness
        case Outline():
            # arcs count as the two chords that they are given by
            corners = [shape.start]
            for segment in shape.segments:
                corners += [segment.via, segment.end] if isinstance(segment, Arc) else [segment.end]
            polygon = np.array(corners)
            perimeter = np.hypot(*(np.roll(polygon, -1, axis=0) - polygon).T).sum()
            return float(2.0 * abs(signed_area(polygon)) / perimeter)
    raise DescriptionError(part, "its shape comes from a file, so its thickness is not known", "Give size=… for it")


def _request(
    name: str,
    sites: Sequence[InterfaceSite],
    dim: int,
    size: float,
    layers: int | None,
    segments: int,
    half: bool,
) -> MeshRequest:
    part = f"mesh of link {name!r}"
    size = positive(f"element size, {part}", size)
    if dim not in (2, 3):
        raise DescriptionError(part, f"dim is {dim!r}", "Give 2 or 3")
    if layers is not None and not (isinstance(layers, int) and layers > 0):
        raise DescriptionError(part, f"the number of layers is {layers!r}", "Give a whole number from 1 up")
    if not (isinstance(segments, int) and segments >= LEAST_SEGMENTS):
        raise DescriptionError(
            part, f"the number of segments around pins is {segments!r}", f"Give a whole number from {LEAST_SEGMENTS} up"
        )
    if dim == 2 or half:
        # in the plane every region is swept along z, whatever the joint's own axis (of a slider, say)
        sites = [replace(site, axis=(0.0, 0.0, 1.0)) for site in sites]
    return MeshRequest(name, tuple(sites), dim, size, layers, segments, half)


def _check_volumes(mesh: LinkMesh, request: MeshRequest) -> None:
    longest = np.ptp(mesh.points[mesh.cells], axis=1).max(axis=1)
    flat = np.flatnonzero(cell_measures(mesh.points, mesh.cells) <= 1e-12 * longest**mesh.dim)
    if len(flat):
        where = point_text(mesh.points[mesh.cells[flat[0]]].mean(axis=0))
        raise MeshingError(
            request.part,
            f"{len(flat)} of {len(mesh.cells)} cells have no volume, one of them at {where}",
            "Remove tiny features from the shape, or change the element size",
        )


def _check_connected(mesh: LinkMesh, request: MeshRequest) -> None:
    pieces = count_pieces(mesh.cells)
    if pieces > 1:
        raise MeshingError(
            request.part, f"the link falls into {pieces} separate pieces", "Describe each piece as a link of its own"
        )


def _check_held(mesh: LinkMesh, request: MeshRequest, number: int, site: InterfaceSite) -> None:
    held = mesh.cells_of(number)
    tolerance = 1e-2 * request.size  # of joints off their link, by rounded coordinates or flattened arcs
    offsets = site.across(mesh.points)
    away = _distance(offsets, mesh.cells)
    if away > tolerance and not _surrounds(offsets, held):
        raise MeshingError(
            request.part_at(site),
            f"the point {point_text(site.at)} is not on the link, but {away:g} away from it",
            "Move the joint onto the link, or change the link's shape",
        )
    if not len(held):
        raise MeshingError(
            request.part_at(site),
            f"no cell lies in {site.region} around {point_text(site.at)}",
            "Make the region larger or the elements smaller",
        )
    if mesh.dim == len(site.at) == 3:
        heights = site.along(mesh.points[np.unique(held)])
        if heights.min() > tolerance or heights.max() < -tolerance:
            raise MeshingError(
                request.part_at(site),
                f"the point {point_text(site.at)} is not on the link: along the joint's axis the link lies between "
                f"{heights.min():g} and {heights.max():g} from it",
                "Move the joint along its axis onto the link",
            )


def _distance(offsets: np.ndarray, cells: np.ndarray) -> float:
    """Distance of the origin of the plane from the projection of the nearest cell; 0 inside one."""
    nearest = math.inf
    for kept in combinations(range(cells.shape[1]), 3):
        corners = offsets[cells[:, list(kept)]]
        edges = np.roll(corners, -1, axis=1) - corners
        squares = np.maximum(np.einsum("mkd,mkd->mk", edges, edges), np.finfo(float).tiny)
        # twice the area to the left of each edge, seen from the origin; their sum is twice the triangle's area
        left = edges[..., 1] * corners[..., 0] - edges[..., 0] * corners[..., 1]
        upright = np.abs(left.sum(axis=1)) <= 1e-9 * squares.max(axis=1)  # projected onto a line
        if np.any(~upright & (np.all(left >= 0.0, axis=1) | np.all(left <= 0.0, axis=1))):
            return 0.0
        foot = np.clip(-np.einsum("mkd,mkd->mk", corners, edges) / squares, 0.0, 1.0)
        nearest = min(nearest, float(np.linalg.norm(corners + foot[..., None] * edges, axis=2).min()))
    return nearest


def _surrounds(offsets: np.ndarray, cells: np.ndarray) -> bool:
    """Whether the projections of ``cells`` stand around the origin on all sides, as around a pin hole."""
    if not len(cells):
        return False
    angles = np.arctan2(offsets[cells, 1], offsets[cells, 0])
    # a cell beside the origin subtends less than a half turn, measured from its own first vertex
    relative = np.angle(np.exp(1j * (angles - angles[:, :1])))
    start = angles[:, 0] + relative.min(axis=1)
    width = np.ptp(relative, axis=1)
    start = np.mod(start, 2.0 * math.pi)
    order = np.argsort(start)
    start, reach = start[order], np.maximum.accumulate((start + width)[order])
    # the last arcs may run over into the next turn
    first_covered = max(reach[-1] - 2.0 * math.pi, 0.0)
    covered = np.maximum(reach[:-1], first_covered)
    gaps_inside = start[1:] - covered
    closes = start[0] + 2.0 * math.pi - reach[-1]
    return bool(np.all(gaps_inside <= 1e-6) and closes <= 1e-6)


def _check_apart(mesh: LinkMesh, request: MeshRequest) -> None:
    """Refuses two interfaces with a common vertex, which could not follow both bodies."""
    held = mesh.interface != FREE
    holder = np.repeat(mesh.interface[held], mesh.dim + 1)
    vertex = mesh.cells[held].reshape(-1)
    pairs = np.unique(np.column_stack([vertex, holder]), axis=0)
    shared = np.flatnonzero(pairs[1:, 0] == pairs[:-1, 0])
    if len(shared):
        raise request.overlap(int(pairs[shared[0], 1]), int(pairs[shared[0] + 1, 1]))


def _check_flexible(mesh: LinkMesh, request: MeshRequest) -> None:
    if not np.any(mesh.interface == FREE):
        raise MeshingError(
            request.part,
            "the interface regions of its joints cover the whole link, so nothing of it can bend",
            "Make the regions smaller, or the link rigid",
        )
