"""Worker processes: answers, failures, a killed worker, memory, an end in the middle."""

import os
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import pytest

from gcode2krl.batch.crew import Crew
from tests.batch import errands


def answers(function, tasks, processes=2, costs_mb=None, **settings):
    with Crew(processes, settings.pop("budget_mb", float("inf"))) as crew:
        return list(crew.answers(function, tasks, costs_mb or [0.0] * len(tasks), **settings))


def test_every_task_is_answered_once():
    found = answers(errands.double, range(20))
    assert sorted((each.task, each.value) for each in found) == [(n, 2 * n) for n in range(20)]
    assert all(each.failure == "" for each in found)


def test_nothing_to_do_needs_no_process():
    assert answers(errands.double, []) == []


def test_a_worker_has_one_thread_and_its_own_temporary_folder():
    found = {each.value for each in answers(errands.environment, range(6))}
    assert os.getpid() not in {process for process, _, _ in found}
    assert {threads for _, threads, _ in found} == {"1"}
    assert not any(Path(folder).exists() for _, _, folder in found)


def test_an_exception_is_a_failure_of_its_task_alone():
    (first,) = answers(errands.fail, [7])
    assert (first.value, first.failure) == (None, "ValueError: no 7")


def test_what_a_library_prints_is_no_answer():
    assert [each.value for each in answers(errands.say, [5])] == [5]


def test_a_killed_worker_costs_the_task_only_that_kills_it():
    found = {each.task: each for each in answers(errands.die_at_three, range(6))}
    assert {task: each.value for task, each in found.items() if task != 3} == {
        task: 2 * task for task in (0, 1, 2, 4, 5)
    }
    assert found[3].value is None
    if os.name == "posix":
        assert found[3].failure == "the worker was ended by SIGKILL: the last word"


def test_a_task_is_tried_again_once(tmp_path):
    markers = [str(tmp_path / name) for name in ("a", "b", "c")]
    found = answers(errands.die_once, markers)
    assert sorted(each.value for each in found) == ["a", "b", "c"]


def test_too_little_memory_is_tried_again_and_then_a_failure():
    (only,) = answers(errands.lack_memory, [1])
    assert only.failure == "MemoryError"


def overlaps(found):
    """Return how many pairs of tasks ran at the same time."""
    spans = sorted(each.value for each in found)
    return sum(later[0] < earlier[1] for earlier, later in pairwise(spans))


def test_tasks_run_beside_each_other_where_the_memory_suffices():
    assert overlaps(answers(errands.note_time, [0.5] * 2, budget_mb=200.0, costs_mb=[100.0] * 2)) == 1
    assert overlaps(answers(errands.note_time, [0.3] * 3, budget_mb=150.0, costs_mb=[100.0] * 3)) == 0


def test_a_task_that_needs_more_than_there_is_runs_alone():
    found = answers(errands.note_time, [0.2] * 3, budget_mb=100.0, costs_mb=[1000.0, 10.0, 10.0])
    first = next(each for each in found if each.task == 0)
    assert all(each is first or each.value[0] >= first.value[1] for each in found)


def test_the_order_is_kept_by_one_process():
    found = answers(errands.double, range(4), processes=1, order=[2, 0, 3, 1])
    assert [each.task for each in found] == [2, 0, 3, 1]


def test_answers_in_turn_and_few_of_them_wait():
    waits = [0.6, 0.0, 0.0, 0.0, 0.0, 0.0]
    found = answers(errands.note_time, waits, ahead=3)
    assert [each.task for each in found] == list(range(6))
    assert found[3].value[0] >= found[0].value[1]  # not begun before the first was passed on


def test_leaving_ends_the_workers_at_once():
    began = time.monotonic()
    with Crew(2) as crew:
        for _ in crew.answers(errands.note_time, [0.0, 60.0, 60.0], [0.0] * 3):
            processes = [process for worker in crew._workers for process in worker._pool._processes]
            break
    assert time.monotonic() - began < 30.0
    if os.name == "posix":
        assert len(processes) == 2
        for process in processes:
            with pytest.raises(ProcessLookupError):
                os.kill(process, 0)


def test_no_temporary_folder_stays():
    before = set(Path(tempfile.gettempdir()).glob("gcode2krl-*"))
    answers(errands.double, [1])
    assert set(Path(tempfile.gettempdir()).glob("gcode2krl-*")) <= before


def test_a_script_without_a_guard_can_use_it(tmp_path):
    """multiprocessing would run such a script again in each worker."""
    import subprocess
    import sys

    script = tmp_path / "plain.py"
    script.write_text(
        "import sys; sys.path[:] = sys.argv[1:]\n"
        "from gcode2krl.batch.crew import Crew\n"
        "from tests.batch import errands\n"
        "with Crew(2) as crew:\n"
        "    print(sorted(a.value for a in crew.answers(errands.double, [1, 2], [0, 0])))\n"
    )
    done = subprocess.run([sys.executable, script, *sys.path], capture_output=True, text=True, timeout=60)
    assert done.stdout == "[2, 4]\n", done.stderr
