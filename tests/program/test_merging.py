"""Feed moves merged into one: never further off than the tolerance, in order, only where nothing differs."""

import io
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl import plan_motion, set_targets
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gcode import read_stream
from gcode2krl.krl.number_text import fixed
from gcode2krl.program.merging import MOST_TURN_RAD, as_written, straightened
from tests.cells import over_demonstration

CELL = over_demonstration()
ROUNDED_MM = 0.00087
"""Half the diagonal of a cube of the last decimal."""


def steps_of(size_um, count=60):
    step = st.integers(-size_um, size_um).map(lambda micrometre: micrometre / 1000 + 0.0003)
    return st.lists(st.tuples(step, step, step), min_size=3, max_size=count)


@st.composite
def wavy_lines(draw):
    """Return the steps of a line that goes on in x, with noise across it that is mostly small."""
    across = st.integers(-12, 12).map(lambda micrometre: micrometre / 1000)
    ahead = st.integers(-5, 400).map(lambda micrometre: micrometre / 1000)
    return draw(st.lists(st.tuples(ahead, across, across), min_size=3, max_size=80))


paths = st.one_of(steps_of(5), steps_of(60), steps_of(3000, 20), wavy_lines()).map(
    lambda steps: np.cumsum(np.array(steps), axis=0)
)


def all_free(path):
    free = np.ones(len(path), dtype=bool)
    free[[0, -1]] = False
    return free


def written(points):
    """Return points as the program's text says them."""
    return np.array([[float(fixed(value, 3)) for value in point] for point in points])


def dense(points, spacing_mm):
    """Return points along a polyline no further apart than the spacing."""
    parts = []
    for a, b in itertools.pairwise(points):
        count = int(np.linalg.norm(b - a) / spacing_mm) + 2
        parts.append(a + np.linspace(0.0, 1.0, count)[:, None] * (b - a))
    return np.concatenate(parts)


def distance_to_segment(points, a, b):
    """Return the distances of points to a segment, by minimising the square over the segment."""
    way = b - a
    share = np.clip(((points - a) @ way) / (way @ way), 0.0, 1.0)
    return np.linalg.norm(points - a - share[:, None] * way, axis=1)


def apart(first, second):
    """Return the discrete Fréchet distance of two rows of points, by its recursion."""
    size = np.linalg.norm(first[:, None, :] - second[None, :, :], axis=2)
    last = np.maximum.accumulate(size[0])
    for row in size[1:]:
        here = np.empty_like(last)
        before = np.inf
        for k, one in enumerate(row.tolist()):
            reach = min(last[k], before, last[k - 1] if k else np.inf)
            before = here[k] = max(one, reach)
        last = here
    return float(last[-1])


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(paths, st.floats(0.001, 0.05))
def test_both_paths_are_within_the_tolerance_everywhere(path, limit_mm):
    keep, off_mm = straightened(path, all_free(path), limit_mm)
    rows = np.flatnonzero(keep)
    assert rows[0] == 0
    assert rows[-1] == len(path) - 1
    for a, b in itertools.pairwise(rows):
        if b == a + 1:
            continue
        ends = written(path[[a, b]])
        run = dense(path[a : b + 1], 0.003)
        off = distance_to_segment(run, *ends)
        assert off.max() <= limit_mm
        corners = distance_to_segment(path[a + 1 : b], *ends)
        assert corners.max() == pytest.approx(off_mm[b], abs=1e-9)
        new = dense(ends, 0.003)
        back = np.min(
            [
                distance_to_segment(new, p, q)
                for p, q in itertools.pairwise(path[a : b + 1])
                if (p != q).any()
            ],
            axis=0,
        )
        assert back.max() <= limit_mm
        unit = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        steps = np.diff(path[a : b + 1], axis=0)
        size = np.linalg.norm(steps, axis=1)
        assert (steps @ unit >= size * math.cos(MOST_TURN_RAD) - 1e-12).all()


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(st.one_of(steps_of(60, 10), wavy_lines()).map(lambda steps: np.cumsum(np.array(steps[:12]), axis=0)))
def test_both_paths_are_passed_in_the_same_order(path):
    """The Fréchet distance of the whole paths, from points 2 µm apart."""
    limit_mm, spacing_mm = 0.02, 0.004
    keep, _ = straightened(path, all_free(path), limit_mm)
    whole, new = dense(path, spacing_mm), dense(written(path[keep]), spacing_mm)
    assert apart(whole, new) <= limit_mm + spacing_mm + ROUNDED_MM


@settings(deadline=None)
@given(paths, st.data())
def test_a_corner_that_has_to_stay_stays(path, data):
    free = np.array(data.draw(st.lists(st.booleans(), min_size=len(path), max_size=len(path))))
    keep, _ = straightened(path, free, 0.02)
    assert keep[~free].all()


