"""What is planned around the programmed moves: HOME, approach, retracts, tool changes, stops and events."""

import numpy as np
import pytest

from gcode2krl.errors import NotUnderstoodError

HEAD = "G21 G90 G54\nT1 M6\nS8000 M3\nG43 H1\n"
LONG = {"tool": {"2": {"length_mm": 150.0}, "3": {"length_mm": 60.0}}}


def test_approach_and_final_retract(plan):
    made = plan(HEAD + "G0 X10 Y20\nG0 Z5\nG1 Z-1 F600\nG1 X30\nM30\n")
    assert made.steps == [
        "HOME",
        ("PTP", 10, 20, 100),
        ("LIN", 10, 20, 5),
        ("LIN", 10, 20, -1),
        ("LIN", 30, 20, -1),
        ("LIN", 30, 20, 100),
        "HOME",
    ]
    targets = made.targets
    assert targets.source_line.tolist() == [0, 6, 6, 7, 8, 8, 0]  # added targets have the line they serve
    assert (targets.move < 0).tolist() == [True, True, False, False, False, True, True]
    assert targets.speed_mm_s[2:6] == pytest.approx([200, 10, 10, 200])
    assert np.isnan(targets.speed_mm_s[targets.ptp]).all()
    assert made.codes() == {}


def test_position_above_the_clearance_plane_is_approached_at_its_own_height(plan):
    made = plan(HEAD + "G0 X10 Y20 Z150\nG1 Z-1 F600\nG0 Z150\nM30\n")
    assert made.steps == ["HOME", ("PTP", 10, 20, 150), ("LIN", 10, 20, -1), ("LIN", 10, 20, 150), "HOME"]


def test_axes_one_by_one(plan):
    """Nothing moves before X, Y and Z have all been programmed."""
    made = plan(HEAD + "G0 X10\nG0 Z50\nG0 X20\nG0 Y5\nG1 Z-1 F600\nM30\n")
    assert made.steps[:4] == ["HOME", ("PTP", 20, 5, 100), ("LIN", 20, 5, 50), ("LIN", 20, 5, -1)]


@pytest.mark.parametrize("first", ["G1 X5 Y5 Z-1 F600", "G0 X5 Y5\nG1 Z-1 F600", "G0 Z5\nG1 X5 Y5 F600"])
def test_feed_from_an_undefined_position_is_an_error(plan, first):
    made = plan(HEAD + first + "\nG1 X6\nM30\n")
    feed = 1 + next(k for k, line in enumerate(made.text.splitlines()) if line.startswith("G1 "))
    assert made.codes() == {"undefined-position": feed}


@pytest.mark.parametrize(
    "text", ["M30\n", "G21\nT1 M6\nM30\n", "G21\nG0 X1 Y1\nM30\n", "G21\nG53 G0 Z0\nM30\n"]
)
def test_no_motion(plan, text):
    with pytest.raises(NotUnderstoodError, match="no-motion"):
        plan(text)


# --- machine moves --------------------------------------------------------------------------------------


@pytest.mark.parametrize("move", ["G28 G91 Z0\nG90", "G28", "G53 G0 Z0", "G53 G0 X0 Y0", "G30 G91 Z0\nG90"])
def test_machine_move_at_home_is_no_motion(plan, move):
    made = plan("G21 G90 G54\n" + move + "\n" + HEAD + "G0 X10 Y20\nG0 Z5\nG1 Z-1 F600\nM30\n")
    assert made.steps[:3] == ["HOME", ("PTP", 10, 20, 100), ("LIN", 10, 20, 5)]
    assert made.codes() == {}


