"""Plots and pictures: draws the plain data it is given, without elements, joints or ranks; call it on one rank.

- ``curve``: load–displacement curves
- ``mechanism``: mechanisms, deformed and not, one or several beside each other
- ``design``: links before and after an optimisation
- ``shapes``, ``outlines``: what these pictures are made of
- ``layout``: size of a picture, and places of panels and links
- ``labels``: labels beside what they name
- ``style``: the look of all figures, and PNG files
"""

from fenicsmech.plot.curve import CurveMark, CurveSeries, CurveTarget, plot_curve
from fenicsmech.plot.design import draw_designs
from fenicsmech.plot.labels import Labels, Spot
from fenicsmech.plot.layout import IN_PLACE, lay_out, lay_out_designs
from fenicsmech.plot.mechanism import draw_configurations
from fenicsmech.plot.outlines import PlanView, plan_view, rigid_outline, rim
from fenicsmech.plot.shapes import (
    Arrow,
    DesignShape,
    FlexibleShape,
    LinkOutline,
    MechanismShape,
    Panel,
    Pin,
    RigidShape,
    Trace,
)
from fenicsmech.plot.style import FLEXIBLE, INK, PALETTE, house_style, new_figure, open_frame, save_png, text_size

__all__ = [
    "Arrow",
    "CurveMark",
    "CurveSeries",
    "CurveTarget",
    "DesignShape",
    "FLEXIBLE",
    "FlexibleShape",
    "INK",
    "IN_PLACE",
    "Labels",
    "LinkOutline",
    "MechanismShape",
    "PALETTE",
    "Panel",
    "Pin",
    "PlanView",
    "RigidShape",
    "Spot",
    "Trace",
    "draw_configurations",
    "draw_designs",
    "house_style",
    "lay_out",
    "lay_out_designs",
    "new_figure",
    "open_frame",
    "plan_view",
    "plot_curve",
    "rigid_outline",
    "rim",
    "save_png",
    "text_size",
]
