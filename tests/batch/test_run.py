"""A batch from Python: a part that kills its workers, one that vanishes, a cache that cannot be used."""

import os

import pytest

from gcode2krl.batch.cache import Cache
from gcode2krl.batch.parts import find_parts
from gcode2krl.batch.planning import plan
from gcode2krl.batch.run import crew_for, run_batch
from gcode2krl.result.model import Record
from gcode2krl.translation import Order
from tests.batch import errands
from tests.cli.test_batch import GOOD


@pytest.fixture
def parts(tmp_path):
    folder = tmp_path / "parts"
    folder.mkdir()
    for number, name in enumerate(["a.nc", "deadly.nc", "z.nc"]):
        (folder / name).write_text(GOOD.format(x=50 + number), encoding="ascii")
    return folder


def batch(parts, out, cache=None):
    out.mkdir(exist_ok=True)
    lines = list(run_batch(plan(find_parts([str(parts)]), Order("")), out, crew_for(2), cache))
    assert lines[-1].share == pytest.approx(1.0)
    for line in lines:
        Record.model_validate(line.record)
    return {line.record["part"]: line.record for line in lines}


def test_a_part_that_kills_its_workers_is_a_failure_of_its_own(parts, tmp_path, monkeypatch):
    monkeypatch.setattr("gcode2krl.batch.run.make", errands.make_or_die)
    cache = Cache(tmp_path / "cache", 10**9)
    found = batch(parts, tmp_path / "out", cache)
    assert {part: record["exit_code"] for part, record in found.items()} == {
        "a.nc": 0,
        "deadly.nc": 2,
        "z.nc": 0,
    }
    (issue,) = found["deadly.nc"]["issues"]
    assert issue["code"] == "worker-died"
    if os.name == "posix":
        assert issue["message"].startswith("tried twice: the worker was ended by SIGKILL")
    monkeypatch.undo()
    found = batch(parts, tmp_path / "out", cache)  # what failed is no result to keep
    assert {part: record["cached"] for part, record in found.items()} == {
        "a.nc": True,
        "deadly.nc": False,
        "z.nc": True,
    }
    assert found["deadly.nc"]["exit_code"] == 0


def test_an_error_of_the_program_itself_is_told_of_its_part(parts, tmp_path, monkeypatch):
    monkeypatch.setattr("gcode2krl.batch.run.make", errands.fail)
    found = batch(parts, tmp_path / "out")
    assert {record["issues"][0]["code"] for record in found.values()} == {"internal-error"}
    assert found["a.nc"]["issues"][0]["message"].startswith("ValueError: no Task")


def test_a_part_that_vanishes_is_a_failure_of_its_own(parts, tmp_path):
    planned = plan(find_parts([str(parts)]), Order(""))
    (parts / "z.nc").unlink()
    (tmp_path / "out").mkdir()
    found = {line.record["part"]: line.record for line in run_batch(planned, tmp_path / "out", crew_for(1))}
    assert found["z.nc"]["issues"][0]["code"] == "file-unreadable"
    assert found["a.nc"]["exit_code"] == 0


def test_an_output_that_cannot_be_written_is_a_failure_of_its_part(parts, tmp_path):
    (tmp_path / "out" / "a.src").mkdir(parents=True)
    found = batch(parts, tmp_path / "out")
    assert found["a.nc"]["issues"][0]["code"] == "output-unwritable"
    assert found["z.nc"]["exit_code"] == 0


@pytest.mark.slow
def test_a_cache_that_cannot_be_written_costs_only_time(parts, tmp_path):
    (tmp_path / "file").write_text("")
    found = batch(parts, tmp_path / "out", Cache(tmp_path / "file" / "cache", 10**9))
    assert {record["exit_code"] for record in found.values()} == {0}


def test_the_longest_part_begins_first(parts, tmp_path):
    long = parts / "long.nc"
    long.write_text(GOOD.format(x=80).replace("M30", "(a long remark)\n" * 500 + "M30"))
    (tmp_path / "out").mkdir()
    planned = plan(find_parts([str(parts)]), Order(""))
    first = next(run_batch(planned, tmp_path / "out", crew_for(1)))
    assert first.record["part"] == "long.nc"
