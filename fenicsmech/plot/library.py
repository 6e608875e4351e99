"""What pictures use of matplotlib, imported with the first picture.

Programs without pictures start half a second sooner.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_MODULES = {
    "Bbox": "matplotlib.transforms",
    "Circle": "matplotlib.patches",
    "FancyArrowPatch": "matplotlib.patches",
    "Figure": "matplotlib.figure",
    "FigureCanvasAgg": "matplotlib.backends.backend_agg",
    "FuncFormatter": "matplotlib.ticker",
    "Line2D": "matplotlib.lines",
    "LineCollection": "matplotlib.collections",
    "LinearSegmentedColormap": "matplotlib.colors",
    "MaxNLocator": "matplotlib.ticker",
    "Normalize": "matplotlib.colors",
    "Patch": "matplotlib.patches",
    "Path": "matplotlib.path",
    "PathPatch": "matplotlib.patches",
    "Polygon": "matplotlib.patches",
    "Rectangle": "matplotlib.patches",
    "ScalarMappable": "matplotlib.cm",
    "TriMesh": "matplotlib.collections",
    "Triangulation": "matplotlib.tri",
    "rc_context": "matplotlib",
    "to_hex": "matplotlib.colors",
    "to_rgb": "matplotlib.colors",
    "withStroke": "matplotlib.patheffects",
}


class _Library:
    """Names of matplotlib as attributes."""

    def __getattr__(self, name: str) -> Any:
        found = getattr(import_module(_MODULES[name]), name)
        setattr(self, name, found)
        return found


mpl: Any = _Library()
