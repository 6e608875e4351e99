"""Links whose largest stress is known: by a closed form, or by much finer elements of another code
(``stress_references``).

All have depth 1 and ν = 0.3; radii of notches are 1. In space the peak of a plate with a hole or a notch differs from
that in plane stress, by thickness over radius (Sternberg & Sadowsky 1949).
"""

from __future__ import annotations

import csv
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

from .fine_elements import drawing

E, NU, DEPTH = 1e6, 0.3, 1.0
STEEL = fm.Material("steel", E, NU)
TABLE = Path(__file__).with_name("stress_references.csv")
"""Stresses of finer elements, which ``stress_references`` writes."""


@dataclass(frozen=True)
class Case:
    """A link whose largest stress is known.

    Attributes:
        name: of it.
        size: its least width, as large as elements usually are.
        build: in a model, "plane-stress" or "3d-symmetric", the mechanism, its effects, what loads it and how much.
        handbook: what a formula says of the stress, and its name.
        exact: whether it is a closed form.
        strain: the largest principal strain in plane stress, from the largest stress: where nothing acts on a surface
            that one is alone.
    """

    name: str
    size: float
    build: Callable[[str], tuple[fm.Mechanism, list[fm.Effect], fm.Force | fm.ForceGroup, float]]
    handbook: tuple[float, str]
    exact: bool = False
    strain: Callable[[float], float] = lambda stress: stress / E

    def solved(self, space: str, size: float) -> tuple[fm.Simulation, fm.Curve]:
        """The simulation with elements of ``size``, and the curve of one frame."""
        mechanism, effects, part, force = self.build(space)
        simulation = fm.Simulation(fm.Scene(mechanism, effects), space=space, size=size, comm=MPI.COMM_SELF)
        return simulation, simulation.load_displacement(part, forces=[force])

    def reference(self, space: str, simulation: fm.Simulation) -> float:
        """The largest von Mises stress in a model, beyond what a simulation leaves out beside a clamp."""
        return self.handbook[0] if self.exact else _fine()[self.name, space, self.beyond(simulation)]

    def beyond(self, simulation: fm.Simulation) -> str:
        """How far from a clamp the stress is sought, as in the table; elsewhere it does not matter."""
        reach = max(place.reach for place in simulation.singular_places)
        return f"{reach:.4g}" if self.build is cantilever else ""


@cache
def _fine() -> dict[tuple[str, str, str], float]:
    """Stresses of the table."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        _, *rows = csv.reader(file)
    return {(name, space, beyond): float(stress) for name, space, beyond, stress, _ in rows}


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


# -- all of them ------------------------------------------------------------------------------------------------


def in_tension(name: str, draw: Callable[[], int], width: float, factor: float, chart: str) -> Case:
    """A bar in tension, drawn by ``draw``, ``width`` at its least section; its Kt there by a chart."""
    return Case(name, 0.5 * width, lambda _: pulled(name, draw), (factor / (width * DEPTH), chart))


CASES = (
    Case("cantilever", 1.0, cantilever, (6e-3 * LENGTH, "6 F L / b h²")),
    Case("curved bar", OUTER - INNER, curved_bar, (winkler_bach(0.02), "Winkler–Bach")),
    in_tension("plate with a hole", holed_plate, 6.0, howland(0.25), "Howland"),
    in_tension("shoulder fillet", filleted_bar, 4.0, fillet(1.0 / 3.0), "Peterson"),
    in_tension("U notch", notched_bar, 8.0, notch(1.0 / 3.0), "Roark"),
    in_tension("elliptic hole", slotted_plate, 8.0, ellipse(1.0 / 3.0), "Roark"),
    Case(
        "Lamé's tube",
        OUTER - INNER,
        pressed,
        (math.sqrt(1.0 + HOOP + HOOP**2), "Lamé"),
        exact=True,
        strain=lambda _: (HOOP + NU) / E,
    ),
)
