"""Recovered stress and strain along the edge of a link: its outline in the plane, at mid-depth in space.

With the tangents T of the edge at rest and t of the deformed one, both of length 1, and the elastic part F_e of F,

    σ = t · σ t,     ε = |F T| / |F_e⁻¹ F T| − 1.

Where nothing acts on an edge no other stress is left in the plane, and the von Mises stress is the modulus of that
along it. The strain is what a gauge along the edge shows, growth without stress left out.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import on_one
from fenicsmech.errors import DescriptionError, point_text
from fenicsmech.files import write_csv
from fenicsmech.mechanism import Units
from fenicsmech.plot import EdgeSeries, plot_edge
from fenicsmech.polygons import signed_area
from fenicsmech.stress.recovered import CellFields, Recovered, von_mises
from fenicsmech.stress.recovery import shape_slopes
from fenicsmech.stress.singular_places import Facets
from fenicsmech.stress.surface import LinkSurface

_PARTS = 4  # of each side of a cell


@dataclass(frozen=True, eq=False)
class EdgeStress:
    """Stress and strain along the edge of a link, NaN where a joint holds it.

    Attributes:
        link: its name.
        arc_length: from the start, along the edge at rest, (n,).
        points: at rest, (n, dim).
        along: t · σ t, tension positive, (n,).
        error: estimated, of ``along``, (n,).
        von_mises: von Mises stress, (n,).
        strain: nominal, of the elastic deformation along the edge, (n,).
        strain_error: estimated, of ``strain``, (n,).
        singular: within reach of a singular place, where stress has no limit, (n,).
        outline: closed polygons of the link at rest, in the plane, (k, 2) each.
        units: of the scene.
        comm: processes that share the result.
    """

    link: str
    arc_length: np.ndarray
    points: np.ndarray
    along: np.ndarray
    error: np.ndarray
    von_mises: np.ndarray
    strain: np.ndarray
    strain_error: np.ndarray
    singular: np.ndarray
    outline: tuple[np.ndarray, ...]
    units: Units
    comm: MPI.Comm

    def __repr__(self) -> str:
        low, high = np.nanmin(self.along), np.nanmax(self.along)
        length = f"{self.arc_length[-1]:.4g} {self.units.length}"
        return f"<EdgeStress of {self.link!r}: {length}, {low:.4g} to {high:.4g} {self.units.stress}>"

    def plot(self, path: str | Path) -> None:
        """Draws the stress over the arc length, and the link with the edge, as a PNG."""
        series = EdgeSeries(
            self.arc_length, self.along, self.error, self.von_mises, self.singular, self.points[:, :2], self.outline
        )
        labels = f"arc length [{self.units.length}]", f"stress [{self.units.stress}]"
        on_one(self.comm, lambda: plot_edge(path, series, title=self.link, labels=labels))

    def write_csv(self, path: str | Path) -> None:
        """Writes all values, a row for each point that no joint holds."""
        known = np.isfinite(self.along)
        length, stress = self.units.length, self.units.stress
        axes = {f"{name} [{length}]": values for name, values in zip("xyz", self.points.T, strict=False)}
        columns = {
            f"arc length [{length}]": self.arc_length, **axes, f"along the edge [{stress}]": self.along,
            f"error [{stress}]": self.error, f"von Mises [{stress}]": self.von_mises,
            "strain along the edge": self.strain, "error of the strain": self.strain_error, "singular": self.singular,
        }  # fmt: skip
        on_one(self.comm, lambda: write_csv(path, {name: values[known] for name, values in columns.items()}))


@dataclass(frozen=True, eq=False)
class _Loop:
    """A closed line of segments in the order of the edge, the material on their left.

    Attributes:
        cells: of each segment, (k,).
        ends: barycentric coordinates of both ends, (k, 2, dim + 1).
    """

    cells: np.ndarray
    ends: np.ndarray

    def corners(self) -> np.ndarray:
        """Barycentric coordinates of ends and middles of parts of the segments, (k, 2 parts + 1, dim + 1)."""
        t = np.linspace(0.0, 1.0, 2 * _PARTS + 1)[:, None]
        return (1.0 - t) * self.ends[:, None, 0] + t * self.ends[:, None, 1]


def edge_stress(
    surface: LinkSurface, fields: CellFields, link: int, name: str, start: np.ndarray | None, end: np.ndarray | None
) -> dict[str, Any]:
    """What ``EdgeStress`` has of a link by its number, see ``Curve.edge_stress``. Local, on the first process."""
    nodes = surface.whole(fields).nodes
    loops = [_Line(surface, nodes, loop) for loop in _loops(surface, link)]
    loops.sort(key=lambda line: -abs(signed_area(line.points[:, :2])))
    line = loops[0]
    if start is not None:
        line = min(loops, key=lambda own: own.distance(start))
        if end is not None and line is not min(loops, key=lambda own: own.distance(end)):
            raise DescriptionError(
                f"edge of {name!r}",
                f"{point_text(start)} and {point_text(end)} lie on different outlines, as of a hole and around it",
                "Give two points on one outline",
            )
    order, arc_length = line.between(start, end)

    def along(found: Recovered) -> np.ndarray:
        """Stress and strain along the edge, (2, n)."""
        assert found.elastic is not None, "strains are recovered with it"
        t = np.einsum("nij,nj->ni", found.F[:, 0], line.tangents)
        free = np.linalg.solve(found.elastic[:, 0], t[..., None])[..., 0]
        length, dim = np.linalg.norm(t, axis=1), t.shape[1]
        stress = np.einsum("ni,nij,nj->n", t, found.stress[:, 0, :dim, :dim], t) / length**2
        return np.stack([stress, length / np.linalg.norm(free, axis=1) - 1.0])

    found, errors, (recovered,) = surface.errors([fields], line.cells, line.corners[:, None], along)
    values = np.stack([*found, *errors, von_mises(recovered.stress[:, 0])])
    values[:, ~surface.mesh[3][line.cells]] = np.nan
    stress, strain, error, strain_error, equivalent = values[:, order]
    singular = np.zeros(len(line.cells), dtype=bool)
    for place in surface.places:
        if place.link == name:
            singular |= place.holds(line.drawn)
    return {
        "link": name,
        "arc_length": arc_length,
        "points": line.points[order],
        "along": stress,
        "error": error,
        "von_mises": equivalent,
        "strain": strain,
        "strain_error": strain_error,
        "singular": singular[order],
        "outline": tuple(own.points[:, :2] for own in loops),
    }


class _Line:
    """Points along a loop, n, each the start of a part of it."""

    def __init__(self, surface: LinkSurface, nodes: np.ndarray, loop: _Loop) -> None:
        corners, every = loop.corners(), np.repeat(loop.cells, _PARTS)
        own = nodes[loop.cells]
        slopes = np.swapaxes(own, 1, 2)[:, None] @ shape_slopes(corners, own.shape[1])
        tangents = (slopes @ (loop.ends[:, 1] - loop.ends[:, 0])[:, None, :, None])[..., 0]
        speeds = np.linalg.norm(tangents, axis=2)
        # Simpson's rule
        lengths = (speeds[:, :-1:2] + 4.0 * speeds[:, 1::2] + speeds[:, 2::2]) / (6.0 * _PARTS)
        self.lengths, self.cells = lengths.ravel(), every
        self.corners = corners[:, :-1:2].reshape(-1, corners.shape[2])
        self.tangents = tangents[:, :-1:2].reshape(len(every), -1)
        self.points = surface.positions(every, self.corners, nodes)
        self.drawn = surface.positions(every, self.corners)

    def distance(self, point: np.ndarray) -> float:
        """From a point (2,) of the plane."""
        return float(np.linalg.norm(self.drawn[:, :2] - point, axis=1).min())

    def _nearest(self, point: np.ndarray) -> int:
        return int(np.argmin(np.linalg.norm(self.drawn[:, :2] - point, axis=1)))

    def between(self, start: np.ndarray | None, end: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of points from one to another the shorter way, or of all and the first again; arc lengths."""
        count = len(self.points)
        first = int(np.lexsort(self.drawn[:, 1::-1].T)[0]) if start is None else self._nearest(start)
        if end is None:
            order = (first + np.arange(count + 1)) % count
        else:
            last = self._nearest(end)
            order = (first + np.arange((last - first) % count + 1)) % count
            if self.lengths[order[:-1]].sum() > 0.5 * self.lengths.sum():
                order = (first - np.arange((first - last) % count + 1)) % count
                return order, np.concatenate([[0.0], np.cumsum(self.lengths[order[1:]])])
        return order, np.concatenate([[0.0], np.cumsum(self.lengths[order[:-1]])])


