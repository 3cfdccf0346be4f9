"""M61 to M73: saved modes, tool number, outputs; what the reference cannot tell is written out by hand."""

import math

import pytest

from gcode2krl import load_cell, read_gcode
from gcode2krl.krl.statements import event_statements
from gcode2krl.program.checks import check_toolpath
from tests.cells import over_demonstration
from tests.gcode import Control, named

LINUXCNC = Control("G21 G90 G17 G94 F600 S900\nG0 X0 Y0 Z0\n")


read, refused = LINUXCNC.read, LINUXCNC.refused


def spindle_and_coolant(text):
    events = [event for event in read(text).events if event.kind in ("spindle", "coolant")]
    return [
        (event.values["m"], event.values.get("rpm")) for event in events if not event.values.get("implied")
    ]


@named(
    ("lines", "expected"),
    {
        "they come back": (
            "M4\nM7\nM8\nM70\nS100\nM5\nM9\nM72\nG0 X1",
            [(4, -900), (7, None), (8, None), (4, -100), (5, 0), (9, None), (4, -900), (7, None), (8, None)],
        ),
        "what has not changed switches nothing": ("M3\nM8\nM70\nM72\nG0 X1", [(3, 900), (8, None)]),
    },
)
def test_spindle_and_coolant_come_back(lines, expected):
    assert spindle_and_coolant(lines) == expected


def test_of_two_coolants_the_one_that_was_on_comes_back():
    events = [e for e in read("M7\nM70\nM8\nM72\nG0 X1").events if e.kind == "coolant"]
    assert [(e.values["mist"], e.values["flood"]) for e in events[:4]] == [
        (True, False),
        (True, True),
        (False, False),
        (True, False),
    ]


def test_modes_that_a_subprogram_of_another_file_restores_name_the_caller(tmp_path):
    (tmp_path / "side.ngc").write_text("o<side> sub\nM73\nM5\n(end)\no<side> endsub\n")
    main = tmp_path / "part.nc"
    main.write_text(LINUXCNC.text("M3\no<side> call\nG0 X1"))
    spindle = [e.values for e in read_gcode(main).events if e.kind == "spindle"]
    assert [(v["m"], v["line"]) for v in spindle[:3]] == [(3, 3), (5, 4), (3, 4)]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("M72", ("modes-restore", 1)),
        ("M70\nM71\nM72", ("modes-restore", 3)),
        ("M70\nM72 G0 X1", ("modes-restore", 2)),
        ("o1 sub\nM72\no1 endsub\nM70\no1 call", ("modes-restore", 2)),
        ("M70\nG41.1 D1\nM72", ("modes-restore", 3)),
        ("M70\nG43.1 Z5\nM70\nG43.1 Z7\nM72", ("modes-restore", 5)),
        ("G43.1 Z5\nM70\nG49\nM72", ("modes-restore", 4)),
        ("o1 sub\nM73\nG41.1 D1\nG1 X9\no1 endsub\no1 call", ("modes-restore", 5)),
        ("M62 P1.5", ("output-word", 1)),
        ("M62 P-1", ("output-word", 1)),
        ("M67 E1", ("output-word", 1)),
        ("G4 P2 M64", ("two-uses", 1)),
        ("G64 P0.1 M62", ("two-uses", 1)),
        ("G2 X10 I5 P2 M62", ("two-uses", 1)),
        ("G41.1 D1\nG1 X9\nM62 P1\nY9", ("cutter-on", 3)),
        ("M66 P1 L3 Q5", ("unsupported-m", 1)),
        ("M61 Q2", ("tool-number", 1)),
        ("M61 Q1.5", ("bad-integer", 1)),
        ("T1 M6\nM61 Q2", ("tool-number", 2)),
        ("E1", ("unknown-letter", 1)),
    ],
)
def test_what_is_refused(text, found):
    assert refused(text) == found


def test_a_tool_number_is_that_of_the_tool_in_the_spindle():
    assert read("T3 M6\nM61 Q3\nG0 X1").tool[-1] == 3
    cell = load_cell()
    mounted = cell.model_copy(update={"mounted_tool": 1})
    toolpath = read("M61 Q1\nG43\nG0 X1", mounted)
    assert toolpath.tool[-1] == 1
    assert not [event for event in toolpath.events if event.kind == "tool"]
    assert refused("M61 Q2", mounted) == ("tool-number", 1)
    assert "tool-not-changed" in {issue.code for issue in read("T2\nM61 Q1", mounted).issues}


def test_outputs_are_events_with_their_words():
    events = [e.values for e in read("M62 P3\nM68 E1 Q-2.5\nM150 P1 Q2\nG0 X1").events if e.kind == "message"]
    assert [{key: value for key, value in v.items() if key in "mpqe"} for v in events[:3]] == [
        {"m": 62, "p": 3.0},
        {"m": 68, "q": -2.5, "e": 1.0},
        {"m": 150, "p": 1.0, "q": 2.0},
    ]


def test_the_cell_makes_krl_of_an_output():
    cell = load_cell()
    codes = {**cell.m_code, "M62": "$OUT[{{ p | int }}]=TRUE", "M68": "$ANOUT[{{ e | int }}]={{ q / 10 }}"}
    cell = cell.model_copy(update={"m_code": codes})
    on, value, _end = (e for e in read("M62 P3\nM68 E1 Q2.5\nG0 X1", cell).events if e.kind == "message")
    assert event_statements(on, cell).splitlines()[-1] == "$OUT[3]=TRUE"
    assert event_statements(value, cell).splitlines()[-1] == "$ANOUT[1]=0.25"


def test_elsewhere_they_are_codes_of_the_machine_builder():
    event, _end = (e.values for e in read("M66\nG0 X1.", dialect="fanuc").events if e.kind == "message")
    assert (event["m"], math.isnan(event.get("p", math.nan))) == (66, True)


@pytest.mark.parametrize(
    ("lines", "found"),
    [
        ("M62 P20\nG0 X1", []),
        ("M68 E1 Q5\nM68 E2 Q5\nG0 X1", [3]),
        ("M62 P20\nM62 P1\nG0 X1\nM62 P1", [4]),
    ],
)
def test_a_word_may_not_name_an_output_of_the_spindle(lines, found):
    """The demonstration cell's spindle is $OUT[1]; the template alone does not say which output is meant."""
    codes = {"M62": "$OUT[{{ p | int }}]=TRUE", "M68": "$ANOUT[{{ e | int }}]={{ q / 10 }}"}
    cell = over_demonstration({"m_code": codes})
    issues = check_toolpath(read(lines, cell), cell)
    assert [issue.line for issue in issues if issue.code == "signal-twice"] == found
