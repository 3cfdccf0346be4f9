"""The record: what every command prints under --json, however it ends, against the printed schema."""

import hashlib
import json
import shutil
import tomllib
from pathlib import Path

import click
import jsonschema
import pytest

from gcode2krl import Prediction, load_cell
from gcode2krl.cell import as_toml, cell_from_resolved
from gcode2krl.cli.main import commands
from gcode2krl.cli.record_head import Heading
from gcode2krl.gcode import CHORD_TOLERANCE_MM
from gcode2krl.prediction.bundle import CHORD_MM
from gcode2krl.result import cell_of
from tests.cli.test_translate import CLEAN
from tests.conftest import ROOT
from tests.online.test_replay import write_run
from tests.online.test_twin import SLOT

IDENTIFY = ROOT / "examples" / "identify"
ANSWERS = ROOT / "examples" / "cells" / "answers" / "upside_down.toml"
STOCK = 'based_on = "demonstration"\n[stock]\nbox_mm = [[0, -20, -30], [40, 20, 0]]\nresolution_mm = 0.5\n'
LOG = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n" + "".join(
    f"{k / 100},{k / 50},{-90 + k / 50},90,{k / 100},{45 - k / 50},0\n" for k in range(200)
)
WELL = (
    ("translate", "part.nc", "-o", "part.src", "--tolerance", "0.05"),
    ("batch", "part.nc", "-o", "out", "--cache", "kept"),
    ("cache", "show", "--cache", "kept"),
    ("predict", "part.nc", "-o", "prediction", "--csv"),
    ("verify", "part.src", "part.nc", "--tolerance", "0.05"),
    ("report", "prediction"),
    ("runkit", "part.src", "-o", "kit", "--lift", "50"),
    ("make-test", "circle", "-o", "circle.nc", "--size", "80"),
    ("stiffness-map", "--step", "400", "-o", "map"),
    ("models", "list"),
    ("models", "check", "cell.toml"),
    ("models", "confirm", "cell.toml", "--by", "A", "--yes"),
    ("init", "mine.toml", "--answers", str(ANSWERS)),
    ("explain", "no-feed"),
    ("inspect", "part.nc"),
    ("identify", "stiffness", str(IDENTIFY / "holder.toml")),
    ("identify", "sensor", str(IDENTIFY / "orientations.csv"), "-o", "calibration.toml"),
    ("runs", "import", "log.csv", "-o", "run-9"),
    ("tools", "import", "tool.tbl", "--unit", "mm", "--cell", "cell.toml"),
    ("online", "simulate", "slot.nc", "--cell", "cell.toml"),
    ("online", "replay", "run-1"),
    ("online", "serve", "--files", "rsi"),
)
REFUSED = (
    ("translate", "no.nc"),
    ("batch", "no", "-o", "out"),
    ("predict", "part.nc", "-o", ""),
    ("verify", "part.src", "no.nc"),
    ("report", "no"),
    ("diagnose", "no"),
    ("runkit", "no.src"),
    ("make-test", "circle", "-o", "nowhere/circle.nc"),
    ("stiffness-map", "--cell", "no.toml"),
    ("models", "check", "no.toml"),
    ("models", "confirm", "cell.toml"),
    ("init", "no/cell.toml", "--answers", str(ANSWERS)),
    ("explain", "no-such-code"),
    ("inspect", "absent.nc"),
    ("identify", "stiffness", "no.toml"),
    ("identify", "sensor", "no.csv"),
    ("identify", "force", "no"),
    ("identify", "controller", "no.csv"),
    ("identify", "kinematics", "no.csv"),
    ("runs", "import", "no.csv", "-o", "run-9"),
    ("tools", "import", "no.tbl"),
    ("online", "simulate", "no.nc"),
    ("online", "replay", "no"),
    ("online", "serve", "--cell", "no.toml"),
)


def commands_with_json(group, context, path=()):
    """Yield the path of each command that has --json."""
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if isinstance(command, click.Group):
            yield from commands_with_json(command, context, (*path, name))
        elif any("--json" in option.opts for option in command.params):
            yield " ".join((*path, name))


ALL = sorted(commands_with_json(commands, click.Context(commands)))


@pytest.fixture
def recorded(run, tmp_path):
    """Run a command with --json; returns its record, which the printed schema has been held against."""
    (tmp_path / "part.nc").write_text(CLEAN, encoding="ascii")
    (tmp_path / "slot.nc").write_text(SLOT, encoding="ascii")
    (tmp_path / "log.csv").write_text(LOG, encoding="ascii")
    (tmp_path / "tool.tbl").write_text("T77 P1 D6 ; 3 flute end mill\n", encoding="ascii")
    (tmp_path / "cell.toml").write_text(STOCK, encoding="ascii")
    schema = json.loads(run("models", "schema", "result").out)
    jsonschema.Draft202012Validator.check_schema(schema)

    def record_of(*words):
        done = run(*words, "--json")
        record = json.loads(done.out)
        jsonschema.validate(record, schema)
        assert record["exit_code"] == done.code
        severities = [issue["severity"] for issue in record["issues"]]
        if words[0] != "batch":  # its counts are those of all parts
            assert record["counts"] == {
                f"{each}s": severities.count(each) for each in ("error", "warning", "note")
            }
        return record

    return record_of


