"""Rotary words against homogeneous matrices (scipy), which share nothing with the reader."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gcode2krl import Gcode2KrlError, load_cell
from gcode2krl.cell.sections import Machine
from tests.gcode import errors, named
from tests.gcode import read as parsed

CENTRE_MM, PIVOT_MM, TOOL_MM = (12.0, -7.0, -90.0), 160.0, 100.0
KINDS = {
    "head": (("B",), (1,)),
    "table": (("A",), (-1,)),
    "head-head": (("C", "A"), (1, -1)),
    "table-table": (("A", "C"), (-1, -1)),
    "table-head": (("C", "B"), (-1, 1)),
}


def machine(kind, *, tcpm, axes=None, signs=None, **keys):
    of_kind, signs_of_kind = KINDS[kind]
    keys = {"pivot_mm": PIVOT_MM, "centre_mm": CENTRE_MM, **keys}
    return Machine(kind=kind, axes=axes or of_kind, signs=signs or signs_of_kind, tcpm=tcpm, **keys)


def read(text, made_for, **options):
    return parsed(text, load_cell().model_copy(update={"machine": made_for}), **options)


def matrix(rotation, shift=(0.0, 0.0, 0.0)):
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = rotation.as_matrix(), shift
    return made


def shift(x, y, z):
    return matrix(Rotation.identity(), (x, y, z))


def turn(letters, signs, angles_deg):
    """Return the product of rotations about X (A), Y (B), Z (C), the first nearest to the base."""
    made = Rotation.identity()
    for letter, sign in zip(letters, signs, strict=True):
        made = made * Rotation.from_euler("xyz"["ABC".index(letter)], sign * angles_deg[letter], degrees=True)
    return matrix(made)


def tool_in_part(made_for, xyz_mm, angles_deg, tool_mm=TOOL_MM):
    """Return tip and axis in the part: the chain base → head → tool, seen from base → table → part."""
    heads = {"head": 1, "head-head": 2, "table-head": 1}.get(made_for.kind, 0)
    tables = len(made_for.axes) - heads
    letters, signs = made_for.axes, made_for.signs
    reach = (made_for.pivot_mm or 0.0) + tool_mm
    x, y, z = xyz_mm
    head = shift(x, y, z + reach) @ turn(letters[tables:], signs[tables:], angles_deg) @ shift(0, 0, -reach)
    c = np.array(made_for.centre_mm or (0.0, 0.0, 0.0))
    table = shift(*c) @ turn(letters[:tables], signs[:tables], angles_deg) @ shift(*-c)
    tool = np.linalg.inv(table) @ head
    return tool[:3, 3], tool[:3, 2]


def words(made_for, xyz_mm, angles_deg):
    named = zip("XYZ", xyz_mm, strict=True)
    text = [f"{letter}{value:.9f}" for letter, value in named]
    return " ".join(text + [f"{letter}{angles_deg[letter]:.9f}" for letter in made_for.axes])


HEAD = "G21 G90 G94\nT1 M6\nG43 H1\nS1000 M3\n"


def ends(toolpath):
    """Return the rows that end a block that moves."""
    line = toolpath.source_line
    return np.flatnonzero(np.append(line[1:] != line[:-1], True) & (line > 0))


# --- positions by hand ------------------------------------------------------------------------------------


TRUNNION = {"kind": "table-table", "tcpm": False, "centre_mm": (0.0, 0.0, -100.0)}
FORK = {"kind": "head-head", "axes": ("C", "B"), "signs": (1, 1)}


@named(
    ("keys", "words", "tip_mm", "axis"),
    {
        "A90 turns the part right-handed about X: the tool comes from its +Y": (
            TRUNNION | {"signs": (1, 1)},
            "X10 Y20 Z30 A90 C0",
            [10, 130, -120],
            [0, 1, 0],
        ),
        "the other sign": (
            TRUNNION | {"signs": (-1, 1)},
            "X10 Y20 Z30 A90 C0",
            [10, -130, -80],
            [0, -1, 0],
        ),
        "B90 lays the tool along +X: its tip is 260 mm (pivot and tool) up and back": (
            FORK | {"tcpm": False},
            "X0 Y0 Z0 B90 C0",
            [-260, 0, 260],
            [1, 0, 0],
        ),
        "the first axis carries the second: C90 turns the direction of B": (
            FORK | {"tcpm": True},
            "X1 Y2 Z3 B30 C90",
            [1, 2, 3],
            [0, 0.5, np.sqrt(0.75)],
        ),
    },
)
def test_places_by_hand(keys, words, tip_mm, axis):
    toolpath = read(f"{HEAD}G0 {words}\nM2\n", machine(**keys))
    np.testing.assert_allclose(toolpath.position_mm[-1], tip_mm, atol=1e-9)
    np.testing.assert_allclose(toolpath.axis[-1], axis, atol=1e-12)


# --- against matrices -------------------------------------------------------------------------------------

ANGLES = st.floats(-400.0, 400.0).map(lambda value: round(value, 4))
PLACES = st.tuples(*[st.floats(-200.0, 200.0).map(lambda value: round(value, 4))] * 3)
POSES = st.lists(st.tuples(PLACES, ANGLES, ANGLES), min_size=1, max_size=4)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=25, deadline=None)
@given(poses=POSES)
def test_machine_axes(kind, poses):
    made_for = machine(kind, tcpm=False)
    steps = [(xyz, dict(zip(made_for.axes, angles, strict=False))) for xyz, *angles in poses]
    lines = "\n".join("G1 F500 " + words(made_for, *step) for step in steps)
    toolpath = read(HEAD + "G0 X0 Y0 Z0\n" + lines + "\nM2\n", made_for)
    rows = ends(toolpath)[-len(steps) :]
    for row, (xyz, angles) in zip(rows, steps, strict=True):
        tip, axis = tool_in_part(made_for, xyz, angles)
        np.testing.assert_allclose(toolpath.position_mm[row], tip, atol=1e-6)
        np.testing.assert_allclose(toolpath.axis[row], axis, atol=1e-9)


@pytest.mark.parametrize("kind", ["head-head", "table-table", "table-head"])
@settings(max_examples=25, deadline=None)
@given(poses=POSES)
def test_the_same_surface_for_any_machine_is_the_same_toolpath(kind, poses):
    """Machine axes of the tip programs, from the matrices solved for the position, end at the same tips."""
    tip_machine, bare = machine(kind, tcpm=True), machine(kind, tcpm=False)
    by_tip, by_axes = [], []
    for xyz, *two in poses:
        angles = dict(zip(bare.axes, two, strict=True))
        at_zero, _ = tool_in_part(bare, (0.0, 0.0, 0.0), angles)
        columns = [tool_in_part(bare, unit, angles)[0] - at_zero for unit in np.eye(3)]
        axes_mm = np.linalg.solve(np.array(columns).T, np.array(xyz) - at_zero)
        by_tip.append("G1 F500 " + words(bare, xyz, angles))
        by_axes.append("G1 F500 " + words(bare, axes_mm, angles))
    texts = ("\n".join([HEAD + "G0 X0 Y0 Z0", *lines, "M2", ""]) for lines in (by_tip, by_axes))
    one, other = (read(text, made) for text, made in zip(texts, (tip_machine, bare), strict=True))
    for name in ("position_mm", "axis"):
        mine, theirs = (getattr(path, name)[ends(path)] for path in (one, other))
        np.testing.assert_allclose(mine, theirs, atol=1e-6)


# --- between two blocks -----------------------------------------------------------------------------------


def way_of_block(toolpath, line):
    """Return the rows of a block with the one before them."""
    rows = np.flatnonzero(toolpath.source_line == line)
    return np.append(rows[0] - 1, rows)


@pytest.mark.parametrize(
    ("kind", "tcpm"),
    [
        ("head-head", True),
        ("table-table", False),
        ("table-head", True),
        *(
            pytest.param(kind, tcpm, marks=pytest.mark.slow)
            for kind, tcpm in (("head-head", False), ("table-table", True), ("table-head", False))
        ),
    ],
)
def test_chords_follow_the_machine_within_tolerance(kind, tcpm):
    made_for = machine(kind, tcpm=tcpm)
    first, second = made_for.axes
    steps = [
        ((40.0, 5.0, -3.0), {first: 20.0, second: 35.0}),
        ((80.0, -30.0, 8.0), {first: 130.0, second: -12.0}),
    ]
    text = HEAD + "\n".join("G1 F500 " + words(made_for, *step) for step in steps) + "\nM2\n"
    toolpath = read(text.replace("G1", "G0", 1), made_for)
    rows = way_of_block(toolpath, 6)
    (from_mm, from_deg), (to_mm, to_deg) = steps
    share = np.linspace(0.0, 1.0, 2001)
    chord = np.minimum((share * (len(rows) - 1)).astype(int), len(rows) - 2)
    within = share * (len(rows) - 1) - chord
    start, end = toolpath.position_mm[rows[chord]], toolpath.position_mm[rows[chord + 1]]
    axes = toolpath.axis[rows]
    for k, part in enumerate(share):
        xyz = np.array(from_mm) + part * (np.array(to_mm) - from_mm)
        angles = {name: from_deg[name] + part * (to_deg[name] - from_deg[name]) for name in (first, second)}
        tip, axis = tool_in_part(made_for, xyz, angles)
        tip = xyz if tcpm else tip
        u = (end[k] - start[k]) / np.linalg.norm(end[k] - start[k])
        assert np.linalg.norm(np.cross(tip - start[k], u)) <= 0.0101
        a, b = axes[chord[k]], axes[chord[k] + 1]
        angle = np.arccos(np.clip(a @ b, -1.0, 1.0))
        plane = (np.sin((1 - within[k]) * angle) * a + np.sin(within[k] * angle) * b) / np.sin(angle)
        assert np.degrees(np.linalg.norm(plane - axis)) <= 0.0205
        assert np.degrees(angle) <= 2.0 + 1e-6
    assert len(rows) > 10


def test_a_turn_about_the_tool_itself_is_one_move():
    toolpath = read(HEAD + "G0 X0 Y0 Z0\nG1 X50 C360 F500\nM2\n", machine("table-table", tcpm=True))
    assert len(toolpath) == 3


@pytest.mark.parametrize("before", ["", "G0 X0 Y0 Z9\nG28 B0\n", "G0 X0 Y0 Z9\nG53 G0 C0\n"])
def test_there_is_no_way_to_the_first_position(before):
    """Where the machine stands before it is not known, or it is a machine move: nothing is put between."""
    made_for = machine("head-head", tcpm=False, axes=("C", "B"), signs=(1, 1))
    toolpath = read(HEAD + before + "G0 X10 Y20 Z30 B60 C90\nM2\n", made_for)
    assert np.count_nonzero(toolpath.source_line == toolpath.source_line[-1]) == 1


def test_no_shortest_way():
    """A of 370 is 370: the way from 10 goes once around."""
    made_for = machine("table-table", tcpm=True)
    toolpath = read(HEAD + "G0 X0 Y0 Z0 A10\nG1 X50 A370 F500\nM2\n", made_for)
    rows = way_of_block(toolpath, 6)
    np.testing.assert_allclose(toolpath.axis[rows[-1]], toolpath.axis[rows[0]], atol=1e-12)
    assert toolpath.axis[rows, 2].min() < -0.99


def test_incremental_and_machine_coordinates():
    made_for = machine("head-head", tcpm=True)
    text = HEAD + "G0 X0 Y0 Z0 C10 A5\nG91 G0 C20 A5\nG90\nG53 G0 C0\nG0 X1 Y1 Z1\nM2\n"
    toolpath = read(text, made_for)
    for row, angles in ((-3, {"C": 30.0, "A": 10.0}), (-1, {"C": 0.0, "A": 10.0})):
        np.testing.assert_allclose(
            toolpath.axis[row], tool_in_part(made_for, (0, 0, 0), angles)[1], atol=1e-12
        )
    assert toolpath.machine.tolist()[-2:] == [True, False]


def test_homes_turn_back():
    made_for = machine("head-head", tcpm=True)
    one = read(HEAD + "G0 X0 Y0 Z0 C10 A5\nG28 A0\nG0 X1 Y1 Z1\nM2\n", made_for)
    np.testing.assert_allclose(one.axis[-1], [0.0, 0.0, 1.0], atol=1e-12)
    assert one.known[-1].all()
    kept = read(HEAD + "G0 X0 Y0 Z0 C10 A5\nG28.1\nG0 A20\nG28 A20\nG0 X1 Y1 Z1\nM2\n", made_for)
    want = tool_in_part(made_for, (0, 0, 0), {"C": 10.0, "A": 5.0})[1]
    np.testing.assert_allclose(kept.axis[-1], want, atol=1e-12)


def test_arcs_turn_evenly():
    made_for = machine("table-table", tcpm=True)
    toolpath = read(HEAD + "G0 X10 Y0 Z0\nG3 X-10 Y0 I-10 A40 F500\nM2\n", made_for)
    rows = way_of_block(toolpath, 6)
    around = np.degrees(np.arctan2(toolpath.position_mm[rows, 1], toolpath.position_mm[rows, 0]))
    tilt = np.degrees(np.arccos(toolpath.axis[rows, 2]))
    inner = np.abs(around - around[:1]) > 0
    np.testing.assert_allclose(tilt[inner][-1], 40.0, atol=1e-9)
    np.testing.assert_allclose(tilt, around / 180.0 * 40.0, atol=0.3)
    ends_of_chords = np.isclose(np.hypot(*toolpath.position_mm[rows, :2].T), 10.0, atol=1e-9)
    np.testing.assert_allclose(tilt[ends_of_chords], around[ends_of_chords] / 180.0 * 40.0, atol=1e-6)


# --- feeds ------------------------------------------------------------------------------------------------


def time_of_block(toolpath, line):
    rows = way_of_block(toolpath, line)
    length = np.linalg.norm(np.diff(toolpath.position_mm[rows], axis=0), axis=1)
    return float((length / toolpath.feed_mm_s[rows[1:]]).sum())


@pytest.mark.parametrize("kind", ["head-head", "table-table", "table-head"])
def test_feeds_of_machine_axes(kind):
    """G94: F along X, Y, Z of the machine; rotary axes alone: degrees a minute; G93: 1/F minutes."""
    made_for = machine(kind, tcpm=False)
    first, second = made_for.axes
    text = HEAD + (
        f"G0 X30 Y20 Z10\nG1 X60 Y60 F500 {first}30 {second}20\nG1 {first}60 {second}-20 F1000\nG93\n"
        f"G1 X10 {first}10 F4\nG1 {second}50 F2\nG1 X11 F3\nM2\n"
    )
    toolpath = read(text, made_for, chord_tolerance_mm=0.001)
    for line, seconds in ((6, 6.0), (7, 3.0), (9, 15.0), (10, 30.0), (11, 20.0)):
        assert time_of_block(toolpath, line) == pytest.approx(seconds, rel=2e-4), line


def test_feeds_of_the_tip():
    made_for = machine("head-head", tcpm=True)
    text = HEAD + "G0 X0 Y0 Z0\nG1 X50 C30 A20 F600\nG93\nG1 X90 C60 A0 F5\nM2\n"
    toolpath = read(text, made_for)
    np.testing.assert_allclose(toolpath.feed_mm_s[toolpath.source_line == 6], 10.0)
    np.testing.assert_allclose(toolpath.feed_mm_s[toolpath.source_line == 8], 40.0 / 12.0)


@pytest.mark.parametrize(
    ("block", "said"),
    [
        ("G1 A30 F600", ["at 10 deg/s"]),
        ("G93\nG1 A30 F4", ["at 2 deg/s"]),
        ("G1 A30 F60000", []),
    ],
)
def test_a_slow_turn_on_the_spot_is_refused_with_its_speed(block, said):
    toolpath = read(HEAD + f"G0 X0 Y0 Z0\nG1 X5 F500\n{block}\nM2\n", machine("head-head", tcpm=True))
    found = [issue.message for issue in toolpath.issues if issue.code == "turn-speed"]
    assert len(found) == len(said)
    assert all(words in message for words, message in zip(said, found, strict=True))


# --- G43.4 and G43.5 --------------------------------------------------------------------------------------


def test_tip_programming_begins_and_ends():
    made_for = machine("head-head", tcpm=False, axes=("C", "B"), signs=(1, 1))
    text = "G21 G90\nT1 M6\nG43.4 H1\nG0 X1 Y2 Z3 B90 C0\nG49\nG43 H1\nG0 X1 Y2 Z3\nM2\n"
    toolpath = read(text, made_for)
    np.testing.assert_allclose(toolpath.position_mm[1], [1.0, 2.0, 3.0], atol=1e-9)
    np.testing.assert_allclose(toolpath.position_mm[2], [-259.0, 2.0, 263.0], atol=1e-9)


def test_a_change_of_meaning_makes_the_position_unknown():
    made_for = machine("head-head", tcpm=False, axes=("C", "B"), signs=(1, 1))
    toolpath = read(HEAD + "G0 X1 Y2 Z3 B90 C0\nG43.4 H1\nG0 X5\nG0 X5 Y6 Z7\nM2\n", made_for)
    known = [toolpath.known[toolpath.source_line == line][-1].tolist() for line in (5, 7, 8)]
    assert known == [[True] * 3, [True, False, False], [True] * 3]


def test_tool_vectors():
    made_for = machine("table-table", tcpm=False)
    text = "G21 G90\nT1 M6\nG43.5 H1\nG0 X0 Y0 Z0 I0 J0 K1\nG1 X50 I3 J0 K4 F500\nG1 X60\nG49\nM2\n"
    toolpath = read(text, made_for)
    np.testing.assert_allclose(toolpath.axis[-1], [0.6, 0.0, 0.8], atol=1e-12)
    rows = way_of_block(toolpath, 5)
    steps = np.degrees(np.arccos((toolpath.axis[rows[1:]] * toolpath.axis[rows[:-1]]).sum(axis=1)))
    np.testing.assert_allclose(steps, steps[0], rtol=1e-6)  # in one plane, evenly
    assert steps[0] <= 2.0
    np.testing.assert_allclose(toolpath.axis[rows, 1], 0.0)
    np.testing.assert_allclose(toolpath.position_mm[rows[:, None], 1:], 0.0)


# --- what is refused --------------------------------------------------------------------------------------

REFUSED = {  # block: code, empty for any; kind of machine, None without one
    "G43.4 H1": ("machine-missing", None),
    "G0 A10": ("rotary-axis", None),
    "G0 B10": ("rotary-axis", "head-head"),
    "G43.5 H1\nG1 X1 F100 I0 J0 K0": ("tool-vector", "head-head"),
    "G43.5 H1\nG1 X1 F100 A10": ("tool-vector", "head-head"),
    "G43.5 H1\nG2 X1 I0.5 F100": ("tool-vector", "head-head"),
    "G43.5 H1\nG1 X1 F100 I1 K1\nG49\nG1 X2": ("rotary-unknown", "head-head"),
    "G43.5 H1\nG1 X1 F100 K1\nG1 X2 K-1": ("tool-vector", "head-head"),
    "G95 F0.1\nG1 A10": ("turn-per-rev", "head-head"),
    "G0 A400000": ("too-far", "head-head"),
    "G81 X1 Y1 Z-5 R2 F100 A10": ("cycle-turned", "head-head"),
    "G43.4 H1\nG0 X0 Y0 Z9 A10\nG81 X1 Y1 Z-5 R2 F100": ("cycle-turned", "head-head"),
    "G10 L2 P1 A10": ("", "head-head"),
    "G92 A10": ("", "head-head"),
    "G52 A10": ("", "head-head"),
    "G80\nG4 P1 A10": ("no-motion-mode", "head-head"),
}


@pytest.mark.parametrize("block", REFUSED)
def test_refused(block):
    code, kind = REFUSED[block]
    cell = load_cell().model_copy(update={"machine": machine(kind, tcpm=False) if kind else None})
    found = errors(HEAD + "G0 X0 Y0 Z0\n" + block + "\nM2\n", cell)
    assert found
    assert not code or code in [issue.code for issue in found]
    assert all(issue.remedy for issue in found)


@pytest.mark.parametrize(("kind", "key"), [("head-head", "pivot_mm"), ("table-table", "centre_mm")])
def test_machine_axes_need_the_lengths_of_the_machine(kind, key):
    made_for = machine(kind, tcpm=False, **{key: None})
    read(HEAD + "G0 X0 Y0 Z0\nM2\n", made_for)
    with pytest.raises(Gcode2KrlError, match=rf"machine\.{key}: line 5"):
        read(HEAD + "G0 X0 Y0 Z0 A10\nM2\n", made_for)


@pytest.mark.parametrize("length", ["", "T99 M6\nG43 H99\n"])
def test_a_turned_head_needs_the_length_of_the_tool(length):
    text = "G21 G90\nT1 M6\n" + length + "S1000 M3\nG0 X0 Y0 Z0 A10\nM2\n"
    with pytest.raises(Gcode2KrlError, match="length of the tool is not known"):
        read(text, machine("head-head", tcpm=False))
    read(text, machine("head-head", tcpm=True))


def test_a_program_without_rotary_words_is_what_it_was():
    text = HEAD + "G0 X0 Y0 Z5\nG1 Z-1 F100\nX50 Y3\nG2 X60 Y13 I10\nG93\nG1 X0 F3\nM2\n"
    plain, declared = (read(text, made) for made in (None, machine("table-table", tcpm=False)))
    for name, column in plain.columns().items():
        np.testing.assert_array_equal(column, declared.columns()[name], err_msg=name)


def test_events_and_dwells_stay_at_the_ends_of_their_blocks():
    made_for = machine("head-head", tcpm=True)
    text = HEAD + "G0 X0 Y0 Z0\nG61\nG1 X50 C30 A40 F600\nG4 P2\nM8\nG1 X60\nM2\n"
    toolpath = read(text, made_for)
    last = np.flatnonzero(toolpath.source_line == 7)[-1]
    assert np.flatnonzero(toolpath.dwell_s).tolist() == [last]
    assert np.flatnonzero(toolpath.exact_stop & (toolpath.source_line == 7)).tolist() == [last]
    assert next(event.row for event in toolpath.events if event.kind == "coolant") == last
