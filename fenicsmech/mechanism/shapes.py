"""Shapes of links and of their interfaces, as plain data (lengths in the user's unit)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import fixed_quad
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from fenicsmech.errors import DescriptionError, expect, finite, point, point_text, points, positive

Point = tuple[float, ...]


@dataclass(frozen=True)
class Disc:
    """All points within ``radius`` of an axis along z: interface region of a pin, or region that a force acts on."""

    radius: float


@dataclass(frozen=True)
class Rectangle:
    """A rectangle centred on a joint or a force: interface region of a clamp, or region that a force acts on.

    ``length`` runs along the direction at ``angle`` (rad) from x, ``width`` across it. For the end of a strip
    ``Mechanism.clamp`` finds position, angle and width.
    """

    length: float
    width: float
    angle: float = 0.0


Region = Disc | Rectangle


@dataclass(frozen=True)
class Face:
    """Part of the boundary of a flexible link, an edge in plane models, that a force acts on.

    Attributes:
        within: the part of the flat face through the force's point within a disc or rectangle about that point, through
            the depth of the link; None for the whole flat face.
        where: instead of the flat face, a part that may be curved: predicate of points on the drawn boundary,
            (n, dim) → (n,) bool; a facet belongs to the part if it holds at all its corners.

    Raises:
        DescriptionError: both are given, or one is something else.
    """

    within: Region | None = None
    where: Callable[[np.ndarray], np.ndarray] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.within is not None and self.where is not None:
            raise DescriptionError("face", "within and where are both given", "Give one of the two")
        expect("face", self.where, Callable | None, "a predicate of points", "Give where=lambda x: …, (n, dim) → (n,)")
        expect("face", self.within, Disc | Rectangle | None, "a region", "Give within=Disc(…) or Rectangle(…)")


@dataclass(frozen=True)
class Strip:
    """A strip of constant thickness along a smooth centreline, extruded by ``depth``.

    Two points give a straight strip, more points the interpolating C² cubic spline (chord-length
    parameter). Ends are flat; each pinned joint adds a round eye. The mid-plane is z = 0.
    """

    centreline: tuple[Point, ...]
    thickness: float
    depth: float


@dataclass(frozen=True)
class Line:
    """Straight segment of an outline, from the end of the previous segment to ``end``."""

    end: Point


@dataclass(frozen=True)
class Arc:
    """Circular segment of an outline, through ``via``, to ``end``."""

    via: Point
    end: Point


@dataclass(frozen=True)
class Outline:
    """A closed planar outline of lines and arcs, extruded by ``depth``; the mid-plane is z = 0."""

    start: Point
    segments: tuple[Line | Arc, ...]
    depth: float


@dataclass(frozen=True)
class StepPart:
    """A solid from a STEP file; in 2D its section with the plane z = ``section``, of depth ``depth``.

    With mid-plane symmetry the half above its centroid is meshed, at whatever height it was drawn.
    """

    path: Path
    depth: float
    section: float = 0.0


@dataclass(frozen=True)
class MeshPart:
    """A link given as a gmsh mesh file of triangles (2D) or tetrahedra (3D)."""

    path: Path
    depth: float


Shape = Strip | Outline | StepPart | MeshPart


def strip(centreline: Sequence[Sequence[float]], *, thickness: float, depth: float) -> Strip:
    """A strip along ``centreline`` ((n, 2) points), ``thickness`` in the plane, ``depth`` out of it."""
    return Strip(
        points("strip centreline", centreline, least=2, dimensions=(2,)),
        positive("strip thickness", thickness),
        positive("strip depth", depth),
    )


def polygon(corners: Sequence[Sequence[float]], *, depth: float) -> Outline:
    """The closed polygon through ``corners`` ((n, 2), n ≥ 3), extruded by ``depth``."""
    corners = points("polygon", corners, least=3, dimensions=(2,))
    segments = tuple(Line(corner) for corner in (*corners[1:], corners[0]))
    return Outline(corners[0], segments, positive("polygon depth", depth))


def outline(start: Sequence[float], segments: Sequence[Line | Arc], *, depth: float) -> Outline:
    """The closed outline that runs from ``start`` along ``segments`` and back, extruded by ``depth``."""
    checked: list[Line | Arc] = []
    expect("outline", segments, Iterable, "a list of segments", "Give [Line(…), Arc(…), …]")
    for segment in segments:
        expect("outline", segment, Line | Arc, "a segment", "Give Line(…) or Arc(…)")
        end = point("outline segment end", segment.end, dimensions=(2,))
        via = point("outline arc", segment.via, dimensions=(2,)) if isinstance(segment, Arc) else None
        checked.append(Line(end) if via is None else Arc(via, end))
    if not checked:
        raise DescriptionError("outline", "it has no segments", "Give those around the link: [Line(…), Arc(…), …]")
    return Outline(point("outline start", start, dimensions=(2,)), tuple(checked), positive("outline depth", depth))


def step_file(path: str | Path, *, depth: float, section: float = 0.0) -> StepPart:
    """The solid in the STEP file ``path``; ``depth`` and ``section`` serve the 2D models."""
    return StepPart(Path(path), positive("STEP depth", depth), finite("STEP section", section))


def gmsh_mesh(path: str | Path, *, depth: float) -> MeshPart:
    """The mesh in the gmsh file ``path``; ``depth`` serves the 2D models."""
    return MeshPart(Path(path), positive("mesh depth", depth))


class Centreline:
    """The interpolating C² cubic spline c(s) through ``points``, with not-a-knot ends.

    The parameter s runs along the chords: s₀ = 0, s_{k+1} = s_k + |p_{k+1} − p_k|. Two points give the straight
    line, three the parabola.

    Args:
        points: (n, dim) with n ≥ 2; neighbours must differ, else a DescriptionError names ``part``.

    Attributes:
        knots: parameters s_k of the points, shape (n,).
    """

    def __init__(self, points: ArrayLike, *, part: str = "centreline") -> None:
        through = np.asarray(points, dtype=float)
        chords = np.linalg.norm(np.diff(through, axis=0), axis=1)
        if not np.all(chords > 0.0):
            k = int(np.argmin(chords))
            problem = f"points {k} and {k + 1} coincide at {point_text(through[k])}"
            raise DescriptionError(part, problem, "Remove one of them")
        self.knots = np.concatenate([[0.0], np.cumsum(chords)])
        self._curve = CubicSpline(self.knots, through, bc_type="not-a-knot")

    @property
    def end(self) -> float:
        """The last parameter; the first is 0."""
        return float(self.knots[-1])

    @property
    def length(self) -> float:
        """Arc length ∫ |c′(s)| ds of the whole curve."""
        return self.length_to(self.end)

    def length_to(self, s: float) -> float:
        """Arc length from the start to the parameter ``s``."""
        ends = [*self.knots[self.knots < s], s]
        return float(sum(fixed_quad(self._speed, a, b, n=20)[0] for a, b in pairwise(ends)))

    def parameter_at(self, length: float) -> float:
        """The parameter to which the curve is ``length`` long, from 0 up to that of the whole."""
        return float(brentq(lambda s: self.length_to(s) - length, 0.0, self.end, xtol=1e-13 * self.end))

    def evaluate(self, s: np.ndarray | float) -> np.ndarray:
        """Points c(s), shape (*s.shape, dim)."""
        return self._curve(s)

    def tangent(self, s: np.ndarray | float) -> np.ndarray:
        """Unit tangents c′/|c′|, shape (*s.shape, dim)."""
        velocity = self._curve(s, 1)
        return velocity / np.linalg.norm(velocity, axis=-1, keepdims=True)

    def normal(self, s: np.ndarray | float) -> np.ndarray:
        """Unit normals to the left of a planar centreline, shape (*s.shape, 2)."""
        tangent = self.tangent(s)
        return np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1)

    def curvature(self, s: np.ndarray | float) -> np.ndarray:
        """Signed curvature det(c′, c″)/|c′|³ of a planar centreline, positive for a left turn, shape s.shape."""
        velocity, second = self._curve(s, 1), self._curve(s, 2)
        cross = velocity[..., 0] * second[..., 1] - velocity[..., 1] * second[..., 0]
        return cross / np.linalg.norm(velocity, axis=-1) ** 3

    def samples(self, per_span: int) -> np.ndarray:
        """Parameters that divide each span between neighbouring points evenly into ``per_span`` parts."""
        spans = [np.linspace(a, b, per_span, endpoint=False) for a, b in zip(self.knots, self.knots[1:], strict=False)]
        return np.concatenate([*spans, self.knots[-1:]])

    def closest(self, point: ArrayLike) -> float:
        """Parameter of the point of the curve nearest to ``point``: (c(s) − p)·c′(s) = 0, or an end."""
        s = self.samples(64)
        nearest = int(np.argmin(np.linalg.norm(self.evaluate(s) - point, axis=1)))
        low, high = s[max(nearest - 1, 0)], s[min(nearest + 1, len(s) - 1)]
        # bisection on the sign of the slope of the distance, exact to the last digits
        for _ in range(60):
            middle = 0.5 * (low + high)
            slope = np.dot(self.evaluate(middle) - point, self._curve(middle, 1))
            low, high = (middle, high) if slope < 0.0 else (low, middle)
        return min((0.0, 0.5 * (low + high), self.end), key=lambda t: np.linalg.norm(self.evaluate(t) - point))

    def _speed(self, s: np.ndarray) -> np.ndarray:
        return np.linalg.norm(self._curve(s, 1), axis=-1)


def end_clamp(shape: Strip, end: str, length: float, *, part: str = "clamp") -> tuple[Point, Rectangle]:
    """The place of a clamp at an end of a strip, and the region that it holds: the strip up to its inner face.

    The inner face is normal to the centreline at the arc length ``length`` from the end. The rectangle is centred on
    the end, aligned with the strip at the inner face, and wider than the strip. It is refused where the strip bends so
    much that no rectangle holds the piece and nothing else.
    """
    curve = Centreline(shape.centreline, part=f"centreline of {part}")
    if end not in ("start", "end"):
        raise DescriptionError(part, f"the end of the strip is {end!r}", "Give end='start' or end='end'")
    length = positive(f"length of {part}", length)
    if length >= curve.length:
        problem = f"its length {length:g} is not less than that of the strip, {curve.length:g}"
        raise DescriptionError(part, problem, "Give a shorter one")
    last, beyond, inward = (0.0, curve.end, 1.0) if end == "start" else (curve.end, 0.0, -1.0)
    inner = curve.parameter_at(length if end == "start" else curve.length - length)
    centre, direction = curve.evaluate(last), curve.tangent(inner)
    normal = np.array([-direction[1], direction[0]])

    def sides(start: float, stop: float) -> tuple[np.ndarray, np.ndarray]:
        """Distances of both sides of a piece from the centre, along the strip at the face and across it."""
        s = np.linspace(start, stop, 257)
        offsets = 0.5 * shape.thickness * curve.normal(s)
        points = np.concatenate([curve.evaluate(s) + offsets, curve.evaluate(s) - offsets]) - centre
        return inward * (points @ direction), points @ normal

    reach = inward * float((curve.evaluate(inner) - centre) @ direction)
    along, across = sides(last, inner)
    half_width = float(np.abs(across).max()) + 0.25 * shape.thickness
    slack = 1e-6 * shape.thickness
    holds_all = reach > 0.0 and np.all(np.abs(along) <= reach + slack)
    along, across = sides(inner, beyond)
    if not holds_all or np.any((np.abs(along) < reach - slack) & (np.abs(across) <= half_width)):
        problem = f"the strip bends too much for a clamp of length {length:g}"
        raise DescriptionError(part, problem, "Make the clamp shorter")
    angle = float(np.arctan2(direction[1], direction[0]))
    return tuple(centre.tolist()), Rectangle(2.0 * reach, 2.0 * half_width, angle)