@pytest.mark.parametrize("move", ["G28 G91 Z0\nG90", "G53 G0 Z0", "G30 G91 Z0\nG90"])
def test_retract_in_the_program_carries_the_line(plan, move):
    made = plan(HEAD + "G0 X10 Y20\nG0 Z5\nG1 Z-1 F600\n" + move + "\nG0 X50 Y60\nG0 Z5\nG1 Z-2\nM30\n")
    assert made.steps[3:] == [
        ("LIN", 10, 20, -1),
        ("LIN", 10, 20, 100),
        ("LIN", 50, 60, 100),
        ("LIN", 50, 60, 5),
        ("LIN", 50, 60, -2),
        ("LIN", 50, 60, 100),
        "HOME",
    ]
    targets, row = made.targets, 4
    assert targets.source_line[row] == 8
    assert made.toolpath.machine[targets.move[row]]
    assert targets.speed_mm_s[row] == 200
    assert made.codes() == {}


@pytest.mark.parametrize("move", ["G28 G91 X0 Y0\nG90", "G28", "G53 G0 X0 Y0", "G28 G91 X0 Y0 Z0\nG90"])
def test_x_and_y_of_the_machine_are_home(plan, move):
    made = plan(HEAD + "G0 X10 Y20\nG0 Z5\nG1 Z-1 F600\n" + move + "\nG0 X50 Y60 Z5\nG1 Z-2\nM30\n")
    assert made.steps[3:8] == [
        ("LIN", 10, 20, -1),
        ("LIN", 10, 20, 100),
        "HOME",
        ("PTP", 50, 60, 100),
        ("LIN", 50, 60, 5),
    ]
    assert made.targets.source_line[4] == made.targets.source_line[5] == 8
    assert made.steps.count("HOME") == 3


def test_machine_move_last(plan):
    made = plan(HEAD + "G0 X10 Y20\nG0 Z5\nG1 Z-1 F600\nG28 G91 Z0\nG28 X0 Y0\nM30\n")
    assert made.steps[3:] == [("LIN", 10, 20, -1), ("LIN", 10, 20, 100), "HOME"]


def test_feed_after_a_machine_move_needs_the_position_again(plan):
    made = plan(HEAD + "G0 X10 Y20\nG0 Z5\nG1 Z-1 F600\nG53 G0 Z0\nG1 X50\nM30\n")
    assert made.codes() == {"undefined-position": 9}


def test_machine_move_without_a_clearance_plane(plan):
    text = HEAD + "G0 X10 Y20\nG0 Z5\nG1 Z-1 F600\nG53 G0 Z0\nM30\n"
    found = plan(text, {"clearance": {"z_mm": "none"}}).targets.issues
    assert {issue.line for issue in found if issue.code == "no-clearance"} == {0, 8}


def test_feed_in_machine_coordinates(plan):
    made = plan(HEAD + "G0 X10 Y20\nG0 Z5\nG1 Z-1 F600\nG53 G1 Z0\nM30\n")
    assert made.codes().get("machine-feed") == 8


# --- known positions ------------------------------------------------------------------------------------


def test_a_new_length_offset_makes_z_unknown(plan):
    made = plan(HEAD + "G0 X10 Y20\nG0 Z5\nG1 Z-1 F600\nG0 Z50\nG43 H2\nG1 X20 F600\nM30\n", LONG)
    assert "undefined-position" in made.codes()
    assert made.codes()["undefined-position"] == 10


def test_after_a_new_length_offset_only_z_is_needed(plan):
    made = plan(HEAD + "G0 X10 Y20\nG0 Z5\nG1 Z-1 F600\nT2 M6\nG43 H2\nG0 Z5\nS9000 M3\nG1 Z-1\nM30\n", LONG)
    assert "undefined-position" not in made.codes()
    assert made.steps[-3:] == [("LIN", 10, 20, -1), ("LIN", 10, 20, 100), "HOME"]


def test_sideways_move_with_z_unknown_stays_on_the_clearance_plane(plan):
    made = plan(HEAD + "G0 X10 Y20\nG0 Z5\nG1 Z-1 F600\nG53 G0 Z0\nG0 X40\nG0 Y50\nG0 Z5\nG1 Z-1\nM30\n")
    assert made.steps[4:8] == [
        ("LIN", 10, 20, 100),
        ("LIN", 40, 20, 100),
        ("LIN", 40, 50, 100),
        ("LIN", 40, 50, 5),
    ]
    assert made.targets.source_line[4:8].tolist() == [8, 9, 10, 11]


