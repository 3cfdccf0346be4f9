"""``gcode2krl batch``: what is written, what a second run computes, what a killed worker and Ctrl-C cost."""

import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import trimesh

from gcode2krl.batch import results
from gcode2krl.batch.cache import FOLDER_VARIABLE
from gcode2krl.result.model import Record
from tests.cli import on_a_terminal
from tests.conftest import HEEDS_CTRL_C, ROOT

HEAD = "G21 G90 G17\nT1 M6\nS8000 M3\nG0 X0 Y0 Z20\nG43 H1 Z20\n"
GOOD = HEAD + "G0 X10 Y10 Z5\nG1 Z-1 F500\nG1 X{x} F1000\nG1 Y40\nG0 Z20\nM30\n"
REFUSED = HEAD + "G1 Z-1 F500\nG1 X9000 F1000\nM30\n"
NOT_UNDERSTOOD = "G1 X10 Q99\n"
CELL = 'based_on = "demonstration"\n\n[stock]\nbox_mm = [[-50, -50, -30], [300, 100, 0]]\n'


@pytest.fixture
def parts(tmp_path, monkeypatch):
    """A folder with parts, and an empty cache."""
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "cache"))
    folder = tmp_path / "parts"
    for number, name in enumerate(["a.nc", "b.NGC", "Größe 2/c d.tap"]):
        place = folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(GOOD.format(x=50 + number), encoding="ascii")
    return folder


def records(out):
    lines = (Path(out) / "results.jsonl").read_text(encoding="utf-8").splitlines()
    return {record["part"]: record for record in map(json.loads, lines)}


def programs(out):
    """Return name → content of what was written for the parts."""
    out = Path(out)
    about = {"results.jsonl", "junit.xml", "findings.sarif", "summary.md", "index.html"}
    files = [file for file in out.rglob("*") if file.is_file()]
    return {
        name: file.read_bytes() for file in files if (name := file.relative_to(out).as_posix()) not in about
    }


def cached(out):
    return {part for part, record in records(out).items() if record["cached"]}


def test_every_part_becomes_what_translate_makes_of_it(parts, run):
    done = run("batch", parts, "-o", "out")
    assert (done.code, done.err.count("written")) == (0, 3)
    Path("alone").mkdir()
    for part, record in records("out").items():
        assert run(parts / part, "-o", "alone").code == 0
        assert record["exit_code"] == 0
        for name, sha256 in record["sha256"].items():
            content = (Path("out") / name).read_bytes()
            assert content == (Path("alone") / Path(name).name).read_bytes()
            assert hashlib.sha256(content).hexdigest() == sha256
    assert set(records("out")) == {"a.nc", "b.NGC", "Größe 2/c d.tap"}
    assert set(programs("out")) == {
        f"{name}{ending}" for name in ("a", "b", "Größe 2/C_D") for ending in (".src", ".dat", ".pilot.csv")
    }


