"""Two links whose shapes may change, far apart in one mesh: an arch with two joints and a rod with three (mm)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from dolfinx import fem
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.compat import vector_space
from fenicsmech.design import HandleOptimum, LinkParameters, LinkSpline, QualitySum, ShapeMap, ShapeRequest, shape_links
from fenicsmech.mechanism import Centreline
from fenicsmech.meshing import InterfaceSite, LinkMesh, MechanismMesh, distribute, mesh_link

THICKNESS, DEPTH, RADIUS, SIZE = 3.0, 5.0, 2.5, 2.0
ARCH = ((0.0, 0.0), (20.0, 9.0), (40.0, 0.0))
ROD = ((0.0, 50.0), (18.0, 52.0), (45.0, 46.0))
CENTRELINES = (ARCH, ROD)
JOINTS = ((ARCH[2], ARCH[0]), (ROD[1], ROD[0], ROD[2]))  # not in order along the links


def strip_mesh(
    link: int, dim: int, *, unit: float = 1.0, width: float = THICKNESS, axis: tuple[float, float, float] = (0, 0, 1)
) -> LinkMesh:
    """One of the links, in a unit of length ``unit`` mm long; an ``axis`` that is not along z makes it a solid."""
    points, joints = (np.array(a) / unit for a in (CENTRELINES[link], JOINTS[link]))
    shape = fm.strip(points, thickness=width / unit, depth=DEPTH / unit)
    axes = [axis] + [(0.0, 0.0, 1.0)] * (len(joints) - 1)
    sites = [
        InterfaceSite((*at, 0.0)[:dim], fm.Disc(RADIUS / unit), direction)
        for at, direction in zip(joints, axes, strict=True)
    ]
    return mesh_link(str(link), shape, sites, dim=dim, size=SIZE / unit)


def request(link: int, *, unit: float = 1.0, turns: bool = True) -> ShapeRequest:
    """The shape request of one of the links."""
    joints = tuple(tuple(c / unit for c in at) for at in JOINTS[link])
    return ShapeRequest(
        link=link,
        name=str(link),
        centreline=Centreline(np.array(CENTRELINES[link]) / unit),
        joints=joints,
        turns=(turns,) * len(joints),
        reach=(RADIUS / unit,) * len(joints),
        segments=3,
        thickness=THICKNESS / unit,
    )


def own_parameters(splines: Sequence[LinkSpline]) -> list[LinkParameters]:
    """The parameters of splines, where those of one after the other are the design."""
    sizes = [spline.size for spline in splines]
    ends, matrix = np.cumsum(sizes).tolist(), np.eye(sum(sizes))
    places = [slice(end - size, end) for size, end in zip(sizes, ends, strict=True)]
    return [LinkParameters(own, np.zeros(own.stop - own.start), matrix[own]) for own in places]


def shape_map(dim: int, order: int, comm: MPI.Comm, *, unit: float = 1.0, turns: bool = True) -> ShapeMap:
    """The map from all parameters of both links to a design field of this order on their mesh."""
    meshes = [strip_mesh(link, dim, unit=unit) for link in range(2)] if comm.rank == 0 else None
    mesh = distribute(comm, meshes)
    shapes = shape_links(mesh, [request(link, unit=unit, turns=turns) for link in range(2)])
    splines = [shape.handles.spline for shape in shapes]
    initial = np.concatenate([spline.initial for spline in splines])
    return ShapeMap(mesh, fem.Function(vector_space(mesh.mesh, order)), shapes, own_parameters(splines), initial)


@dataclass(frozen=True, eq=False)
class Bench:
    """Both links with their handles, on one mesh."""

    mesh: MechanismMesh
    shape: ShapeMap
    quality: QualitySum
    optimum: HandleOptimum

    def lengths(self) -> np.ndarray:
        """The typical size of each parameter, (parameters,)."""
        parts = [
            np.where(s.handles.spline.is_thickness, 1.0, 40.0 / s.handles.spline.segments) for s in self.shape.shapes
        ]
        return np.concatenate(parts)

    def direction(self, seed: int) -> np.ndarray:
        """A change of p, of typical size 1 in units of ``lengths``."""
        return np.random.default_rng(seed).standard_normal(len(self.shape.initial)) * self.lengths()

    def design(self, change: float = 0.1, seed: int = 1) -> np.ndarray:
        """A design away from the initial one."""
        return self.shape.initial + change * self.direction(seed)

    def positions(self, seed: int = 2) -> np.ndarray:
        """Handle positions away from the initial ones."""
        theta = self.shape.initial_theta
        return theta + np.random.default_rng(seed).uniform(-0.02, 0.02, len(theta))


@cache
def bench(dim: int, *, shared: bool = False, unit: float = 1.0, turns: bool = True) -> Bench:
    """The bench in 2D or 3D; if ``shared`` on all ranks together, else on each alone (collective)."""
    shape = shape_map(dim, 1, MPI.COMM_WORLD if shared else MPI.COMM_SELF, unit=unit, turns=turns)
    quality = QualitySum(shape.design)
    return Bench(shape.mesh, shape, quality, HandleOptimum(shape, quality))
