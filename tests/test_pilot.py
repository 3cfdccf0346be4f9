"""Knots of the pilot force against brute force and known polylines; the sidecar and its errors."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.pilot import (
    Knots,
    PilotHeader,
    force_at,
    knot_rows,
    knots_of,
    read_pilot,
    sidecar_text,
    to_pilot_frame,
)
from tests.cells import over_demonstration

CYCLE_S = 0.012
HEADER = PilotHeader("tcp", "index", "$SEN_PINT[1]", 0.04, 123456)


def path_of(time_s, seed=0):
    """An arc length whose speed changes, and stands still for a while."""
    speed = 25.0 * np.clip(1.2 + np.sin(0.7 * time_s + seed), 0.0, 1.5)
    return np.concatenate([[0.0], np.cumsum(speed[1:] * np.diff(time_s))])


def brute_force_error(knots, time_s, path_mm, force_N):
    """Largest distance of the samples to the polyline, the worse of the two ways to draw it."""
    if len(knots) == 0:
        return np.linalg.norm(force_N, axis=1)
    by_time = np.stack([np.interp(time_s, knots.time_s, f) for f in knots.force_N.T], axis=1)
    by_time[(time_s < knots.time_s[0] - 1e-6) | (time_s > knots.time_s[-1] + 1e-6)] = 0.0
    error = np.linalg.norm(force_N - by_time, axis=1)
    for i, (t, s, f) in enumerate(zip(time_s, path_mm, force_N, strict=True)):
        k = np.searchsorted(knots.time_s, t, side="right") - 1
        if 0 <= k < len(knots) - 1 and knots.path_mm[k + 1] - knots.path_mm[k] > 1e-6:
            share = (s - knots.path_mm[k]) / (knots.path_mm[k + 1] - knots.path_mm[k])
            ramp = knots.force_N[k] + np.clip(share, 0, 1) * (knots.force_N[k + 1] - knots.force_N[k])
            error[i] = max(error[i], np.linalg.norm(f - ramp))
    return error


forces = st.tuples(
    st.integers(0, 2**32 - 1), st.integers(1, 200), st.sampled_from([0.0, 1.0, 5.0, 40.0]), st.integers(0, 6)
)


def random_force(seed, count, noise_N, contacts):
    """Smooth forces with noise, in contact now and then."""
    chance = np.random.default_rng(seed)
    time_s = np.arange(count) * CYCLE_S
    knots = np.sort(chance.uniform(0, time_s[-1] + 1e-3, 12))
    values = chance.normal(0, 200, (12, 3))
    force = np.stack([np.interp(time_s, knots, column) for column in values.T], axis=1)
    force += chance.normal(0, noise_N, force.shape)
    edges = chance.integers(0, count + 1, 2 * contacts)
    acting = np.searchsorted(np.sort(edges), np.arange(count), side="right") % 2 == 1
    force[~acting] = 0.0
    return time_s, force


@settings(deadline=None, max_examples=200)
@given(forces, st.sampled_from([None, 0.5, 30.0]))
@example((0, 1, 0.0, 0), None)
def test_no_sample_is_farther_than_the_tolerance(drawn, tolerance_N):
    time_s, force = random_force(*drawn)
    path_mm = path_of(time_s)
    knots = knots_of(time_s, path_mm, force, tolerance_N=tolerance_N)
    error = brute_force_error(knots, time_s, path_mm, force)
    assert error.max(initial=0) <= knots.tolerance_N
    assert knots.max_error_N == pytest.approx(error.max(initial=0), abs=1e-6)
    acting = (force != 0).any(axis=1)
    rms = np.sqrt(np.mean(error[acting] ** 2)) if acting.any() else 0.0
    assert knots.rms_error_N == pytest.approx(rms, abs=1e-6)
    peak = np.linalg.norm(force, axis=1).max(initial=0)
    assert knots.tolerance_N == pytest.approx(tolerance_N or max(10.0, 0.03 * peak))
    assert (np.diff(knots.time_s) >= CYCLE_S - 2e-6).all()
    assert not knots.issues
    assert knots.force_N == pytest.approx(force[np.rint(knots.time_s / CYCLE_S).astype(int)], abs=0.0051)


@settings(deadline=None, max_examples=100)
@given(forces)
def test_contact_and_breakthrough_are_knots(drawn):
    time_s, force = random_force(*drawn)
    knots = knots_of(time_s, path_of(time_s), force)
    rows = np.rint(knots.time_s / CYCLE_S).astype(int).tolist()
    acting = (force != 0).any(axis=1).tolist()
    for row in range(len(acting) - 1):
        if acting[row + 1] and not acting[row]:
            assert row in rows
        if acting[row] and not acting[row + 1]:
            assert row + 1 in rows
    if acting[0]:
        assert rows[0] == 0
    if acting[-1]:
        assert rows[-1] == len(acting) - 1


@settings(deadline=None, max_examples=100)
@given(forces, st.lists(st.integers(0, 199), max_size=10))
def test_changes_of_direction_are_knots_while_a_force_acts(drawn, breaks):
    time_s, force = random_force(*drawn)
    breaks = np.array([row for row in breaks if row < len(time_s)], dtype=np.int64)
    knots = knots_of(time_s, path_of(time_s), force, breaks=breaks, tolerance_N=1e6)
    rows = set(np.rint(knots.time_s / CYCLE_S).astype(int).tolist())
    acting = (force != 0).any(axis=1)
    assert {row for row in breaks.tolist() if acting[row]} <= rows
    edges = np.flatnonzero(np.diff(acting.astype(int)))
    ends = [row for row in (0, len(acting) - 1) if acting[row]]
    assert rows <= {*edges.tolist(), *(edges + 1).tolist(), *breaks.tolist(), *ends}


def test_a_polyline_gives_back_its_own_knots():
    """Between contacts of a slow ramp, a jump and a plateau; the speed is constant, so both ways agree."""
    time_s = np.arange(400) * CYCLE_S
    corners = [50, 120, 121, 300, 301]
    values = np.array([[0, 0, 0], [300, -100, 20], [500, 0, 40], [500, 0, 40], [0, 0, 0]], dtype=float)
    force = np.stack([np.interp(np.arange(400), corners, column, 0, 0) for column in values.T], axis=1)
    knots = knots_of(time_s, 25.0 * time_s, force)
    assert np.rint(knots.time_s / CYCLE_S).astype(int).tolist() == corners
    assert knots.force_N.tolist() == values.tolist()
    assert knots.path_mm == pytest.approx(25.0 * knots.time_s)
    assert knots.max_error_N < 0.01


def test_knots_are_those_of_a_plain_recursion():
    """Ramer-Douglas-Peucker as in the books, where path and time are the same."""
    chance = np.random.default_rng(5)
    time_s = np.arange(300) * CYCLE_S
    force = np.cumsum(chance.normal(0, 8, (300, 3)), axis=0) + 200.0
    kept = set()

    def thin(a, b):
        kept.update((a, b))
        share = ((time_s[a : b + 1] - time_s[a]) / (time_s[b] - time_s[a]))[:, None]
        off = np.linalg.norm(force[a : b + 1] - force[a] - share * (force[b] - force[a]), axis=1)
        at = a + int(off.argmax())
        if off.max() > 20.0 - 0.1:  # what the written decimals need
            thin(a, at)
            thin(at, b)

    thin(0, 299)
    knots = knots_of(time_s, time_s, force, tolerance_N=20.0)
    assert set(np.rint(knots.time_s / CYCLE_S).astype(int).tolist()) == kept


def test_what_changes_within_a_cycle_is_stated():
    """At 4 ms a step of 500 N takes a third of a cycle: the ramp is off by 2/3 of it, which is reported."""
    time_s = np.arange(300) * 0.004
    force = np.zeros((300, 3))
    force[100:200, 0] = 500.0
    knots = knots_of(time_s, 25.0 * time_s, force, line=np.full(300, 17, dtype=np.int32))
    assert (np.diff(knots.time_s) >= CYCLE_S - 2e-6).all()
    assert knots.max_error_N == pytest.approx(500 * 2 / 3, abs=0.01)
    (issue,) = knots.issues
    assert (issue.code, issue.line, issue.severity) == ("pilot-cycle", 17, "warning")
    assert "333 N" in issue.message
    assert force_at(knots, time_s[150:151])[0, 0] == 500.0


def test_a_blip_shorter_than_a_cycle():
    time_s = np.arange(300) * 0.004
    force = np.zeros((300, 3))
    force[100, 0], force[101, 0] = 50.0, 400.0
    force[150:200, 0] = 100.0
    knots = knots_of(time_s, 25.0 * time_s, force)
    assert (np.diff(knots.time_s) >= CYCLE_S - 2e-6).all()
    assert [issue.code for issue in knots.issues] == ["pilot-cycle"]
    assert knots.max_error_N >= 100.0


def test_no_force_no_knots():
    time_s = np.arange(50) * CYCLE_S
    knots = knots_of(time_s, time_s, np.zeros((50, 3)))
    assert len(knots) == 0
    assert knots.max_error_N == knots.rms_error_N == 0.0
    assert force_at(knots, time_s).tolist() == np.zeros((50, 3)).tolist()


def test_a_long_program():
    """A million samples with a knot every few of them."""
    chance = np.random.default_rng(1)
    time_s = np.arange(1_000_000) * CYCLE_S
    force = chance.normal(0, 20, (1_000_000, 3)) + 300.0
    force[np.sin(time_s) < -0.5] = 0.0
    knots = knots_of(time_s, 25 * time_s, force)
    assert len(knots) > 100_000
    by_time = np.linalg.norm(force - force_at(knots, time_s), axis=1)
    assert by_time.max() <= knots.tolerance_N
    assert (np.diff(knots.time_s) >= CYCLE_S - 2e-6).all()


# --- frame ----------------------------------------------------------------------------------------------


def test_forces_are_turned_into_the_tool():
    chance = np.random.default_rng(2)
    turns = Rotation.random(20, random_state=3)
    vectors, tool = chance.normal(0, 100, (20, 3)), np.ones(20, dtype=np.int32)
    found = to_pilot_frame(vectors, turns.as_quat(), tool, over_demonstration())
    assert found == pytest.approx(turns.inv().apply(vectors))
    one = to_pilot_frame(
        vectors,
        np.broadcast_to(turns[4].as_quat(), (20, 4)),
        tool,
        over_demonstration(),
    )
    assert one == pytest.approx(turns[4].inv().apply(vectors))
    base = to_pilot_frame(
        vectors,
        turns.as_quat(),
        tool,
        over_demonstration({"pilot": {"frame": "base"}}),
    )
    assert base.tolist() == vectors.tolist()


def test_tcp_is_the_tool_as_the_controller_has_it():
    """With x from tip to holder, a force along the inner z is one along x."""
    frame = {"x_mm": 100.0, "y_mm": 0.0, "z_mm": 200.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0}
    cell = over_demonstration({"tool": {"2": {"axis": "+x", "frame": frame}}})
    rotation = np.tile([0.0, 0.0, 0.0, 1.0], (2, 1))
    found = to_pilot_frame(np.array([[0, 0, 9.0], [0, 0, 9.0]]), rotation, np.array([1, 2]), cell)
    assert found == pytest.approx(np.array([[0, 0, 9.0], [9.0, 0, 0]]))


# --- sidecar --------------------------------------------------------------------------------------------


def some_knots(count=5, bent=True) -> Knots:
    time_s = np.arange(300) * CYCLE_S
    force = np.zeros((300, 3))
    force[40:250] = 100.0 * np.sin(np.arange(210) / 20)[:, None] + np.array([200.0, -5.0, 0.25])
    deflection = force / 500.0 if bent else None
    knots = knots_of(time_s, path_of(time_s), force, deflection, line=np.arange(300, dtype=np.int32))
    return replace(knots, lead_s=np.round(0.04 + 0.001 * np.arange(len(knots)), 4))


@pytest.mark.parametrize("bent", [True, False])
def test_what_is_written_is_read(tmp_path, bent):
    knots = some_knots(bent=bent)
    file = tmp_path / "part.pilot.csv"
    file.write_bytes(sidecar_text(knots, HEADER))
    found, header = read_pilot(file)
    assert header == HEADER
    for name in ("line", "path_mm", "time_s", "lead_s", "force_N", "deflection_mm"):
        assert np.array_equal(getattr(found, name), getattr(knots, name), equal_nan=True), name
    assert knot_rows(found) == knot_rows(knots)


def test_first_lines_of_a_sidecar(tmp_path):
    lines = sidecar_text(some_knots(), HEADER).decode("ascii").split("\n")
    assert lines[0] == (
        "# gcode2krl/pilot/1 frame=tcp sign=on-tool form=index variable=$SEN_PINT[1] lead_s=0.040 "
        "checksum=123456"
    )
    assert lines[1] == "knot,line,s_mm,time_s,lead_s,fx_N,fy_N,fz_N,dx_mm,dy_mm,dz_mm"
    assert lines[2].startswith("0,39,")
    assert lines[2].endswith(",0.468000,0.0400,0.00,0.00,0.00,0.00000,0.00000,0.00000")
    assert "-0.00," not in "\n".join(lines)
    assert lines[-1] == ""


def cell_of(row, column, word):
    """Return an edit of one word of the table."""

    def edit(lines):
        words = lines[row - 1].split(",")
        words[column] = word
        lines[row - 1] = ",".join(words)

    return edit


def head(old, new):
    """Return an edit of the first line."""

    def edit(lines):
        assert old in lines[0]
        lines[0] = lines[0].replace(old, new)

    return edit


BAD = {
    "empty": (lambda lines: lines.clear(), 1, "gcode2krl/pilot/1"),
    "another version": (head("pilot/1", "pilot/2"), 1, "pilot/2"),
    "no checksum": (head(" checksum=123456", ""), 1, "checksum= is missing"),
    "checksum of 32 bits": (head("123456", "2147483648"), 1, "2147483647"),
    "frame": (head("=tcp", "=flange"), 1, "tcp or base"),
    "sign": (head("=on-tool", "=on-part"), 1, "on-part"),
    "form": (head("=index", "=word"), 1, "index or values"),
    "lead": (head("0.040", "0.000"), 1, "above 0"),
    "columns": (cell_of(2, 5, "fx_kN"), 2, "fx_kN"),
    "a column less": (lambda lines: lines.__setitem__(4, lines[4].rsplit(",", 1)[0]), 5, "10 columns"),
    "comma for point": (cell_of(5, 5, "1,5"), 5, "12 columns"),
    "a word": (cell_of(5, 6, "much"), 5, "column fy_N: 'much'"),
    "empty force": (cell_of(5, 7, ""), 5, "column fz_N: ''"),
    "infinite": (cell_of(5, 7, "inf"), 5, "column fz_N: 'inf'"),
    "no lead": (cell_of(6, 4, ""), 6, "column lead_s"),
    "knot out of order": (cell_of(6, 0, "9"), 6, "column knot: found 9"),
    "knots from 1": (lambda lines: lines.pop(2), 3, "column knot: found 1"),
    "time falls": (cell_of(6, 3, "0.001"), 6, "column time_s: found 0.001"),
    "path falls": (cell_of(6, 2, "-1.0"), 6, "column s_mm"),
    "half a line": (cell_of(6, 1, "3.5"), 6, "column line: found 3.5"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_sidecar(tmp_path, name):
    edit, row, words = BAD[name]
    lines = sidecar_text(some_knots(), HEADER).decode("ascii").splitlines()
    edit(lines)
    file = tmp_path / "part.pilot.csv"
    file.write_text("".join(line + "\n" for line in lines), encoding="utf-8")
    with pytest.raises(NotUnderstoodError) as raised:
        read_pilot(file)
    text = str(raised.value)
    assert words in text
    assert f"row {row}" in text
    assert str(file) in text
    assert "write the program again" in text


def test_sidecar_that_cannot_be_read(tmp_path):
    with pytest.raises(NotUnderstoodError, match="file-unreadable"):
        read_pilot(tmp_path / "none.pilot.csv")
    binary = tmp_path / "binary.pilot.csv"
    binary.write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(NotUnderstoodError, match="not a text file"):
        read_pilot(binary)


def test_sidecar_from_another_system(tmp_path):
    """A byte-order mark and CRLF change nothing."""
    file = tmp_path / "part.pilot.csv"
    text = sidecar_text(some_knots(), HEADER)
    file.write_bytes(b"\xef\xbb\xbf" + text.replace(b"\n", b"\r\n"))
    found, header = read_pilot(file)
    assert header == HEADER
    assert knot_rows(found) == knot_rows(some_knots())
