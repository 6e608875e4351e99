"""The Klann walking linkage in closed form, with the proportions and part numbers of US patent 6,260,862.

A four-bar (crank 15–29, rod 29–27, second rocker 11–27) whose coupler, the rod, carries the knee 35; the leg hangs
between the knee and the first rocker 9–37 and ends in the foot 33. Lengths are the patent's, without unit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .fourbar import LEFT, RIGHT, circle_intersection, crank_pin

CRANK_SHAFT = (17.607, 11.807)  # 15
FIRST_AXLE = (17.818, 16.076)  # 9
SECOND_AXLE = (12.101, 10.186)  # 11

CRANK = 2.976  # 15–29
ROD_TO_ELBOW, ELBOW_TO_KNEE, ROD_TO_KNEE = 5.506, 6.236, 11.679  # 29–27, 27–35, 29–35
SECOND_ROCKER = 3.390  # 11–27
FIRST_ROCKER = 7.391  # 9–37
KNEE_TO_HIP, KNEE_TO_FOOT, HIP_TO_FOOT = 10.137, 13.442, 22.188  # 35–37, 35–33, 37–33

# as drawn in the patent, crank at 180°
DRAWN_ANGLE = np.pi
DRAWN = {
    "crank_pin": (14.631, 11.807),  # 29
    "elbow": (9.125, 11.807),  # 27
    "knee": (3.024, 13.099),  # 35
    "hip": (11.119, 19.200),  # 37
    "foot": (0.0, 0.0),  # 33
}


@dataclass(frozen=True)
class KlannPose:
    """Moving pivots and the foot, each (..., 2), at the crank angles (...) asked for."""

    crank_pin: np.ndarray
    elbow: np.ndarray
    knee: np.ndarray
    hip: np.ndarray
    foot: np.ndarray


def klann(angle: float | np.ndarray) -> KlannPose:
    """Pose of the linkage at the crank ``angle`` (...) rad from x, counter-clockwise."""
    pin = crank_pin(CRANK_SHAFT, CRANK, angle)
    second = np.broadcast_to(np.array(SECOND_AXLE), pin.shape)
    first = np.broadcast_to(np.array(FIRST_AXLE), pin.shape)
    elbow = circle_intersection(pin, ROD_TO_ELBOW, second, SECOND_ROCKER, side=RIGHT)
    knee = circle_intersection(pin, ROD_TO_KNEE, elbow, ELBOW_TO_KNEE, side=RIGHT)
    hip = circle_intersection(knee, KNEE_TO_HIP, first, FIRST_ROCKER, side=LEFT)
    foot = circle_intersection(knee, KNEE_TO_FOOT, hip, HIP_TO_FOOT, side=RIGHT)
    return KlannPose(pin, elbow, knee, hip, foot)


@dataclass(frozen=True)
class GroundStroke:
    """Longest run of crank angles at which the foot is within ``band`` of its lowest point.

    angles (2,): first and last crank angle, rad, increasing; length: the foot's way along x over the run.
    """

    angles: tuple[float, float]
    length: float
    band: float


def ground_stroke(band: float, *, samples: int = 7200) -> GroundStroke:
    """The part of a turn on which the foot stays within ``band`` (patent units) of its lowest height."""
    angles = np.linspace(0.0, 4.0 * np.pi, 2 * samples, endpoint=False)  # two turns: no run is cut in two
    foot = klann(angles).foot
    on_ground = foot[:, 1] <= foot[:, 1].min() + band
    edges = np.flatnonzero(np.diff(on_ground.astype(int)))
    runs = [(a + 1, b) for a, b in zip(edges, edges[1:], strict=False) if on_ground[a + 1]]
    first, last = max(runs, key=lambda run: run[1] - run[0])
    length = abs(foot[last, 0] - foot[first, 0])
    return GroundStroke((float(angles[first]), float(angles[last])), float(length), band)