# --- tool changes ---------------------------------------------------------------------------------------


def change(new: int, after: str = "G0 X10 Y20\nG0 Z5\nG1 Z-1\nG1 X30\n") -> str:
    return HEAD + f"G0 X10 Y20\nG0 Z5\nG1 Z-1 F600\nT{new} M6\nS9000 M3\nG43 H{new}\n{after}M30\n"


def test_tool_change_stands_on_the_clearance_plane(plan):
    made = plan(change(4))
    row = 4
    assert made.steps[3:5] == [("LIN", 10, 20, -1), ("LIN", 10, 20, 100)]
    assert made.events_at(row)[:2] == [("spindle", 0), ("tool", 4)]  # above the work, not in it
    assert made.targets.cdis_mm[row] == 0
    assert made.targets.tool[: row + 1].tolist() == [1] * (row + 1)
    assert set(made.targets.tool[row + 1 :].tolist()) == {4}


def flange_heights(made):
    """Return the height of the tool's holder side above $BASE, by the frames that hold during each motion."""
    targets, cell = made.targets, made.cell
    return [
        targets.position_mm[k, 2] + cell.tool[int(targets.tool[k])].length_mm for k in range(len(targets))
    ]


def test_longer_tool_finds_room(plan):
    """The arm goes up by the difference first, so that the longer tool's tip is on the clearance plane."""
    made = plan(change(2), LONG)
    row = next(
        event.row for event in made.targets.events if event.kind == "tool" and event.values["tool"] == 2
    )
    assert made.steps[row] == ("LIN", 10, 20, 150)
    assert made.targets.tool[row] == 1
    assert flange_heights(made)[row] == pytest.approx(100 + 150)
    assert made.steps[row + 1] == ("LIN", 10, 20, 100)  # the same place for the arm
    assert made.targets.tool[row + 1] == 2
    assert flange_heights(made)[row + 1] == pytest.approx(100 + 150)


@pytest.mark.parametrize("length", [60.0, 150.0])
def test_longer_tool_by_its_frame_alone(plan, length):
    """A tool may be given by its frame, without a length: it needs the same room."""
    own = {"x_mm": 250.0, "y_mm": 0.0, "z_mm": 250.0, "a_deg": 0.0, "b_deg": -90.0, "c_deg": 0.0}
    own["x_mm"] += length - 100.0  # z of the default tool frame is -x of the flange
    tool = {"diameter_mm": 10.0, "teeth": 3, "frame": own}
    made = plan(change(31, "G0 X10 Y20\nG0 Z5\nG1 Z-1\n").replace("G43 H31\n", ""), {"tool": {"31": tool}})
    row = next(
        event.row for event in made.targets.events if event.kind == "tool" and event.values["tool"] == 31
    )
    tip_after = made.targets.position_mm[row, 2] - (length - 100.0)
    assert tip_after >= 100.0


def test_shorter_tool_comes_down_from_where_it_is(plan):
    """Its tip stands 40 mm above the plane; the move to the first position begins above it."""
    made = plan(change(3), LONG)
    row = next(
        event.row for event in made.targets.events if event.kind == "tool" and event.values["tool"] == 3
    )
    assert made.steps[row] == ("LIN", 10, 20, 100)
    assert made.steps[row + 1 : row + 3] in (
        [("LIN", 10, 20, 5), ("LIN", 10, 20, -1)],
        [("LIN", 10, 20, 100), ("LIN", 10, 20, 5)],
    )


def test_position_reached_anew_with_another_tool_is_a_motion(plan):
    """The same X, Y, Z with a shorter tool is another place for the arm: a feed move must begin there."""
    text = change(3, "G0 X10 Y20 Z100\nG1 X50 Z90 F600\nG1 Z-1\n").replace(
        "G1 Z-1 F600\nT3", "G1 Z-1 F600\nG0 Z100\nT3"
    )
    made = plan(text, LONG)
    row = made.row_of(50, 20, 90)
    assert made.steps[row - 1] == ("LIN", 10, 20, 100)
    assert made.targets.tool[row - 1] == 3


