"""Plots and pictures of plain data; all but ``plot_curve`` are local: call them on one rank.

- ``curve``: load–displacement curves
- ``mechanism``: mechanisms, deformed and not, side by side
- ``design``: links before and after an optimisation
- ``shapes``, ``outlines``: the content of these pictures
- ``layout``: size of a picture, and places of panels and links
- ``labels``: labels of parts of a picture
- ``style``: the look of all figures, and PNG files
"""

from fenicsmech.plot.curve import CurveMark, CurveSeries, CurveTarget, draw_curve, plot_curve
from fenicsmech.plot.design import draw_designs
from fenicsmech.plot.labels import Labels, Spot
from fenicsmech.plot.layout import IN_PLACE, lay_out, lay_out_designs
from fenicsmech.plot.mechanism import draw_configurations
from fenicsmech.plot.outlines import PlanView, plan_view, rigid_outline
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
    "draw_curve",
    "draw_designs",
    "house_style",
    "lay_out",
    "lay_out_designs",
    "new_figure",
    "open_frame",
    "plan_view",
    "plot_curve",
    "rigid_outline",
    "save_png",
    "text_size",
]
