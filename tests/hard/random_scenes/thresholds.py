"""Every threshold of the judge, in one record that is fixed before the runs it judges."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Thresholds:
    """What an equilibrium must satisfy, and when an error is true.

    Attributes:
        residual: of an equilibrium, over the largest load or reaction.
        rounding: residual over that of rounded displacements, where this is larger.
        balanced: work along motions that deform no link, over what works there.
        grain: turn in rad, or travel over the mechanism's length, to which springs must be relaxed for that.
        rounded: velocities along these motions, over that of what moves fastest, taken for rounding.
        opening: speed at which joints open along these motions, times this counts as rounding.
        closed: gaps of joints and motors over the mechanism's length, rad.
        reached: what is prescribed, and the displacement reported, over the mechanism's length or the force.
        energy: the strain energy reported, over itself.
        digits: strain energy over its rounding in double precision below which it is not compared.
        signless: eigenvalue over the largest below which a direction counts as neither stable nor unstable.
        unknowns: displacements up to which stability is checked.
        rank: singular value over the largest below which motions count as free.
        frames: of a path that are checked.
        directions: at random, along which the potential must be stationary.
        joined: gap over the mechanism's length, rad, above which rigid links cannot be joined.
        immobile: travel of the force's point per unit motion of bodies at which it cannot be displaced.
        adrift: work of loads along a free motion, over loads times the velocity of what moves fastest, at which no
            equilibrium is near the drawn configuration.
        soft: stiffness of the softest mode over that of the unloaded scene at which a limit point is near.
        unreached: force that a displacement takes, over E b t of the weakest link, at which it is out of reach.
        strained: principal stretch, or its inverse, of elements out of shape.
        followed: most frames of a path that is to turn back.
        drowned: stiffness of springs over that of the stiffest link at which rounding hides it.
        excused: share of all scenes that each excuse may let off.
        held: share of those in which joints and motors hold the point, which is exact.
        spare: scenes that each may let off besides, for small samples.
        effectivity: largest factor between an error estimate and the true difference.
        effective: least share of estimates within it, of those whose difference is above resolution.
        resolved: difference over the value below which it counts as rounding and tolerance.
        still: displacement over the mechanism's length below which differences count as rounding.
    """

    residual: float = 1e-6
    rounding: float = 10.0
    balanced: float = 1e-5
    grain: float = 1e-7
    rounded: float = 1e-14
    opening: float = 10.0
    closed: float = 1e-9
    reached: float = 1e-9
    energy: float = 1e-6
    digits: float = 1e6
    signless: float = 1e-10
    unknowns: int = 2500
    rank: float = 1e-9
    frames: int = 6
    directions: int = 8
    joined: float = 1e-6
    immobile: float = 1e-9
    adrift: float = 1e-6
    soft: float = 0.1
    unreached: float = 10.0
    strained: float = 2.0
    followed: int = 150
    drowned: float = 1e-14
    excused: float = 0.03
    held: float = 0.1
    spare: int = 5
    effectivity: float = 2.0
    effective: float = 0.95
    resolved: float = 1e-6
    still: float = 1e-13


THRESHOLDS = Thresholds()
