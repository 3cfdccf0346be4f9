"""The pilot is used when it matches, and in no cycle of a hundred cases in which it does not."""

import numpy as np
import pytest

from gcode2krl.cell.sections.online import Online
from gcode2krl.online.pilot_gate import Announced, Gate, PilotTable, estimate, gate_start

SETTINGS = Online()
DT_S = 0.004
KNOT_S = np.array([1.0, 1.1, 1.35, 3.0, 3.05, 3.2, 5.0, 5.3, 7.0])
FORCE_N = np.array(
    [
        [0, 0, 0],
        [150, 0, 0],
        [500, 0, 0],
        [500, 0, 0],
        [200, 0, 0],
        [0, 0, 0],
        [0, 0, 0],
        [300, 10, 5],
        [0, 0, 0.0],
    ]
)
TABLE = PilotTable(KNOT_S, np.full(len(KNOT_S), 0.04), FORCE_N, 4711)


def run_of(scale=1.0, seconds=8.0, table=TABLE):
    """Return time, positions at 25 mm/s and what is told of a program that runs at some speed."""
    time_s = np.arange(0.0, seconds, DT_S)
    position = np.zeros((len(time_s), 3))
    position[:, 0] = 25.0 * scale * time_s
    knot = np.searchsorted((table.time_s - table.lead_s) / scale, time_s, side="right") - 1.0
    full = np.ones(len(time_s))
    return time_s, position, Announced(knot, 4711 * full, 100 * full, 0 * full)


def used(time_s, position, told, table=TABLE, settings=SETTINGS):
    _, force, known, reason = estimate(gate_start(), time_s, position, told, table, settings)
    return force, known, reason


def test_a_run_that_fits_opens_the_gate_and_gives_the_force_ahead_of_time():
    time_s, position, told = run_of()
    force, known, reason = used(time_s, position, told)
    proven = np.argmax(known)
    assert reason[proven - 1] == Gate.UNPROVEN
    assert time_s[proven] < 3.0
    after = slice(proven, None)
    assert known[after].all()
    exact = np.stack([np.interp(time_s + 0.04, KNOT_S, c, left=0, right=0) for c in FORCE_N.T], axis=1)
    assert np.abs(force[after] - exact[after]).max() < 0.03 * 4.0 / 40.0 * 500.0 * 3  # of a 4 ms tick


@pytest.mark.parametrize("scale", [0.97, 0.98, 1.02, 1.03])
def test_a_robot_within_5_percent_of_the_speed_is_followed(scale):
    time_s, position, told = run_of(scale)
    force, known, _ = used(time_s, position, told)
    assert known[-1]
    exact = np.interp((time_s + 0.04) * scale, KNOT_S, FORCE_N[:, 0], left=0, right=0)
    off_s = np.abs(force[known, 0] - exact[known])
    assert off_s.max() < 200.0  # at the steepest slope, 6 N a ms, that is 33 ms
    assert off_s.mean() < 10.0


def test_knots_are_not_run_ahead_of_their_announcement():
    time_s, position, told = run_of()
    stopped = told._replace(knot=np.minimum(told.knot, 3.0))  # later knots are never announced
    force, known, _ = used(time_s, position, stopped)
    assert force[known][-1, 0] == pytest.approx(200.0)


def test_a_pause_closes_the_gate_until_the_next_knot():
    time_s, position, told = run_of()
    cut = int(4.0 / DT_S)
    pause = 250
    position = np.insert(position, cut, np.repeat(position[cut][None], pause, axis=0), axis=0)
    told = Announced(*(np.insert(column, cut, np.full(pause, column[cut])) for column in told))
    time_s = DT_S * np.arange(len(position))
    _, known, reason = used(time_s, position, told)
    assert reason[cut + pause - 1] == Gate.STANDS
    assert not known[cut + 50 : cut + pause].any()
    assert known[int(5.2 / DT_S) + pause]


def test_a_dozen_values_that_are_missing_close_it():
    time_s, position, told = run_of()
    for name in Announced._fields:
        nothing = told._replace(**{name: np.full(len(time_s), np.nan)})
        assert not used(time_s, position, nothing)[1].any()


