"""Doubtful programs: long dwells, wide corners, stops in the cut, absurd feeds per tooth."""

import io

import pytest

from gcode2krl import load_cell, read_gcode
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gcode.read import read_stream
from gcode2krl.pipeline import predict_toolpath, set_targets
from gcode2krl.program.checks import check_toolpath
from gcode2krl.program.doubts import doubtful
from tests.cells import over_demonstration

HEAD = ["G21 G90 G17", "T1 M6", "S9000 M3", "G0 G43 H1 Z30", "G0 X0 Y0", "G0 Z2", "G1 Z-5 F600"]
TAIL = ["G0 Z30", "M5", "M30"]


def warnings(tmp_path, body, code, data=None, tolerance_mm=None, head=HEAD):
    path = tmp_path / "part.nc"
    path.write_text("\n".join([*head, *body, *TAIL]) + "\n")
    cell = over_demonstration(data)
    toolpath = read_gcode(path, cell)
    cuts = code == "feed-per-tooth"
    source = predict_toolpath(toolpath, cell) if cuts else set_targets(toolpath, cell, tolerance_mm)
    found = [issue for issue in source.issues if issue.code == code]
    assert {issue.severity for issue in found} <= {"warning"}
    assert all(issue.remedy for issue in found)
    return [(issue.line, issue.message) for issue in found]


@pytest.mark.parametrize(
    ("dwell", "line"),
    [("G4 P2000", 9), ("n9 g04p31", 9), ("G4 P0.5", None), ("G4 P30", None), ("(G4 P9000)", None)],
)
def test_a_long_dwell(tmp_path, dwell, line):
    found = warnings(tmp_path, ["X60", dwell, "(later)", "Y5"], "dwell-long")
    assert [at for at, _ in found] == ([line] if line else [])
    if line:
        assert "G4 P counts seconds" in found[0][1]


def test_the_long_one_of_several_dwells_is_named(tmp_path):
    found = warnings(tmp_path, ["X60", "G4 P1", "Y5", "G4 P500", "X0", "G4 P700"], "dwell-long")
    assert [at for at, _ in found] == [11]
    assert "2 times" in found[0][1]


