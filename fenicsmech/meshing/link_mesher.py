"""From the shape of a link to its mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from fenicsmech.checks import positive
from fenicsmech.errors import DescriptionError, MeshingError
from fenicsmech.mechanism import Shape
from fenicsmech.meshing.interface_site import InterfaceSite
from fenicsmech.meshing.link_mesh import LinkMesh
from fenicsmech.meshing.mesh_checks import check_link_mesh
from fenicsmech.meshing.mesh_request import MeshRequest, check_shape, holds, mesh_shape
from fenicsmech.meshing.sizing import LEAST_SEGMENTS


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
    """Mesh one link so that the cells of each interface fill the region where its joint holds the link.

    The same input gives the same arrays. Lengths have no preferred unit, except that STEP files are read in mm.

    Args:
        name: the link's name, for messages.
        shape: what the link looks like.
        sites: where joints hold it; ``LinkMesh.interface`` counts them.
        dim: 2 (triangles) or 3 (tetrahedra).
        size: target edge length, in the plane for links that are extruded.
        layers: layers through the depth of an extruded link; None: one per two element sizes.
        segments: of which the circle around a pin has at least so many.
        half: mesh the half above the mid-plane z = 0 only, which ``layers`` count through then.

    Raises:
        MeshingError: the link cannot be meshed as described, a joint is not on the link or holds no cell, or the
            regions of two joints touch.
        DescriptionError: an argument makes no sense, or half is asked of a shape without mirror symmetry.
    """
    request = _request(name, sites, dim, size, layers, segments, half)
    check_shape(shape, request)
    return check_link_mesh(mesh_shape(shape, request), request)


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
    """Refuse what can be seen to be wrong with a link before it is meshed; arguments as in ``mesh_link``.

    Args:
        points: further points that must be on the link, by name: where forces act and displacements are read.

    Raises:
        MeshingError: as ``mesh_link``, or one of ``points`` is not on the link.
        DescriptionError: as ``mesh_link``.
    """
    request = _request(name, sites, dim, size, layers, segments, half)
    check_shape(shape, request)
    for part, at in points.items():
        if not holds(shape, request, tuple(at)):
            shown = ", ".join(f"{c:g}" for c in at)
            raise MeshingError(f"{part!r}", f"the point ({shown}) is not on link {name!r}", "Move it onto the link")


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
        # in the plane there is only one way to sweep a region, whatever the joint's own axis (of a slider, say)
        sites = [replace(site, axis=(0.0, 0.0, 1.0)) for site in sites]
    return MeshRequest(name, tuple(sites), dim, size, layers, segments, half)
