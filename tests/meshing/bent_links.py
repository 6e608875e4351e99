"""A strip with eyes, and what a design may make of it: bent, and thicker in the middle, its eyes moved as a whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline

from fenicsmech.mechanism import Disc, strip
from fenicsmech.meshing import CurvedEdges, InterfaceSite, LinkMesh, mesh_link

LENGTH, THICKNESS, DEPTH, RADIUS, ANGLE = 40.0, 3.0, 5.0, 2.5, 1.1
STRAIGHT = ((0.0, 0.0), (20.0, 0.0), (LENGTH, 0.0))
CURVED = ((0.0, 0.0), (20.0, 9.0), (LENGTH, 0.0))


def link(size: float, *, points=CURVED, dim: int = 2, radius: float = RADIUS, pins=(0, -1)) -> LinkMesh:
    """The strip along ``points`` with pins at some of them."""
    sites = [InterfaceSite((*points[k], 0.0)[:dim], Disc(radius), name=f"pin {k}") for k in pins]
    return mesh_link("strip", strip(points, thickness=THICKNESS, depth=DEPTH), sites, dim=dim, size=size)


def bent(mesh: LinkMesh, *, thicker: float = 0.6) -> LinkMesh:
    """A link along ``STRAIGHT``, its centreline bent by ``ANGLE`` in between and up to 1 + ``thicker`` as thick."""

    def moved(positions: np.ndarray) -> np.ndarray:
        x, y = positions[:, :2].T
        points = _centreline()(x) + ((1.0 + thicker * _bump(x)) * y * _normal(x)).T
        return np.column_stack([points, positions[:, 2:]])

    points, ends = moved(mesh.points), mesh.curved.ends
    middles = moved(mesh.points[ends].mean(axis=1) + mesh.curved.bulges)
    return replace(mesh, points=points, curved=CurvedEdges.through(points, ends, middles))


def bent_point(x: float) -> tuple[float, float]:
    """Place of the point x of the centreline after ``bent``."""
    return tuple(_centreline()(x).tolist())


def _share(x):
    return np.clip((x - 6.0) / (LENGTH - 12.0), 0.0, 1.0)


def _bump(x):
    return np.sin(np.pi * _share(x)) ** 4


def _angle(x):
    s = _share(x)
    return ANGLE * s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3)


def _normal(x):
    return np.array([-np.sin(_angle(x)), np.cos(_angle(x))])


def _centreline() -> CubicSpline:
    x = np.linspace(-5.0, LENGTH + 5.0, 5001)
    slopes = np.column_stack([np.cos(_angle(x)), np.sin(_angle(x))])
    curve = CubicSpline(x, cumulative_trapezoid(slopes, x, axis=0, initial=0.0))
    return CubicSpline(x, curve(x) - curve(0.0))
