"""Work of one process for all: they wait for it, and get its result or its error."""

import gc
import threading
import time
import weakref

import pytest
from mpi4py import MPI

from fenicsmech.collective import from_one, on_all, on_one

pytestmark = pytest.mark.parallel

COMM = MPI.COMM_WORLD


class OddError(Exception):
    """Cannot be made anew from its arguments, as unpickling does."""

    def __init__(self, part, shown):
        super().__init__(f"{part}: {shown}")


def fail(error: Exception) -> None:
    raise error


def test_only_the_first_process_works():
    assert on_one(COMM, lambda: COMM.rank) == (0 if COMM.rank == 0 else None)
    assert from_one(COMM, lambda: COMM.rank) == 0


def test_no_process_continues_before_the_work_is_done(shared_tmp_path):
    def write() -> None:
        time.sleep(0.05)
        (shared_tmp_path / "done").touch()

    on_one(COMM, write)
    assert (shared_tmp_path / "done").exists()


@pytest.mark.parametrize("call", [on_one, from_one])
def test_its_error_is_raised_on_all(call):
    with pytest.raises(FileNotFoundError, match="nowhere"):
        call(COMM, lambda: open("/nowhere"))


@pytest.mark.parametrize("error", [OddError("link", 3), OSError("link", threading.Lock())], ids=["odd", "locked"])
def test_an_error_that_cannot_be_pickled_is_replaced_by_its_message(error):
    with pytest.raises(type(error) if COMM.rank == 0 else RuntimeError, match="link"):
        on_one(COMM, lambda: fail(error))
    assert COMM.allreduce(1) == COMM.size


def test_the_next_call_is_not_disturbed_by_an_error():
    with pytest.raises(ValueError):
        from_one(COMM, lambda: fail(ValueError("no")))
    assert from_one(COMM, lambda: "yes") == "yes"


def test_a_result_that_cannot_be_sent_is_an_error_on_all():
    with pytest.raises((TypeError, RuntimeError), match="pickle"):
        from_one(COMM, threading.Lock)
    assert COMM.allreduce(1) == COMM.size


def test_work_of_all_fails_on_all_with_the_error_of_the_lowest_rank():
    assert on_all(COMM, lambda: COMM.rank) == COMM.rank
    with pytest.raises(ValueError, match="first"):
        on_all(COMM, lambda: fail(ValueError("first") if COMM.rank == 0 else OSError("second")))
    last = COMM.size - 1
    with pytest.raises(OSError, match="last"):
        on_all(COMM, lambda: fail(OSError("last")) if COMM.rank == last else None)


class Large:
    """Something that is in use when an error is raised."""


@pytest.mark.parametrize("call", [on_one, from_one, on_all])
def test_objects_in_use_when_work_failed_are_freed_with_the_error(call):
    used = []

    def work() -> None:
        large = Large()
        used.append(weakref.ref(large))
        raise ValueError(f"with {type(large).__name__}")

    gc.disable()
    try:
        try:
            call(COMM, work)
        except ValueError as error:
            assert "Large" in str(error)
        assert [reference() for reference in used] == [None] * len(used)
    finally:
        gc.enable()
