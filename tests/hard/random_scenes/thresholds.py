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
        closed: gaps of joints and motors over the mechanism's length, rad.
        reached: what is prescribed, and the displacement reported, over the mechanism's length or the force.
        energy: the strain energy reported, over itself.
        signless: eigenvalue over the largest below which a direction counts as neither stable nor unstable.
        immobile: travel of the force's point per unit motion of bodies at which it cannot be displaced.
        soft: stiffness of the softest mode over that of the unloaded scene at which a limit point is near.
        huge: load over what bends the softest link at which equilibria need not exist.
        unreached: force over what bends the softest link at which links are stretched straight.
        drowned: stiffness of a spring over that of the stiffest link at which rounding hides it.
        effectivity: largest factor between an error estimate and the true difference.
        told: difference over the value below which it counts as rounding and tolerance.
        rounded: displacement over the mechanism's length below which it counts as rounding.
    """

    residual: float = 1e-6
    rounding: float = 10.0
    balanced: float = 1e-5
    closed: float = 1e-9
    reached: float = 1e-9
    energy: float = 1e-6
    signless: float = 1e-10
    immobile: float = 1e-9
    soft: float = 0.1
    huge: float = 10.0
    unreached: float = 1e3
    drowned: float = 1e-14
    effectivity: float = 2.0
    told: float = 1e-6
    rounded: float = 1e-13


THRESHOLDS = Thresholds()
