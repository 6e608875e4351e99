"""Decisions are the same on all processes, also where copies of a number differ in its last digits."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.multibody import BodyPoint, JointSystem

from ..simulation.demo_scenes import describe
from . import toggle

pytestmark = pytest.mark.parallel

COMM = MPI.COMM_WORLD
ODD = [1.0 - 1e-15, 1.0 + 1e-15]  # factors of what all processes but the first compute


def rounded_otherwise(monkeypatch, kind: type, name: str, factor: float) -> None:
    """Makes a method of ``kind`` return ``factor`` times its result, on all processes but the first."""
    original = getattr(kind, name)
    if COMM.rank > 0:
        monkeypatch.setattr(kind, name, lambda *arguments: factor * original(*arguments))


def alike(values: object) -> bool:
    """Whether all processes have the same ``values``."""
    return len(set(COMM.allgather(repr(values)))) == 1


@pytest.mark.parametrize("factor", ODD)
def test_an_iteration_at_the_threshold_of_convergence_is_the_last_one_on_all(monkeypatch, factor):
    rounded_otherwise(monkeypatch, JointSystem, "gradient", factor)

    def frame(tolerance: float) -> fm.Frame:
        scene, push = describe("truss")
        solver = fm.PrimalDualNewton(tolerance=tolerance, reuse_factor=0.0)
        simulation = fm.Simulation(scene, space="plane-stress", order=1, size=8.0, solver=solver)
        return simulation.load_displacement(push, forces=[0.05]).frames[0]

    residuals = frame(1e-9).residuals
    for threshold in COMM.bcast(residuals[-3:-1], root=0):
        stopped = frame(threshold)
        assert alike((stopped.iterations, stopped.residuals, stopped.displacement, stopped.unstable_modes))
        assert stopped.residuals[-1] <= threshold


@pytest.mark.parametrize("factor", ODD)
def test_a_path_that_is_to_end_where_it_has_a_frame_ends_there_on_all(monkeypatch, factor):
    rounded_otherwise(monkeypatch, BodyPoint, "displacement", factor)
    case = toggle.toggle(stilt_modulus=200.0, comm=COMM)

    def path(*ends: float) -> fm.FollowedCurve:
        return case.simulation.follow(case.push, until=fm.Until(displacement=ends))

    whole = path(12.0)
    end = COMM.bcast(float(whole.displacements[len(whole.frames) // 2]), root=0)
    ended = path(end, 12.0)
    assert alike((ended.displacements.tolist(), ended.forces.tolist(), [event.kind for event in ended.events]))
    assert ended.displacements[-1] == pytest.approx(end, rel=1e-9)


def test_frames_of_a_mechanism_are_those_of_the_first_process(monkeypatch):
    rounded_otherwise(monkeypatch, BodyPoint, "displacement", 1.0 + 1e-15)
    scene, push = describe("truss")
    simulation = fm.Simulation(scene, space="plane-stress", order=1, size=8.0)
    curve = simulation.load_displacement(push, displacements=[2.0, 5.0])
    assert alike([(frame.displacement, frame.force, frame.residuals) for frame in curve.frames])
    assert np.allclose(curve.displacements, [2.0, 5.0], rtol=1e-9)
