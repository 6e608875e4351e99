"""Plots and pictures of plain data; all but ``plot_curve`` are local: call them on one rank.

- ``curve``: load–displacement curves
- ``mechanism``: mechanisms, deformed and not, side by side
- ``edge``: stress along edges
- ``design``: links before and after an optimisation
- ``shapes``: the content of these pictures
- ``page``: look, lengths, panels, labels, and PNG files
- ``library``: matplotlib, imported with the first picture
"""

from fenicsmech.plot.curve import CurveMark, CurveSeries, CurveTarget, plot_curve
from fenicsmech.plot.design import IN_PLACE, draw_designs, lay_out_designs
from fenicsmech.plot.edge import EdgeSeries, plot_edge
from fenicsmech.plot.mechanism import draw_configurations, lay_out
from fenicsmech.plot.page import (
    FLEXIBLE,
    INK,
    PALETTE,
    Labels,
    Spot,
    house_style,
    new_figure,
    open_frame,
    save_png,
    text_size,
)
from fenicsmech.plot.shapes import (
    Arrow,
    DesignShape,
    FlexibleShape,
    MechanismShape,
    OutlineShape,
    Panel,
    PeakMark,
    Pin,
    RigidShape,
    Trace,
    outer_faces,
    plan_view,
    rigid_outline,
)
