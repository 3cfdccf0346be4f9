"""How a program begins and ends."""

import re

import pytest

pytestmark = pytest.mark.slow

HEAD = (
    "G21 G90 G17 G54 G64 P0.02\nT1 M6\nS8000 M3\n{coolant}"
    "G0 G43 H1 Z20\nG0 X0 Y0\nG0 Z2\nG1 Z-1 F600\nG1 X20\n"
)
OFF = ["$OUT[1]=FALSE", "$OUT[2]=FALSE"]


def end_of(made):
    """Return the statements from the last LIN on, each without comment."""
    lines = [re.sub(r"\s*;.*", "", line).strip() for line in made.src.read_text("ascii").splitlines()]
    lines = [line for line in lines if line]
    last = max(k for k, line in enumerate(lines) if line.startswith("LIN"))
    return lines[last:]


@pytest.mark.parametrize("end", ["M30\n", "M2\n", "%\n", ""])
@pytest.mark.parametrize("coolant", ["", "M8\n", "M7\n"])
@pytest.mark.parametrize("leave", ["", "G0 Z20\n", "G0 Z200\n"])
def test_spindle_and_coolant_stop_above_the_work_before_home(make, end, coolant, leave):
    text = HEAD.format(coolant=coolant) + leave + end
    if end == "%\n":
        text = "%\n" + text
    made = make(text)
    after = end_of(made)
    assert float(re.search(r"Z ([-0-9.]+)", after[0])[1]) >= made.cell.clearance_z_mm
    home = next(k for k, line in enumerate(after) if line.startswith("PTP"))
    assert after[1:3] == OFF
    assert "$OUT[1]=FALSE" not in after[home:]
    assert ("$OUT[3]=FALSE" in after[:home]) == bool(coolant)
    assert made.verified().ok
    notes = [issue for issue in made.program.issues if issue.code == "stopped-by-end"]
    assert [note.severity for note in notes] == ["note"]
    assert ("coolant" in notes[0].message) == bool(coolant)
    assert "line 0" not in made.src.read_text("ascii")


def test_a_program_that_says_so_itself_has_no_note(make):
    made = make(HEAD.format(coolant="M8\n") + "G0 Z20\nM5 M9\nM30\n")
    assert "stopped-by-end" not in [issue.code for issue in made.program.issues]


def test_verify_insists_that_the_spindle_stops_before_home(make):
    made = make(HEAD.format(coolant="") + "M30\n")
    lines = made.src.read_text("ascii").splitlines()
    off = max(k for k, line in enumerate(lines) if line.startswith("$OUT[1]=FALSE"))
    home = max(k for k, line in enumerate(lines) if line.startswith("PTP"))
    assert off < home
    lines.insert(home, lines.pop(off))
    made.src.write_text("\r\n".join(lines) + "\r\n")
    assert not made.verified().ok


def test_after_g28_the_spindle_stops_before_the_way_to_home(make):
    made = make(HEAD.format(coolant="") + "G28 X0 Y0\nM30\n")
    after = end_of(made)
    assert after[1:3] == OFF
    assert after[4].startswith("PTP {A1")
    assert made.verified().ok


def test_what_is_switched_on_at_home_is_switched_off_after_it(make):
    made = make(HEAD.format(coolant="") + "M5\nG28 X0 Y0\nS5000 M3\nM30\n")
    after = end_of(made)
    assert after.index("$OUT[1]=TRUE") < len(after) - 1 - after[::-1].index("$OUT[1]=FALSE")
    assert made.verified().ok


# --- base and tool without a number -----------------------------------------------------------------------

FRAME = {"x_mm": 250.0, "y_mm": 0.0, "z_mm": 250.0, "a_deg": 0.0, "b_deg": -90.0, "c_deg": 0.0}
NUMBERED_TOOL = {
    "1": {"diameter_mm": 16.0, "teeth": 3, "length_mm": 100.0, "tool_data": 4, "axis": "+z", "frame": FRAME}
}
NUMBERED_BASE = {
    "base": {"x_mm": 1500.0, "y_mm": 0.0, "z_mm": 800.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0},
    "base_data": 3,
}


@pytest.mark.parametrize("numbered_base", [False, True])
@pytest.mark.parametrize("numbered_tool", [False, True])
def test_the_head_says_which_number_is_not_that_in_use(make, numbered_base, numbered_tool):
    """A frame assigned by value has no number: a person who jogs at a stop would move by another."""
    data = {"based_on": "demonstration"}
    data |= {"frames": NUMBERED_BASE} if numbered_base else {}
    data |= {"tool": NUMBERED_TOOL} if numbered_tool else {}
    made = make(HEAD.format(coolant="") + "M5\nM30\n", data=data)
    text = made.src.read_text("ascii")
    head, body = text.split(";FOLD INI", 1)
    stale = [] if numbered_base else ["$ACT_BASE"]
    stale += [] if numbered_tool else ["$ACT_TOOL"]
    for name in ("$ACT_BASE", "$ACT_TOOL"):
        assert (name in head) == (name in stale)
    message = [line for line in body.splitlines() if "NR 6" in line]
    assert len(message) == bool(stale)
    if stale:
        assert all(name in message[0] for name in stale)
        told = body.index(message[0])
        assert told < body.index("PTP {"), "before anything stops where a person may jog"
        assert body.index("SET_KRLMSG(#NOTIFY", told) > 0
        assert len(re.search(r'MSG_TXT\[\] "([^"]*)"', message[0])[1]) <= 80
    assert made.verified().ok
    for name in ("$ACT_BASE", "$ACT_TOOL"):
        assert f"{name}=" not in text, "only KUKA's BAS sets it"