def _loops(surface: LinkSurface, link: int) -> Iterator[_Loop]:
    """The closed lines of the outline of a link by its number, at mid-depth in space."""
    vertices, cells, links, _ = surface.mesh
    facets, dim = Facets.around(cells, links == link), vertices.shape[1]
    keys, ends, owners = _segments_in_plane(facets, cells) if dim == 2 else _segments_in_space(facets, vertices, cells)
    segments_at = defaultdict(list)
    for number, both in enumerate(keys):
        for key in both:
            segments_at[key].append(number)
    unused = dict.fromkeys(range(len(keys)))
    while unused:
        number = next(iter(unused))
        way, (key, goal) = [], keys[number][::-1]
        unused.pop(number)
        way.append((number, False))
        while key != goal:
            number = next(own for own in segments_at[key] if own in unused)
            unused.pop(number)
            turned = keys[number][0] != key
            way.append((number, turned))
            key = keys[number][0 if turned else 1]
        numbers, turns = (np.array(own) for own in zip(*way, strict=True))
        own = np.where(turns[:, None, None], ends[numbers][:, ::-1], ends[numbers])
        yield _oriented(_Loop(owners[numbers], own), vertices, cells)


def _oriented(loop: _Loop, vertices: np.ndarray, cells: np.ndarray) -> _Loop:
    """The loop with the material on the left."""
    corners = vertices[cells[loop.cells]]
    first, last = (np.einsum("kc,kcd->kd", loop.ends[:, side], corners)[:, :2] for side in (0, 1))
    along, inward = last - first, corners.mean(axis=1)[:, :2] - first
    if (along[:, 0] * inward[:, 1] - along[:, 1] * inward[:, 0]).sum() >= 0.0:
        return loop
    return _Loop(loop.cells[::-1], loop.ends[::-1, ::-1])


