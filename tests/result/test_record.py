"""The record: counts, hashes that other tools compute alike, and what changes the hash of a cell."""

import hashlib
import json

from gcode2krl import load_cell
from gcode2krl.errors import Issue
from gcode2krl.result import SCHEMA, cell_of, hashes_of, input_of, record_of
from gcode2krl.result.model import Record, result_schema

ISSUES = [
    Issue("error", "no-feed", 3, "no feed", "give F"),
    Issue("note", "krl-name", 0, "the program is called PART"),
    Issue("note", "krl-name", 0, "the program is called PART"),
]
TOOL = "[tool.1]\ndiameter_mm = 10.0\nteeth = 2\nlength_mm = 100.0\n"


def test_a_record_counts_its_findings_and_keeps_the_figures_in_their_place():
    record = record_of("translate", {"moves": 5}, ISSUES, exit_code=1, files={"a.src": "0" * 64})
    assert list(record) == [
        "schema",
        "command",
        "version",
        "input",
        "cell",
        "options",
        "exit_code",
        "counts",
        "files",
        "sha256",
        "moves",
        "issues",
    ]
    assert record["schema"] == SCHEMA
    assert record["counts"] == {"errors": 1, "warnings": 0, "notes": 2}
    assert record["files"] == ["a.src"]
    assert record["issues"][0]["remedy"] == "give F"
    assert record["issues"][1]["remedy"] != ""  # of the table of codes
    Record.model_validate_json(json.dumps(record))
    assert set(result_schema()["required"]) == set(record) - {"moves"}


def test_the_hash_of_a_file_and_of_a_folder_are_those_of_sha256sum(tmp_path):
    (tmp_path / "run" / "deep").mkdir(parents=True)
    (tmp_path / "run" / "b.csv").write_bytes(b"t_s\n0\n")
    (tmp_path / "run" / "deep" / "a.csv").write_bytes(b"abc")
    abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"  # FIPS 180-2, appendix B.1
    entry = input_of(tmp_path / "run" / "deep" / "a.csv")
    assert entry == {"file": str(tmp_path / "run" / "deep" / "a.csv"), "sha256": abc, "size_bytes": 3}
    other = hashlib.sha256(b"t_s\n0\n").hexdigest()
    lines = f"{other}  b.csv\n{abc}  deep/a.csv\n".encode()
    folder = input_of(tmp_path / "run")
    assert folder["sha256"] == hashlib.sha256(lines).hexdigest()
    assert folder["size_bytes"] == 9
    assert input_of(tmp_path / "nothing") is None
    assert hashes_of([tmp_path / "nothing"]) == {str(tmp_path / "nothing"): None}


def cell_hash(file, text):
    file.write_text(text, encoding="utf-8")
    entry = cell_of(load_cell(file), file)
    assert entry["file"] == str(file)
    return entry["sha256"]


def test_the_hash_of_a_cell_is_that_of_its_values(tmp_path):
    file = tmp_path / "cell.toml"
    plain = cell_hash(file, f'name = "mine"\n{TOOL}')
    assert cell_hash(file, f'# a remark\nname = "mine"\n\n{TOOL}') == plain
    assert cell_hash(tmp_path / "other.toml", f'name = "mine"\n{TOOL}') == plain
    assert cell_hash(file, f'name = "mine"\n{TOOL.replace("10.0", "12.0")}') != plain
    assert cell_of(load_cell(), None)["file"] is None


def test_a_base_and_a_mesh_count_by_their_content(tmp_path):
    base, file = tmp_path / "base.toml", tmp_path / "cell.toml"
    mesh = tmp_path / "stock.stl"
    mesh.write_bytes(b"solid one")
    base.write_text(TOOL, encoding="utf-8")
    text = f'based_on = "base.toml"\n[stock]\nmesh = {json.dumps(str(mesh))}\n'
    before = cell_hash(file, text)
    mesh.write_bytes(b"solid two")
    with_other_mesh = cell_hash(file, text)
    base.write_text(TOOL.replace("teeth = 2", "teeth = 3"), encoding="utf-8")
    assert len({before, with_other_mesh, cell_hash(file, text)}) == 3
