"""Links of known shape, before and after."""

import numpy as np

from fenicsmech.plot import DesignShape, OutlineShape


def strip(points, thickness):
    """The outline of a strip along ``points`` (n, 2) that is ``thickness`` (n,) wide, with all that is known of it."""
    points, thickness = np.asarray(points, float), np.broadcast_to(thickness, len(points)).astype(float)
    along = np.gradient(points, axis=0)
    across = np.column_stack((-along[:, 1], along[:, 0])) / np.hypot(*along.T)[:, None]
    sides = [points + side * 0.5 * thickness[:, None] * across for side in (-1.0, 1.0)]
    return OutlineShape([np.vstack((sides[0], sides[1][::-1]))], points, thickness, points[::20])


def bow(start, end, rise, *, count=61):
    """(count, 2) points of a parabola from ``start`` to ``end``."""
    start, end = np.array(start, float), np.array(end, float)
    t = np.linspace(0.0, 1.0, count)[:, None]
    across = np.array([start[1] - end[1], end[0] - start[0]]) / np.hypot(*(end - start))
    return start + t * (end - start) + 4.0 * rise * t * (1.0 - t) * across


def design(name, start, end, *, rise=(3.0, 7.0), bulge=2.0, scale=1.0):
    """A strip 3 units wide that bows by ``rise`` before and after, thicker by ``bulge`` in the middle after."""
    t = np.linspace(0.0, 1.0, 61)
    points = [scale * bow(start, end, r) for r in rise]
    after = scale * (3.0 + bulge * np.sin(np.pi * t) ** 2)
    return DesignShape(
        name, strip(points[0], 3.0 * scale), strip(points[1], after), scale * np.array([start, end], float)
    )


def four_bar(scale=1.0):
    """Three links of different lengths and directions."""
    return [
        design("crank", (0, 0), (5, 30), bulge=-1.5, scale=scale),
        design("coupler", (5, 30), (80, 50), rise=(4.0, -6.0), scale=scale),
        design("rocker", (80, 50), (70, 0), bulge=4.0, scale=scale),
    ]