@pytest.mark.parametrize("word", ["G64 P5", "G20\nG64 P0.2\nG21"])
def test_a_wide_blend_of_the_program(tmp_path, word):
    lines = word.splitlines()
    found = warnings(tmp_path, [*lines, "X60", "Y60"], "blend-wide")
    assert [line for line, _ in found] == [8 + len(lines) // 2]
    assert not warnings(tmp_path, ["G64 P0.05", "X60", "Y60"], "blend-wide")


def test_a_wide_blend_of_cell_and_option(tmp_path):
    body = ["X60", "Y60", "X0"]
    found = warnings(tmp_path, body, "blend-wide", {"controller": {"model": "KRC4", "cdis_mm": 50.0}})
    assert [line for line, _ in found] == [8]
    assert "10.607 mm" in found[0][1]  # d = half of 60 mm, sqrt(1/2)/2 of it
    assert warnings(tmp_path, body, "blend-wide", tolerance_mm=5.0)
    assert warnings(tmp_path, body, "blend-wide", {"controller": {"model": "KRC4", "tolerance_mm": 4.0}})
    assert not warnings(tmp_path, body, "blend-wide", tolerance_mm=0.5)
    assert not warnings(tmp_path, body, "blend-wide", {"controller": {"model": "KRC4", "cdis_mm": 2.0}})


def test_a_stop_in_the_cut(tmp_path):
    ((line, message),) = warnings(tmp_path, ["X30", "M0", "X60"], "stop-in-cut")
    assert line == 9
    assert "7.00 mm" in message
    assert "spindle turning" in message
    ((_, stopped),) = warnings(tmp_path, ["X30", "M5", "M0", "S9000 M3", "X60"], "stop-in-cut")
    assert "spindle stopped" in stopped
    assert not warnings(tmp_path, ["X30", "G1 Z3", "M0", "Z-5", "X60"], "stop-in-cut")
    assert not warnings(tmp_path, ["X30", "G0 Z30", "M0", "G1 Z-5"], "stop-in-cut")
    assert not warnings(tmp_path, ["X30", "M1", "X60"], "stop-in-cut")  # the cell's M1 is a comment
    assert warnings(tmp_path, ["X30", "M1", "X60"], "stop-in-cut", {"m_code": {"M1": "HALT"}})


@pytest.mark.parametrize(
    ("speed", "feed", "wanted"),
    [
        ("S9000", "F600", 0),
        ("S90", "F600", 1),
        ("S24000", "F10", 1),
        ("S9000", "F6000", 0),
        ("S300", "F2000", 1),
    ],
)
def test_a_feed_per_tooth_of_nothing_or_of_a_tenth_of_the_tool(tmp_path, speed, feed, wanted):
    head = [line.replace("S9000", speed).replace("F600", feed) for line in HEAD]
    found = warnings(tmp_path, ["X60"], "feed-per-tooth", head=head)
    assert [line for line, _ in found] == [7] * wanted
    if wanted:
        f_z_mm = float(feed[1:]) / (float(speed[1:]) * 3)
        assert f"{f_z_mm:.3g} mm a tooth" in found[0][1]


def test_a_feed_per_tooth_in_the_air_is_none(tmp_path):
    head = [line.replace("S9000", "S90").replace("Z-5", "Z1") for line in HEAD]
    assert not warnings(
        tmp_path, ["X60"], "feed-per-tooth", {"stock": {"box_mm": [[-9, -9, -9], [70, 9, 0]]}}, head=head
    )


def test_the_examples_are_not_doubted():
    from tests.conftest import EXAMPLES

    cell = load_cell()
    for example in EXAMPLES:
        targets = set_targets(read_gcode(example, cell), cell)
        assert not [issue for issue in targets.issues if issue.severity == "warning"], example


def test_a_wide_chord_tolerance(tmp_path):
    path = tmp_path / "part.nc"
    path.write_text("\n".join([*HEAD, "G2 X20 Y0 I10", *TAIL]) + "\n")
    cell = load_cell()
    codes = [i.code for i in read_gcode(path, cell, chord_tolerance_mm=2.0).issues if i.severity == "warning"]
    assert codes == ["chord-tolerance"]
    assert not read_gcode(path, cell, chord_tolerance_mm=0.5).issues
    with pytest.raises(NotUnderstoodError, match="500 mm is more than 10 mm"):
        read_gcode(path, chord_tolerance_mm=500.0)


@pytest.mark.parametrize(
    ("low_x", "code"),
    [(0.0, []), (60.0, []), (200.0, [("error", "stock.box_mm")]), (-260.0, [("error", "stock.box_mm")])],
)
def test_a_stock_beside_the_program(plan, low_x, code):
    body = "\n".join([*HEAD, "X50", *TAIL]) + "\n"
    box = [[low_x, -20.0, -10.0], [low_x + 60.0, 20.0, 0.0]]
    toolpath = plan(body, {"stock": {"box_mm": box}})
    issues = [i for i in doubtful(toolpath.toolpath, toolpath.cell) if i.code == "stock-untouched"]
    assert [(i.severity, i.key) for i in issues] == code


@pytest.mark.parametrize(
    ("at", "top", "found"), [(20.0, 130.0, True), (20.0, 90.0, False), (400.0, 130.0, False)]
)
def test_a_clamp_above_the_plane_where_the_program_goes(plan, at, top, found):
    """The clearance plane of the demonstration cell is at 100."""
    body = "\n".join([*HEAD, "X50", *TAIL]) + "\n"
    clamp = {"name": "clamp", "box_mm": [[at, -10.0, -20.0], [at + 10.0, 10.0, top]]}
    made = plan(body, {"obstacle": [clamp]})
    keys = [i.key for i in doubtful(made.toolpath, made.cell) if i.code == "cell-contradiction"]
    assert keys == ["clearance.z_mm"] * found


PART = b"G21\nT1 M6\nG43 H1\nS1000 M3\nG0 X0 Y0 Z50\nG1 Z110 F500\nG0 Z20\nG1 Z125\nM5\nM2\n"


def test_the_remedy_names_the_highest_feed():
    cell = load_cell()
    found = [
        i
        for i in check_toolpath(read_stream(io.BytesIO(PART), "part.nc", cell), cell)
        if i.code == "above-clearance"
    ]
    assert found
    assert all("z_mm to 125.000 or more" in issue.remedy for issue in found)
