"""Optimal and naive handle positions: quality of the mesh of one link on the same target spline.

    python3 -m benchmarks.handles [--size MM] [--write]

The comparison of the paper's Fig. 4. A straight link between pins is carried to a bent spline whose middle control
point has moved along the link, so that one half is stretched and the other compressed. Naive handles stay at their
parameters t of the spline, and joints turn with its tangents; optimal ones slide and turn so that the sum of the aspect
ratios ρ of all cells is smallest. With --write the picture of both goes to demos/pictures/ too.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from dolfinx import fem
from matplotlib.axes import Axes

import fenicsmech as fm
from fenicsmech.compat import cell_dofs, vector_space
from fenicsmech.design import (
    HandleOptimum,
    LinkParameters,
    QualitySum,
    ShapeMap,
    follow_spline,
    shape_links,
    shape_request,
)
from fenicsmech.report import format_table

from .table import ROOT, command, publish

HEADERS = ("handles", "cells", "mean ρ / 2", "95 % of cells below", "inverted", "largest over smallest cell")
PINS, THICKNESS, SIZE = [(0.0, 0.0), (80.0, 0.0)], 6.0, 2.0  # mm
# x, y, δ and tangent of each control point of the target, mm
MIDDLE, START_TANGENT, MIDDLE_TANGENT, END_TANGENT = (60.0, 22.0), (20.0, 60.0), (60.0, 0.0), (10.0, -40.0)
PICTURE = ROOT / "demos" / "pictures" / "handles.png"


class Link:
    """The link with its handles, and the cells of its shapes."""

    def __init__(self, size: float) -> None:
        rig = fm.Mechanism("one link")
        base = rig.rigid("base", fixed=True)
        link = rig.flexible("link", fm.strip(PINS, thickness=THICKNESS, depth=5.0), fm.ONYX)
        for at in PINS:
            rig.revolute(base, link, at=at, interface_radius=0.5 * THICKNESS)
        sim = fm.Simulation(fm.Scene(rig), space="plane-stress", size=size)
        request, model = shape_request(fm.SplineDesign(link, 2), rig, sim.linkage), sim.model
        (shape,) = shapes = shape_links(model.mesh, [request])
        space = vector_space(model.mesh.mesh, 1)
        self.handles, self.cells, self.free = shape.handles, cell_dofs(space), model.mesh.interface < 0
        self.drawn, self.design = space.tabulate_dof_coordinates()[:, :2], fem.Function(space)
        spline, size = self.handles.spline, self.handles.spline.size
        own = LinkParameters(slice(0, size), np.zeros(size), np.eye(size))
        self.map = ShapeMap(model.mesh, self.design, shapes, [own], spline.initial)
        self.quality = QualitySum(self.design)
        drawn = spline.controls_at(spline.initial)
        wanted = drawn.copy()
        wanted[:, 1, :2] = START_TANGENT, MIDDLE_TANGENT, END_TANGENT
        wanted[1, 0, :2] = MIDDLE
        # control points are linear in the parameters
        columns = [(spline.controls_at(spline.initial + row) - drawn).ravel() for row in np.eye(spline.size)]
        change, *_ = np.linalg.lstsq(np.array(columns).T, (wanted - drawn).ravel(), rcond=None)
        self.target = spline.initial + change

    def naive(self) -> np.ndarray:
        """θ of handles that stay where they are on the spline."""
        return follow_spline(self.handles, self.target)

    def optimal(self) -> np.ndarray:
        """θ of handles with the best mesh."""
        return HandleOptimum(self.map, self.quality).solve(self.target).theta

    def place(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (n, 2) and half the aspect ratio ρ of each cell, at least 1, NaN where it is inverted."""
        self.map.apply(self.target, theta)
        return self.drawn + self.design.x.array.reshape(-1, 2), 0.5 * self.quality.cell_values()


def areas(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Areas of triangles, (m,)."""
    (x, y), (u, v) = ((points[cells[:, k]] - points[cells[:, 0]]).T for k in (1, 2))
    return 0.5 * np.abs(x * v - y * u)


def draw(ax: Axes, points: np.ndarray, cells: np.ndarray, ratio: np.ndarray, title: str):
    """Cells coloured by their aspect ratio; inverted ones are black."""
    colours = plt.get_cmap("RdYlBu_r").with_extremes(bad="black")
    shown = ax.tripcolor(
        *points.T, cells, np.ma.masked_invalid(ratio), cmap=colours, vmin=1.0, vmax=2.0, edgecolors="k"
    )
    ax.set(title=title, aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    return shown


def compare(size: float, picture: Path | None = None) -> list[tuple]:
    """Rows of the table, and the picture if it is wanted."""
    link, rows, drawn = Link(size), [], []
    cells = link.cells
    for name, theta in (("naive", link.naive()), ("optimal", link.optimal())):
        points, ratio = link.place(theta)
        free, sizes = ratio[link.free], areas(points, cells[link.free])
        inverted, worst = int(np.sum(np.isnan(free))), np.nanpercentile(free, 95)
        rows.append((name, len(free), np.nanmean(free), worst, inverted, sizes.max() / sizes.min()))
        drawn.append((points, ratio, name))
    if picture is not None:
        figure, axes = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
        for ax, (points, ratio, name) in zip(axes, drawn, strict=True):
            shown = draw(ax, points, cells, ratio, f"{name} handles")
        figure.colorbar(shown, ax=axes, label="aspect ratio ρ / 2, equilateral: 1", extend="max")
        picture.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(picture, dpi=110)
        plt.close(figure)
    return rows


def main():
    parser = command(__doc__)
    parser.add_argument("--size", type=float, default=SIZE, metavar="MM", help="element size")
    options = parser.parse_args()
    rows = compare(options.size, PICTURE if options.write else None)
    publish("handles", format_table(HEADERS, rows), write=options.write)


if __name__ == "__main__":
    main()
