"""Programs with a pilot force: carried out by an independent replay (`pilot_replay`), and verified."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from gcode2krl import load_cell, plan_motion, read_gcode, write_krl
from gcode2krl.errors import RefusedError
from gcode2krl.pilot import force_at, read_pilot
from tests.cells import over_demonstration
from tests.conftest import EXAMPLES as ALL_EXAMPLES
from tests.conftest import draws
from tests.krl.conftest import read, verified
from tests.krl.forces import cutting_below, moved, with_forces
from tests.krl.pilot_replay import breaks_of_blending, fire, halts_of, most_waiting
from tests.krl.replay import read_program

pytestmark = pytest.mark.slow

EXAMPLES = [part for part in ALL_EXAMPLES if part.stem != "raster_finish"]  # thousands of lines
HEAD = "G21 G90 G17 G54 G64\nT1 M6\nS9000 M3\nG0 G43 H1 Z20\nG0 X0 Y0\nG0 Z2\n"
FOOT = "G0 Z20\nM30\n"
CYCLE_S, LEAD_S, REPLAY_S = 0.012, 0.040, 0.002
IN_VIEW = 5
"""Motions whose triggers have been read at the default $ADVANCE of 3: this one, 3 more, what stands before
the next."""


def predicted(body, data=None):
    """Predict a part that begins above the work at (0, 0, 2)."""
    cell = over_demonstration(data) if data else load_cell()
    return moved(read(HEAD + body + FOOT, cell), cell)


def force_by_time(prediction, points):
    """Return forces (m, 3) along x through (time, newton); zero elsewhere."""
    time_s, force = np.array(points, dtype=float).T
    motion_s = prediction.motion.time_s
    result = np.zeros((len(motion_s), 3))
    result[:, 0] = np.interp(motion_s, time_s, force, 0, 0)
    return result


class Written:
    """A program with a pilot force, and what the replay finds in it."""

    def __init__(self, folder, prediction, force, **options):
        self.prediction = with_forces(prediction, force)
        self.src = folder / "part.src"
        self.program = write_krl(self.prediction, self.src, **options)
        self.cell = prediction.cell
        self.knots, self.header = read_pilot(folder / "part.pilot.csv")
        self.fired = fire(self.src, prediction.targets, self.cell)
        self.lead_s = self.knots.time_s - self.fired.time_s
        self.codes = {issue.code for issue in self.program.issues if issue.severity == "warning"}

    @property
    def text(self):
        return self.src.read_text("ascii")


@pytest.fixture
def make(tmp_path):
    return lambda prediction, force, **options: Written(tmp_path, prediction, force, **options)


def check(made, in_view=IN_VIEW):
    """What holds for every program."""
    knots, fired, pilot = made.knots, made.fired, made.program.pilot
    assert len(fired.motion) == len(knots) == pilot.knots
    assert (np.abs(made.lead_s - knots.lead_s) < REPLAY_S).all()
    assert (fired.time_s <= fired.end_s + REPLAY_S).all()
    assert (np.diff(fired.time_s) >= CYCLE_S - REPLAY_S).all()
    assert (np.diff(knots.time_s) >= CYCLE_S - 2e-6).all()
    assert most_waiting(fired.motion, in_view, halts_of(made.src)) <= 8
    assert pilot.max_active <= 8
    assert pilot.min_lead_s == pytest.approx(made.lead_s.min(), abs=REPLAY_S)
    assert breaks_of_blending(made.src) == []
    motion = made.prediction.motion
    force = made.prediction.forces.force_base_N  # the tool frame of 3 axes at spin 0 is that of $BASE
    off = np.linalg.norm(force - force_at(knots, motion.time_s), axis=1)
    assert off.max() <= pilot.max_error_N + 1e-6
    assert pilot.max_error_N <= pilot.tolerance_N or "pilot-cycle" in made.codes
    assert pilot.rms_error_N <= pilot.max_error_N + 1e-9
    report = verified(made.src, made.prediction.toolpath, made.cell, prediction=made.prediction)
    assert report.ok, [issue.text() for issue in report.issues]
    assert report.pilot.knots == pilot.knots
    assert report.pilot.max_active == pilot.max_active
    assert report.pilot.min_lead_s == pytest.approx(pilot.min_lead_s, abs=1e-3)
    assert report.pilot.max_error_N == pytest.approx(off.max(), abs=1e-6)


# --- the examples ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=EXAMPLES, ids=lambda part: part.stem)
def example(request):
    prediction = moved(read_gcode(request.param, load_cell()), load_cell())
    return SimpleNamespace(prediction=prediction, name=request.param.stem)


@pytest.mark.parametrize(("form", "ramp_s"), [("index", 0.3), ("values", 0.0)])
def test_examples(example, tmp_path, form, ramp_s):
    """Cuts along the feed that begin with a step or like a square root; the direction turns in corners."""
    made = Written(tmp_path, example.prediction, cutting_below(example.prediction, ramp_s=ramp_s), pilot=form)
    assert len(made.knots) > 100
    assert made.codes <= {"program-large", "short-moves"}
    check(made)
    assert made.lead_s.min() >= LEAD_S
    peak = np.linalg.norm(made.prediction.forces.force_base_N, axis=1).max()
    assert made.program.pilot.tolerance_N == pytest.approx(max(10.0, 0.03 * peak))
    assert made.program.pilot.max_error_N <= max(10.0, 0.03 * peak)
    lines = made.prediction.toolpath.source_line.tolist()
    assert set(made.knots.line.tolist()) <= set(lines)


def test_numbers_count_up_from_zero(example, tmp_path):
    made = Written(tmp_path, example.prediction, cutting_below(example.prediction))
    assert set(made.fired.variable) == {"$SEN_PINT[1]"}
    assert [number for (number,) in made.fired.numbers] == list(range(len(made.knots)))


# --- few knots at known instants -------------------------------------------------------------------------


def test_trigger_of_a_long_line(make):
    """100 mm at 50 mm/s: contact begins a second after the plunge has ended."""
    prediction = predicted("G1 Z-1 F3000\nG1 X100\n")
    motion = prediction.motion
    start_s = float(motion.time_s[np.flatnonzero(motion.position_mm[:, 0] > 0)[0]])
    contact_s = round((start_s + 1.0) / CYCLE_S) * CYCLE_S
    force = force_by_time(prediction, [(contact_s, 0), (contact_s + 0.12, 300), (contact_s + 0.36, 0)])
    made = make(prediction, force)
    check(made)
    assert made.knots.time_s == pytest.approx([contact_s, contact_s + 0.12, contact_s + 0.36])
    assert made.knots.force_N[:, 0].tolist() == [0.0, 300.0, 0.0]
    assert made.lead_s == pytest.approx(np.full(3, LEAD_S + 0.0025), abs=0.0015)
    assert made.knots.line.tolist() == [8, 8, 8]
    lines = made.text.splitlines()
    triggers = [k for k, line in enumerate(lines) if line.startswith("TRIGGER")]
    assert triggers == list(range(triggers[0], triggers[0] + 3))
    assert lines[triggers[-1] + 1].startswith("LIN {X 100.000,")
    assert re.fullmatch(r"TRIGGER WHEN DISTANCE=0 DELAY=\d+ DO \$SEN_PINT\[1\]=0", lines[triggers[0]])


def test_values_tell_the_next_knot_before_its_ramp_begins(make):
    prediction = predicted("G1 Z-1 F3000\nG1 X100\n")
    force = force_by_time(prediction, [(1.2, 0), (1.5, 300), (1.8, 280), (2.1, 0)])
    made = make(prediction, force, pilot="values")
    check(made)
    assert made.fired.variable == ("GK_PILOT",) * len(made.knots)
    for knot, (x, y, z, seconds) in enumerate(made.fired.numbers):
        assert [x, y, z] == made.knots.force_N[knot].tolist()
        assert made.fired.time_s[knot] + seconds == pytest.approx(made.knots.time_s[knot], abs=REPLAY_S)
    ramp_begins_s = made.knots.time_s[:-1]
    assert (ramp_begins_s - made.fired.time_s[1:] >= LEAD_S).all()
    assert made.lead_s[0] >= LEAD_S
    text = made.text
    assert text.count("DEF GK_PILOT(GK_X:IN,GK_Y:IN,GK_Z:IN,GK_T:IN)\n") == 1
    assert "$SEN_PREA[4]=GK_T\n" in text
    assert text.index("$SEN_PREA[1]=0.0") < text.index("PTP {A1")
    assert "EXT GK_PILOT" not in text


def test_a_receiver_of_values_follows_the_polyline(make):
    """Ramps to what the triggers say, from where it stands; nothing else is known to it."""
    prediction = predicted("G1 Z-1 F3000\nG1 X100\nG1 Y30\nG1 X40\n")
    points = [(1.2, 0), (1.25, 250), (1.4, 300), (2.6, 280), (2.62, 400), (3.2, 90), (3.3, 0)]
    made = make(prediction, force_by_time(prediction, points), pilot="values")
    check(made)
    fired = made.fired
    told = [(t, np.array(n[:3]), t + n[3]) for t, n in zip(fired.time_s, fired.numbers, strict=True)]
    value, since, queue = np.zeros(3), 0.0, []
    worst = 0.0
    for now in np.arange(0, 4, 0.001):
        while told and told[0][0] <= now:
            queue.append(told.pop(0)[1:])
        while queue and queue[0][1] <= now:
            value, since = queue.pop(0)
        ramp = value
        if queue:
            target, until = queue[0]
            ramp = value + (target - value) * (now - since) / (until - since)
        slope = 150 / 0.02  # of the steepest ramp, N/s
        worst = max(worst, abs(ramp[0] - np.interp(now, *np.array(points).T)) - slope * REPLAY_S)
    assert worst <= made.program.pilot.tolerance_N


def test_instants_in_a_corner_move_before_it(make):
    """A wide corner takes 0.2 s; knots in its middle are announced where it begins."""
    prediction = predicted("G1 Z-1 F600\nG64 P2\nG1 X60 F3000\nG1 Y60\n")
    motion = prediction.motion
    corner_s = motion.time_s[motion.corner & (motion.position_mm[:, 0] > 40)]
    middle_s = round(corner_s.mean() / CYCLE_S) * CYCLE_S
    points = [(middle_s, 0), (middle_s + 0.024, 200), (middle_s + 0.6, 200), (middle_s + 0.7, 0)]
    made = make(prediction, force_by_time(prediction, points))
    check(made)
    assert np.ptp(corner_s) > 0.15
    assert made.fired.time_s[:2].max() <= corner_s[0] + CYCLE_S
    assert made.lead_s.min() >= LEAD_S
    assert made.lead_s[0] == pytest.approx(middle_s - corner_s[0], abs=0.05)


def test_a_cut_that_begins_with_the_program(make):
    """Nothing moves before; the first knots are announced one cycle after the other and say their lead."""
    prediction = predicted("G1 Z-1 F600\nG1 X60\n")
    force = np.full((len(prediction.motion), 3), 100.0)
    made = make(prediction, force)
    check(made)
    assert made.codes == {"pilot-lead"}
    assert made.knots.time_s[0] == 0.0
    assert made.lead_s[0] == pytest.approx(0.0, abs=REPLAY_S)
    issue = next(issue for issue in made.program.issues if issue.code == "pilot-lead")
    assert "less than 0.040 s ahead" in issue.message
    assert made.program.pilot.min_lead_s == pytest.approx(0.0, abs=REPLAY_S)
    first = made.fired.motion[0]
    assert read_program(made.src).motions[first].kind == "LIN"


@pytest.mark.parametrize("word", ["M8", "M0", "M3 S9500"])
def test_no_announcement_across_a_standstill_of_unknown_length(make, word):
    """After an M-code in the cut the knots are announced once the robot moves again."""
    prediction = predicted(f"G1 Z-1 F600\nG1 X60\n{word}\nG1 X90\n")
    motion = prediction.motion
    again_s = float(motion.time_s[np.flatnonzero(motion.position_mm[:, 0] > 60.0 + 1e-6)[0]]) - CYCLE_S
    points = [(1, 0), (1.2, 200), (again_s, 200), (again_s + 0.024, 300), (again_s + 0.6, 0)]
    made = make(prediction, force_by_time(prediction, points))
    check(made)
    later = made.knots.time_s > again_s + 1e-3
    assert later.sum() >= 2
    targets = made.program.targets
    stop = max(event.row for event in targets.events if event.values["line"] == 9)
    assert (made.fired.motion[later] > stop).all()
    assert (made.fired.motion[~later] <= stop + 1).all()
    assert made.codes - {"stop-in-cut"} == {"pilot-lead"}


def test_a_dwell_is_known_time(make):
    prediction = predicted("G1 Z-1 F600\nG1 X60\nG4 P0.5\nG1 X90\n")
    motion = prediction.motion
    again_s = float(motion.time_s[np.flatnonzero(motion.position_mm[:, 0] > 60.0 + 1e-6)[0]])
    points = [(1, 0), (1.2, 200), (again_s, 200), (again_s + 0.024, 300), (again_s + 0.6, 0)]
    made = make(prediction, force_by_time(prediction, points))
    check(made)
    assert made.lead_s.min() >= LEAD_S
    assert made.codes == set()


def test_the_force_behind_a_long_dwell_is_announced_before_it(make):
    prediction = predicted("G1 Z-1 F600\nG1 X60\nG4 P2\nG4 P1.5\nG1 X90\n")
    motion = prediction.motion
    stands = np.flatnonzero(motion.speed_mm_s == 0)
    stands = stands[np.abs(motion.position_mm[stands, 0] - 60.0) < 0.1]
    rests_s, again_s = (float(motion.time_s[stands[k]]) for k in (0, -1))
    assert again_s - rests_s > 3.4
    dense = [(rests_s - 1.0 + 0.02 * k, 200.0 * (k % 2)) for k in range(30)]
    points = [*dense, (rests_s - 0.012, 200), (rests_s, 0), (again_s, 0), (again_s + 0.012, 300)]
    made = make(prediction, force_by_time(prediction, [*points, (again_s + 0.6, 0)]))
    check(made)
    assert made.lead_s.min() >= LEAD_S
    assert made.lead_s.max() == pytest.approx(again_s - rests_s, abs=0.1)
    assert made.codes <= {"pilot-tolerance"}


# --- many knots in few motions --------------------------------------------------------------------------


def sawtooth(prediction, step_s, from_s=1.0, force_N=400.0, until_s=None):
    """A force that falls and rises, with a knot every ``step_s``."""
    end_s = until_s or float(prediction.motion.time_s[-1]) - 1.2
    time_s = np.arange(from_s, end_s, step_s)
    values = force_N * (1.0 + 0.5 * (np.arange(len(time_s)) % 2))
    values[[0, -1]] = 0.0
    return force_by_time(prediction, np.column_stack([time_s, values]))


@pytest.mark.parametrize("form", ["index", "values"])
@pytest.mark.parametrize("step_s", [0.048, 0.12, 0.48])
def test_long_line_is_cut_into_collinear_pieces(make, form, step_s):
    """400 mm at 25 mm/s take 16 s; the pieces are blended and change nothing of the motion."""
    prediction = predicted("G1 Z-1 F600\nG1 X300 F1500\nG1 Y10\n")
    made = make(prediction, sawtooth(prediction, step_s, 2.4), pilot=form)
    check(made)
    assert made.lead_s.min() >= LEAD_S
    assert made.codes == set()
    pieces = [m for m in read_program(made.src).motions if m.kind == "LIN" and 0 < m.values["X"] < 300]
    knots_on_line = np.count_nonzero(made.knots.line == 8)
    assert (knots_on_line - 8) * IN_VIEW / 8 - IN_VIEW <= len(pieces) <= knots_on_line * IN_VIEW / 6
    for piece in pieces:
        assert piece.blend
        assert piece.cdis_mm > 0
        assert piece.values["Y"] == 0.0
        assert piece.values["Z"] == -1.0
        assert piece.speed_m_s == 0.025
    same = plan_motion(made.program.targets, made.cell)
    assert len(same) == len(prediction.motion)
    assert np.abs(same.position_mm - prediction.motion.position_mm).max() < 0.02
    assert same.time_s[-1] == pytest.approx(prediction.motion.time_s[-1], abs=0.006)
    own = made.program.targets.move >= 0
    assert np.array_equal(
        made.program.targets.position_mm[own],
        prediction.targets.position_mm[prediction.targets.move >= 0],
    )


def test_short_chained_moves(make):
    """Moves of 0.6 mm and knots every 48 ms: triggers sit before many of them, none is added."""
    body = "".join(f"G1 X{0.6 * k:.1f} Y{0.02 * (k % 2):.2f}\n" for k in range(1, 300))
    prediction = predicted(f"G1 Z-1 F1500\n{body}", {"controller": {"advance": "unlimited"}})
    made = make(prediction, sawtooth(prediction, 0.048))
    check(made, in_view=7)
    assert len(made.knots) > 100
    assert len(set(made.fired.motion.tolist())) > 80
    assert made.lead_s.min() >= LEAD_S


def test_a_burst_is_announced_earlier_where_motions_are_too_short_to_be_cut(make):
    """14 knots in 0.26 s on moves of a millimetre."""
    body = "".join(f"G1 X{1.0 * k:.1f} Y{0.2 * (k % 2):.1f}\n" for k in range(1, 120))
    prediction = predicted(f"G1 Z-1 F1500\n{body}")
    middle_s = float(prediction.motion.time_s[-1]) / 2
    made = make(prediction, sawtooth(prediction, 0.02, middle_s, until_s=middle_s + 0.28))
    check(made)
    assert made.codes == set()
    assert LEAD_S + 0.05 < made.lead_s.max() < 1.0
    assert made.lead_s.min() >= LEAD_S


def test_fewer_active_triggers_on_request(make):
    prediction = predicted("G1 Z-1 F600\nG1 X300 F1500\n", {"pilot": {"max_active": 3}})
    made = make(prediction, sawtooth(prediction, 0.24, 2.4))
    check(made)
    assert made.program.pilot.max_active <= 3
    assert most_waiting(made.fired.motion, IN_VIEW, halts_of(made.src)) <= 3


def test_without_look_ahead_every_end_is_a_stop_and_nothing_is_cut(make):
    prediction = predicted("G1 Z-1 F600\nG1 X300 F1500\n", {"controller": {"advance": 0}})
    made = make(prediction, sawtooth(prediction, 1.8, 2.4))
    check(made, in_view=1)
    assert len(made.program.targets) == len(prediction.targets)
    with pytest.raises(RefusedError, match="pilot-dense"):
        make(prediction, sawtooth(prediction, 0.24, 2.4), pilot="index")


def noisy(prediction, sigma_N=60.0):
    force = np.random.default_rng(0).normal(300.0, sigma_N, (len(prediction.motion), 3))
    force[prediction.motion.position_mm[:, 2] > 0] = 0.0
    return force


def test_default_tolerance_gives_way_and_says_so(make):
    """Noise wants a knot every cycle on short moves: too many. A stated tolerance is kept, or nothing is."""
    body = "".join(f"G1 X{1.2 * k:.1f} Y{0.3 * (k % 2):.1f}\n" for k in range(1, 60))
    prediction = predicted(f"G1 Z-1 F1500\n{body}")
    made = make(prediction, noisy(prediction, 12.0))
    check(made)
    assert "pilot-tolerance" in made.codes
    peak = np.linalg.norm(made.prediction.forces.force_base_N, axis=1).max()
    assert 0.03 * peak < made.program.pilot.tolerance_N <= 0.15 * peak


@pytest.mark.parametrize(("sigma_N", "stated"), [(100.0, None), (12.0, 15.0)])
def test_too_many_knots_are_refused_and_nothing_is_written(tmp_path, sigma_N, stated):
    body = "".join(f"G1 X{1.2 * k:.1f} Y{0.3 * (k % 2):.1f}\n" for k in range(1, 60))
    data = {"pilot": {"tolerance_N": stated}} if stated else {}
    prediction = predicted(f"G1 Z-1 F1500\n{body}", data)
    forced = with_forces(prediction, noisy(prediction, sigma_N))
    with pytest.raises(RefusedError, match=r"pilot-(dense|slows)") as refused:
        write_krl(forced, tmp_path / "part.src", pilot="index")
    assert "--pilot none" in str(refused.value)
    assert list(tmp_path.iterdir()) == []


# --- many programs --------------------------------------------------------------------------------------


def random_body(chance):
    """Moves of 0.1 to 50 mm at 200 to 6000 mm/min, with stops, dwells and M-codes now and then."""
    lines, here = [f"G1 Z-1 F{chance.integers(300, 1500)}"], np.zeros(2)
    for _ in range(chance.integers(3, 14)):
        here = np.clip(here + chance.normal(0, 10 ** chance.uniform(-0.5, 1.6), 2), -150, 150)
        feed = f" F{chance.integers(200, 6000)}" if chance.random() < 0.3 else ""
        lines.append(f"G1 X{here[0]:.3f} Y{here[1]:.3f}{feed}")
        extra = {1: "G4 P0.3", 2: "M8", 3: "G0 Z5\nG1 Z-1", 4: "G64 P0.05"}.get(int(chance.integers(0, 30)))
        lines += [extra] if extra else []
    return "\n".join(lines) + "\n"


def random_forces(prediction, chance):
    """Contact now and then, with steps and ramps in between."""
    motion_s = prediction.motion.time_s
    count = chance.integers(2, 3 + int(3 * motion_s[-1]))
    time_s = np.sort(chance.uniform(0, motion_s[-1], count))
    values = chance.normal(0, chance.uniform(20, 300), (count, 3))
    force = np.stack([np.interp(motion_s, time_s, column) for column in values.T], axis=1)
    contact = np.sort(chance.uniform(0.3, motion_s[-1], 2 * chance.integers(1, 4)))
    force[np.searchsorted(contact, motion_s) % 2 == 0] = 0.0
    return force


@pytest.mark.slow
def test_many_programs(tmp_path):
    """Some are carried out by the replay; few are refused, for knots that are too close."""
    chance = np.random.default_rng(20)
    written, refused, pieces, knots = 0, [], 0, 0
    count = draws(15)
    for number in range(count):
        prediction = predicted(random_body(chance))
        for trial in range(20):
            form = ("index", "values")[trial % 2]
            try:
                if trial == number % 20:
                    made = Written(tmp_path, prediction, random_forces(prediction, chance), pilot=form)
                    check(made)
                    program = made.program
                else:
                    forced = with_forces(prediction, random_forces(prediction, chance))
                    file = tmp_path / "part.src" if form == "index" else None
                    program = write_krl(forced, file, pilot=form)
            except RefusedError as error:
                refused += [issue.code for issue in error.issues if issue.severity == "error"]
                continue
            text = program.texts["PART.src"]
            assert text.count(b"TRIGGER") == program.pilot.knots
            assert program.pilot.max_active <= 8
            written, knots = written + 1, knots + program.pilot.knots
            pieces += len(program.targets) - len(prediction.targets)
    assert written + len(refused) == 20 * count
    assert len(refused) <= count
    assert set(refused) <= {"pilot-dense", "pilot-slows", "pilot-late"}
    assert knots > 200 * count
    assert pieces > 10 * count
