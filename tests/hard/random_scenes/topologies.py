"""Skeletons of planar mechanisms: named points, and the links that hold them. Lengths are of the order of one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from random import Random

Point = tuple[float, float]


@dataclass(frozen=True)
class Skeleton:
    """Points, and for each link the points it goes through.

    Attributes:
        name: of the topology.
        points: where joints are.
        links: the points of each link in order; "base" is fixed, "slider" slides.
        slide: direction of the slider, None if there is none.
        mobility: freedoms of the pinned mechanism with rigid links.
    """

    name: str
    points: dict[str, Point]
    links: dict[str, tuple[str, ...]]
    slide: Point | None = None
    mobility: int = 1

    @property
    def joints(self) -> dict[str, tuple[str, str]]:
        """The two links that meet in each point."""
        return {p: tuple(name for name, at in self.links.items() if p in at) for p in self.points}


def _off(origin: Point, angle: float, length: float) -> Point:
    return origin[0] + length * math.cos(math.radians(angle)), origin[1] + length * math.sin(math.radians(angle))


def _loop(rng: Random) -> dict[str, Point]:
    """Ground pivots A and D, moving pivots B and C of a four-bar."""
    a, d = (0.0, 0.0), (rng.uniform(0.7, 1.2), rng.uniform(-0.2, 0.2))
    return {
        "A": a,
        "B": _off(a, rng.uniform(60, 150), rng.uniform(0.35, 0.8)),
        "C": _off(d, rng.uniform(30, 120), rng.uniform(0.35, 0.9)),
        "D": d,
    }


def _six_bar(rng: Random, *, link: tuple[str, str], lean: tuple[float, float]) -> dict[str, Point]:
    """A four-bar, E beyond the end of its ``link``, and a dyad E–F–G to the ground, E–F within angles ``lean``."""
    points = _loop(rng)
    start, end = (points[name] for name in link)
    angle = math.degrees(math.atan2(end[1] - start[1], end[0] - start[0])) + rng.uniform(-25, 25)
    points["E"] = _off(end, angle, rng.uniform(0.3, 0.5))
    points["F"] = _off(points["E"], rng.uniform(*lean), rng.uniform(0.5, 0.8))
    points["G"] = _off(points["F"], rng.uniform(-110, -60), rng.uniform(0.5, 0.9))
    return points


def four_bar(rng: Random) -> Skeleton:
    """Crank AB, coupler BC, rocker CD."""
    links = {"base": ("A", "D"), "crank": ("A", "B"), "coupler": ("B", "C"), "rocker": ("D", "C")}
    return Skeleton("four-bar", _loop(rng), links)


def watt(rng: Random) -> Skeleton:
    """A four-bar whose rocker DCE drives a second one: E–F, F–G."""
    points = _six_bar(rng, link=("D", "C"), lean=(-20, 30))
    links = {
        "base": ("A", "D", "G"),
        "crank": ("A", "B"),
        "coupler": ("B", "C"),
        "rocker": ("D", "C", "E"),
        "second coupler": ("E", "F"),
        "second rocker": ("G", "F"),
    }
    return Skeleton("Watt six-bar", points, links)


def stephenson(rng: Random) -> Skeleton:
    """A four-bar whose coupler BCE drives a rocker: E–F, F–G."""
    points = _six_bar(rng, link=("B", "C"), lean=(-60, 20))
    links = {
        "base": ("A", "D", "G"),
        "crank": ("A", "B"),
        "coupler": ("B", "C", "E"),
        "rocker": ("D", "C"),
        "tie": ("E", "F"),
        "second rocker": ("G", "F"),
    }
    return Skeleton("Stephenson six-bar", points, links)


def slider_crank(rng: Random) -> Skeleton:
    """Crank AB, rod BC, and a slider at C that slides on the base at S."""
    a = (0.0, 0.0)
    b = _off(a, rng.uniform(30, 150), rng.uniform(0.25, 0.5))
    c = _off(b, rng.uniform(-60, -10), rng.uniform(0.8, 1.2))
    turn = math.radians(rng.uniform(-20, 20))
    points = {"A": a, "B": b, "C": c, "S": (c[0] + 0.05, c[1] - 0.1)}
    links = {"base": ("A", "S"), "crank": ("A", "B"), "rod": ("B", "C"), "slider": ("S", "C")}
    return Skeleton("slider-crank", points, links, slide=(math.cos(turn), math.sin(turn)))


def truss(rng: Random) -> Skeleton:
    """Two links pinned to the ground and to each other: an arch, steep or shallow."""
    half, rise = rng.uniform(0.4, 0.8), rng.choice([rng.uniform(0.3, 0.8), rng.uniform(0.08, 0.2)])
    points = {"A": (0.0, 0.0), "B": (half, rise), "C": (half + rng.uniform(0.4, 0.8), rng.uniform(-0.1, 0.1))}
    links = {"base": ("A", "C"), "left": ("A", "B"), "right": ("C", "B")}
    return Skeleton("two-link arch", points, links, mobility=0)


def chain(rng: Random) -> Skeleton:
    """A finger: links one after the other, the first on the ground."""
    points, angle = {"A": (0.0, 0.0)}, rng.uniform(-90, 90)
    for name, last in (("B", "A"), ("C", "B")):
        angle += rng.uniform(-60, 60)
        points[name] = _off(points[last], angle, rng.uniform(0.4, 0.9))
    links = {"base": ("A",), "proximal": ("A", "B"), "distal": ("B", "C"), "tip": ("C",)}
    return Skeleton("chain", points, links, mobility=3)


TOPOLOGIES: tuple[Callable[[Random], Skeleton], ...] = (four_bar, watt, stephenson, slider_crank, truss, chain)