def _segments_in_plane(facets: Facets, cells: np.ndarray) -> tuple[list[tuple], np.ndarray, np.ndarray]:
    """Keys of both ends of each segment, their barycentric coordinates (k, 2, 3), and the cells, (k,)."""
    ends = facets.barycentric(np.eye(2))
    corners = np.take_along_axis(cells[facets.cells], np.argmax(ends, axis=2), axis=1)
    return [tuple(pair) for pair in corners.tolist()], ends, facets.cells


def _segments_in_space(
    facets: Facets, vertices: np.ndarray, cells: np.ndarray
) -> tuple[list[tuple], np.ndarray, np.ndarray]:
    """The same where facets cross mid-depth, coordinates (k, 2, 4); ends lie on edges of the mesh."""
    heights = vertices[:, 2]
    low, high = heights[facets.corners].min(), heights[facets.corners].max()
    # beside vertices at mid-depth, where facets would meet it in points
    offsets = heights - 0.5 * (low + high) - 1e-6 * (high - low)
    above = offsets[cells[facets.cells]] > 0.0
    keys, ends, owners = [], [], []
    for k, cell in enumerate(facets.cells.tolist()):
        own = [c for c in range(4) if c != facets.opposite[k]]
        crossed = [(a, b) for i, a in enumerate(own) for b in own[i + 1 :] if above[k, a] != above[k, b]]
        if not crossed:
            continue
        points = np.zeros((2, 4))
        for point, (a, b) in zip(points, crossed, strict=True):
            za, zb = offsets[cells[cell, [a, b]]]
            point[[a, b]] = -zb / (za - zb), za / (za - zb)
        keys.append(tuple(tuple(sorted(cells[cell, list(pair)].tolist())) for pair in crossed))
        ends.append(points)
        owners.append(cell)
    return keys, np.array(ends), np.array(owners)