def name_of(words):
    return (
        " ".join(words[:2])
        if words[0] in ("models", "identify", "online", "cache", "runs", "tools")
        else words[0]
    )


def test_the_lists_of_this_file_name_every_command_with_json():
    slow = {"diagnose", "identify controller", "identify force", "identify kinematics"}  # run in their rooms
    assert sorted({name_of(words) for words in WELL} | slow) == ALL
    assert sorted({name_of(words) for words in REFUSED} | {"models list", "cache show"}) == ALL


def test_every_command_says_what_it_was_given_and_has_written(recorded, tmp_path):
    write_run(tmp_path / "run-1", load_cell())
    for words in WELL:
        record = recorded(*words)
        assert record["exit_code"] == 0, record["issues"]
        assert record["command"] == name_of(words)
        for name in record["files"]:
            content = (tmp_path / name).read_bytes()
            assert record["sha256"][name] == hashlib.sha256(content).hexdigest(), words
        if name_of(words) not in ("explain", "make-test", "stiffness-map", "cache show", "models list"):
            assert record["input"] is not None or record["files"], words


def test_what_was_given_is_named(recorded):
    predicted = recorded("predict", "part.nc", "-o", "prediction", "--tolerance", "0.05", "--no-forces")
    assert predicted["options"] == {"tolerance_mm": 0.05, "no_forces": True}
    assert predicted["input"]["sha256"] == hashlib.sha256(CLEAN.encode()).hexdigest()
    assert predicted["cell"]["sha256"] == cell_of(load_cell(), None)["sha256"]
    recorded("part.nc", "-o", "part.src")
    verified = recorded("verify", "part.src", "part.nc")
    assert [entry["file"] for entry in verified["inputs"]] == ["part.src", "part.nc"]
    assert verified["options"] == {}
    assert recorded("make-test", "circle", "-o", "c.nc", "--size", "80")["options"] == {
        "what": "circle",
        "size_mm": 80.0,
    }


@pytest.mark.parametrize("words", REFUSED, ids=name_of)
def test_every_command_prints_a_record_where_it_refuses(recorded, words):
    record = recorded(*words)
    assert record["exit_code"] in (1, 2)
    assert record["command"] == name_of(words)
    assert record["counts"]["errors"] >= 1
    assert record["files"] == []


@pytest.mark.parametrize("name", ALL)
def test_wrong_options_give_a_record_too(recorded, name):
    record = recorded(*name.split(), "--no-such-option")
    assert record["exit_code"] == 2
    assert record["command"] == name
    assert [issue["code"] for issue in record["issues"]] == ["option-value"]
    assert "--no-such-option" in record["issues"][0]["message"]


@pytest.mark.parametrize(
    "words",
    [
        ("part.nc", "--split", "halves"),
        ("part.nc", "--tolerance", "wide"),
        ("part.nc", "-o", "-"),
        ("part.nc", "another.nc"),
        ("predict",),
        ("identify",),
        ("predcit",),
        ("online", "simulate", "--cell", "no.toml"),
    ],
)
def test_whatever_is_wrong_there_is_one_record(recorded, words):
    record = recorded(*words)
    assert record["exit_code"] == 2
    assert len(record["issues"]) == 1


def test_a_defect_of_the_program_gives_a_record(recorded, monkeypatch):
    def broken(order, begin):
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr("gcode2krl.cli.translate.carry_out", broken)
    record = recorded("part.nc")
    assert record["exit_code"] == 2
    assert record["issues"][0]["code"] == "internal-error"


def test_a_prediction_carries_its_record(recorded, run, tmp_path):
    printed = recorded("predict", "part.nc", "-o", "prediction", "--chord-tolerance", "0.02")
    text = (tmp_path / "prediction" / "prediction.toml").read_text(encoding="utf-8")
    assert text.startswith('schema = "gcode2krl/prediction/1"\n')
    head = tomllib.loads(text)["result"]
    same = {"schema", "command", "version", "input", "exit_code", "counts", "moves", "time_s", "max_force_N"}
    assert {key: head[key] for key in same} == {key: printed[key] for key in same}
    assert head["options"] == printed["options"] == {"chord_tolerance_mm": 0.02}
    assert head["cell"]["sha256"] == printed["cell"]["sha256"]
    tables = {Path(name).name: content for name, content in printed["sha256"].items()}
    assert head["sha256"]["motion.parquet"] == tables["motion.parquet"]
    schema = json.loads(run("models", "schema", "result").out)
    whole = {**head, "cell": {"file": None, **head["cell"]}, "issues": printed["issues"]}
    jsonschema.validate(whole, schema)
    loaded = Prediction.load(tmp_path / "prediction")
    assert cell_of(loaded.cell, None)["sha256"] == printed["cell"]["sha256"]
    assert CHORD_MM == CHORD_TOLERANCE_MM


def test_a_cell_that_was_saved_has_the_hash_of_the_cell():
    cell = load_cell()
    assert cell_of(cell_from_resolved(as_toml(cell), "again"), None) == cell_of(cell, None)


def test_a_heading_hashes_when_it_is_asked(tmp_path):
    file = tmp_path / "part.nc"
    file.write_bytes(b"G0")
    head = Heading("verify")
    head.reads(file, None)
    shutil.copy(file, tmp_path / "copy.nc")
    assert head.record({})["input"]["size_bytes"] == 2
    assert "inputs" not in head.record({})