def test_tool_change_at_home(plan):
    made = plan(change(2).replace("T2 M6", "G28 G91 X0 Y0 Z0\nG90\nT2 M6"), LONG)
    homes = [k for k, step in enumerate(made.steps) if step == "HOME"]
    assert ("tool", 2) in made.events_at(homes[1])
    assert made.steps[homes[1] + 1] == ("PTP", 10, 20, 100)
    assert made.targets.tool[homes[1] + 1] == 2


def test_tool_named_but_unknown_is_an_error(plan):
    assert plan(change(77)).codes()["tool-unknown"] == 8


def test_no_tool_named(plan):
    text = "G21 G90 G54\nS8000 M3\nG0 X0 Y0\nG0 Z5\nG1 Z-1 F600\nM30\n"
    assert "tool-assumed" in {issue.code for issue in plan(text).targets.issues}
    with pytest.raises(NotUnderstoodError, match="mounted_tool"):
        plan(text, {"mounted_tool": 99})


# --- dwell, events, stops -------------------------------------------------------------------------------


def test_dwell_stands_behind_its_move(plan):
    made = plan(HEAD + "G0 X0 Y0\nG0 Z5\nG1 Z-1 F600\nG4 P1.5\nG4 P0.5\nG1 X10\nG1 Y10\nM30\n")
    row = made.row_of(0, 0, -1)
    assert made.targets.wait_s[row] == pytest.approx(2.0)
    assert made.targets.cdis_mm[row] == 0
    assert np.count_nonzero(made.targets.wait_s) == 1
    assert made.targets.cdis_mm[made.row_of(10, 0, -1)] > 0


def test_dwell_on_a_move_of_no_length_is_kept(plan):
    made = plan(HEAD + "G0 X0 Y0\nG0 Z5\nG1 Z-1 F600\nG1 X0\nG4 P1.5\nG1 X0.0002\nG4 P0.25\nG1 X10\nM30\n")
    row = made.row_of(0, 0, -1)
    assert made.targets.wait_s[row] == pytest.approx(1.75)
    assert made.steps[row + 1] == ("LIN", 10, 0, -1)


def test_moves_that_print_as_one_point_are_one(plan):
    lines = "".join(f"G1 X{10 + k * 1e-4:.4f}\n" for k in range(11))
    made = plan(HEAD + "G0 X0 Y0\nG0 Z5\nG1 Z-1 F600\n" + lines + "G1 X20\nM30\n")
    grid = np.round(made.targets.position_mm / 1e-3)
    same = (np.diff(grid, axis=0) == 0).all(axis=1)
    assert not same[~made.targets.ptp[1:]].any()
    assert np.abs(made.targets.position_mm[-4] - [10.001, 0, -1]).max() <= 1e-3


def test_dwell_before_the_first_position_is_at_home(plan):
    made = plan("G21 G90 G54\nT1 M6\nG4 P2\nS8000 M3\nG43 H1\nG0 X0 Y0\nG0 Z5\nG1 Z-1 F600\nM30\n")
    assert made.targets.wait_s[0] == 2.0


def test_dwell_after_a_tool_change_stands_behind_it(plan):
    """Waits that belong above the work do not happen with the mill in the work."""
    made = plan(change(4).replace("T4 M6\n", "T4 M6\nG4 P2\n"))
    row = next(
        event.row for event in made.targets.events if event.kind == "tool" and event.values["tool"] == 4
    )
    assert np.flatnonzero(made.targets.wait_s).tolist() == [row]


def test_events_stand_behind_their_move(plan):
    made = plan(HEAD + "G0 X0 Y0\nG0 Z5\nM8\nG1 Z-1 F600\nG1 X10\nM9\nG1 Y10\n(MSG, hello)\nG1 X0\nM30\n")
    assert made.events_at(0) == [("tool", 1), ("spindle", 8000)]
    assert made.events_at(made.row_of(0, 0, 5)) == [("coolant", True)]
    assert made.events_at(made.row_of(10, 0, -1)) == [("coolant", False)]
    assert ("message", "hello") in made.events_at(made.row_of(10, 10, -1))
    for event in made.targets.events:
        assert made.targets.cdis_mm[event.row] == 0


