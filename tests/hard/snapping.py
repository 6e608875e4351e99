"""Mechanisms that snap: load and displacement turn back, and the whole path between is followed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI
from scipy.optimize import minimize_scalar

import fenicsmech as fm

from ..equilibrium import arch, bistable, curved_beam, toggle
from .case import BOTH, PLANE, Check, Fact, HardCase, deviation

STIFF, SOFT = 200.0, 0.075  # MPa of the toggle's stilt: only the load turns back, or the displacement as well
LIMIT, TURNING = fm.Critical.LIMIT, fm.Critical.TURNING


def _highest(function, low: float, high: float) -> float:
    """The maximum of a smooth function of one number."""
    return minimize_scalar(lambda x: -function(x), bounds=(low, high), method="bounded", options={"xatol": 1e-10}).x


def _toggle(space: str, comm: MPI.Comm) -> Iterator[Check]:
    rise = toggle.RISE
    for modulus, kinds in ((STIFF, [LIMIT, LIMIT]), (SOFT, [LIMIT, TURNING, TURNING, LIMIT])):
        case = toggle.toggle(stilt_modulus=modulus, space=space, comm=comm)
        end = fm.Until(displacement=toggle.displacement(2.4 * rise, modulus))
        curve = case.simulation.follow(case.push, until=end)
        sunk = np.array([frame.outputs[case.sunk] for frame in curve.frames])
        yield deviation("forces along the path", curve.forces, toggle.force(sunk), 1e-8)
        yield deviation("displacements", curve.displacements, toggle.displacement(sunk, modulus), 1e-8)
        yield Fact("2 limit points, and 2 turning points between with a soft link in series", _kinds(curve) == kinds)
        peaks = [_highest(toggle.force, 0.0, rise), _highest(lambda x: -toggle.force(x), rise, 2.0 * rise)]
        found = [event.frame.force for event in curve.limit_points]
        yield deviation("limit loads", found, toggle.force(np.array(peaks)), 1e-6)
        slope = toggle.force(sunk + 1e-6) - toggle.force(sunk - 1e-6)
        clear = np.delete(np.arange(len(sunk)), [event.index for event in curve.events])
        yield Fact("stable where the force rises, nowhere else", np.array_equal(curve.stable[clear], slope[clear] > 0))


def _kinds(curve: fm.FollowedCurve) -> list[fm.Critical]:
    return [event.kind for event in curve.events]


def _arch(space: str, comm: MPI.Comm) -> Iterator[Check]:
    simulation, push = arch.arch(comm, space=space)
    curve = simulation.follow(push, until=fm.Until(displacement=2.4 * arch.RISE))
    yield Fact("2 limit points", _kinds(curve) == [LIMIT, LIMIT])
    upper, lower = (event.frame.force for event in curve.limit_points)
    exact = arch.beam_forces(np.linspace(0.5 * arch.RISE, 1.6 * arch.RISE, 101))
    yield deviation("upper limit load", upper, exact.max(), 3e-3)
    yield deviation("lower limit load", lower, exact.min(), 1e-2)
    yield deviation("forces along the path", curve.forces, arch.beam_forces(curve.displacements), 5e-3)


def _four_bar(space: str, comm: MPI.Comm) -> Iterator[Check]:
    material, rise = bistable.PLASTIC if space == PLANE else bistable.CORK, bistable.RISE
    case = bistable.four_bar(comm, space=space, material=material)
    curve = case.simulation.follow(case.push, until=fm.Until(displacement=2.2 * rise))
    yield Fact("2 limit points", _kinds(curve) == [LIMIT, LIMIT])
    some = np.arange(0, len(curve.frames), 4)
    exact = bistable.forces(curve.displacements[some], material)
    yield deviation("forces along the path", curve.forces[some], exact, 1e-2)
    loads = [event.frame.force for event in curve.limit_points]
    there = [event.frame.displacement for event in curve.limit_points]
    yield deviation("limit loads", loads, bistable.forces(np.array(there), material), 1e-2)
    rest = case.simulation.load_displacement(case.push, displacements=np.linspace(0.0, 2.0 * rise, 9))
    size = curve.forces.max()
    yield deviation("force in the mirror image", rest.forces[-1], 0.0, 1e-6, scale=size)
    yield deviation("energy there", rest.frames[-1].strain_energy, 0.0, 1e-9, scale=size * rise)
    yield Fact("stable there", rest.frames[-1].stable)


def _curved_beams(space: str, comm: MPI.Comm) -> Iterator[Check]:
    end = fm.Until(displacement=2.0 * curved_beam.RISE)
    for ratio in (3.0, 6.0, 10.0):
        simulation, push = curved_beam.curved_beam(ratio, 1e-3, cells=1.0, comm=comm)
        imperfect = simulation.follow(push, until=end)
        yield Fact(f"2 limit points with an imperfection, h/t = {ratio:g}", _kinds(imperfect) == [LIMIT, LIMIT])
        exact = curved_beam.beam_forces(ratio, 1e-3, imperfect.displacements[::4])
        yield deviation("forces along that path", imperfect.forces[::4], exact, 1e-2)
        simulation, push = curved_beam.curved_beam(ratio, cells=1.0, comm=comm)
        perfect = simulation.follow(push, until=end)
        loads = [event.value for event in perfect.bifurcations]
        limits = [event.frame.force for event in imperfect.limit_points]
        yield Fact(
            "without it 2 limit points and 2 bifurcations, or more", min(len(loads), len(perfect.limit_points)) > 1
        )
        # the limit loads of a beam tend to the first and last of them as its imperfection vanishes
        yield deviation("first and last bifurcation, at the limit loads", [loads[0], loads[-1]], limits, 0.05)
        yield Fact("stable at both ends", bool(perfect.stable[0] and perfect.stable[-1]))


CASES = (
    HardCase(
        "toggle", "snaps through, and back where a soft link stands in series; against the closed form", _toggle, BOTH
    ),
    HardCase("shallow arch", "load falls between two limit points, against the beam", _arch, BOTH),
    HardCase(
        "curved beams",
        "of Qiu, Lang and Slocum, h/t = 3, 6 and 10, perfect, and with an imperfection of 1e-3 t, against the beam",
        _curved_beams,
        (PLANE,),
        slow=True,
    ),
    HardCase("bistable four-bar", "one flexible link, pushed through to its mirror image", _four_bar, BOTH),
)
