"""The keys of a TOML file: the line of each, and the one that is meant by a mistyped one."""

import re
import time
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl import load_cell
from gcode2krl.cell import Cell, resolve_cell
from gcode2krl.cell.key_lines import lines_of_keys, with_lines
from gcode2krl.cell.loading import meant_key
from gcode2krl.errors import Issue, NotUnderstoodError
from tests.conftest import ROOT

TEXT = '''#:schema x.json
title = "a # no comment [no.table]"

  [ frames ] # a table
base = { x_mm = 5, y_mm = 5, "z mm" = 5 } # }

"quoted.key" = 7
tool.length = 8 ; dotted
list = [ 9,
         10, # ]
         { a = 11 }, ]
text = """
[not.a.table]
key = 1
"""
after = 16
literal = \'\'\'
after = 0 \'\'\'
last = 19
[[guard_inputs]]
number = 21
[guard_inputs.deep]
x = 23
[[guard_inputs]]
number = 25
[tool.1]
n = 27
'''.replace(" ; dotted", "")


def leaves(value, place=()):
    """Yield (dotted key, value) of every plain value of a file."""
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, one in items:
            yield from leaves(one, (*place, str(key)))
    else:
        yield ".".join(place), value


def test_each_number_stands_in_the_line_that_it_says():
    found = lines_of_keys(TEXT)
    numbers = [(key, value) for key, value in leaves(tomllib.loads(TEXT)) if isinstance(value, int)]
    assert len(numbers) == 14
    assert {key: found[key] for key, _ in numbers} == dict(numbers)
    tables = {"frames": 4, "frames.text": 12, "guard_inputs": 20, "guard_inputs.1": 24}
    assert {key: found[key] for key in tables} == tables


NAMES = st.from_regex(r"\A[a-z_]{1,3}\Z")
TREES = st.recursive(
    st.just(0), lambda below: st.dictionaries(NAMES, below, min_size=1, max_size=4), max_leaves=12
).filter(lambda tree: tree)


def written(tree, blanks):
    """Return a tree as TOML, tables and inline tables by turns, each value the number of its line."""
    lines = []

    def inline(value):
        if not isinstance(value, dict):
            return str(len(lines) + 1)
        return "{ " + ", ".join(f"{key} = {inline(one)}" for key, one in value.items()) + " }"

    def table(value, place):
        for key, one in value.items():
            if not isinstance(one, dict) or len(key) == 3:
                lines.extend(["# a = [1"] * blanks)
                lines.append(f"{key} = {inline(one)}")
        for key, one in value.items():
            if isinstance(one, dict) and len(key) != 3:
                lines.append(f"[{'.'.join([*place, key])}]")
                table(one, [*place, key])

    table(tree, [])
    return "\n".join(lines)


@settings(max_examples=80, deadline=None)
@given(TREES, st.integers(0, 2))
def test_any_file(tree, blanks):
    text = written(tree, blanks)
    found = lines_of_keys(text)
    assert {key: found[key] for key, _ in leaves(tomllib.loads(text))} == dict(leaves(tomllib.loads(text)))


def test_every_value_of_the_examples_stands_in_its_line():
    for file in (ROOT / "examples" / "cells").glob("*.toml"):
        text = file.read_text(encoding="utf-8")
        lines, found = text.split("\n"), lines_of_keys(text)
        for key, _ in leaves(tomllib.loads(text)):
            last = next(part for part in reversed(key.split(".")) if not part.isdigit())
            assert re.search(rf"\b{last}\b\s*=", lines[found[key] - 1]), key


def test_a_key_that_is_not_stated_has_the_line_of_its_table():
    issues = [Issue("error", "cell-key", 0, "missing", key=key) for key in ("tool.1.teeth", "home.q_deg", "")]
    assert [issue.line for issue in with_lines(issues, TEXT)] == [26, 0, 0]
    based = 'name = "a"\nbased_on = "demonstration"\n'
    assert [issue.line for issue in with_lines(issues, based)] == [2, 2, 0]


