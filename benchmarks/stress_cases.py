"""Links whose largest stress is known, each drawn once for fenicsmech and once for ``fine_elements``.

All have depth 1 and ν = 0.3; radii of notches are 1. In space the peak of a plate with a hole or a notch differs from
that in plane stress, by thickness over radius (Sternberg & Sadowsky 1949).
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import gmsh
import numpy as np
from mpi4py import MPI

import fenicsmech as fm

from .fine_elements import FineSolution, Held, drawing, solved

E, NU, DEPTH = 1e6, 0.3, 1.0
STEEL = fm.Material("steel", E, NU)
LAYERS = 3
"""Of fine elements through half the depth."""


@dataclass(frozen=True)
class Reference:
    """The largest von Mises stress.

    Attributes:
        value: the stress.
        source: of it.
        handbook: what a formula says, and its name; None where the source is exact.
    """

    value: float
    source: str
    handbook: tuple[float, str] | None = None


@dataclass(frozen=True)
class Case:
    """A link whose largest stress is known.

    Attributes:
        name: of it.
        size: its least width, as large as elements usually are.
        build: in a model, "plane-stress" or "3d-symmetric", the mechanism, its effects, what loads it and how much.
        reference: in a model; of a cantilever, beyond a distance from its clamp.
        strain: the largest principal strain in plane stress, from the largest stress: where nothing acts on a surface
            that one is alone.
    """

    name: str
    size: float
    build: Callable[[str], tuple[fm.Mechanism, list[fm.Effect], fm.Force | fm.ForceGroup, float]]
    reference: Callable[[str, float], Reference]
    strain: Callable[[float], float] = lambda stress: stress / E

    def solved(self, space: str, size: float) -> tuple[fm.Curve, Reference]:
        """The curve of one frame with elements of ``size``, and the reference of its peak."""
        mechanism, effects, part, force = self.build(space)
        simulation = fm.Simulation(fm.Scene(mechanism, effects), space=space, size=size, comm=MPI.COMM_SELF)
        curve = simulation.load_displacement(part, forces=[force])
        return curve, self.reference(space, max(place.reach for place in simulation.singular_places))


def between(name, shape, *ends):
    """A link between a fixed and a free rigid link, each of which holds a rectangle: (place, length, width)."""
    mechanism = fm.Mechanism(name)
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    link = mechanism.flexible(name, shape, STEEL)
    for rigid, (at, *lengths) in zip((base, hand), ends, strict=True):
        mechanism.weld(rigid, link, at=at, region=fm.Rectangle(*lengths))
    return mechanism, hand


@cache
def solid(draw: Callable[[], int]) -> Path:
    """A STEP file of the face that ``draw`` draws, extruded by the depth."""
    path = Path(tempfile.mkdtemp()) / "part.step"
    with drawing():
        gmsh.model.occ.extrude([(2, draw())], 0.0, 0.0, DEPTH)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    return path


def cut(body: tuple[int, int], *tools: tuple[int, int]) -> int:
    """The face that is left of one without others."""
    (((_, face),), _) = gmsh.model.occ.cut([body], list(tools))
    return face


def disk(x: float, y: float, radius: float = 1.0) -> tuple[int, int]:
    """A disk, its rim a circle where that of ``addDisk`` is an ellipse."""
    occ = gmsh.model.occ
    return 2, occ.addPlaneSurface([occ.addCurveLoop([occ.addCircle(x, y, 0.0, radius)])])


# -- a cantilever -----------------------------------------------------------------------------------------------

LENGTH = 20.0


def cantilever(space: str):
    mechanism, hand = between(
        "cantilever", fm.strip([(-1, 0), (LENGTH + 1, 0)], thickness=1.0, depth=DEPTH),
        ((-0.5, 0), 1.0, 1.5), ((LENGTH + 0.5, 0), 1.0, 1.5),
    )  # fmt: skip
    return mechanism, [], mechanism.force(on=hand, at=(LENGTH, 0), direction=(0, 1)), 1e-3


def cantilever_reference(space: str, beyond: float) -> Reference:
    """The clamp holds the width too: 3 % less than 6 F L / b h² at half a thickness from it, no limit at its rim."""

    def draw() -> int:
        return gmsh.model.occ.addRectangle(0.0, -0.5, 0.0, LENGTH, 1.0)

    clamp = [Held(0, 0.0, component) for component in range(2 if space == "plane-stress" else 3)]
    tip = Held(0, LENGTH, 1, lambda points: np.ones(len(points)))
    size = "0.04 + 0.3 * sqrt(x^2 + (abs(y) - 0.5)^2)" if space == "plane-stress" else "0.12 + 0.3 * x"
    found = fine(draw, size, (*clamp, tip), space)
    force = halves(space) * found.forces[tip.holds(found.points), 1].sum()
    kept = (found.points[:, 0] > beyond * (1.0 - 1e-9)) & (found.points[:, 0] < 0.5 * LENGTH)
    return Reference(1e-3 * found.von_mises[kept].max() / force, "fine elements", (6e-3 * LENGTH, "6 F L / b h²"))


# -- a curved bar in pure bending -------------------------------------------------------------------------------

INNER, OUTER, TAB = 2.0, 4.0, 3.0


def curved_bar(space: str):
    a, b, y = INNER, OUTER, -TAB
    segments = [
        fm.Line((b, 0)), fm.Arc((0, b), (-b, 0)), fm.Line((-b, y)), fm.Line((-a, y)),
        fm.Line((-a, 0)), fm.Arc((0, a), (a, 0)), fm.Line((a, y)),
    ]  # fmt: skip
    mechanism, hand = between(
        "curved bar", fm.outline((b, y), segments, depth=DEPTH), ((3, y), 3.0, 2.0), ((-3, y), 3.0, 2.0)
    )
    forces = {mechanism.force(on=hand, at=(-3, y), direction=(y, 0), name=f"at {y}"): 1.0 for y in (50, -50)}
    return mechanism, [], fm.ForceGroup("couple", forces), 2e-4


def winkler_bach(moment: float) -> float:
    """Hoop stress at the inner radius of a curved bar of depth 1 whose sections stay plane."""
    area, centroid = OUTER - INNER, 0.5 * (INNER + OUTER)
    neutral = area / math.log(OUTER / INNER)
    return moment * (neutral - INNER) / (area * (centroid - neutral) * INNER)


def draw_curved_bar() -> int:
    """The half at x > 0."""
    occ, y = gmsh.model.occ, 1.0 - TAB
    places = ((INNER, y), (OUTER, y), (OUTER, 0.0), (0.0, OUTER), (0.0, INNER), (INNER, 0.0))
    centre, *points = (occ.addPoint(*place, 0.0) for place in ((0.0, 0.0), *places))
    edges = [
        occ.addCircleArc(first, centre, last) if k in (2, 4) else occ.addLine(first, last)
        for k, (first, last) in enumerate(zip(points, [*points[1:], points[0]], strict=True))
    ]
    return occ.addPlaneSurface([occ.addCurveLoop(edges)])


def curved_bar_reference(space: str, _: float) -> Reference:
    y = 1.0 - TAB
    turned = Held(1, y, 1, lambda points: points[:, 0] - 3.0)
    found = fine(draw_curved_bar, "0.15 + 0.4 * max(0, sqrt(x*x + y*y) - 2)", (Held(0, 0.0, 0), turned), space)
    end = turned.holds(found.points)
    moment = halves(space) * abs(found.forces[end, 1] @ (found.points[end, 0] - 3.0))
    return Reference(0.02 * found.von_mises.max() / moment, "fine elements", (winkler_bach(0.02), "Winkler–Bach"))


# -- bars in tension --------------------------------------------------------------------------------------------

END = 13.0


def bar(width: float) -> tuple[int, int]:
    """A rectangle of the length of all bars."""
    return 2, gmsh.model.occ.addRectangle(-END - 1.0, -0.5 * width, 0.0, 2.0 * END + 2.0, width)


def holed_plate() -> int:
    """Width 8, a hole in the middle."""
    return cut(bar(8.0), disk(0.0, 0.0))


def filleted_bar() -> int:
    """Width 6, 4 in the middle, fillets at x = ±6."""
    above, below = ((2, gmsh.model.occ.addRectangle(-7.0, y, 0.0, 14.0, 6.0, roundedRadius=1.0)) for y in (2.0, -8.0))
    return cut(bar(6.0), above, below)


def notched_bar() -> int:
    """Width 12, notches of depth 2."""
    flanks = [(2, gmsh.model.occ.addRectangle(-1.0, y, 0.0, 2.0, 4.0)) for y in (5.0, -9.0)]
    return cut(bar(12.0), disk(0.0, 5.0), disk(0.0, -5.0), *flanks)


def slotted_plate() -> int:
    """Width 12, in the middle an elliptic hole 4 wide and 2 long, its radius at the peak 0.5."""
    occ = gmsh.model.occ
    rim = occ.addEllipse(0.0, 0.0, 0.0, 2.0, 1.0)
    occ.rotate([(1, rim)], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5 * math.pi)
    return cut(bar(12.0), (2, occ.addPlaneSurface([occ.addCurveLoop([rim])])))


def howland(hole: float) -> float:
    """Kt of a central hole in a plate, ``hole`` its diameter over the width; a fit to Howland (1930).

    Source: Pilkey & Pilkey, Peterson's Stress Concentration Factors, 3rd ed., chart 4.1.
    """
    rest = 1.0 - hole
    return 2.0 + 0.284 * rest - 0.6 * rest**2 + 1.32 * rest**3


def fillet(ratio: float) -> float:
    """Kt of fillets of radius 1 in a stepped bar, ``ratio`` = 2 t / D, depth t = 1; ibid., chart 3.1."""
    return 1.970 - 0.384 * ratio - 1.018 * ratio**2 + 1.430 * ratio**3


def notch(ratio: float) -> float:
    """Kt of opposite U notches of radius 1 and depth h = 2, ``ratio`` = 2 h / D.

    Source: Young & Budynas, Roark's Formulas for Stress and Strain, 7th ed., table 17.1.
    """
    root, h = math.sqrt(2.0), 2.0
    factors = (
        0.833 + 2.069 * root - 0.009 * h,
        2.732 - 4.157 * root + 0.176 * h,
        -8.859 + 5.327 * root - 0.320 * h,
        6.294 - 3.239 * root + 0.154 * h,
    )
    return sum(own * ratio**k for k, own in enumerate(factors))


def ellipse(ratio: float) -> float:
    """Kt of a central elliptic hole with half-axes a = 2 across the bar and b = 1, ``ratio`` = 2 a / D; ibid."""
    root, shape = math.sqrt(2.0), 2.0
    factors = (
        1.0 + 2.0 * shape,
        -0.351 - 0.021 * root - 2.483 * shape,
        3.621 - 5.183 * root + 4.494 * shape,
        -2.270 + 5.204 * root - 4.011 * shape,
    )
    return sum(own * ratio**k for k, own in enumerate(factors))


def pulled(name: str, draw: Callable[[], int]):
    """A bar pulled at its ends by 1."""
    mechanism, hand = between(
        name, fm.step_file(solid(draw), depth=DEPTH), ((-END, 0.0), 2.0, 16.0), ((END, 0.0), 2.0, 16.0)
    )
    return mechanism, [], mechanism.force(on=hand, at=(END, 0.0), direction=(1, 0)), 1.0


def pulled_reference(
    draw: Callable[[], int], root: tuple[float, float], width: float, handbook: tuple[float, str], space: str
) -> Reference:
    """That of a bar pulled by 1, by a quarter of it.

    Args:
        draw: the bar.
        root: place near its peak.
        width: least.
        handbook: Kt of the least section, and the chart.
        space: the model.
    """

    def quarter() -> int:
        ((_, face),), _ = gmsh.model.occ.intersect(
            [(2, draw())], [(2, gmsh.model.occ.addRectangle(0.0, 0.0, 0.0, END - 1.0, 50.0))]
        )
        return face

    (x, y), (factor, chart) = root, handbook
    size = f"0.15 + 0.4 * max(0, sqrt((x - {x})^2 + (y - {y})^2) - 0.4)"
    moved, across = (
        Held(0, END - 1.0, 0, lambda points: np.ones(len(points))),
        range(1, 2 if space == "plane-stress" else 3),
    )
    ends = (moved, *(Held(0, END - 1.0, component) for component in across))
    found = fine(quarter, size, (Held(0, 0.0, 0), Held(1, 0.0, 1), *ends), space)
    force = 2.0 * halves(space) * found.forces[moved.holds(found.points), 0].sum()
    # stress has no limit at the ends
    return Reference(
        found.von_mises[found.points[:, 0] < 0.75 * END].max() / force,
        "fine elements",
        (factor / (width * DEPTH), chart),
    )


# -- a tube under pressure --------------------------------------------------------------------------------------


def tube() -> int:
    return cut(disk(0.0, 0.0, OUTER), disk(0.0, 0.0, INNER))


def pressed(_: str):
    """A tube under pressure in its bore, its ends free."""
    mechanism = fm.Mechanism("under pressure")
    base = mechanism.rigid("base", fixed=True)
    link = mechanism.flexible("link", fm.step_file(solid(tube), depth=DEPTH), STEEL)
    # held at almost a point, which hardly strains it
    mechanism.weld(base, link, at=(3.8, 0.0), region=fm.Disc(0.01))
    idle = mechanism.force(on=link, at=(-OUTER, 0.0), direction=(1, 0))

    def bore(x: np.ndarray) -> np.ndarray:
        return np.linalg.norm(x[:, :2], axis=1) < INNER + 1e-6

    return mechanism, [fm.Pressure(link, 1.0, where=bore, about=(0.0, 0.0))], idle, 0.0


HOOP = (INNER**2 + OUTER**2) / (OUTER**2 - INNER**2)
"""At the bore σ_r = −p and σ_θ = p (a² + b²) / (b² − a²), p = 1."""


def lame(*_) -> Reference:
    return Reference(math.sqrt(1.0 + HOOP + HOOP**2), "Lamé")


# -- all of them ------------------------------------------------------------------------------------------------


def halves(space: str) -> float:
    """Depth that counts over that of the fine elements."""
    return DEPTH if space == "plane-stress" else 2.0


@cache
def fine(draw: Callable[[], int], size: str, held: tuple[Held, ...], space: str) -> FineSolution:
    """Elements of order 4 in plane stress, of order 3 in space."""
    if space == "plane-stress":
        return solved(draw, size, held, order=4, modulus=E, poisson=NU)
    return solved(draw, size, held, order=3, modulus=E, poisson=NU, depth=0.5 * DEPTH, layers=LAYERS)


def in_tension(
    name: str, draw: Callable[[], int], root: tuple[float, float], width: float, handbook: tuple[float, str]
) -> Case:
    """A bar in tension; arguments as those of ``pulled_reference``."""
    return Case(
        name,
        0.5 * width,
        lambda _: pulled(name, draw),
        lambda space, _: pulled_reference(draw, root, width, handbook, space),
    )


CASES = (
    Case("cantilever", 1.0, cantilever, cantilever_reference),
    Case("curved bar", OUTER - INNER, curved_bar, curved_bar_reference),
    in_tension("plate with a hole", holed_plate, (0.0, 1.0), 6.0, (howland(0.25), "Howland")),
    in_tension("shoulder fillet", filleted_bar, (6.2, 2.0), 4.0, (fillet(1.0 / 3.0), "Peterson")),
    in_tension("U notch", notched_bar, (0.0, 4.0), 8.0, (notch(1.0 / 3.0), "Roark")),
    in_tension("elliptic hole", slotted_plate, (0.0, 2.0), 8.0, (ellipse(1.0 / 3.0), "Roark")),
    Case("Lamé's tube", OUTER - INNER, pressed, lame, lambda _: (HOOP + NU) / E),
)
