"""Behind a call and a HALT everything is set again and the arm compared: written so, and asked for."""

import re

import numpy as np
import pytest

from gcode2krl.krl.controller_state import may_disturb
from gcode2krl.krl.read import read_krl
from gcode2krl.krl.rules import rule_issues, state_issues

MAGAZINE = {"tool_change": "MAGAZINE({{ tool }})", "program": {"externals": ["MAGAZINE(INT :IN)"]}}
BY_HAND = {"tool_change": "HALT ; change to tool {{ tool }} by hand"}
STEPS = {
    "$BASE=": "$BASE",
    "$TOOL=": "$TOOL",
    "$LOAD=": "$LOAD",
    "BAS (#VEL_PTP": "$VEL_AXIS",
    "BAS (#ACC_PTP": "$ACC_AXIS",
    "$ACC.CP": "$ACC.CP",
    "$VEL.ORI1": "$VEL.ORI1",
    "$VEL.ORI2": "$VEL.ORI2",
    "$ACC.ORI1": "$ACC.ORI1",
    "$ACC.ORI2": "$ACC.ORI2",
    "$ORI_TYPE": "$ORI_TYPE",
    "$IPO_MODE": "$IPO_MODE",
    "$ADVANCE": "$ADVANCE",
}


def behind(lines, text, start):
    """Return the first line from ``start`` on that begins with a text."""
    return next(k for k in range(start, len(lines)) if lines[k].startswith(text))


def last_change(lines):
    """Return where the second tool is called for."""
    return max(k for k, line in enumerate(lines) if re.match(r"MAGAZINE\(|HALT ; change", line))


def errors_of(made, lines):
    made.src.write_bytes(("\n".join(lines) + "\n").encode("ascii"))
    program = read_krl(made.src)
    return [
        *state_issues(program, made.targets.tool, made.cell),
        *(issue for issue in rule_issues(program, made.cell) if issue.severity == "error"),
    ]


@pytest.mark.parametrize("data", [MAGAZINE, BY_HAND], ids=["call", "halt"])
@pytest.mark.parametrize("deleted", STEPS)
def test_a_setting_that_is_not_set_again_is_missed(make, deleted, data):
    made = make(data=data)
    lines = made.lines
    assert errors_of(made, lines) == []
    change = last_change(lines)
    del lines[behind(lines, deleted, change)]
    found = errors_of(made, lines)
    assert [issue.code for issue in found] == ["krl-state-unknown"]
    assert STEPS[deleted] in found[0].message
    assert found[0].line == behind(lines, "LIN", change) + 1


def test_speed_and_approximation_are_not_carried_over_a_call(make):
    made = make(data=MAGAZINE)
    lines = made.lines
    del lines[behind(lines, "$VEL.CP", last_change(lines))]
    assert "krl-velocity" in {issue.code for issue in errors_of(made, lines)}
    lines = made.lines
    del lines[behind(lines, "$APO.CDIS", last_change(lines))]
    made.src.write_bytes("\n".join(lines).encode("ascii"))
    program = read_krl(made.src)
    assert np.isnan(program.cdis_mm).any()
    assert not made.verified().ok


def without_guard(lines, change):
    begin, end = behind(lines, "WHILE (ABS($AXIS_ACT", change), behind(lines, "ENDWHILE", change)
    del lines[begin : end + 1]


def guard_before_the_call(lines, change):
    begin, end = behind(lines, "WHILE (ABS($AXIS_ACT", change), behind(lines, "ENDWHILE", change)
    guard = lines[begin : end + 1]
    del lines[begin : end + 1]
    lines[change:change] = guard


def remembered_behind_the_call(lines, change):
    at = max(k for k in range(change) if lines[k].startswith("GK_STOOD="))
    lines.insert(change, lines.pop(at))


def one_axis_less(lines, change):
    at = behind(lines, "WHILE (ABS($AXIS_ACT", change)
    lines[at] = re.sub(r" OR \(ABS\(\$AXIS_ACT\.A5.*?\)>0.1\)", "", lines[at])


def halt_behind_the_guard(lines, change):
    lines.insert(behind(lines, "ENDWHILE", change) + 1, "HALT\r")


@pytest.mark.parametrize(
    "edit",
    [
        without_guard,
        guard_before_the_call,
        remembered_behind_the_call,
        one_axis_less,
        halt_behind_the_guard,
    ],
)
@pytest.mark.parametrize("data", [MAGAZINE, BY_HAND], ids=["call", "halt"])
def test_an_arm_that_nothing_compares_is_told(make, edit, data):
    made = make(data=data)
    lines = made.lines
    edit(lines, last_change(lines))
    found = errors_of(made, lines)
    assert any("moved the arm" in issue.message for issue in found), [issue.text() for issue in found]


def test_a_motion_under_another_tool_is_told(make):
    made = make(data={**MAGAZINE, "tool": {"2": {"model": "flat 10 z3", "length_mm": 130.0}}})
    lines = made.lines
    first = behind(lines, "$TOOL=", 0)
    lines[behind(lines, "$TOOL=", last_change(lines))] = lines[first]
    assert any("of T2" in issue.message for issue in errors_of(made, lines))


def test_without_the_guard_everything_is_set_again_all_the_same(make):
    made = make(data=MAGAZINE, guard=False)
    assert errors_of(made, made.lines) == []
    assert sum(line.startswith("$ORI_TYPE") for line in made.lines) == 3  # the start and two tools
    assert not any("GK_STOOD" in line for line in made.lines)


def test_files_of_a_split_program_declare_what_they_call(make):
    made = make(data=MAGAZINE, split="files")
    calling = [text for name, text in made.program.texts.items() if b"MAGAZINE(2)" in text]
    assert len(calling) == 1
    assert b"EXT MAGAZINE(INT :IN)" in calling[0]
    assert b"EXT BAS" in calling[0]
    assert made.verified().ok


@pytest.mark.parametrize(
    ("statement", "disturbs"),
    [
        ("HALT", True),
        ("MAGAZINE(2)", True),
        ("IF $IN[3] THEN\nPARK()\nENDIF", True),
        ("X=F(3)", True),
        ("INTERRUPT ON 5", True),
        ("INTERRUPT OFF 5", False),
        ("INTERRUPT ON 3", False),
        ("$OUT[3]=TRUE", False),
        ("PULSE($OUT[3],TRUE,0.5)", False),
        ("WAIT FOR $IN[17]", False),
        ("WAIT SEC 2.0", False),
        ("BAS (#TOOL,3 )", False),
        ("GK_HANDLE=SET_KRLMSG(#QUIT,GK_MSG,GK_PAR[],GK_OPT)", False),
        ("; HALT", False),
    ],
)
def test_what_may_change_the_state(statement, disturbs):
    assert may_disturb(statement) is disturbs
