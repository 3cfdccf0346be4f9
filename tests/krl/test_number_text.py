"""The text of motions does not depend on the chunks that it is written in, nor on the number of threads."""

import numpy as np
import pytest

from gcode2krl.compiled.chunks import chunk_borders
from gcode2krl.krl import number_text


def random_run(seed):
    """The arguments of `motion_lines`: speeds and blends that repeat, lines that are missing, triggers."""
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 120))
    length = random.integers(0, 12, count) if seed % 2 else np.zeros(count, dtype=np.int64)
    start = np.concatenate([[0], np.cumsum(length)]).astype(np.int64)
    line = random.integers(1, 99_999, count)
    line[random.random(count) < random.choice([0.0, 0.3, 1.0])] = 0
    return (
        random.uniform(-500.0, 500.0, (count, 3)),
        random.uniform(-180.0, 180.0, (count, 3)),
        np.repeat(random.uniform(0.01, 0.2, count), 4)[:count],
        random.choice([0.0, 0.5, 0.75], count),
        line.astype(np.int32),
        np.array([*random.choice([-1.0, 0.5], 2), random.integers(0, 9)], dtype=float),
        int(random.choice([0, 1, 2, 5, 50])),
        (random.integers(65, 90, int(start[-1])).astype(np.uint8), start),
    )


def written(run):
    """The text, and the state behind it."""
    *columns, state, every, before = run
    state = state.copy()
    return b"".join(number_text.motion_lines(*columns, state, every, before)), state.tolist()


@pytest.mark.parametrize("rows", [1, 2, 7, 50])
@pytest.mark.parametrize("threads", ["1", "3"])
def test_the_chunks_do_not_matter(rows, threads, monkeypatch):
    runs = [random_run(seed) for seed in range(100)]
    whole = [written(run) for run in runs]
    monkeypatch.setattr(number_text, "chunk_borders", lambda count: chunk_borders(count, rows))
    monkeypatch.setenv("GCODE2KRL_THREADS", threads)
    assert [written(run) for run in runs] == whole
    assert any(text.count(b"; line ") > 2 and text.count(b"$APO.CDIS=") > 2 for text, _ in whole)


def test_the_state_is_that_of_the_kernel():
    for seed in range(200):
        *columns, state, every, _ = random_run(seed)
        by_kernel = state.copy()
        buffer = np.empty(number_text.BYTES_PER_TARGET * len(columns[0]), dtype=np.uint8)
        number_text._lines(
            *columns, np.zeros((0, 6)), 0, by_kernel, every, *number_text.NOTHING_BEFORE, buffer
        )
        behind = number_text._state_behind(*columns[2:], state, every)
        assert behind.tolist() == by_kernel.tolist()


def test_no_motion_is_no_text():
    *columns, state, every, _ = random_run(2)
    nothing = [column[:0] for column in columns]
    before = state.copy()
    assert b"".join(number_text.motion_lines(*nothing, state, every)) == b""
    assert state.tolist() == before.tolist()
