"""Plots and pictures: draws the plain data it is given.

Nothing here knows elements, joints or ranks; call it on one rank.

==================  ==================================================================
``curve``           load–displacement curves as CSV and PNG
``shapes``          what a picture of a mechanism is made of
``outline``         the outline of a rigid link from its joints
``plan``            the top of a tetrahedral mesh
``picture``         mechanisms, deformed and not, one or several beside each other
``design_shapes``   what a picture of a design is made of
``designs``         links before and after an optimisation
``canvas``          the look of all figures, and PNG files
``frame``           size and panels of a picture
``design_frame``    size of a picture of a design, and where each link stands in it
``labels``          labels beside what they name
``arrays``          checked arrays of the records
==================  ==================================================================
"""

from fenicsmech.report.arrays import real_array
from fenicsmech.report.canvas import FLEXIBLE, INK, PALETTE, house_style, new_figure, open_frame, save_png
from fenicsmech.report.curve import CurveMark, CurveSeries, CurveTarget, plot_curve, read_curve_csv, write_curve_csv
from fenicsmech.report.design_frame import IN_PLACE, lay_out_designs
from fenicsmech.report.design_shapes import DesignShape, LinkOutline
from fenicsmech.report.designs import draw_designs
from fenicsmech.report.frame import lay_out
from fenicsmech.report.labels import Labels, Spot, text_size
from fenicsmech.report.outline import rigid_outline
from fenicsmech.report.picture import draw_configurations, draw_mechanism
from fenicsmech.report.plan import PlanView, plan_view, rim
from fenicsmech.report.shapes import Arrow, FlexibleShape, MechanismShape, Panel, Pin, RigidShape, Trace

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
    "draw_mechanism",
    "house_style",
    "lay_out",
    "lay_out_designs",
    "new_figure",
    "open_frame",
    "plan_view",
    "plot_curve",
    "read_curve_csv",
    "real_array",
    "rigid_outline",
    "rim",
    "save_png",
    "text_size",
    "write_curve_csv",
]