def wrong_cases():
    """Yield 100 runs that do not fit: (name, time, position, told, table)."""
    rng = np.random.default_rng(7)
    time_s, position, told = run_of()
    count = len(time_s)
    for _ in range(20):
        other = float(rng.integers(0, 2**31))
        yield "checksum", time_s, position, told._replace(checksum=np.full(count, other)), TABLE
    for percent in (1, 3, 10, 25, 30, 50, 75, 90, 94, 99, 99.5, 101, 105, 110, 150, 200, 0, -1, 1e9, np.inf):
        yield "override", time_s, position, told._replace(override_percent=np.full(count, percent)), TABLE
    for value in (1.0, 2.0, -1.0, np.nan, 0.5):
        yield "mode", time_s, position, told._replace(t1=np.full(count, value)), TABLE
    for scale in (0.1, 0.3, 0.5, 0.7, 0.8, 0.85, 0.9, 0.91, 1.09, 1.1, 1.15, 1.2, 1.5, 2.0, 3.0):
        yield "speed", *run_of(scale, 8.0 / scale), TABLE
    for start in range(1, 9):  # block selection: the program begins at a later knot
        late = np.where(told.knot < start, start, told.knot)
        yield "selected", time_s, position, told._replace(knot=late), TABLE
    for start in range(1, 9):  # ... or jumps there from its start
        jump = np.where((told.knot >= 0) & (told.knot < start), -1.0, told.knot)
        yield "jumped", time_s, position, told._replace(knot=jump), TABLE
    for _ in range(8):
        back = told.knot.copy()
        back[int(rng.integers(260, 320)) :] -= 1.0
        yield "back", time_s, position, told._replace(knot=back), TABLE
    for skipped in (1, 2):
        for lost in range(4):
            skips = np.where(told.knot >= lost, told.knot + skipped, told.knot)
            yield "order", time_s, position, told._replace(knot=skips), TABLE
    for _ in range(8):  # the sidecar of another part of the same length
        times = np.sort(rng.uniform(0.5, 7.0, len(KNOT_S)))
        yield "sidecar", time_s, position, told, TABLE._replace(time_s=times, checksum=4712)


def test_there_are_100_cases_and_none_has_a_cycle_with_the_pilot():
    cases = list(wrong_cases())
    assert len(cases) == 100
    for name, time_s, position, told, table in cases:
        _, known, _ = used(time_s, position, told, table)
        assert not known.any(), name


def test_an_override_that_is_turned_down_closes_it_until_the_next_start():
    time_s, position, told = run_of()
    override = told.override_percent.copy()
    override[1000:1010] = 50.0
    _, known, reason = used(time_s, position, told._replace(override_percent=override))
    assert known[999]
    assert not known[1000:].any()
    assert (reason[1000:] == Gate.OVERRIDE).all()


def test_cut_anywhere_it_is_the_same():
    time_s, position, told = run_of()
    force, known, reason = used(time_s, position, told)
    state, found = gate_start(), []
    for a, b in ((0, 1), (1, 400), (400, 401), (401, len(time_s))):
        part = Announced(*(column[a:b] for column in told))
        state, *out = estimate(state, time_s[a:b], position[a:b], part, TABLE, SETTINGS)
        found.append(out)
    for whole, parts in zip((force, known, reason), zip(*found, strict=True), strict=True):
        assert np.array_equal(np.concatenate(parts), whole)


def test_without_a_sidecar_there_is_no_pilot():
    time_s, position, told = run_of()
    nothing = PilotTable(np.zeros(0), np.zeros(0), np.zeros((0, 3)), -1)
    _, known, reason = used(time_s, position, told, nothing)
    assert not known.any()
    assert (reason == Gate.NO_PILOT).all()


@pytest.mark.parametrize("lead_s", [0.0, 0.02, 0.06])
def test_the_lead_is_the_settings(lead_s):
    time_s, position, told = run_of()
    own = SETTINGS.model_copy(update={"lead_s": lead_s})
    force, known, _ = used(time_s, position, told, settings=own)
    at = known & (time_s > 5.05) & (time_s < 5.2)
    exact = np.interp(time_s + lead_s, KNOT_S, FORCE_N[:, 0])
    assert np.abs(force[at, 0] - exact[at]).max() < 5.0


def test_a_knot_that_is_skipped_later_closes_it_then():
    time_s, position, told = run_of()
    skips = np.where(told.knot >= 6, told.knot + 1, told.knot)
    _, known, reason = used(time_s, position, told._replace(knot=skips))
    at = np.argmax(told.knot >= 6)
    assert known[at - 1]
    assert not known[at:].any()
    assert (reason[at:] == Gate.ORDER).all()


def test_a_sidecar_of_another_revision_is_not_read(tmp_path):
    from gcode2krl.errors import NotUnderstoodError
    from gcode2krl.pilot import read_pilot

    for first in ("# gcode2krl/pilot/2", "# gcode2krl/pilot/0", "# other/pilot/1", ""):
        file = tmp_path / "part.pilot.csv"
        file.write_text(f"{first} frame=tcp sign=on-tool form=index variable=x lead_s=0.04 checksum=1\n")
        with pytest.raises(NotUnderstoodError):
            read_pilot(file)
