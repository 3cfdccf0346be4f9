"""Long columns in temporary files: the same numbers, nothing left behind, and pages that are given back."""

import math
import subprocess
import sys

import numpy as np
import pytest

from gcode2krl.compiled import long_columns
from gcode2krl.compiled.long_columns import by_regions, columns_on_disk, long_columns_on_disk
from tests.conftest import ROOT

ROWS = 3000
LEAST_BYTES = 8 * ROWS

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="there they stay in memory")


@pytest.fixture
def on_disk():
    with long_columns_on_disk(LEAST_BYTES) as lie_there:
        assert lie_there
        yield columns_on_disk()


def test_a_long_column_lies_in_a_file_and_a_short_one_does_not(on_disk):
    column = np.empty(ROWS)
    assert columns_on_disk() == on_disk + 1
    short = np.empty(ROWS - 1)
    assert columns_on_disk() == on_disk + 1
    del column, short
    assert columns_on_disk() == on_disk


def test_numbers_are_those_of_memory(on_disk):
    rows = np.arange(3.0 * ROWS)
    table = np.sqrt(rows).reshape(-1, 3)
    total = np.concatenate([table, table[::-1]]).cumsum(axis=0)
    grown = np.zeros(ROWS)
    grown.resize(2 * ROWS)
    shrunk = np.ones(2 * ROWS)
    shrunk.resize(7)
    assert columns_on_disk() > on_disk
    with_lists = np.array([math.sqrt(k) for k in range(3 * ROWS)]).reshape(-1, 3)
    assert (table == with_lists).all()
    assert total[-1].tolist() == pytest.approx((2 * with_lists.sum(axis=0)).tolist())
    assert (grown == 0.0).all()
    assert shrunk.tolist() == [1.0] * 7


def test_columns_live_on_and_later_ones_lie_in_memory():
    before = columns_on_disk()
    with long_columns_on_disk(LEAST_BYTES):
        column = np.arange(float(ROWS))
    later = np.arange(float(ROWS))
    assert columns_on_disk() == before + 1
    assert (column == later).all()
    del column
    assert columns_on_disk() == before


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_ends_it(error):
    before = columns_on_disk()

    def broken():
        with long_columns_on_disk(LEAST_BYTES):
            raise error(np.ones(ROWS).sum())

    with pytest.raises(error):
        broken()
    assert np.ones(ROWS).sum() == ROWS
    assert columns_on_disk() == before


def test_what_the_disk_refuses_lies_in_memory():
    code = f"""
import resource
import numpy as np
from gcode2krl.compiled.long_columns import by_regions, columns_on_disk, long_columns_on_disk
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
with long_columns_on_disk({LEAST_BYTES}):
    column = np.arange({ROWS}.0)
    print(int(column.sum()), columns_on_disk())
"""
    assert ran(code) == [str(ROWS * (ROWS - 1) // 2), "0"]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the system gives pages back")
def test_pages_are_given_back():
    """Fifty columns of 8 MB are written and read in turn; without the files they are 400 MB."""
    code = f"""
import time
import numpy as np
from gcode2krl.compiled import long_columns
long_columns.MOST_RESIDENT_BYTES = 60 << 20
def resident_mb():
    pages = open("/proc/self/statm").read().split()[1]
    return int(pages) * 4096 / 1e6
before = resident_mb()
with long_columns.long_columns_on_disk({LEAST_BYTES}):
    columns = []
    for k in range(50):
        columns.append(np.full(1_000_000, float(k)))
        time.sleep(0.005)
    time.sleep(0.1)
    after = resident_mb()
    total = sum(column[::1000].sum() for column in columns)
print(int(after - before), int(total))
"""
    more_mb, total = map(int, ran(code))
    assert more_mb < 120
    assert total == 1000 * sum(range(50))


def test_without_numpys_function_columns_stay_in_memory(monkeypatch):
    monkeypatch.setattr(long_columns, "_set_handler", lambda: None)
    before = columns_on_disk()
    with long_columns_on_disk(LEAST_BYTES) as lie_there:
        assert not lie_there
        column = np.empty(ROWS)
        assert columns_on_disk() == before
    del column


def ran(code):
    """Return the words that a program of its own prints."""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_rows_far_apart_are_looked_at_in_parts_with_the_same_numbers():
    rows = np.arange(0, ROWS, 7)
    in_memory = by_regions(rows, lambda part: part * 2.0)
    assert len(in_memory) == 1 or columns_on_disk()
    with long_columns_on_disk(LEAST_BYTES):
        column = np.arange(float(ROWS)) ** 2
        parts = by_regions(rows, lambda part: column[part])
        few = by_regions(rows[:3], lambda part: column[part])
        none = by_regions(rows[:0], lambda part: column[part])
    assert len(parts) > 4
    assert [len(part) for part in none] == [0]
    assert np.concatenate(parts).tolist() == (rows.astype(float) ** 2).tolist()
    assert np.concatenate(few).tolist() == [0.0, 49.0, 196.0]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the system gives pages back")
def test_a_look_at_rows_far_apart_leaves_nothing_resident():
    """Of 400 MB in files, 2000 rows between them are read: without parts most of it may become resident."""
    program = """
import numpy as np
from gcode2krl.compiled import long_columns
long_columns.MOST_RESIDENT_BYTES = 1 << 40  # no help by the thread that looks now and then
resident = lambda: int(open("/proc/self/statm").read().split()[2]) * 4096 >> 20
with long_columns.long_columns_on_disk():
    column = np.ones(50_000_000)
    long_columns._let_go()
    before, most = resident(), []
    def work(part):
        column[part].sum()
        most.append(resident() - before)
    long_columns.by_regions(np.arange(0, len(column), 25_000), work)
    print(len(most), max(most))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    parts, most_mb = map(int, done.stdout.split())
    assert parts == 16
    assert most_mb < 60
