"""A design problem as plain data: links that may change, targets; and the checks of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.checks import finite, positive
from fenicsmech.design.shape.shape_map import ShapeRequest
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import DRAWN, Centreline, Configuration, FlexibleLink, Force, Mechanism, Strip
from fenicsmech.multibody import Linkage, assemble
from fenicsmech.simulation import Simulation, read_request


@dataclass(frozen=True)
class Bounds:
    """Fabrication bounds of a link.

    Attributes:
        thickness: least and largest thickness in the plane.
        bend: largest curvature ratio r.
    """

    thickness: tuple[float, float]
    bend: float


@dataclass(frozen=True)
class SplineDesign:
    """A flexible link whose shape may change: centreline and thickness as cubic Hermite segments.

    Attributes:
        link: the link.
        segments: number of cubic segments; control points beyond the joints go where joints are farthest apart.
        thickness: least and largest thickness in the plane that can be made; a third to three times the drawn one
            by default.
        bend: largest curvature ratio r, the spacing of 500 samples over the radius of curvature.
        centreline: points the centreline runs through; that of a strip by default.

    Raises:
        DescriptionError: a number makes no sense.
    """

    link: FlexibleLink
    segments: int
    thickness: tuple[float, float] | None = None
    bend: float = 0.08
    centreline: Sequence[Sequence[float]] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.link, FlexibleLink):
            raise DescriptionError(
                "spline design", f"{self.link!r} is not a flexible link", "Name one of the mechanism's"
            )
        part = f"design of link {self.link.name!r}"
        if not isinstance(self.segments, int) or self.segments < 1:
            raise DescriptionError(part, f"{self.segments!r} segments", "Give a whole number of at least 1")
        positive(f"curvature bound of the {part}", self.bend)
        if self.thickness is not None:
            if not isinstance(self.thickness, Sequence) or len(self.thickness) != 2:
                raise DescriptionError(part, f"thickness {self.thickness!r}", "Give the least and the largest one")
            least, most = self.thickness
            positive(f"least thickness of the {part}", least)
            finite(f"largest thickness of the {part}", most)
            if not least < most:
                raise DescriptionError(part, f"thickness from {least:g} to {most:g}", "Give the smaller one first")

    def bounds(self, thickness: float) -> Bounds:
        """The bounds for a link drawn with ``thickness``.

        Raises:
            DescriptionError: the drawn thickness is not within them.
        """
        least, most = self.thickness or (thickness / 3.0, 3.0 * thickness)
        if not least < thickness < most:
            raise DescriptionError(
                f"design of link {self.link.name!r}",
                f"its drawn thickness {thickness:.3g} is not between {least:g} and {most:g}",
                "Draw it within the bounds, or widen them",
            )
        return Bounds((least, most), self.bend)


@dataclass(frozen=True)
class Target:
    """A wanted sample of a load–displacement curve.

    Attributes:
        part: the force that acts.
        force: its magnitude.
        displacement: target displacement of its point along it.
        configuration: motor positions.
        weight: of its squared relative error in the objective.

    Raises:
        DescriptionError: a number makes no sense.
    """

    part: Force
    force: float
    displacement: float
    configuration: Configuration = DRAWN
    weight: float = 1.0

    def __post_init__(self) -> None:
        if not isinstance(self.part, Force):
            raise DescriptionError("target", f"{self.part!r} is not a force", "Give one of the mechanism's")
        finite(f"force of a target for {self.part.name!r}", self.force)
        finite(f"displacement of a target for {self.part.name!r}", self.displacement)
        positive(f"weight of a target for {self.part.name!r}", self.weight)


def shape_request(design: SplineDesign, mechanism: Mechanism, linkage: Linkage) -> ShapeRequest:
    """The handles and spline of ``design``.

    Raises:
        DescriptionError: no centreline is known, or there are fewer segments than gaps between joints.
    """
    link = design.link
    part = f"design of link {link.name!r}"
    if link not in mechanism.flexible_links:
        raise DescriptionError(part, f"it is not a flexible link of {mechanism.name!r}", "Name one of its links")
    points = design.centreline
    if points is None:
        if not isinstance(link.shape, Strip):
            raise DescriptionError(part, "its shape has no centreline", "Give centreline=…, points along the link")
        points = link.shape.centreline
    centreline = Centreline(points, part=part)
    bodies = [linkage.bodies[i] for i in linkage.interfaces[link]]
    joints = tuple((body.centre[0], body.centre[1]) for body in bodies)
    stations = sorted(centreline.closest(at) for at in joints)
    gaps = np.diff(stations)
    interior = np.zeros(len(gaps), dtype=int)
    if design.segments < len(gaps):
        raise DescriptionError(
            part, f"{design.segments} segment(s) for {len(gaps)} gaps between joints", f"Give at least {len(gaps)}"
        )
    for _ in range(design.segments - len(gaps)):
        interior[int(np.argmax(gaps / (interior + 1)))] += 1
    welded = {joint.at[:2] for joint in mechanism.joints if joint.kind.clamps and link in (joint.a, joint.b)}
    return ShapeRequest(
        link=mechanism.flexible_links.index(link),
        name=link.name,
        centreline=centreline,
        thickness=link.shape.thickness if isinstance(link.shape, Strip) else None,
        joints=joints,
        turns=tuple(at not in welded for at in joints),
        interior=tuple(int(n) for n in interior),
    )


def check_designs(designs: Sequence[SplineDesign]) -> None:
    """Refuses designs of no link, and two of one link, with a DescriptionError."""
    if not designs:
        raise DescriptionError("design problem", "no link may change", "Name links with SplineDesign(…)")
    for design in designs:
        if not isinstance(design, SplineDesign):
            raise DescriptionError("design problem", f"{design!r} is not a design of a link", "Give SplineDesign(…)")
    names = [design.link.name for design in designs]
    for name in names:
        if names.count(name) > 1:
            raise DescriptionError(f"design of link {name!r}", "it is given twice", "Give each link once")


def check_targets(simulation: Simulation, targets: Sequence[Target]) -> None:
    """Refuses targets whose force or configuration ``simulation`` does not have.

    Raises:
        DescriptionError: a target is missing, or one of another mechanism.
        AssemblyError: a configuration does not assemble.
    """
    if not targets:
        raise DescriptionError("design problem", "nothing is wanted", "Give targets=[Target(…), …]")
    for target in targets:
        if not isinstance(target, Target):
            raise DescriptionError("design problem", f"{target!r} is not a target", "Give Target(…)")
        read_request(
            simulation.scene.mechanism,
            target.part,
            forces=[target.force],
            displacements=None,
            configuration=target.configuration,
            others=None,
        )
        assemble(simulation.linkage, target.configuration)


def check_sensitivities(
    targets: Sequence[Target], designs: Sequence[SplineDesign], *, sensitivities: np.ndarray, errors: np.ndarray
) -> None:
    """Refuses targets that are missed and that no parameter moves.

    Args:
        targets: wanted displacements.
        designs: the links that may change.
        sensitivities: relative change of each displacement when a parameter changes by its length ℓ,
            (targets, parameters).
        errors: relative errors of the displacements, (targets,).

    Raises:
        DescriptionError: naming the first such target.
    """
    names, rounding = ", ".join(repr(design.link.name) for design in designs), 1e-9
    for target, row, error in zip(targets, sensitivities, errors, strict=True):
        if np.abs(row).max(initial=0.0) > rounding or abs(error) <= rounding:
            continue
        if target.force == 0.0:
            reason, remedy = "no force acts", "Give a force that is not zero"
        else:
            reason = f"{names} do not carry the force, or something rigid holds its point"
            remedy = "Let links change that carry it, or give targets of another force"
        raise DescriptionError(
            f"target of {target.part.name!r} ({target.force:g} in configuration {target.configuration.name!r})",
            f"its displacement does not depend on the shapes that may change: {reason}",
            remedy,
        )