@pytest.mark.slow
def test_a_record_has_what_a_page_needs(parts, run):
    run("batch", parts, "-o", "out", "--report")
    record = records("out")["Größe 2/c d.tap"]
    assert record["schema"] == "gcode2krl/result/1"
    assert record["input"]["file"] == str(parts / "Größe 2/c d.tap")
    assert record["time_s"] > 0.0
    assert record["max_force_N"] > 0.0
    assert 2 <= len(record["thumbnail"]) <= 200
    assert record["thumbnail"][-1] == [52.0, 40.0]
    assert (record["cached"], record["against"]) == (False, None)
    assert record["seconds"] > 0.0
    assert "Größe 2/C_D.html" in record["files"]
    assert (Path("out") / "Größe 2" / "C_D.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert [issue["code"] for issue in record["issues"]].count("krl-name") == 1


def test_a_bad_part_does_not_stop_the_others(parts, run):
    (parts / "far.nc").write_text(REFUSED)
    (parts / "no.nc").write_text(NOT_UNDERSTOOD)
    done = run("batch", parts, "-o", "out", code=1)
    assert {part: record["exit_code"] for part, record in records("out").items()} == {
        "a.nc": 0,
        "b.NGC": 0,
        "Größe 2/c d.tap": 0,
        "far.nc": 1,
        "no.nc": 2,
    }
    assert "far.nc:7: error" in done.err
    assert "no.nc:1: error" in done.err
    sarif = json.loads((Path("out") / "findings.sarif").read_text(encoding="utf-8"))
    places = {
        result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
        for result in sarif["runs"][0]["results"]
    }
    assert "parts/far.nc" in places  # below the folder in which the run began
    assert {"junit.xml", "summary.md", "index.html"} <= {file.name for file in Path("out").iterdir()}
    words = done.out.split()
    assert [words[words.index(word) + 1] for word in ("parts", "written", "refused", "understood")] == [
        "5",
        "3",
        "1",
        "1",
    ]


@pytest.mark.slow
def test_nothing_is_computed_twice(parts, run):
    (parts / "far.nc").write_text(REFUSED)
    (parts / "no.nc").write_text(NOT_UNDERSTOOD)
    assert run("batch", parts, "-o", "out", "--report").code == 1
    first, before = programs("out"), records("out")
    assert run("batch", parts, "-o", "again", "--report").code == 1
    assert cached("again") == set(before)
    assert programs("again") == first
    for part, record in records("again").items():
        same = {**before[part], "cached": True, "seconds": record["seconds"]}
        assert record == same
        assert record["seconds"] < 0.5
    run("batch", parts, "-o", "out", "--report", "--no-cache")
    assert cached("out") == set()
    assert programs("out") == first


@pytest.mark.slow
def test_one_part_changed(parts, run):
    run("batch", parts, "-o", "out")
    (parts / "a.nc").write_text(GOOD.format(x=77))
    run("batch", parts, "-o", "out")
    assert cached("out") == {"b.NGC", "Größe 2/c d.tap"}
    assert b"77" in programs("out")["a.src"]


@pytest.mark.slow
def test_an_option_a_cell_and_its_mesh_count(parts, run, tmp_path):
    cell, base, mesh = (tmp_path / name for name in ("cell.toml", "base.toml", "stock.stl"))
    base.write_text(CELL)
    cell.write_text('based_on = "base.toml"\n')
    everything = {"a.nc", "b.NGC", "Größe 2/c d.tap"}

    def again(*options):
        assert run("batch", parts, "-o", "out", "--cell", cell, *options).code == 0
        return cached("out")

    assert again() == set()
    assert again() == everything
    assert again("--tolerance", "0.05") == set()
    cell.write_text('# a remark\nbased_on = "base.toml"\n')
    assert again() == everything  # the same values
    base.write_text(CELL.replace("300", "301"))
    assert again() == set()
    trimesh.creation.box(bounds=[[-50, -50, -30], [300, 100, 0]]).export(mesh)
    cell.write_text('based_on = "base.toml"\n[stock]\nmesh = "stock.stl"\n')
    assert again() == set()
    assert again() == everything
    trimesh.creation.box(bounds=[[-50, -50, -30], [300, 100, -0.5]]).export(mesh)
    assert again() == set()


@pytest.mark.slow
def test_an_output_that_was_changed_or_lost_is_put_back(parts, run):
    run("batch", parts, "-o", "out")
    before = programs("out")
    (Path("out") / "a.src").write_text("tampered")
    (Path("out") / "b.dat").unlink()
    run("batch", parts, "-o", "out")
    assert programs("out") == before
    assert len(cached("out")) == 3


@pytest.mark.slow
def test_a_damaged_entry_is_a_miss(parts, run, tmp_path):
    run("batch", parts, "-o", "out")
    entries = sorted((tmp_path / "cache").rglob("*.zip"))
    entries[0].write_bytes(entries[0].read_bytes()[:-50])
    assert run("batch", parts, "-o", "again").code == 0
    assert len(cached("again")) == 2
    assert programs("again") == programs("out")


@pytest.mark.slow
def test_a_program_that_is_refused_now_does_not_stay(parts, run):
    run("batch", parts, "-o", "out")
    assert (Path("out") / "a.src").exists()
    (Path("out") / "b.dat").write_text("changed by hand")
    (parts / "a.nc").write_text(REFUSED)
    (parts / "b.NGC").write_text(REFUSED)
    run("batch", parts, "-o", "out")
    left = {name for name in programs("out") if name.startswith(("a.", "b."))}
    assert left == {"b.dat"}  # what somebody changed is not ours to remove


def test_collisions_are_refused_before_anything_is_computed(parts, run):
    (parts / "A.ngc").write_text(GOOD.format(x=1))
    done = run("batch", parts, "-o", "out", code=2)
    assert "A.ngc" in done.err
    assert "a.nc" in done.err
    assert not (Path("out") / "results.jsonl").exists()


def test_an_output_folder_without_a_parent_is_refused(parts, run):
    assert "output-unwritable" in run("batch", parts, "-o", "no/where", code=2).err


def test_the_cell_of_each_folder(parts, run, tmp_path):
    (tmp_path / "left.toml").write_text('based_on = "demonstration"\nname = "left"\n')
    (tmp_path / "right.toml").write_text('based_on = "demonstration"\nname = "right"\n')
    (tmp_path / "parts.toml").write_text(
        '[[folder]]\npath = "parts"\ncell = "left.toml"\n'
        '[[folder]]\npath = "parts/../other/*.nc"\ncell = "right.toml"\n'
    )
    (tmp_path / "other").mkdir()
    shutil.copy(parts / "a.nc", tmp_path / "other" / "e.nc")
    assert run("batch", "parts.toml", "-o", "out").code == 0
    names = {part: record["cell"]["name"] for part, record in records("out").items()}
    assert names["parts/a.nc"] == "left"
    assert names["e.nc"] == "right"


def test_a_wrong_cell_ends_the_batch(parts, run, tmp_path):
    (tmp_path / "cell.toml").write_text("[robot]\nmodle = 1\n")
    assert "robot.modle" in run("batch", parts, "-o", "out", "--cell", "cell.toml", code=2).err


def test_json_and_quiet(parts, run):
    (parts / "no.nc").write_text(NOT_UNDERSTOOD)
    done = run("batch", parts, "-o", "out", "--json", "-q", "--strict")
    found = json.loads(done.out)
    Record.model_validate(found)
    for record in records("out").values():
        Record.model_validate(record)
    assert (found["schema"], found["command"]) == ("gcode2krl/result/1", "batch")
    assert found["parts"] == 4
    assert found["written"] + found["refused"] + found["not_understood"] == 4
    assert found["exit_code"] == done.code == 1
    assert found["options"] == {"strict": True}
    assert "out/results.jsonl" in [Path(file).as_posix() for file in found["files"]]
    assert "written " not in done.err
    assert "no.nc:1: error" in done.err


@pytest.mark.slow
def test_against_an_earlier_run(parts, run):
    run("batch", parts, "-o", "old")
    (parts / "a.nc").write_text(GOOD.format(x=150))
    assert run("batch", parts, "-o", "new", "--against", "old").code == 0
    before, after = records("old")["a.nc"]["time_s"], records("new")["a.nc"]
    assert after["against"]["time_s"] == before < after["time_s"]
    assert "a.nc" in (Path("new") / "summary.md").read_text(encoding="utf-8")
    assert run("batch", parts, "-o", "new", "--against", "nothing").code == 2


@pytest.mark.slow
def test_the_cache_is_shown_and_cleared(parts, run, tmp_path):
    run("batch", parts, "-o", "out")
    shown = json.loads(run("cache", "show", "--json").out)
    assert (shown["folder"], shown["entries"]) == (str(tmp_path / "cache"), 3)
    assert "3 entries" in run("cache", "show").out
    assert run("cache", "clear").code == 0
    run("batch", parts, "-o", "out", "--cache-size", "0")
    assert cached("out") == set()
    assert json.loads(run("cache", "show", "--json").out)["entries"] == 0  # more than nothing may not stay


def test_several_parts_for_translate_name_the_batch(parts, run):
    assert "gcode2krl batch PARTS -o out/" in run(parts / "a.nc", parts / "b.NGC", code=2).err
    assert "batch" not in run(parts / "a.nc", "--nonsense").err


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="a pseudo-terminal")
def test_on_a_terminal_the_lines_stand_above_one_bar(parts, tmp_path):
    code, shown, _ = on_a_terminal(tmp_path, "batch", parts, "-o", "out", stdout=subprocess.DEVNULL)
    assert code == 0
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown)
    lines = [line for line in re.split(r"[\r\n]+", plain) if "written" in line]
    assert len(lines) == 3
    assert all(line.startswith("written ") for line in lines)
    assert "translating" in plain
    assert "left" in plain or "100%" in plain


