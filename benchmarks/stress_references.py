"""Largest stresses of the ``stress_cases`` that have no closed form, by much finer elements of another code.

    python3 -m benchmarks.stress_references [--write] [CASE ...]

Elements of order 5 in plane stress and 4 in space. With --write the rows of these cases, of all by default, are
replaced in ``stress_references.csv``, which benchmarks and tests read. Its last column says how far elements of one
order less are from them. Half an hour for all.
"""

import csv
import io
from collections.abc import Callable, Iterator
from functools import partial

import gmsh
import numpy as np
from mpi4py import MPI

from fenicsmech.files import atomic_write

from .fine_elements import FineSolution, Held, solved
from .stress import SPACES
from .stress_cases import (
    CASES,
    DEPTH,
    END,
    INNER,
    LENGTH,
    NU,
    OUTER,
    TAB,
    TABLE,
    Case,
    E,
    filleted_bar,
    holed_plate,
    notched_bar,
    slotted_plate,
)
from .table import command

HEADER = ("case", "model", "beyond", "stress", "with elements of one order less [%]")
LAYERS = 5
"""Of elements through half the depth."""

Draw = Callable[[], int]
Solve = Callable[[Draw, str, list[Held]], FineSolution]
"""Solves for a face, a size of elements and what is held."""


def cantilever(solve: Solve, space: str, beyond: float) -> float:
    """The clamp holds the width too: 3 % less than 6 F L / b h² at half a thickness from it, no limit at its rim."""

    def draw() -> int:
        # corners of elements lie where the peak may
        x, y = (0.0, beyond, LENGTH, LENGTH, beyond, 0.0), (-0.5, -0.5, -0.5, 0.5, 0.5, 0.5)
        points = [gmsh.model.occ.addPoint(*at, 0.0) for at in zip(x, y, strict=True)]
        ends = zip(points, [*points[1:], points[0]], strict=True)
        return gmsh.model.occ.addPlaneSurface([gmsh.model.occ.addCurveLoop([gmsh.model.occ.addLine(*e) for e in ends])])

    clamp = [Held(0, 0.0, component) for component in range(2 if space == "plane-stress" else 3)]
    tip = Held(0, LENGTH, 1, lambda points: np.ones(len(points)))
    size = "0.04 + 0.3 * sqrt(x^2 + (abs(y) - 0.5)^2)" if space == "plane-stress" else "0.08 + 0.2 * x"
    found = solve(draw, size, [*clamp, tip])
    kept = (found.points[:, 0] > beyond * (1.0 - 1e-9)) & (found.points[:, 0] < 0.5 * LENGTH)
    return 1e-3 * found.von_mises[kept].max() / found.forces[tip.holds(found.points), 1].sum()


def curved_bar(solve: Solve, space: str, _: float) -> float:
    """The half at x > 0, its end turned."""
    y = 1.0 - TAB

    def draw() -> int:
        occ = gmsh.model.occ
        places = ((INNER, y), (OUTER, y), (OUTER, 0.0), (0.0, OUTER), (0.0, INNER), (INNER, 0.0))
        centre, *points = (occ.addPoint(*place, 0.0) for place in ((0.0, 0.0), *places))
        edges = [
            occ.addCircleArc(first, centre, last) if k in (2, 4) else occ.addLine(first, last)
            for k, (first, last) in enumerate(zip(points, [*points[1:], points[0]], strict=True))
        ]
        return occ.addPlaneSurface([occ.addCurveLoop(edges)])

    turned = Held(1, y, 1, lambda points: points[:, 0] - 3.0)
    found = solve(draw, "0.15 + 0.4 * max(0, sqrt(x*x + y*y) - 2)", [Held(0, 0.0, 0), turned])
    end = turned.holds(found.points)
    return 0.02 * found.von_mises.max() / abs(found.forces[end, 1] @ (found.points[end, 0] - 3.0))


def pulled(draw: Draw, root: tuple[float, float], solve: Solve, space: str, _: float) -> float:
    """A bar pulled by 1, by a quarter of it; its peak lies near ``root``."""

    def quarter() -> int:
        ((_, face),), _ = gmsh.model.occ.intersect(
            [(2, draw())], [(2, gmsh.model.occ.addRectangle(0.0, 0.0, 0.0, END - 1.0, 50.0))]
        )
        return face

    x, y = root
    moved = Held(0, END - 1.0, 0, lambda points: np.ones(len(points)))
    across = [Held(0, END - 1.0, component) for component in range(1, 2 if space == "plane-stress" else 3)]
    size = f"0.1 + 0.3 * max(0, sqrt((x - {x})^2 + (y - {y})^2) - 0.4)"
    found = solve(quarter, size, [Held(0, 0.0, 0), Held(1, 0.0, 1), moved, *across])
    # stress has no limit at the ends
    largest = found.von_mises[found.points[:, 0] < 0.75 * END].max()
    return largest / (2.0 * found.forces[moved.holds(found.points), 0].sum())


STRESSES = {
    "cantilever": cantilever,
    "curved bar": curved_bar,
    "plate with a hole": partial(pulled, holed_plate, (0.0, 1.0)),
    "shoulder fillet": partial(pulled, filleted_bar, (6.2, 2.0)),
    "U notch": partial(pulled, notched_bar, (0.0, 4.0)),
    "elliptic hole": partial(pulled, slotted_plate, (0.0, 2.0)),
}


def stress(case: Case, space: str, beyond: float, order: int) -> float:
    """The largest stress with elements of an order."""
    plane = space == "plane-stress"
    solid = {} if plane else {"depth": 0.5 * DEPTH, "layers": LAYERS}

    def solve(draw: Draw, size: str, held: list[Held]) -> FineSolution:
        return solved(draw, size, tuple(held), order=order, modulus=E, poisson=NU, **solid)

    # forces of half the depth
    return (1.0 if plane else 0.5) * STRESSES[case.name](solve, space, beyond)


def rows(case: Case) -> Iterator[tuple[str, ...]]:
    """Lines of the table."""
    for space in SPACES:
        known = set()
        for size in (case.size, 0.5 * case.size):
            beyond = case.beyond(case.solved(space, size)[0])
            if beyond not in known:
                known.add(beyond)
                order = 5 if space == "plane-stress" else 4
                less, found = (stress(case, space, float(beyond or 0.0), own) for own in (order - 1, order))
                yield case.name, space, beyond, f"{found:.7g}", f"{100.0 * (less / found - 1.0):.2g}"


def main() -> None:
    parser = command(__doc__)
    parser.add_argument("cases", nargs="*", metavar="CASE", help="names; all by default")
    options = parser.parse_args()
    if MPI.COMM_WORLD.rank:
        return
    chosen = [case for case in CASES if case.name in (options.cases or STRESSES)]
    found = []
    for case in chosen:
        for row in rows(case):
            print(*row, sep=", ", flush=True)
            found.append(row)
    if options.write:
        with TABLE.open(encoding="utf-8", newline="") as file:
            kept = [row for row in list(csv.reader(file))[1:] if row[0] not in {case.name for case in chosen}]
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([HEADER, *kept, *found])
        with atomic_write(TABLE) as file:
            file.write(text.getvalue())


if __name__ == "__main__":
    main()
