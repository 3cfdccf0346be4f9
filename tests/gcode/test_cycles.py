"""Canned cycles equal their moves written out, in every plane, unit and distance mode; findings, events."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl import load_cell
from gcode2krl.gcode import read as reading
from gcode2krl.program.checks import check_toolpath
from tests.gcode import Control, read

CYCLES = Control("G21 G90 G17\nS1000 M3 F100\nG0 X0 Y0 Z10\n")
HEAD = CYCLES.head


def toolpath(text, head=HEAD):
    """Return the toolpath of a program."""
    return read(f"{head}{text}\nM2\n")


def moves(table):
    """Return where the rows end, at what speed, rapid or not, and what is waited there."""
    return table.position_mm[1:], table.feed_mm_s[1:], table.rapid[1:], table.dwell_s[1:]


def assert_same_moves(one, other):
    """Compare two toolpaths but for their lines."""
    assert len(one) == len(other)
    for first, second in zip(moves(one), moves(other), strict=True):
        np.testing.assert_allclose(first, second, rtol=1e-12, atol=1e-9)


def written_out(cycle, holes, heights, words, level, returns):
    """Return a cycle as G0 and G1, worked out from its description; all heights in whole units."""
    r, depth = heights
    lines, here, height = [], (0, 0), level
    clear = max(level, r) if returns else r
    if height < r:
        height = r
        lines.append(f"G0 Z{r}")
    for x, y in holes:
        lines += [f"G0 X{x} Y{y}"] + ([f"G0 Z{r}"] if height > r else [])
        if cycle in (73, 83):
            pecked = r - words["Q"]
            while pecked > depth:
                lines += (
                    [f"G1 Z{pecked}"] + ([f"G0 Z{r}"] if cycle == 83 else []) + [f"G0 Z{pecked + 0.254:.3f}"]
                )
                pecked -= words["Q"]
        lines.append(f"G1 Z{depth}")
        if cycle in (82, 86, 89):
            lines.append(f"G4 P{words['P']}")
        if cycle == 85:
            lines.append(f"G1 Z{r}")
        lines.append(f"G{1 if cycle == 89 else 0} Z{clear}")
        here, height = (x, y), clear
    assert here == holes[-1]
    return "\n".join(lines)


def words_of(cycle, words):
    """Return the words that a cycle needs beside R and the depth."""
    return f" Q{words['Q']}" if cycle in (73, 83) else f" P{words['P']}" if cycle in (82, 86, 89) else ""


coordinate = st.integers(-50, 50)
drillings = st.tuples(
    st.sampled_from([73, 81, 82, 83, 85, 86, 89]),
    st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=5),
    st.tuples(st.integers(-5, 20), st.integers(1, 20)).map(lambda pair: (pair[0], pair[0] - pair[1])),
    st.fixed_dictionaries({"Q": st.integers(1, 7), "P": st.integers(0, 3)}),
    st.integers(-5, 30),
    st.booleans(),
)


@given(drillings)
@settings(max_examples=60, deadline=None)
def test_a_cycle_equals_its_moves_written_out(drilling):
    cycle, holes, (r, depth), words, level, returns = drilling
    head = f"{HEAD}G0 Z{level}\nG{98 if returns else 99}\n"
    first, *others = [f"X{x} Y{y}" for x, y in holes]
    text = "\n".join([f"G{cycle} {first} Z{depth} R{r}{words_of(cycle, words)}", *others])
    one = toolpath(text, head)
    other = toolpath(written_out(cycle, holes, (r, depth), words, level, returns), head)
    if level < r:  # from below, LinuxCNC goes to R before each of the cycles, where the tool is already
        stays = np.flatnonzero((np.diff(one.position_mm, axis=0) == 0).all(axis=1) & one.rapid[1:]) + 1
        assert len(one) - len(other) == len(holes) - 1
        keep = np.setdiff1d(np.arange(len(one)), stays[one.position_mm[stays, 2] == r])
        np.testing.assert_allclose(one.position_mm[keep], _distinct(other.position_mm, other.rapid, r))
        return
    assert_same_moves(one, other)


def _distinct(position_mm, rapid, r):
    """Return the positions without rapid rows at height R that do not move."""
    stays = np.concatenate([[False], (np.diff(position_mm, axis=0) == 0).all(axis=1)])
    return position_mm[~(stays & rapid & (position_mm[:, 2] == r))]


@given(drillings)
@settings(max_examples=40, deadline=None)
def test_incremental_equals_absolute(drilling):
    cycle, holes, (r, depth), words, level, returns = drilling
    head = f"{HEAD}G0 Z{level}\nG{98 if returns else 99}\n"
    heights = f"Z{depth - r} R{r - level}{words_of(cycle, words)}"
    steps = np.diff([(0, 0), *holes], axis=0)
    first, *others = [f"X{x} Y{y}" for x, y in steps]
    incremental = toolpath("\n".join([f"G91 G{cycle} {first} {heights}", *others]), head)
    first, *others = [f"X{x} Y{y}" for x, y in holes]
    absolute = "\n".join([f"G{cycle} {first} Z{depth} R{r}{words_of(cycle, words)}", *others])
    assert_same_moves(incremental, toolpath(absolute, head))


@given(drillings)
@settings(max_examples=40, deadline=None)
def test_inches_equal_millimetres(drilling):
    cycle, holes, (r, depth), words, level, returns = drilling
    first, *others = [f"X{x} Y{y}" for x, y in holes]
    body = "\n".join([f"G{cycle} {first} Z{depth} R{r}{words_of(cycle, words)}", *others])
    retract = f"G0 X0 Y0 Z{level}\nG{98 if returns else 99}\n"
    inch = toolpath(body, f"G20\nS1000 M3 F10\n{retract}")
    mm = toolpath(body + "\n", f"G21\nS1000 M3 F10\n{retract}")
    clearance = {73: 1, 83: 1}.get(cycle, 0)
    assert len(inch) == len(mm)
    np.testing.assert_allclose(inch.feed_mm_s[1:], mm.feed_mm_s[1:] * 25.4, rtol=1e-12)
    np.testing.assert_allclose(
        inch.position_mm, mm.position_mm * 25.4, rtol=1e-12, atol=0.254 * 25.4 * clearance + 1e-9
    )


@given(drillings, st.sampled_from([(18, "ZXY"), (19, "YZX")]))
@settings(max_examples=40, deadline=None)
def test_another_plane_is_the_same_motion_turned(drilling, plane):
    cycle, holes, (r, depth), words, level, returns = drilling
    number, axes = plane

    def text(first, second, along):
        lines = [f"{first}{u} {second}{v}" for u, v in holes]
        lines[0] = f"G{cycle} {lines[0]} {along}{depth} R{r}{words_of(cycle, words)}"
        return "\n".join([f"G0 {along}{level}\nG{98 if returns else 99}", *lines])

    flat = toolpath(text(*"XYZ"), "G21 G17\nS1000 M3 F100\nG0 X0 Y0 Z0\n")
    turned = toolpath(text(*axes), f"G21 G{number}\nS1000 M3 F100\nG0 X0 Y0 Z0\n")
    order = ["XYZ".index(axis) for axis in axes]
    np.testing.assert_allclose(turned.position_mm[:, order], flat.position_mm)
    np.testing.assert_array_equal(turned.rapid, flat.rapid)


@pytest.mark.parametrize(("plane", "axes"), [(18, "ZXY"), (19, "YZX")])
def test_tapping_in_another_plane_is_along_the_tool(plane, axes):
    """Not from LinuxCNC, which mixes up the axes of G84 outside G17."""
    u, v, along = axes
    flat = toolpath("G98 G84 X1 Y2 Z-3 R2 P1")
    head = f"G21 G{plane}\nS1000 M3 F100\nG0 {u}0 {v}0 {along}10\n"
    turned = toolpath(f"G98 G84 {u}1 {v}2 {along}-3 R2 P1", head)
    np.testing.assert_allclose(turned.position_mm[:, ["XYZ".index(axis) for axis in axes]], flat.position_mm)


def test_rows_of_a_cycle_end_in_an_exact_stop_and_the_mode_comes_back():
    table = toolpath("G64 P0.1\nG0 X5\nG99 G81 X1 Z-5 R2\nX2\nG0 X5 Z10")
    assert table.exact_stop[1:].tolist() == [False, False] + [True] * 7 + [False]


def test_the_dwell_lies_before_the_spindle_stops():
    table = toolpath("G98 G86 X1 Z-5 R2 P1.5")
    spindle = [event for event in table.events if event.kind == "spindle"]
    assert [(e.values["m"], e.values["rpm"]) for e in spindle[1:3]] == [(5, 0.0), (3, 1000.0)]
    assert spindle[1].values["dwell_s"] == 1.5
    bottom = spindle[1].row
    assert table.position_mm[bottom].tolist() == [1, 0, -5]
    assert table.dwell_s[bottom] == 1.5
    assert table.spindle_rad_s[bottom + 1] == 0.0  # out of the hole with the spindle at rest


def test_tapping_reverses_at_the_bottom_and_above_the_hole():
    table = toolpath("G99 G84 X1 Z-5 R2")
    spindle = [event for event in table.events if event.values.get("cycle") == "G84"]
    assert [(e.values["m"], table.position_mm[e.row, 2]) for e in spindle] == [
        (5, -5),
        (4, -5),
        (5, 2),
        (3, 2),
    ]
    last = len(table) - 1
    assert table.spindle_rad_s[last] < 0 < table.spindle_rad_s[last - 1]


def test_tapping_is_refused_in_translation_and_named_once_a_block():
    table = toolpath("G99 G84 X1 Z-5 R2\nX2\nG0 X5")
    issues = check_toolpath(table, load_cell())
    assert [issue.line for issue in issues if issue.code == "tapping-cycle"] == [4, 5]
    assert not [issue for issue in issues if issue.code == "spindle-direction"]


def test_a_height_that_is_not_known_is_not_returned_to():
    table = toolpath("G28 Z0\nG98 G81 X1 Y1 Z-5 R2\nX2 Y1\nG80", HEAD)
    known = table.known[:, 2].tolist()
    position = table.position_mm[:, 2].tolist()
    assert [(z, k) for z, k in zip(position, known, strict=True)][4:] == [
        (2, False),  # it rises over the first hole, not where it stands
        (2, True),
        (-5, True),
        (2, True),
        (2, False),
        (2, True),
        (-5, True),
        (2, True),
    ]


def test_without_g98_and_g99_a_warning_says_where_the_tool_stays():
    issues = toolpath("G81 X1 Z-5 R2\nX2").issues
    assert [(i.code, i.severity, i.line) for i in issues] == [("retract-unnamed", "warning", 4)]
    assert toolpath("G99 G81 X1 Z-5 R2\nX2").issues == ()
    assert toolpath("G0 Z2\nG81 X1 Z-5 R2\nX2").issues == ()


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("G81 X1 Z-5 R2\nG91 X1 L3", [("cycle-distance-changed", 2)]),
        ("G81 X1 Z-5 R2\nG20 X1", [("cycle-modes-changed", 2)]),
        ("G81 X1 Z-5 R2\nG18 X1 Y-2 R1", [("cycle-modes-changed", 2)]),
        ("G82 X1 Z-5 R2 P-2", [("dwell-negative", 1)]),
        ("G83 X1 Z-5 R2 Q1 D-1", [("cycle-clearance", 1)]),
        ("G83 X1 Z-5 R2 Q1e-300", [("unknown-letter", 1)]),
        ("G83 X1 Z-5 R2 Q.0000000000000000001", [("cycle-too-long", 1)]),
        ("G83 X1 Z-5 R2 Q.001 L99999", [("cycle-too-long", 1)]),
        ("G81 X1 Z-99999999 R2", [("too-far", 1)]),
        ("G91 G81 X100 Z-5 R2 L99999", [("too-far", 1)]),
        ("G81 X1 Z-5 R2\nG4 P1 X2", [("two-uses", 2)]),
        ("G87 X1 Z-5 R2 I1 J1 K1", [("unsupported-g", 1)]),
        ("G88 X1 Z-5 R2 P1", [("unsupported-g", 1)]),
        (  # one finding however many holes follow
            "G82 X1 Z-5 R2\nX2\nX3\nG80\nG0 Z10\nG81 X1 R2",
            [("cycle-no-dwell", 1), ("cycle-no-depth", 6)],
        ),
    ],
)
def test_what_is_refused(text, found):
    assert [(issue.code, issue.line) for issue in CYCLES.errors(text)] == found


def test_distance_mode_may_change_where_r_and_the_depth_are_written_again():
    table = toolpath("G98 G81 X1 Z-5 R2\nG91 X1 R-8 Z-7 L2")
    assert table.position_mm[-1].tolist() == [3, 0, 10]
    assert table.position_mm[:, 2].min() == -5


def test_the_clearance_may_be_given():
    assert 1.5 in toolpath("G99 G83 X1 Z-3 R2 Q1 D0.5").position_mm[:, 2]


@pytest.mark.parametrize("rows", [1, 20, 8192])
def test_room_is_made_for_rows_and_events_of_a_block(rows, monkeypatch):
    text = "M8 G98 G83 X1 Z-50 R2 Q.1 L3\nG86 X5 Z-3 R1 P.5 L40\nG84 X7 Z-3 R2 L30"
    whole = toolpath(text)
    monkeypatch.setattr(reading, "_FIRST_ROWS", rows)
    monkeypatch.setattr(reading, "_FIRST_EVENTS", 1)
    monkeypatch.setattr(reading, "_ROOM", 0.0)
    again = toolpath(text)
    assert_same_moves(whole, again)
    assert whole.events == again.events


@pytest.mark.parametrize("code", [73, 81, 82, 83, 84, 85, 86, 89])
@pytest.mark.parametrize("retract", ["G98", "G99"])
def test_as_many_rows_as_were_reserved_at_most(code, retract, monkeypatch):
    """With room for no row more than a block asks for; the checked core stops at the first one beside it."""
    monkeypatch.setattr(reading, "_FIRST_ROWS", 1)
    monkeypatch.setattr(reading, "_FIRST_EVENTS", 0)
    words = "Q.5" if code in (73, 83) else "P.1" if code in (82, 84, 86, 89) else ""
    head = "G21 G90 G17 G94 F500 S100 M3\nG0 X0 Y0 Z10\n"
    few, many = (len(toolpath(f"{retract} G{code} X1 Z-1 R2 {words} L{n}", head)) for n in (1, 999))
    assert many - few >= 998 * 3


@pytest.mark.parametrize("cycle", ["G89 X5. Z-4. R1. P500", "G84 X5. Z-4. R1."])
@pytest.mark.parametrize(("retract", "up"), [("", [1, 9]), ("G99 ", [1])])
def test_a_fanuc_feeds_up_to_r_and_rises_from_there_at_rapid_speed(cycle, retract, up):
    text = f"G21 G90 G17 G94\nS500 M3\nG0 X0. Y0. Z9.\nF120\n{retract}{cycle}\nG80\nM30\n"
    found = read(text, dialect="fanuc")
    assert found.position_mm[-1 - len(up) :, 2].tolist() == [-4, *up]
    assert found.rapid[-1 - len(up) :].tolist() == [False, False, True][: 1 + len(up)]
