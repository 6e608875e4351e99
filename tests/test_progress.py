import io
from threading import Thread

import pytest

from fenicsmech.errors import DescriptionError
from fenicsmech.log import Progress


class Clock:
    """A clock that the test sets."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


class Terminal(io.StringIO):
    def isatty(self):
        return True


def run(stream, steps, seconds_per_step, total=None):
    clock = Clock()
    with Progress(steps if total is None else total, "load steps", stream, clock=clock) as progress:
        for done in range(1, steps + 1):
            clock.now += seconds_per_step
            progress.update(done, f"{done} N")
    return stream.getvalue()


def test_a_file_gets_a_whole_line_every_few_seconds_and_the_last_one():
    lines = run(io.StringIO(), 100, 0.2).splitlines()
    assert len(lines) == 5
    assert lines[0] == "load steps: 1/100  0.2 s, 19.8 s left  1 N"
    assert lines[-1] == "load steps: 100/100  20.0 s  100 N"


def test_a_terminal_gets_one_line_redrawn_at_most_twice_a_second():
    text = run(Terminal(), 100, 0.1)
    assert text.count("\n") == 1 and text.endswith("\n")
    assert 15 <= text.count("\r") <= 21
    assert all(part.endswith("\x1b[K") for part in text.rstrip("\n").split("\r")[1:])


def test_a_long_note_does_not_wrap_the_terminal_line(monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    stream = Terminal()
    with Progress(3, "frames", stream) as progress:
        progress.update(1, "x" * 100)
    assert len(stream.getvalue().strip("\r\n").removesuffix("\x1b[K")) == 39


def test_a_run_that_stops_early_shows_where():
    clock, stream = Clock(), io.StringIO()
    with pytest.raises(RuntimeError), Progress(10, "frames", stream, clock=clock) as progress:
        for done in (1, 2, 3):
            progress.update(done)
        raise RuntimeError
    assert stream.getvalue().splitlines()[-1].startswith("frames: 3/10")


def test_fractions_and_an_unknown_total_are_shown():
    clock, stream = Clock(), io.StringIO()
    with Progress(None, "iterations", stream, clock=clock) as progress:
        progress.update(0)
        clock.now += 7530.0
        progress.update(12)
    assert stream.getvalue().splitlines() == ["iterations: 0  0.0 s", "iterations: 12  2:05:30 h"]
    stream = io.StringIO()
    with Progress(2.5, "load", stream, clock=clock) as progress:
        clock.now += 90.0
        progress.update(0.5)
    assert stream.getvalue() == "load: 0.5/2.5  1:30 min, 6:00 min left\n"


def test_tasks_within_another_one_are_not_shown():
    outer, inner = io.StringIO(), io.StringIO()
    with Progress(2, "search", outer) as search:
        with Progress(1, "design", inner) as design:
            design.update(1)
        search.update(2)
    with Progress(1, "design", inner) as design:
        assert inner.getvalue() == ""
        design.update(1)
    assert "search: 2/2" in outer.getvalue() and inner.getvalue().count("design: 1/1") == 1


def test_tasks_of_other_threads_are_shown():
    here, there = io.StringIO(), io.StringIO()
    with Progress(2, "search", here) as search:
        thread = Thread(target=run, args=(there, 3, 0.2))
        thread.start()
        thread.join()
        search.update(2)
    assert "load steps: 3/3" in there.getvalue() and "search: 2/2" in here.getvalue()


def test_the_error_stream_is_the_default(capsys):
    with Progress(1, "frames") as progress:
        progress.update(1)
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.startswith("frames: 1/1")


def test_other_processes_make_the_same_calls_and_show_nothing(capsys):
    with Progress(1, "frames", shown=False) as progress:
        progress.update(1, "note")
    progress.close()
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("total", [0, -1, float("nan"), float("inf")])
def test_a_total_that_cannot_be_reached_is_refused(total):
    with pytest.raises(DescriptionError, match="progress of 'frames'"):
        Progress(total, "frames")