@pytest.mark.parametrize(
    "text", ["a.b." * 50 + "c = 1", "x = [" * 5000, 'k = "', "= 1", "[a", "[[a]", "a = {"]
)
def test_what_is_not_toml_ends_at_once(text):
    started = time.perf_counter()
    lines_of_keys(text)
    assert time.perf_counter() - started < 2.0


def findings(tmp_path, run, text):
    (tmp_path / "cell.toml").write_text(text, encoding="utf-8")
    with pytest.raises(NotUnderstoodError) as caught:
        load_cell("cell.toml")
    assert run("models", "check", "cell.toml").err.strip() == str(caught.value)
    return {issue.code: issue.line for issue in caught.value.issues}


def test_findings_in_cells_carry_their_line(tmp_path, run):
    head = '# a cell\nname = "a"\n\n'
    assert findings(tmp_path, run, head + "[home]\nq_dge = [0]\n") == {"cell-key": 5}
    assert findings(tmp_path, run, head + "[tool.1]\ndiameter_mm = 10.0\n") == {"cell-key": 4}
    assert findings(tmp_path, run, head + "[load]\nmass_kg = 1e6\n") == {"cell-impossible": 5}
    assert findings(tmp_path, run, head + "[home]\n\nq_deg = [0, -1.5707963, 1.5707963, 0, 0, 0]\n") == {
        "cell-impossible": 6
    }
    assert findings(tmp_path, run, head + "[m_code]\nM3 = '$OUT[1]=TRUE'\nM5 = 'WAIT SEC 1'\n") == {
        "cell-pair": 6
    }
    twice = "[spindle]\nrun_cw_output = 3\nflood_output = 3\n"
    assert findings(tmp_path, run, head + twice) == {"signal-twice": 6}
    assert findings(tmp_path, run, head + "[home\n") == {"not-toml": 4}


def test_warnings_of_the_check_carry_their_line(tmp_path, run):
    text = 'name = "a"\n[load]\nmass_kg = 1500.0\n[m_code]\nM10 = """\nHALT\nLIN {X 1}"""\n'
    (tmp_path / "cell.toml").write_text(text, encoding="utf-8")
    done = run("models", "check", "cell.toml", code=1)
    assert "cell.toml:3: warning: load.mass_kg = 1500" in done.err
    assert "cell.toml:5: error: m_code.M10" in done.err


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("clearance = {z = 100.0}", "clearance.z_mm"),
        ("[tool.1]\ndiameter = 6.0", "tool.1.diameter_mm"),
        ("[controler]\nrapid_m_s = 1.0", "controller"),
        ("[limits]\nforce_n = 300.0", "limits.force_N"),
        ("[pilot]\ntolerance = 3.0", "pilot.tolerance_N"),
        ("[program]\ntool_lenght = 'g43'", "program.tool_length"),
        ("[online.link]\nrobot_adress = '1.2.3.4'", "online.link.robot_address"),
        ("[[guard_inputs]]\nnumbr = 3", "guard_inputs.0.number"),
    ],
)
def test_the_remedy_names_the_nearest_key(tmp_path, text, meant):
    file = tmp_path / "cell.toml"
    file.write_text(f'based_on = "demonstration"\n{text}\n', "utf-8")
    with pytest.raises(NotUnderstoodError) as raised:
        load_cell(file)
    unknown = [issue for issue in raised.value.issues if "there is no such key" in issue.message]
    assert [issue.remedy.split("?")[0] for issue in unknown] == [f"did you mean {meant}"]


@pytest.mark.parametrize("place", [("xyzzy",), ("defaultss",), ("tool", "1", "qqqqqq"), ("a", "b", "c")])
def test_what_is_near_to_nothing_is_answered_with_nothing(place):
    assert meant_key(Cell, place) == ""


def test_a_long_text_is_not_quoted_whole():
    with pytest.raises(NotUnderstoodError) as error:
        resolve_cell({"online": {"link": {"address": "a" * 5000}}})
    assert len(str(error.value)) < 300