# --- a worker that is killed, and a batch that is stopped ---------------------------------------------------


def started(parts, *options, folder):
    command = [sys.executable, "-m", "gcode2krl", "batch", str(parts), "-o", "out", *options]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
    return subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=HEEDS_CTRL_C,
    )


def workers_of(process):
    """Return the numbers of a process's children but loky's tracker of semaphores."""
    listed = Path(f"/proc/{process.pid}/task").glob("*/children")
    children = [int(number) for line in listed for number in line.read_text().split()]
    return [
        number
        for number in children
        if b"resource_tracker" not in Path(f"/proc/{number}/cmdline").read_bytes()
    ]


def many(parts, count):
    for number in range(count):
        (parts / f"m{number}.nc").write_text(GOOD.format(x=60 + number))


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the workers in /proc")
def test_a_killed_worker_loses_nothing(parts, run, tmp_path):
    many(parts, 12)
    run("batch", parts, "-o", "undisturbed", "--no-cache")
    disturbed = started(parts, "--no-cache", "--processes", "2", folder=tmp_path)
    disturbed.stderr.readline()  # the first part is finished
    os.kill(workers_of(disturbed)[0], signal.SIGKILL)
    assert disturbed.wait(120) == 0
    assert programs(tmp_path / "out") == programs("undisturbed")
    assert len(records(tmp_path / "out")) == 15


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="sends the signal of Ctrl-C")
def test_ctrl_c_leaves_what_is_finished_and_the_next_call_goes_on(parts, run, tmp_path):
    many(parts, 12)
    run("batch", parts, "-o", "undisturbed", "--no-cache")
    stopped = started(parts, "--processes", "1", folder=tmp_path)
    for _ in range(3):
        stopped.stderr.readline()
    stopped.send_signal(signal.SIGINT)
    out, err = stopped.communicate(timeout=60)
    assert stopped.returncode == 130, err
    assert "left" in out
    finished = set(records(tmp_path / "out"))
    assert 3 <= len(finished) < 15
    for part, record in records(tmp_path / "out").items():
        for name, sha256 in record["sha256"].items():
            assert hashlib.sha256((tmp_path / "out" / name).read_bytes()).hexdigest() == sha256, part
    assert run("batch", parts, "-o", "out").code == 0
    assert cached("out") == finished
    assert programs("out") == programs("undisturbed")


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="sends the signal of Ctrl-C")
def test_ctrl_c_after_the_last_part_does_not_cost_the_results(parts, run, monkeypatch):
    wrote = results.write_results

    def interrupted(*given):
        os.kill(os.getpid(), signal.SIGINT)
        return wrote(*given)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a background shell ignores it
    monkeypatch.setattr(results, "write_results", interrupted)
    try:
        assert run("batch", parts, "-o", "out").code == 0
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert len(records("out")) == 3


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the workers in /proc")
def test_a_batch_that_is_killed_leaves_no_worker(parts, tmp_path):
    many(parts, 6)
    killed = started(parts, "--processes", "2", folder=tmp_path)
    killed.stderr.readline()
    workers = workers_of(killed)
    assert workers
    killed.kill()
    killed.communicate()
    deadline = time.monotonic() + 60.0
    while any(Path(f"/proc/{worker}").exists() for worker in workers) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not any(Path(f"/proc/{worker}").exists() for worker in workers)
