"""Planar mechanisms whose motion is known in closed form, drawn by the oracles."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fenicsmech.mechanism import Mechanism

from ..oracles import klann as patent
from ..oracles.fourbar import FourBar
from .machine import Machine

Place = Callable[[float, float], Sequence[float]]


def same(x: float, y: float) -> tuple[float, float]:
    """Places points where the oracle has them."""
    return x, y


def four_bar(
    oracle: FourBar, angle: float, *, driven: str | None = "crank", place: Place = same, order: Sequence[int] = range(4)
) -> Machine:
    """The four-bar of ``oracle`` drawn at the crank ``angle``; joints are added in ``order``."""
    pin, joint = oracle.positions(angle)
    m = Mechanism("four-bar")
    ground = m.rigid("ground", fixed=True)
    crank, coupler, rocker = (m.rigid(name) for name in ("crank", "coupler", "rocker"))
    hinges = (
        (ground, crank, oracle.shaft, "shaft"),
        (crank, coupler, pin, "pin"),
        (coupler, rocker, joint, "joint"),
        (ground, rocker, oracle.axle, "axle"),
    )
    made = {hinges[k][3]: m.revolute(*hinges[k][:2], at=place(*hinges[k][2]), name=hinges[k][3]) for k in order}
    motor = m.motor(made["shaft" if driven == "crank" else "axle"]) if driven else None
    return Machine(m, motor, {"pin": (crank, place(*pin)), "joint": (rocker, place(*joint))})


CRANK_ROCKER = FourBar((0.0, 0.0), (32.0, 4.0), crank=10.0, coupler=30.0, rocker=25.0)
DRAWN_ANGLE = 0.7


def parallelogram(angle: float, **options) -> Machine:
    """A parallelogram linkage of sides 40 and 20 drawn at the crank ``angle``."""
    return four_bar(FourBar((0.0, 0.0), (40.0, 0.0), crank=20.0, coupler=40.0, rocker=20.0), angle, **options)


def collinear_parallelogram(*, driven: bool = False) -> Machine:
    """The parallelogram drawn flat, at its change point, where it may become an antiparallelogram."""
    m = Mechanism("flat parallelogram")
    ground = m.rigid("ground", fixed=True)
    crank, coupler, rocker = (m.rigid(name) for name in ("crank", "coupler", "rocker"))
    shaft = m.revolute(ground, crank, at=(0.0, 0.0))
    m.revolute(crank, coupler, at=(20.0, 0.0))
    m.revolute(coupler, rocker, at=(60.0, 0.0))
    m.revolute(ground, rocker, at=(40.0, 0.0))
    return Machine(m, m.motor(shaft) if driven else None)


def klann(*, driven: bool = True) -> Machine:
    """The Klann leg of the patent, rigid, drawn with the crank at 180°."""
    pose = patent.klann(patent.DRAWN_ANGLE)
    m = Mechanism("Klann leg")
    base = m.rigid("base", fixed=True)
    crank, rod, first, second, leg = (m.rigid(n) for n in ("crank", "rod", "first rocker", "second rocker", "leg"))
    shaft = m.revolute(base, crank, at=patent.CRANK_SHAFT)
    m.revolute(base, first, at=patent.FIRST_AXLE)
    m.revolute(base, second, at=patent.SECOND_AXLE)
    m.revolute(crank, rod, at=pose.crank_pin)
    m.revolute(rod, second, at=pose.elbow)
    m.revolute(rod, leg, at=pose.knee)
    m.revolute(first, leg, at=pose.hip)
    on = {"crank_pin": crank, "elbow": second, "knee": rod, "hip": first, "foot": leg}
    pivots = {name: (link, tuple(getattr(pose, name))) for name, link in on.items()}
    return Machine(m, m.motor(shaft) if driven else None, pivots)


def slider_crank(crank: float, rod: float, angle: float, *, driven: str) -> Machine:
    """A slider on the x axis driven by a crank about the origin, or the reverse, drawn at the crank ``angle``."""
    pin = crank * np.array([np.cos(angle), np.sin(angle)])
    m = Mechanism("slider-crank")
    ground = m.rigid("ground", fixed=True)
    wheel, bar, slider = (m.rigid(name) for name in ("crank", "rod", "slider"))
    stroke = (slider_position(crank, rod, angle), 0.0)
    shaft = m.revolute(ground, wheel, at=(0.0, 0.0))
    m.revolute(wheel, bar, at=pin)
    m.revolute(bar, slider, at=stroke)
    way = m.prismatic(ground, slider, at=stroke, axis=(1.0, 0.0))
    return Machine(
        m, m.motor(shaft if driven == "crank" else way), {"pin": (wheel, tuple(pin)), "slider": (slider, stroke)}
    )


def slider_position(crank: float, rod: float, angle: float) -> float:
    """Distance of the slider from the crank shaft, on the far side."""
    return float(crank * np.cos(angle) + np.sqrt(rod**2 - (crank * np.sin(angle)) ** 2))
