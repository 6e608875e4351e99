"""Designs of the demos in the parts to be made: exported as STEP, remeshed with finer elements, loaded from zero.

    python3 -m benchmarks.parts [DEMO …] [--size MM] [--results DIR] [--write]

The design problem of each demo at its full size, in the space that it uses by default. Elements of the part are a
quarter as wide as the optimiser's; in space half the depth is meshed, and the claw and the leg take 20 minutes and 8 GB
each. Verified designs are kept as DIR/DEMO.json, so that the same command continues after an interruption.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from pathlib import Path

import fenicsmech as fm
from fenicsmech.report import format_table

from .table import command, publish

HEADERS = (
    "demo",
    "target",
    "unit",
    "wanted",
    "optimiser's value",
    "finer elements add",
    "part",
    "add there",
    "off [%]",
)
SPACES = {
    "truss": "3d",
    "claw": "3d",
    "klann": "3d",
    "gripper": "plane-stress",
    "constant_force": "plane-stress",
    "switch": "plane-stress",
    "suspension": "plane-stress",
}
FINER = 4.0  # width of the optimiser's elements over that of the part's


def verified(name: str, size: float | None = None) -> fm.DesignResult:
    """The optimum of a demo's design problem, with the values of its targets in the parts."""
    demo, space = importlib.import_module(f"demos.{name}"), SPACES[name]
    scene, *rest = demo.describe()
    problem = fm.DesignProblem(fm.Simulation(scene, space=space, size=size or demo.SIZE), **demo.wanted(scene, *rest))
    return problem.verify(problem.optimise(), finer=FINER)


def rows(name: str, result: fm.DesignResult) -> Iterator[tuple]:
    """The lines of the table, one per target."""
    for target in result.targets:
        part = target.part
        there = (None,) * 3 if part is None else (part.value, part.finer_elements_add, 100.0 * part.error)
        yield name, target.name, target.unit, target.wanted, target.reached, target.finer_elements_add, *there


def main():
    parser = command(__doc__)
    parser.add_argument("demos", nargs="*", default=SPACES, help="which (default: all that design)")
    parser.add_argument("--results", type=Path, default=Path("results/parts"), metavar="DIR", help="verified designs")
    parser.add_argument("--size", type=float, metavar="MM", help="element size (default: that of each demo)")
    options = parser.parse_args()
    lines = []
    for name in options.demos:
        kept = options.results / (f"{name}.json" if options.size is None else f"{name}-{options.size:g}.json")
        if not kept.exists():
            verified(name, options.size).save(kept)
        lines += rows(name, fm.DesignResult.load(kept))
    publish("parts", format_table(HEADERS, lines), write=options.write)


if __name__ == "__main__":
    main()