def test_a_line_in_pieces_becomes_one():
    """A hundred thousand pieces along a diagonal, 3 decimals each: rounding noise of 0.9 µm at most."""
    share = np.linspace(0.0, 1.0, 100_001)[:, None]
    path = written(share * [500.0, 333.3, -77.7])
    keep, off_mm = straightened(path, all_free(path), 0.002)
    assert np.flatnonzero(keep).tolist() == [0, 100_000]
    assert 0.0 < off_mm[-1] <= ROUNDED_MM


def test_as_many_chords_as_a_circle_needs():
    """A chord of length c is c²/(8·R) off its arc; with points every 0.1 mm a new chord may be shorter."""
    radius_mm, limit_mm, step_mm = 30.0, 0.01, 0.1
    angle = np.arange(0.0, math.pi, step_mm / radius_mm)
    path = radius_mm * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    keep, _ = straightened(path, all_free(path), limit_mm)
    longest_mm = math.sqrt(8.0 * radius_mm * limit_mm)
    least = math.pi * radius_mm / longest_mm
    most = math.pi * radius_mm / (longest_mm - 2 * step_mm)
    assert least <= np.count_nonzero(keep) - 1 <= most + 1


@pytest.mark.parametrize(
    "corner",
    [
        [[1.0, 0, 0], [0.996, 0, 0], [2.0, 0, 0]],  # forth, a little back, forth
        [[1.0, 0, 0], [1.0, 0.004, 0], [1.0, 0, 0], [2.0, 0, 0]],  # a spike
        [[1.0, 0, 0], [1.0, 0, 0.004], [2.0, 0, 0.004]],  # a step across
    ],
)
def test_spikes_and_steps_within_the_tolerance_stay(corner):
    path = np.array([[0.0, 0, 0], *corner])
    keep, _ = straightened(path, all_free(path), 0.01)
    assert keep[1:-1].all()


# --- which corners may go --------------------------------------------------------------------------------

HEAD = "G21 G90 G17 G40 G49 G80 G94\nG54 G64\nT1 M6\nS8000 M3\nG0 G43 H1 Z20\nG0 X0 Y0\nG0 Z2\nG1 Z-1 F600\n"
TAIL = "G0 Z20\nM5\nM30\n"


def targets_of(body, simplify_mm=0.01, tolerance_mm=None, data=None):
    cell = over_demonstration(data)
    toolpath = read_stream(io.BytesIO(f"{HEAD}{body}{TAIL}".encode()), "part.nc", cell)
    return toolpath, set_targets(toolpath, cell, tolerance_mm, simplify_mm)


def has_corner(targets, x, y=0.0):
    at = targets.position_mm[~targets.home]
    return bool((np.abs(at - [x, y, -1.0]) < 1e-6).all(axis=1).any())


def test_a_corner_on_a_line_goes():
    toolpath, targets = targets_of("G1 X10 F1500\nX20\nX30\nX30 Y10\n")
    assert not has_corner(targets, 10)
    assert not has_corner(targets, 20)
    assert has_corner(targets, 30)
    row = int(np.flatnonzero((targets.position_mm[:, 0] == 30.0) & (targets.position_mm[:, 1] == 0.0))[0])
    assert targets.source_line[row] == 11  # the last of the three
    assert toolpath.source_line[targets.move[row]] == 11
    (note,) = [issue for issue in targets.issues if issue.code == "simplified"]
    assert note.severity == "note"
    assert "5 feed moves became 3 within 0.01 mm, 0.0000 mm off at most" in note.message
    assert note.line == 11


@pytest.mark.parametrize(
    "between",
    [
        "F1400\n",  # another feed
        "G4 P0.5\n",
        "M8\n",
        "S9000\n",
        "G64 P0.05\n",
        "T1 M6\nG0 G43 H1 Z20\nG0 X10 Y0\nG0 Z2\nG1 Z-1\n",
        "G53 G0 Z0\nG0 X10 Y0 Z20\nG1 Z-1\n",
        "G49\n",
    ],
)
def test_a_corner_at_which_something_happens_stays(between):
    _, targets = targets_of(f"G1 X10 F1500\n{between}G1 X20\nX30\n")
    assert has_corner(targets, 10)


def test_exact_stops_stay():
    _, targets = targets_of("G1 X10 F1500\nX20\nG61\nX30\nX40\nG64\nX50\nX60\n")
    assert [has_corner(targets, x) for x in (10, 20, 30, 40, 50)] == [False, False, True, True, False]


def test_rapids_are_not_merged():
    _, targets = targets_of("G0 X10\nG0 X20\nG0 X30\nG1 X40 F1000\nG1 X50\n")
    assert all(has_corner(targets, x) for x in (10, 20, 30))
    assert not has_corner(targets, 40)


