"""Plots, pictures, tables and summaries: draws and writes the plain data it is given.

Nothing here knows elements, joints or ranks; call it on one rank.

==================  ==================================================================
``atomic``          files that appear complete or not at all
``curve``           load–displacement curves as CSV and PNG
``work_precision``  error against time, with the Pareto front
``shapes``          what a picture of a mechanism is made of
``outline``         the outline of a rigid link from its joints
``plan``            the top of a tetrahedral mesh
``picture``         mechanisms, deformed and not, one or several beside each other
``design_shapes``   what a picture of a design is made of
``designs``         links before and after an optimisation
``summary``         the JSON summary of a demo and its schema
``table``           tables for the console
``progress``        progress lines of long runs
``canvas``          the look of all figures, and PNG files
``frame``           size and panels of a picture
``design_frame``    size of a picture of a design, and where each link stands in it
``labels``          labels beside what they name
``arrays``          checked arrays of the records
==================  ==================================================================
"""

from fenicsmech.report.atomic import atomic_write
from fenicsmech.report.canvas import FLEXIBLE, INK, PALETTE, new_figure
from fenicsmech.report.curve import CurveMark, CurveSeries, CurveTarget, plot_curve, read_curve_csv, write_curve_csv
from fenicsmech.report.design_frame import IN_PLACE, lay_out_designs
from fenicsmech.report.design_shapes import DesignShape, LinkOutline
from fenicsmech.report.designs import draw_designs
from fenicsmech.report.frame import lay_out
from fenicsmech.report.labels import Labels, Spot, text_size
from fenicsmech.report.outline import rigid_outline
from fenicsmech.report.picture import draw_configurations, draw_mechanism
from fenicsmech.report.plan import PlanView, plan_view, rim
from fenicsmech.report.progress import Progress, Silent
from fenicsmech.report.shapes import Arrow, FlexibleShape, MechanismShape, Panel, Pin, RigidShape, Trace
from fenicsmech.report.summary import check_summary, write_summary
from fenicsmech.report.table import format_table
from fenicsmech.report.work_precision import ErrorLevel, WorkSeries, pareto_front, plot_work_precision

__all__ = [
    "Arrow",
    "CurveMark",
    "CurveSeries",
    "CurveTarget",
    "DesignShape",
    "ErrorLevel",
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
    "Progress",
    "RigidShape",
    "Silent",
    "Spot",
    "Trace",
    "WorkSeries",
    "atomic_write",
    "check_summary",
    "draw_configurations",
    "draw_designs",
    "draw_mechanism",
    "format_table",
    "lay_out",
    "lay_out_designs",
    "new_figure",
    "pareto_front",
    "plan_view",
    "plot_curve",
    "plot_work_precision",
    "read_curve_csv",
    "rigid_outline",
    "rim",
    "text_size",
    "write_curve_csv",
    "write_summary",
]
