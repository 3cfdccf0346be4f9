"""M61 to M73: saved modes, tool number, outputs; what the reference cannot tell is written out by hand."""

import io
import math

import pytest

from gcode2krl import Gcode2KrlError, load_cell
from gcode2krl.gcode import read_stream
from gcode2krl.krl.statements import event_statements
from gcode2krl.program.checks import check_toolpath

HEAD = "G21 G90 G17 G94 F600 S900\nG0 X0 Y0 Z0\n"


def read(text, cell=None, dialect="linuxcnc"):
    return read_stream(io.BytesIO(f"{HEAD}{text}\nM2\n".encode()), "part.ngc", cell, dialect=dialect)


def refused(text, cell=None):
    with pytest.raises(Gcode2KrlError) as caught:
        read(text, cell)
    return caught.value.issues[0].code, caught.value.issues[0].line


def spindle_and_coolant(text):
    events = [event for event in read(text).events if event.kind in ("spindle", "coolant")]
    return [
        (event.values["m"], event.values.get("rpm")) for event in events if not event.values.get("implied")
    ]


def test_spindle_and_coolant_come_back():
    found = spindle_and_coolant("M4\nM7\nM8\nM70\nS100\nM5\nM9\nM72\nG0 X1")
    assert found == [
        (4, -900.0),
        (7, None),
        (8, None),
        (4, -100.0),
        (5, 0.0),
        (9, None),
        (4, -900.0),
        (7, None),
        (8, None),
    ]


def test_of_two_coolants_the_one_that_was_on_comes_back():
    events = [e for e in read("M7\nM70\nM8\nM72\nG0 X1").events if e.kind == "coolant"]
    assert [(e.values["mist"], e.values["flood"]) for e in events[:4]] == [
        (True, False),
        (True, True),
        (False, False),
        (True, False),
    ]


def test_what_has_not_changed_switches_nothing():
    assert spindle_and_coolant("M3\nM8\nM70\nM72\nG0 X1") == [(3, 900.0), (8, None)]


def test_modes_that_a_subprogram_of_another_file_restores_name_the_caller(tmp_path):
    from gcode2krl import read_gcode

    (tmp_path / "side.ngc").write_text("o<side> sub\nM73\nM5\n(end)\no<side> endsub\n")
    main = tmp_path / "part.nc"
    main.write_text(f"{HEAD}M3\no<side> call\nG0 X1\nM2\n")
    spindle = [e.values for e in read_gcode(main).events if e.kind == "spindle"]
    assert [(v["m"], v["line"]) for v in spindle[:3]] == [(3, 3), (5, 4), (3, 4)]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("M72", ("modes-restore", 3)),
        ("M70\nM71\nM72", ("modes-restore", 5)),
        ("M70\nM72 G0 X1", ("modes-restore", 4)),
        ("o1 sub\nM72\no1 endsub\nM70\no1 call", ("modes-restore", 4)),
        ("M70\nG41.1 D1\nM72", ("modes-restore", 5)),
        ("M70\nG43.1 Z5\nM70\nG43.1 Z7\nM72", ("modes-restore", 7)),
        ("G43.1 Z5\nM70\nG49\nM72", ("modes-restore", 6)),
        ("o1 sub\nM73\nG41.1 D1\nG1 X9\no1 endsub\no1 call", ("modes-restore", 7)),
        ("M62 P1.5", ("output-word", 3)),
        ("M62 P-1", ("output-word", 3)),
        ("M67 E1", ("output-word", 3)),
        ("G4 P2 M64", ("two-uses", 3)),
        ("G64 P0.1 M62", ("two-uses", 3)),
        ("G2 X10 I5 P2 M62", ("two-uses", 3)),
        ("G41.1 D1\nG1 X9\nM62 P1\nY9", ("cutter-on", 5)),
        ("M66 P1 L3 Q5", ("unsupported-m", 3)),
        ("M61 Q2", ("tool-number", 3)),
        ("M61 Q1.5", ("bad-integer", 3)),
        ("T1 M6\nM61 Q2", ("tool-number", 4)),
        ("E1", ("unknown-letter", 3)),
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
    assert refused("M61 Q2", mounted) == ("tool-number", 3)
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


def test_a_word_may_not_name_an_output_of_the_spindle(tmp_path):
    """The demonstration cell's spindle is $OUT[1]; the template alone does not say which output is meant."""
    (tmp_path / "cell.toml").write_text(
        'based_on = "demonstration"\n[m_code]\nM62 = "$OUT[{{ p | int }}]=TRUE"\n'
        'M68 = "$ANOUT[{{ e | int }}]={{ q / 10 }}"\n',
        encoding="ascii",
    )
    cell = load_cell(tmp_path / "cell.toml")

    def found(text):
        return [(i.code, i.line) for i in check_toolpath(read(text, cell), cell) if i.code == "signal-twice"]

    assert found("M62 P20\nG0 X1") == []
    assert found("M68 E1 Q5\nM68 E2 Q5\nG0 X1") == [("signal-twice", 3)]
    assert found("M62 P20\nM62 P1\nG0 X1\nM62 P1") == [("signal-twice", 4)]