def test_events_keep_their_order(plan):
    made = plan(change(2), LONG)
    rows = [event.row for event in made.targets.events]
    assert rows == sorted(rows)
    assert [e.values["line"] for e in made.targets.events] == sorted(
        e.values["line"] for e in made.targets.events
    )


def test_spindle_stops_by_the_programs_end_before_home(plan):
    """M30 stops the spindle, but neither while the mill is still in the work nor on the way to HOME."""
    made = plan(HEAD + "G0 X0 Y0\nG0 Z5\nM8\nG1 Z-1 F600\nG1 X10\nM30\n")
    last = len(made.targets) - 1
    assert made.targets.home[last]
    assert made.targets.position_mm[last - 1, 2] == pytest.approx(made.cell.clearance_z_mm)
    assert ("spindle", 0) in made.events_at(last - 1)
    assert ("coolant", False) in made.events_at(last - 1)
    assert made.events_at(last) == []


def test_exact_stops(plan):
    cut = "G1 Z-1 F600\nG1 X10\nG61\nG1 Y10\nG64 P0.02\nG1 X0\nG1 Y0\n"
    made = plan(HEAD + "G64 P0.02\nG0 X0 Y0\nG0 Z5\nG0 Z2\n" + cut + "G0 Z5\nM30\n")
    cdis = dict(zip(made.steps, made.targets.cdis_mm.tolist(), strict=True))
    between = [("LIN", 0, 0, 2), ("LIN", 0, 0, -1)]  # rapid and feed meet
    stops = [("PTP", 0, 0, 100), *between, ("LIN", 10, 10, -1), ("LIN", 0, 0, 100), "HOME"]
    assert [cdis[step] for step in stops] == [0.0] * len(stops)
    assert cdis[("LIN", 10, 0, -1)] > 0


SQUARE = "G0 X0 Y0\nG0 Z5\nG1 Z-1 F600\nG1 X10\nG1 Y10\nG1 X0\nM30\n"


@pytest.mark.parametrize(
    ("programmed", "asked", "own", "cdis"),
    [
        ("", None, None, 0.1),
        ("", None, 0.2, 0.5),
        ("", 0.02, 0.2, 0.05),
        ("G64 P0.4\n", 0.02, 0.2, 1.0),
        ("G64\n", 0.02, None, 0.05),
    ],
)
def test_precedence_of_tolerances(plan, programmed, asked, own, cdis):
    """G64 P over the tolerance asked for over the cell's tolerance over its CDIS."""
    data = {} if own is None else {"controller": {"tolerance_mm": own}}
    made = plan(HEAD + programmed + SQUARE, data, asked)
    assert made.targets.cdis_mm[made.row_of(10, 0, -1)] == cdis


@pytest.mark.parametrize("tolerance", [0.0, -1.0, float("nan"), float("inf")])
def test_tolerance_that_is_none(plan, tolerance):
    with pytest.raises(NotUnderstoodError, match="option-value"):
        plan(HEAD + SQUARE, tolerance_mm=tolerance)


def test_home_below_the_clearance_plane_is_an_error(plan):
    """PTP HOME would end below the plane on which no PTP may run."""
    made = plan(HEAD + SQUARE, {"home": {"q_deg": [0, -60, 110, 0, 40, 0]}})
    assert made.targets.position_mm[0, 2] < 100
    assert made.codes()


def test_tables_belong_together(plan):
    made = plan(change(2), LONG)
    targets = made.targets
    known = targets.move >= 0
    assert (targets.source_line[known] == made.toolpath.source_line[targets.move[known]]).all()
    assert (np.diff(targets.move[known]) >= 0).all()
    assert np.linalg.norm(targets.rotation, axis=1) == pytest.approx(1)
