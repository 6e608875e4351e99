"""Lengths in units of the element size.

CAD kernels compare lengths with absolute tolerances, so a link in metres would not be meshed like the same link
in millimetres. Shapes are therefore built in units of the element size, rounded to 1e-10 of it: descriptions that
differ by their unit only give the same numbers, and the same mesh, to the last bit but rounding.
"""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch
from typing import TypeVar

from fenicsmech.mechanism import Arc, Disc, Line, Outline, Rectangle, Strip
from fenicsmech.meshing.interface_site import InterfaceSite

Described = TypeVar("Described")

_DIGITS = 10


@singledispatch
def in_units_of(described: Described, unit: float) -> Described:
    """``described`` (a length, a point, a region, a site or a shape) with its lengths divided by ``unit``."""
    raise TypeError(f"{type(described).__name__} has no lengths to convert")


@in_units_of.register(float)
@in_units_of.register(int)
def _(described: float, unit: float) -> float:
    return round(described / unit, _DIGITS)


@in_units_of.register
def _(described: tuple, unit: float) -> tuple:
    return tuple(in_units_of(item, unit) for item in described)


@in_units_of.register
def _(described: Disc, unit: float) -> Disc:
    return Disc(in_units_of(described.radius, unit))


@in_units_of.register
def _(described: Rectangle, unit: float) -> Rectangle:
    return replace(described, length=in_units_of(described.length, unit), width=in_units_of(described.width, unit))


@in_units_of.register
def _(described: InterfaceSite, unit: float) -> InterfaceSite:
    return replace(described, at=in_units_of(described.at, unit), region=in_units_of(described.region, unit))


@in_units_of.register
def _(described: Line, unit: float) -> Line:
    return Line(in_units_of(described.end, unit))


@in_units_of.register
def _(described: Arc, unit: float) -> Arc:
    return Arc(in_units_of(described.via, unit), in_units_of(described.end, unit))


@in_units_of.register
def _(described: Strip, unit: float) -> Strip:
    return Strip(
        in_units_of(described.centreline, unit),
        in_units_of(described.thickness, unit),
        in_units_of(described.depth, unit),
    )


@in_units_of.register
def _(described: Outline, unit: float) -> Outline:
    return Outline(
        in_units_of(described.start, unit),
        in_units_of(described.segments, unit),
        in_units_of(described.depth, unit),
    )
