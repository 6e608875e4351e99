"""STEP parts: the solid in space, its section in the plane."""

import math
from pathlib import Path

import numpy as np
import pytest

from fenicsmech.mechanism.shapes import Disc, step
from fenicsmech.meshing import InterfaceSite, cell_measures, mesh_link, radius_ratios

PART = Path(__file__).parents[2] / "meshes" / "curved_link.step"
SITES = [InterfaceSite(at, Disc(3.0), name=f"pin at {at}") for at in ((0.0, 0.0), (60.0, 0.0))]


def plan_area():
    """Area of the part: band 3 wide on an arc of radius 50 over 60, eyes of radius 4 with holes of radius 1.5."""
    half_angle = math.asin(0.6)
    band = 3.0 * 50.0 * 2.0 * half_angle
    # part of the band inside an eye: points at polar (50 + e, 50 φ) around the arc's centre, within 4 of its end
    e = np.linspace(-1.5, 1.5, 20001)
    radius = 50.0 + e
    phi = np.arccos((50.0**2 + radius**2 - 16.0) / (2.0 * 50.0 * radius))
    inside = np.trapz(radius * phi, e) if hasattr(np, "trapz") else np.trapezoid(radius * phi, e)
    return band + 2.0 * (math.pi * (4.0**2 - 1.5**2) - inside)
