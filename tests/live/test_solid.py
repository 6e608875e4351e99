"""A project of the live page solved in space, and the job that does it."""

from __future__ import annotations

import asyncio
import base64
import json
import sys

import numpy as np
import pytest

from fenicsmech.live import Job, Solver, edited, example, solve_solid

FEW = {"kind": "set", "path": ["curves", 0, "steps"], "value": 2}


@pytest.fixture(scope="module")
def project():
    return edited(example("truss-finger"), [FEW])


def events(project):
    found: list[dict] = []
    solve_solid(project, 0, lambda event: found.append(json.loads(json.dumps(event, allow_nan=False))))
    return found


@pytest.fixture(scope="module")
def solved(project):
    return events(project)


def unpacked(text, kind):
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def test_progress_counts_the_frames_and_the_solid_is_near_plane_stress(project, solved):
    *progress, end = solved
    assert [event["done"] for event in progress] == list(range(progress[0]["of"] + 1))
    plane: list[dict] = []
    Solver(plane.append).run({"task": 1, "kind": "solve", "project": project, "fit": False})
    points = next(event for event in plane if event["event"] == "curve")["points"]
    assert [point["force"] for point in end["points"]] == pytest.approx([point["force"] for point in points])
    assert end["points"][-1]["displacement"] == pytest.approx(points[-1]["displacement"], rel=0.05)


def test_the_surface_encloses_the_links_and_has_their_peak_on_it(project, solved):
    end = solved[-1]
    triangles = unpacked(end["triangles"], "<u4").reshape(-1, 3).astype(int)
    for point in end["points"]:
        a, b, c = unpacked(point["places"], "<f4").reshape(-1, 3).astype(float)[triangles.T]
        volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0
        if not point["force"]:
            drawn = volume
        assert volume == pytest.approx(drawn, rel=0.01)  # rubber
    # a strip of its length between pins, 1.5 to 6 mm thick and 20 mm deep, with two eyes of 3 mm
    assert 40 * 20 * 1.5 + 20 * 9 * np.pi < drawn < 75 * 20 * 6
    last = end["points"][-1]
    stress, peak = unpacked(last["von_mises"], "<f4"), last["peak"]
    assert stress.min() >= 0.0 and stress[peak["point"]] == pytest.approx(peak["value"], rel=0.1)


def test_a_project_that_cannot_be_solved_in_space_is_told_with_its_remedy(project):
    apart = {"kind": "set", "path": ["joints", 5, "at"], "value": [80, 90]}
    (failed,) = events(edited(project, [apart]))
    assert failed["state"] == "failed" and failed["problem"] and failed["remedy"]


def test_a_surface_too_large_for_a_page_is_told_before_it_is_solved(project, monkeypatch):
    monkeypatch.setattr(sys.modules["fenicsmech.live.solid"], "_MOST", 1000)
    (failed,) = events(project)  # no progress before
    assert failed["state"] == "failed" and "points in each of 4 frames" in failed["problem"]


WAITS = 'import json, sys, time; json.load(sys.stdin); print(\'{"state": "solving"}\', flush=True); time.sleep(1000)'


def test_a_job_whose_time_is_over_is_ended_and_told_with_its_remedy():
    async def run():
        received, failed = [], asyncio.Event()

        def receive(event):
            received.append(event)
            if event["state"] == "failed":
                failed.set()

        job = Job((sys.executable, "-c", WAITS), receive, longest=1.0)
        await job.start({})
        await asyncio.wait_for(failed.wait(), 30)
        return received[-1], await job.stop()

    failed, stopped = asyncio.run(run())
    assert "longer than 1 s" in failed["problem"] and "larger elements" in failed["remedy"] and not stopped


@pytest.mark.parametrize(
    ("code", "state"),
    [
        (WAITS, None),
        ("raise SystemExit(3)", "failed"),
        ("print('{')", "failed"),
        ('print(\'{"state": "solved"}\')', "solved"),
    ],
)
def test_a_job_is_ended_at_any_time_and_one_that_dies_is_told(code, state):
    async def run():
        states, heard = [], asyncio.Event()

        def receive(event):
            states.append(event["state"])
            heard.set()

        job = Job((sys.executable, "-c", code), receive)
        await job.start({})
        await asyncio.wait_for(heard.wait(), 30)
        stopped = await asyncio.wait_for(job.stop(), 30)
        return states, stopped

    states, stopped = asyncio.run(run())
    assert (states, stopped) == ((["solving"], True) if state is None else ([state], stopped))
