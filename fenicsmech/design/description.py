"""Links and numbers that may change, as plain data, and their checks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.collective import from_one
from fenicsmech.design.numbers import Number
from fenicsmech.design.shape.shape_map import ImageRequest, ShapeRequest
from fenicsmech.design.shape.spline import lay_out
from fenicsmech.errors import DescriptionError, expect, finite, point_text, points, positive, set_fields, whole
from fenicsmech.mechanism import Centreline, FlexibleLink, Mechanism, Shape, Strip
from fenicsmech.meshing import Figure, LinkOutline, find_centreline, link_outline, matches
from fenicsmech.model import check_numbers, plan_sites
from fenicsmech.multibody import Linkage
from fenicsmech.simulation import Simulation

_AGREE = 1e-4  # largest distance between outlines of links that share a shape, over their extent


@dataclass(frozen=True)
class Bounds:
    """Fabrication bounds of a link.

    Attributes:
        thickness: least and largest thickness in the plane; one pair for each sample of a spline whose drawn thickness
            varies.
        bend: largest curvature ratio r.
    """

    thickness: tuple[float | np.ndarray, float | np.ndarray]
    bend: float


@dataclass(frozen=True)
class SplineDesign:
    """A flexible link whose shape may change: centreline and thickness as cubic Hermite segments.

    Attributes:
        link: the link.
        segments: number of cubic segments; control points beyond those at joints and free ends are placed where these
            are farthest apart.
        thickness: least and largest thickness in the plane that can be made; a third to three times the drawn one
            at the same place by default.
        bend: largest curvature ratio r, the spacing of 500 samples over the radius of curvature.
        centreline: points the centreline runs through; by default that of a strip, and of other links the line that
            halves the chords of their outline.
        ends: points where the line found in an outline begins and ends; by default joints, or free ends where the link
            runs on beyond them.
        ends_move: whether free ends, to which the centreline runs on beyond the last joint, may move; otherwise they
            stay where they are drawn, like a finger tip that has to reach a place.
        same: a link or several that are the same part in another place and keep its shape. Numbers that shift their
            joints have to shift all of them as images of one another, and numbers of their depth name all of them.
        mirrored: those that are mirror images of it.

    Raises:
        DescriptionError: a number is out of its range, or a link is named twice. Later, by a design problem: no motion
            brings the drawn link to one of ``same`` or ``mirrored``, or numbers shift joints of links that share a
            shape otherwise than as images of one another.
    """

    link: FlexibleLink
    segments: int
    thickness: tuple[float, float] | None = None
    bend: float = 0.08
    centreline: Sequence[Sequence[float]] | None = None
    ends: Sequence[Sequence[float]] | None = None
    ends_move: bool = False
    same: FlexibleLink | Sequence[FlexibleLink] = ()
    mirrored: FlexibleLink | Sequence[FlexibleLink] = ()

    def __post_init__(self) -> None:
        expect("spline design", self.link, FlexibleLink, "a flexible link", "Name a flexible link of the mechanism")
        part = f"design of link {self.link.name!r}"
        for name in ("same", "mirrored"):
            given = getattr(self, name)
            others = (given,) if isinstance(given, FlexibleLink) else given
            if not isinstance(others, Sequence) or not all(isinstance(other, FlexibleLink) for other in others):
                raise DescriptionError(part, f"{name}={given!r} are not flexible links", "Name links of the mechanism")
            set_fields(self, **{name: tuple(others)})
        names = [link.name for link in self.links]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise DescriptionError(part, f"link {twice!r} is named twice", "Name each link once")
        whole(f"number of segments of the {part}", self.segments, least=1)
        positive(f"curvature bound of the {part}", self.bend)
        if self.ends is not None:
            if self.centreline is not None:
                raise DescriptionError(part, "centreline and ends are both given", "Give one of the two")
            if len(points(f"ends of the {part}", self.ends, least=2, dimensions=(2,))) > 2:
                raise DescriptionError(part, f"{len(self.ends)} ends", "Give two points")
        if self.thickness is not None:
            try:
                least, most = self.thickness
            except (TypeError, ValueError):
                raise DescriptionError(
                    part, f"thickness {self.thickness!r}", "Give the least and the largest one"
                ) from None
            least = positive(f"least thickness of the {part}", least)
            most = finite(f"largest thickness of the {part}", most)
            set_fields(self, thickness=(least, most))
            if not least < most:
                raise DescriptionError(part, f"thickness from {least:g} to {most:g}", "Give the smaller one first")

    @property
    def links(self) -> tuple[FlexibleLink, ...]:
        """All links that have the shape: ``link``, ``same``, ``mirrored``."""
        return (self.link, *self.same, *self.mirrored)  # type: ignore[misc]  # tuples by now

    def bounds(self, thickness: float | np.ndarray) -> Bounds:
        """The bounds for a link drawn with ``thickness``, everywhere or at each sample of its spline (samples,).

        Raises:
            DescriptionError: the drawn thickness is not within them.
        """
        least, most = self.thickness or (thickness / 3.0, 3.0 * thickness)
        drawn = np.atleast_1d(thickness)
        beyond = drawn[(drawn <= least) | (drawn >= most)]
        if len(beyond):
            worst = float(beyond[0])
            raise DescriptionError(
                f"design of link {self.link.name!r}",
                f"its drawn thickness {worst:.3g} is not between {least:g} and {most:g}",
                "Draw it within the bounds, or widen them",
            )
        return Bounds((least, most), self.bend)


@dataclass(frozen=True)
class FollowingLink(SplineDesign):
    """A flexible link whose shape follows its joints, which numbers shift, and has no parameters of its own."""


_FOLLOWED = 6  # segments of a link that follows its joints: its spline has to run inside it; they add no parameters


def with_followers(designs: Sequence[SplineDesign], numbers: Sequence[Number]) -> tuple[SplineDesign, ...]:
    """``designs``, and those of further links that joints shifted by ``numbers`` take along."""
    designed = [link for design in designs for link in design.links]
    return (*designs, *(FollowingLink(link, _FOLLOWED) for link in taken_along(numbers) if link not in designed))


def taken_along(numbers: Sequence[Number]) -> list[FlexibleLink]:
    """The flexible links whose joints are shifted by ``numbers``."""
    joints = [joint for own in numbers for joint, change in own.kind.changes(2).items() if np.any(change.shift)]
    links = dict.fromkeys(link for joint in joints for link in (joint.a, joint.b))
    return [link for link in links if isinstance(link, FlexibleLink)]


def shape_requests(
    designs: Sequence[SplineDesign], simulation: Simulation, numbers: Sequence[Number] = ()
) -> list[ShapeRequest]:
    """The handles and splines of ``designs`` in a simulation; errors are those of ``shape_request``.

    Links from files are measured on the first process.
    """
    mechanism, linkage, shapes = simulation.scene.mechanism, simulation.linkage, simulation.shapes
    return from_one(
        simulation.comm, lambda: [shape_request(own, mechanism, linkage, shapes, numbers) for own in designs]
    )


def shape_request(
    design: SplineDesign,
    mechanism: Mechanism,
    linkage: Linkage,
    shapes: Mapping[FlexibleLink, Shape] | None = None,
    numbers: Sequence[Number] = (),
) -> ShapeRequest:
    """The handles and spline of ``design``. Local.

    Args:
        design: of a link.
        mechanism: with the link.
        linkage: its bodies and joints.
        shapes: of the links, as drawn by default.
        numbers: that may shift joints.

    Raises:
        DescriptionError: no centreline is found, the link has one joint and no free end, there are fewer segments
            than gaps between joints and free ends, or links that are to share the shape have other outlines.
        MeshingError: the file of the link cannot be read.
    """
    link = design.link
    part = f"design of link {link.name!r}"
    for own in design.links:
        if own not in mechanism.flexible_links:
            problem = f"it is not a flexible link of {mechanism.name!r}"
            raise DescriptionError(f"design of link {own.name!r}", problem, "Name one of its links")
    known = {own: (shapes or {}).get(own, own.shape) for own in design.links}
    shape, bodies = known[link], [linkage.bodies[i] for i in linkage.interfaces[link]]
    sites, line = plan_sites(linkage, link), design.centreline
    reach = tuple(site.reach for site in sites)
    thickness: float | LinkOutline
    if isinstance(shape, Strip):
        if design.ends is not None:
            raise DescriptionError(part, "a strip has a centreline, and ends were given", "Leave them out")
        thickness, centreline = shape.thickness, Centreline(shape.centreline if line is None else line, part=part)
    else:
        thickness = outline = LinkOutline(link_outline(link.name, shape, dim=linkage.dim), sites)
        found = find_centreline(outline, reach, design.ends, part=part) if line is None else line
        centreline = Centreline(found, part=part)
    images = _images(design, mechanism, linkage, known)
    _check_shifts(link, images, mechanism, linkage, numbers)
    everywhere = zip([link, *(mechanism.flexible_links[image.link] for image in images)], [None, *images], strict=True)
    turns = [
        [linkage.turns_about_z(linkage.interfaces[own][k]) for k in (range(len(bodies)) if i is None else i.sites)]
        for own, i in everywhere
    ]
    request = ShapeRequest(
        link=mechanism.flexible_links.index(link),
        name=link.name,
        joints=tuple((body.centre[0], body.centre[1]) for body in bodies),
        turns=tuple(all(own) for own in zip(*turns, strict=True)),
        reach=reach,
        segments=design.segments,
        centreline=centreline,
        ends_move=design.ends_move,
        joints_move=link in taken_along(numbers),
        follows=isinstance(design, FollowingLink),
        thickness=thickness,
        images=images,
    )
    lay_out(centreline, request.joints, request.reach, request.segments, part=part)  # refused before it is meshed
    return request


def _images(
    design: SplineDesign, mechanism: Mechanism, linkage: Linkage, shapes: Mapping[FlexibleLink, Shape]
) -> tuple[ImageRequest, ...]:
    """The links that share the shape of a design, and the motions to them."""
    others, part = design.links[1:], f"design of link {design.link.name!r}"
    if not others:
        return ()

    def figure(link: FlexibleLink) -> Figure:
        return Figure.of(link.name, shapes[link], plan_sites(linkage, link), dim=linkage.dim)

    own, found = figure(design.link), []
    for other in others:
        mirrored = other in design.mirrored  # type: ignore[operator]  # a tuple by now
        word = "a mirror image of" if mirrored else "the same as"
        if shapes[other].depth != shapes[design.link].depth:
            depths = f"{shapes[design.link].depth:g} and {shapes[other].depth:g}"
            raise DescriptionError(part, f"{other.name!r} is of another depth: {depths}", "Draw both of one depth")
        candidates = matches(own, figure(other), mirrored=mirrored)
        if not candidates:
            raise DescriptionError(
                part,
                f"no motion brings its interfaces to those of {other.name!r}, which is to be {word} it",
                "Draw both with the same joints and interfaces, or choose between same=… and mirrored=…",
            )
        best = min(candidates, key=lambda match: match.misfit)
        if best.misfit > _AGREE * own.extent:
            raise DescriptionError(
                part,
                f"{other.name!r}, which is to be {word} it, has an outline up to {best.misfit:.3g} away",
                "Draw both alike, or choose between same=… and mirrored=…",
            )
        close = [match for match in candidates if match.misfit <= max(2.0 * best.misfit, 1e-9 * own.extent)]
        number = mechanism.flexible_links.index(other)
        found.append(ImageRequest(number, other.name, close[0].isometry, close[0].sites))
    return tuple(found)


def joint_shifts(number: Number, link: FlexibleLink, linkage: Linkage) -> np.ndarray:
    """Shifts of the joints of a link in the plane by a unit of a number, (sites, 2)."""
    shifts = np.zeros((len(linkage.interfaces[link]), 2))
    for joint, change in number.kind.changes(linkage.dim).items():
        if link in (joint.a, joint.b):
            shifts[linkage.site(link, joint)] = change.shift[:2]
    return shifts


def _check_shifts(
    link: FlexibleLink,
    images: Sequence[ImageRequest],
    mechanism: Mechanism,
    linkage: Linkage,
    numbers: Sequence[Number],
) -> None:
    """Refuses numbers that shift joints of a link and of its images otherwise than as images of one another."""
    for number, image in ((number, image) for number in numbers for image in images):
        other = mechanism.flexible_links[image.link]
        wanted = image.isometry.vectors(joint_shifts(number, link, linkage))
        given = joint_shifts(number, other, linkage)[image.sites]
        unlike = np.flatnonzero(np.linalg.norm(given - wanted, axis=1) > _AGREE)
        if len(unlike):
            site = linkage.bodies[linkage.interfaces[other][image.sites[unlike[0]]]].name
            pair = point_text(np.round(wanted[unlike[0]], 6)), point_text(given[unlike[0]])
            remedy = f"Name this joint with the direction {pair[0]}: direction=[…] has one for each joint"
            if not np.any(wanted[unlike[0]]):
                remedy = f"Name the joint of {link.name!r} too that this one is the image of"
            raise DescriptionError(
                str(number),
                f"the image of {link.name!r} in {other.name!r} has {site!r} shifted along {pair[0]}, not {pair[1]}",
                remedy,
            )


def check_designs(designs: Sequence[SplineDesign | Number]) -> None:
    """Refuses an empty list of designs, and two designs of one link or number, with a DescriptionError."""
    if not designs:
        raise DescriptionError(
            "design problem", "no link or number may change", "Name them with SplineDesign(…) or Number(…)"
        )
    for design in designs:
        sorts, remedy = SplineDesign | Number, "Give SplineDesign(…) or Number(…)"
        expect("design problem", design, sorts, "a design of a link or number", remedy)
    numbers = [design for design in designs if isinstance(design, Number)]
    check_numbers([(own.kind, (own.least, own.most)) for own in numbers])
    shapes = [design for design in designs if isinstance(design, SplineDesign)]
    names = [link.name for design in shapes for link in design.links]
    for name in names:
        if names.count(name) > 1:
            raise DescriptionError(f"design of link {name!r}", "it is given twice", "Give each link once")
    for shape in (shape for shape in shapes if len(shape.links) > 1):
        for kind in (number.kind for number in numbers):
            missing = [link.name for link in shape.links if link not in kind.reshaped]
            if 0 < len(missing) < len(shape.links):
                raise DescriptionError(
                    str(kind),
                    f"{missing[0]!r} shares the shape of {shape.link.name!r}",
                    "Name all links that do, or the joints of all",
                )
