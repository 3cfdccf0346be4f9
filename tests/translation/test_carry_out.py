"""A translation as a function: it prints and raises nothing, and keeps what was computed."""

import hashlib
import io
import multiprocessing
import pickle
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields

import pytest

from gcode2krl.cli.translate import command
from gcode2krl.result.model import Record
from gcode2krl.translation import Order, carry_out
from tests.cli.test_translate import CLEAN

UNMAPPED = CLEAN.replace("M5\n", "M5\nM77\n")
RAPID_IN_STOCK = CLEAN.replace("X50 F1500\n", "X50 F1500\nY40\nX0\nG0 X45 Y15\n")


@pytest.fixture
def part(tmp_path):
    path = tmp_path / "part.nc"
    path.write_text(CLEAN, encoding="ascii")
    return path


def record_in_a_worker(order):
    return carry_out(order).record


def test_the_command_without_options_is_an_order_without_options():
    given = command.make_context("translate", ["part.nc"]).params
    options = {
        name: value
        for name, value in given.items()
        if name not in ("as_json", "quiet", "verbose", "isolated")
    }
    assert set(options) | {"project"} == {field.name for field in fields(Order)}
    assert Order(**options) == Order("part.nc")
    assert Order(**options).options() == {}


def test_a_worker_process_returns_the_record_that_this_process_makes(part):
    order = Order(part, part.parent, tolerance_mm=0.05, no_forces=True)
    assert pickle.loads(pickle.dumps(order)) == order
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as workers:
        there = workers.submit(record_in_a_worker, order).result()
    assert there == record_in_a_worker(order)
    assert there["exit_code"] == 0


def test_the_record_says_what_went_in_and_what_came_out(part, capfd):
    attempt = carry_out(Order(part, tolerance_mm=0.05, comment_every=0))
    record = attempt.record
    Record.model_validate(record)
    assert capfd.readouterr() == ("", "")
    assert record["input"] == {
        "file": str(part),
        "sha256": hashlib.sha256(CLEAN.encode()).hexdigest(),
        "size_bytes": len(CLEAN),
    }
    assert record["options"] == {"tolerance_mm": 0.05, "comment_every": 0}
    assert [name.rsplit(".", 1)[1] for name in record["files"]] == ["src", "dat", "csv"]
    source = part.with_suffix(".src").read_bytes()
    assert record["sha256"][str(part.with_suffix(".src"))] == hashlib.sha256(source).hexdigest()
    assert record["verify"]["max_deviation_mm"] < 0.002


def test_a_program_that_is_refused_after_its_motion_keeps_its_figures(part):
    whole = carry_out(Order(part)).record
    part.write_text(RAPID_IN_STOCK, encoding="ascii")
    refused = carry_out(Order(part, strict=True)).record
    assert refused["exit_code"] == 1
    assert refused["files"] == []
    assert "rapid-in-stock" in {issue["code"] for issue in refused["issues"]}
    assert refused["moves"] == whole["moves"] + 3
    assert refused["time_s"] > whole["time_s"]
    assert refused["max_force_N"] >= whole["max_force_N"] > 100.0
    assert refused["max_deflection_mm"] > 0.1
    assert refused["corner_error_mm"] == pytest.approx(whole["corner_error_mm"], abs=0.05)
    assert refused["verify"] == {"max_deviation_mm": None}


def test_a_program_that_is_refused_early_knows_its_moves_and_with_a_page_its_time(part):
    part.write_text(UNMAPPED, encoding="ascii")
    early = carry_out(Order(part)).record
    assert early["exit_code"] == 1
    assert early["moves"] == 5
    assert early["corner_error_mm"] is not None
    page = part.with_suffix(".html")
    with_page = carry_out(Order(part, report=page))
    assert with_page.page == page
    assert page.exists()
    assert with_page.record["time_s"] > 5.0
    assert with_page.record["counts"]["errors"] == early["counts"]["errors"] > 0


@pytest.mark.parametrize(
    ("wrong", "code"),
    [
        ({"tolerance_mm": -1.0}, "option-value"),
        ({"output": ""}, "option-value"),
        ({"cell_path": "no.toml"}, "file-unreadable"),
        ({"both": True}, "option-value"),
        ({"part": "no.nc"}, "file-unreadable"),
        ({"report": "page.txt"}, "option-value"),
    ],
)
def test_a_wrong_order_is_an_attempt_with_exit_code_2(part, monkeypatch, wrong, code):
    monkeypatch.chdir(part.parent)
    record = carry_out(Order(**{"part": part, **wrong})).record
    Record.model_validate(record)
    assert record["exit_code"] == 2
    assert [issue["code"] for issue in record["issues"]] == [code]
    assert sorted(path.name for path in part.parent.iterdir()) == ["part.nc"]


def test_a_finding_on_the_cell_names_the_cell_and_its_line(part, tmp_path):
    cell = tmp_path / "cell.toml"
    cell.write_text('based_on = "demonstration"\nclearence.z_mm = 5\n', encoding="ascii")
    record = carry_out(Order(part, cell_path=cell)).record
    Record.model_validate(record)
    assert [(issue["file"], issue["line"]) for issue in record["issues"]] == [(str(cell), 2)]
    part.write_text("G1 X\n", encoding="ascii")
    assert all("file" not in issue for issue in carry_out(Order(part)).record["issues"])


def test_standard_input_is_hashed_as_it_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(CLEAN.encode())))
    record = carry_out(Order("-", tmp_path / "part.src", no_forces=True)).record
    assert record["input"] == {
        "file": "stdin",
        "sha256": hashlib.sha256(CLEAN.encode()).hexdigest(),
        "size_bytes": len(CLEAN),
    }


def test_the_stages_are_told_in_their_order(part):
    told = []
    carry_out(Order(part), lambda stage: told.append(stage) or (lambda done, total: None))
    assert told[0] == "reading"
    assert told[1] == "planning"
    assert told[-1] == "writing and reading back"