def test_the_first_feed_move_begins_where_the_rapid_ended():
    _, targets = targets_of("G0 X10\nG1 X20 F1000\nX30\n")
    assert has_corner(targets, 10)


def test_a_feed_move_that_is_approached_over_the_clearance_plane_is_its_own():
    """Behind a machine move the first feed move is a way down that the G-code does not have."""
    _, targets = targets_of("G1 X10 F1500\nG28 X0 Y0 Z0\nG1 X40 Y0 Z-1\nX50\nX60\n")
    assert has_corner(targets, 40)
    assert not has_corner(targets, 50)


def test_chords_of_an_arc_are_merged():
    _, whole = targets_of("G2 X60 Y0 I30 J0 F1500\n", simplify_mm=None)
    _, targets = targets_of("G2 X60 Y0 I30 J0 F1500\n", simplify_mm=0.1)
    assert len(targets) < len(whole) - 10


def test_events_dwells_and_stops_stay_with_their_points():
    body = "G1 X5 F1500\nX10\nM8\nX15\nX20\nG4 P0.25\nX25\nX30\nM9\nX35\nX40\n"
    _, whole = targets_of(body, simplify_mm=None)
    _, targets = targets_of(body)
    assert len(targets) == len(whole) - 4

    def happens(table):
        events = [(e.kind, e.values["line"], tuple(table.position_mm[e.row])) for e in table.events]
        waits = [tuple(table.position_mm[row]) for row in np.flatnonzero(table.wait_s)]
        return events, waits

    assert happens(targets) == happens(whole)


def test_a_corner_that_is_asked_for_within_a_tolerance_keeps_it():
    """Longer moves could be rounded more: the tolerance at a corner holds for the moves as merged."""
    body = "G64 P0.02\nG1 X5 F1500\nX10\nX15\nX20\nY5\nY10\nY15\n"
    _, targets = targets_of(body)
    row = int(np.flatnonzero((targets.position_mm[:, 0] == 20.0) & (targets.position_mm[:, 1] == 0.0))[0])
    assert 0.0 < targets.cdis_mm[row] * math.cos(math.pi / 4) / 2 <= 0.02


def test_nothing_to_merge_changes_nothing_and_says_so():
    body = "G1 X10 F1500\nY10\nX0\nY0\n"
    _, whole = targets_of(body, simplify_mm=None)
    _, targets = targets_of(body)
    assert np.array_equal(targets.position_mm, whole.position_mm)
    assert np.array_equal(targets.cdis_mm, whole.cdis_mm)
    (note,) = [issue for issue in targets.issues if issue.code == "simplified"]
    assert "none of 5 feed moves can be merged" in note.message


def test_the_times_of_the_note_are_those_of_the_motions():
    """The plunge is the slowest law can do; without joint speed limits a planned motion takes as long."""
    wave = "".join(f"X{x / 10:.1f} Y{0.004 * math.sin(x):.3f}\n" for x in range(1, 400))
    body = f"G1 F3000\n{wave}"
    _, whole = targets_of(body, simplify_mm=None)
    _, targets = targets_of(body)
    (note,) = [issue for issue in targets.issues if issue.code == "simplified"]
    before_s, after_s = (float(plan_motion(t, CELL).time_s[-1]) for t in (whole, targets))
    assert f"{before_s:.1f} s became {after_s:.1f} s" in note.message
    assert after_s < 0.7 * before_s


@pytest.mark.parametrize("simplify_mm", [0.0, -0.01, 0.0005, 1.5, float("nan"), float("inf")])
def test_a_tolerance_out_of_range_is_not_understood(simplify_mm):
    with pytest.raises(NotUnderstoodError, match="simplify"):
        targets_of("G1 X10 F1000\n", simplify_mm=simplify_mm)


def test_a_tool_that_turns_is_not_merged():
    toolpath, _ = targets_of("X5 F1500\nX10\nX15\nX20\nX25\nX30\n")
    tilt = np.radians(np.where(toolpath.position_mm[:, 0] < 15.0, toolpath.position_mm[:, 0], 15.0))
    turning = replace(toolpath, axis=np.stack([np.sin(tilt), 0.0 * tilt, np.cos(tilt)], axis=1))
    targets = set_targets(turning, CELL, None, 0.01)
    assert [has_corner(targets, x) for x in (5, 10, 15, 20, 25)] == [True, True, True, False, False]


@given(
    st.floats(-5000.0, 5000.0) | st.integers(-(10**7), 10**7).map(lambda tenth_um: (tenth_um + 0.5) / 1000)
)
def test_positions_are_rounded_as_they_are_written(value):
    assert as_written(np.array([value]))[0] == float(fixed(value, 3))
