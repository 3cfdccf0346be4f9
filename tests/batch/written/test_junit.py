"""junit.xml, read back by junitparser and by lxml."""

import pytest
from junitparser import Error, Failure, JUnitXml
from lxml import etree

from gcode2krl.batch.written import junit_xml
from tests.batch.written.records import ERROR, NASTY, OF_CELL, WARNING, many, record


def cases(records):
    """Return (suite, case, results, system-out) by junitparser."""
    suites = JUnitXml.fromstring(junit_xml(records))
    return [(suite, case, list(case.result), case.system_out) for suite in suites for case in suite]


def test_a_case_a_part_in_its_folder():
    records = [record("a/one.nc", seconds=2.5), record("a/b/two.nc"), record("three.nc"), record("a/four.nc")]
    found = [(suite.name, case.classname, case.name, case.time) for suite, case, _, _ in cases(records)]
    assert found == [
        (".", ".", "three.nc", 1.25),
        ("a", "a", "four.nc", 1.25),
        ("a", "a", "one.nc", 2.5),
        ("a/b", "a/b", "two.nc", 1.25),
    ]


def test_a_refused_part_is_a_failure_with_line_and_remedy():
    ((_, _, (result,), system_out),) = cases([record("a/part.nc", 1, [WARNING, ERROR])])
    assert isinstance(result, Failure)
    assert result.type == "out-of-reach"
    assert result.message.startswith("line 120: error: the robot cannot reach")
    assert (
        "a/part.nc:120: error: the robot cannot reach X 4000 Y 0 Z 100 [out-of-reach] -> move" in result.text
    )
    assert "a/part.nc:44: warning: force of 812 N" in system_out


def test_a_part_that_is_not_understood_is_an_error():
    ((_, _, (result,), system_out),) = cases([record("a.nc", 2, [OF_CELL])])
    assert isinstance(result, Error)
    assert "cells/big.toml:3: error: robot.model: found 'x' [model-unknown] -> correct it" in result.text
    assert system_out is None
    ((_, _, (result,), _),) = cases([record("a.nc", 2)])
    assert result.message == "not understood"


def test_warnings_that_refuse_are_the_failure():
    ((_, _, (result,), system_out),) = cases([record("a.nc", 1, [WARNING])])
    assert "a.nc:44: warning" in result.text
    assert system_out is None


def test_warnings_of_a_written_part_are_output():
    ((_, case, results, system_out),) = cases([record("a.nc", 0, [WARNING])])
    assert case.is_passed
    assert results == []
    assert "a.nc:44: warning" in system_out


def test_counts_add_up():
    records = many(100)
    root = etree.fromstring(junit_xml(records))
    suites = root.findall("testsuite")
    exits = [one["exit_code"] for one in records]
    assert root.get("tests") == str(len(exits)) == str(len(root.findall(".//testcase")))
    assert root.get("failures") == str(exits.count(1)) == str(len(root.findall(".//failure")))
    assert root.get("errors") == str(exits.count(2)) == str(len(root.findall(".//error")))
    for name in ("tests", "failures", "errors"):
        assert sum(int(suite.get(name)) for suite in suites) == int(root.get(name))
    assert float(root.get("time")) == pytest.approx(sum(one["seconds"] for one in records), abs=1e-3)


def test_hostile_text_stays_text():
    """A strict parser reads it, and nothing of it became an element or a character that XML forbids."""
    message = f"{NASTY}<failure/>&lt;\r\n\x0b"
    content = junit_xml([record(f"<x>&/{NASTY}", 1, [ERROR | {"message": message, "code": NASTY}])])
    root = etree.fromstring(content)
    (case,) = root.iter("testcase")
    assert {element.tag for element in root.iter()} == {"testsuites", "testsuite", "testcase", "failure"}
    assert case.get("classname") == "<x>&"
    assert case.get("name").startswith('<b>&"x"]]>␀␛[31m')
    assert "<failure/>&lt;" in case.find("failure").text
    assert len(list(JUnitXml.fromstring(content))) == 1


def test_thousands_of_findings_are_what_the_command_line_prints():
    issues = [ERROR | {"line": line, "message": f"X {line} is too far"} for line in range(1, 5000)]
    ((_, _, (result,), _),) = cases([record("a.nc", 1, issues)])
    (line,) = result.text.strip().splitlines()
    assert line.startswith(
        "parts/a.nc:1: error: X 1 is too far (also with other figures in lines 2, 3, 4 and "
    )
