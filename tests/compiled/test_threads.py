"""Work in threads: results in the order of the tasks, no more threads than asked for, errors not lost."""

import multiprocessing
import os
import threading
import time
from concurrent.futures import ProcessPoolExecutor

import pytest

from gcode2krl import read_gcode
from gcode2krl.compiled.threads import HELPER, THREADS_VARIABLE, ahead, cores, in_background, in_threads
from gcode2krl.errors import NotUnderstoodError


def test_results_come_in_the_order_of_the_tasks():
    def late(task):
        time.sleep(0.02 if task == 0 else 0.0)
        return 10 * task

    assert in_threads(late, range(4), 4) == [0, 10, 20, 30]


def test_as_many_threads_as_asked_for():
    together = threading.Barrier(3, timeout=10.0)  # three tasks must run at once, or it breaks
    assert len(in_threads(lambda task: together.wait(), range(3), 3)) == 3


def test_one_thread_is_the_callers():
    assert set(in_threads(lambda task: threading.get_ident(), range(5), 1)) == {threading.get_ident()}


def test_the_error_of_the_first_task_that_fails_comes_out():
    both, begun = threading.Barrier(2, timeout=10.0), []

    def fails(task):
        begun.append(task)
        both.wait()
        time.sleep(0.02 if task == 0 else 0.0)  # the second fails before the first
        raise KeyError(task)

    with pytest.raises(KeyError, match="0"):
        in_threads(fails, range(6), 2)
    assert sorted(begun) == [0, 1]


def test_divided_work_may_be_divided_again():
    """More threads asked for than there may ever be: whoever asks works too, so nobody waits for a thread."""

    def divided(depth):
        return 1 if depth == 0 else sum(in_threads(divided, [depth - 1] * 4, 4))

    assert divided(3) == 4**3


def test_threads_are_kept_for_the_next_work():
    before = threading.active_count()
    for _ in range(200):
        in_threads(str, range(2), 2)
    assert threading.active_count() < before + 20


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks on Windows")
def test_a_forked_process_starts_threads_of_its_own():
    assert in_background(lambda: 1).result() == 1
    process = os.fork()
    if not process:
        os._exit(0 if in_background(lambda: 1).result(timeout=10.0) == 1 else 1)
    assert os.waitpid(process, 0)[1] == 0


def test_no_tasks_no_results():
    assert in_threads(str, []) == []


def test_the_environment_says_how_many_threads(monkeypatch):
    """Several processes at once, each on a core of its own, do the same work in less time alone."""
    monkeypatch.setenv(THREADS_VARIABLE, "3")
    assert cores() == 3
    monkeypatch.delenv(THREADS_VARIABLE)
    assert cores() >= 1


def test_a_worker_of_a_pool_takes_one(monkeypatch):
    monkeypatch.delenv(THREADS_VARIABLE, raising=False)
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert pool.submit(cores).result() == 1


def threads_but_helpers():
    return sum(not thread.name.startswith(HELPER) for thread in threading.enumerate())


def counted(most, closed=None):
    try:
        yield from range(most)
    finally:
        if closed is not None:
            closed.set()


@pytest.mark.parametrize("threads", [1, 2])
def test_what_is_made_ahead_comes_in_order(threads):
    for count in (5, 0):
        with ahead(counted(count), threads) as items:
            assert list(items) == list(range(count))


def test_the_next_item_is_made_while_one_is_worked_on():
    together = threading.Barrier(2, timeout=10.0)  # both have to meet, or it breaks

    def items():
        yield 0
        together.wait()
        yield 1

    with ahead(items(), 2) as made:
        for item in made:
            if item == 0:
                together.wait()


def test_an_error_while_making_an_item_comes_where_it_is_due():
    def items():
        yield 0
        raise KeyError(1)

    with ahead(items(), 2) as made:
        assert next(made) == 0
        with pytest.raises(KeyError):
            next(made)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_no_thread_is_left_where_the_work_on_an_item_fails(error, threads):
    before, closed = threads_but_helpers(), threading.Event()

    def twice():
        with ahead(counted(9, closed), threads) as items:
            yield from items

    def work_that_fails():
        with ahead(twice(), threads) as items:
            for _ in items:
                raise error

    with pytest.raises(error):
        work_that_fails()
    assert closed.is_set()
    assert threads_but_helpers() == before


def test_a_refused_program_leaves_no_thread_to_the_garbage_collector(tmp_path):
    """One that waits for a thread may do so where Python holds the lock that the thread's end takes."""
    (tmp_path / "part.nc").write_text("BEGIN PGM 1 MM\nL X+10\n")
    before = threads_but_helpers()
    with pytest.raises(NotUnderstoodError) as refused:
        read_gcode(tmp_path / "part.nc")
    assert threads_but_helpers() == before
    del refused
