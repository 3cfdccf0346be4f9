"""A pilot force that was not asked for ends where it cannot be announced; the program is written anyway."""

import numpy as np
import pytest

from gcode2krl import write_krl
from gcode2krl.cell import load_cell
from gcode2krl.errors import RefusedError
from gcode2krl.krl import pilot_plan
from gcode2krl.online.pilot_gate import Announced, Gate, estimate, gate_start, pilot_table
from gcode2krl.pilot import force_at, read_pilot
from tests.cells import over_demonstration
from tests.krl.brute_replay import Law, replay
from tests.krl.conftest import read, verified
from tests.krl.forces import cutting_below, moved, with_forces
from tests.krl.replay import read_program

HEAD = "G21 G90 G17 G54 G64\nT1 M6\nS9000 M3\nG0 G43 H1 Z20\nG0 X0 Y0\nG0 Z2\n"
FOOT = "G0 Z20\nM30\n"
SHORT = "".join(f"G1 X{80 + 1.2 * k:.1f} Y{0.3 * (k % 2):.1f}\n" for k in range(1, 60))
LINE_OF_SHORT = 9
"""The first of the short moves, behind a plunge and a long line."""
CYCLE_S, LEAD_S, STEP_S = 0.012, 0.040, 0.004


def dense(data=None):
    """A long line with a few knots, then short moves with noise: more knots than can be announced."""
    cell = over_demonstration(data)
    prediction = moved(read(f"{HEAD}G1 Z-1 F1500\nG1 X80\n{SHORT}{FOOT}", cell), cell)
    force = cutting_below(prediction, force_N=300.0)
    late = prediction.motion.position_mm[:, 0] > 80.0
    force[late] = np.random.default_rng(0).normal(300.0, 100.0, (int(late.sum()), 3))
    force[prediction.motion.position_mm[:, 2] > 0] = 0.0
    return with_forces(prediction, force)


@pytest.fixture(params=["index", "values"])
def ended(request, tmp_path):
    """The dense program by default: (prediction, program, knots, header, replay)."""
    prediction = dense({"pilot": {"form": request.param}})
    program = write_krl(prediction, tmp_path / "part.src")
    knots, header = read_pilot(tmp_path / "part.pilot.csv")
    first, last = np.flatnonzero(program.targets.move >= 0)[[0, -1]]
    controller = prediction.cell.controller
    done = replay(tmp_path / "part.src", first, last, Law(controller.k_s, controller.advance))
    return prediction, program, knots, header, done


def test_it_ends_before_the_place_with_one_warning_that_names_the_line(ended):
    _, program, knots, _, _ = ended
    found = [issue for issue in program.issues if issue.code.startswith("pilot-")]
    assert [issue.code for issue in found] == ["pilot-left-out"]
    assert found[0].severity == "warning"
    assert found[0].line >= LINE_OF_SHORT
    assert len(knots) >= 4
    assert knots.line[-1] <= found[0].line
    head = program.texts["PART.src"].decode("ascii").split("DECL")[0]
    assert f"; THE PILOT FORCE ENDS BEFORE G-CODE LINE {found[0].line}" in head


def test_the_program_moves_as_without_a_pilot(ended, tmp_path):
    prediction, program, _, _, _ = ended
    bare = write_krl(prediction, tmp_path / "bare.src", pilot="none")
    own = program.targets.move >= 0
    assert np.array_equal(program.targets.position_mm[own], bare.targets.position_mm[bare.targets.move >= 0])
    assert {motion.speed_m_s for motion in read_program(tmp_path / "part.src").motions[1:-1]} == {
        motion.speed_m_s for motion in read_program(tmp_path / "bare.src").motions[1:-1]
    }


def test_the_last_trigger_says_that_there_is_no_knot_before_a_receiver_runs_beyond(ended):
    _, _, knots, header, done = ended
    assert len(done.fired) == len(knots) + 1
    end = done.fired[-1]
    assert end.numbers == ([-1.0] if header.form == "index" else [0.0] * 4)
    assert end.time_s <= knots.time_s[-1] - LEAD_S
    assert end.time_s <= end.end_s
    assert end.time_s - done.fired[-2].time_s >= CYCLE_S - 0.001


def test_the_receiver_follows_and_then_knows_no_force(ended):
    """The gate of the online side, fed with what the controller's variable holds."""
    prediction, _, knots, header, done = ended
    if header.form == "values":
        pytest.skip("values are turned into numbers of knots first")
    motion = prediction.motion
    now = np.arange(0.0, motion.time_s[-1], STEP_S)
    at = np.array([fired.time_s for fired in done.fired])
    held = np.concatenate([[-1.0], [fired.numbers[0] for fired in done.fired]])
    count = len(now)
    told = Announced(
        knot=held[np.searchsorted(at, now, side="right")],
        checksum=np.full(count, float(header.checksum)),
        override_percent=np.full(count, 100.0),
        t1=np.zeros(count),
    )
    position = np.stack([np.interp(now, motion.time_s, column) for column in motion.position_mm.T], axis=1)
    settings = load_cell().online
    _, force, known, reason = estimate(
        gate_start(), now, position, told, pilot_table(knots, header), settings
    )
    behind = now >= at[-1] + STEP_S
    assert behind.sum() > 100
    assert not known[behind].any()
    assert set(reason[behind].tolist()) == {int(Gate.UNPROVEN)}
    assert known[~behind].any()
    expected = force_at(knots, now + settings.pilot_lead_s)
    slope = np.abs(np.diff(knots.force_N, axis=0) / np.diff(knots.time_s)[:, None]).max()
    assert np.abs(force[known] - expected[known]).max() < slope * (STEP_S + 0.002)


def test_verify_reads_the_end(ended, tmp_path):
    prediction, program, knots, _, _ = ended
    src = tmp_path / "part.src"
    report = verified(src, prediction.toolpath, prediction.cell, prediction=prediction)
    assert report.ok, [issue.text() for issue in report.issues]
    assert report.pilot.knots == len(knots) == program.pilot.knots
    assert report.pilot.max_error_N <= program.pilot.max_error_N + 1e-6
    lines = src.read_bytes().split(b"\r\n")
    end = max(k for k, line in enumerate(lines) if line.startswith(b"TRIGGER"))
    delay = int(lines[end].split(b"DELAY=")[1].split()[0])
    lines[end] = lines[end].replace(b"DELAY=%d " % delay, b"DELAY=%d " % (delay + 100))
    src.write_bytes(b"\r\n".join(lines))
    report = verified(src, prediction.toolpath, prediction.cell, prediction=prediction)
    assert "end of the pilot force: its end is told too late" in {issue.message for issue in report.issues}


@pytest.mark.parametrize("form", ["index", "values"])
def test_asked_for_by_name_it_is_carried_or_refused(tmp_path, form):
    with pytest.raises(RefusedError, match=r"pilot-(dense|slows|late)"):
        write_krl(dense(), tmp_path / "part.src", pilot=form)
    assert list(tmp_path.iterdir()) == []


def test_nothing_left_of_it(tmp_path):
    """Every sample of a part of short moves wants a knot, from the first on."""
    prediction = dense({"controller": {"advance": 0}})
    force = np.random.default_rng(0).normal(300.0, 100.0, (len(prediction.motion), 3))
    program = write_krl(with_forces(prediction, force), tmp_path / "part.src")
    assert program.pilot is None
    assert [file.suffix for file in program.files] == [".src", ".dat"]
    found = [issue for issue in program.issues if issue.code.startswith("pilot-")]
    assert [(issue.code, issue.severity) for issue in found] == [("pilot-left-out", "warning")]
    assert "carries no pilot force" in found[0].message
    assert "TRIGGER" not in program.texts["PART.src"].decode("ascii")


def test_what_its_own_check_finds_leaves_it_out_too(tmp_path, monkeypatch):
    """A pilot force that reading back would refuse costs the pilot force, not the program."""
    whole = pilot_plan.plan_pilot

    def wrong(*arguments, **named):
        plan = whole(*arguments, **named)
        plan.text.knots.lead_s.flags.writeable = True
        plan.text.knots.lead_s[:] += 0.5
        return plan

    monkeypatch.setattr("gcode2krl.krl.write.plan_pilot", wrong)
    program = write_krl(dense(), tmp_path / "part.src")
    assert program.pilot is None
    assert "pilot-left-out" in {issue.code for issue in program.issues}
    with pytest.raises(RefusedError, match="pilot-"):
        write_krl(dense(), tmp_path / "part.src", pilot="index")


@pytest.mark.parametrize("dwell", ["G4 P1.25", "M0"])
def test_triggers_behind_a_wait_are_not_read_before_it(tmp_path, dwell):
    """Eight knots before a standstill and eight behind it: without it they could not wait together."""
    cell = over_demonstration()
    body = f"G1 Z-1 F1500\nG1 X10\n{dwell}\nG1 X20\nG1 X20 Y10\n"
    prediction = moved(read(HEAD + body + FOOT, cell), cell)
    motion = prediction.motion
    force = np.zeros((len(motion), 3))
    zigzag = 300.0 + 150.0 * (np.arange(len(motion)) // 6 % 2)
    x = motion.position_mm[:, 0]
    cut = ((x > 4) & (x < 8)) | ((x > 12) & (x < 16))
    force[cut, 0] = zigzag[cut]
    program = write_krl(with_forces(prediction, force), tmp_path / "part.src", pilot="index")
    assert program.pilot.knots > 8
    assert len(program.targets) == len(prediction.targets)  # no motion had to be cut for them
    assert "pilot-tolerance" not in {issue.code for issue in program.issues}
    assert (read_pilot(tmp_path / "part.pilot.csv")[0].lead_s < 0.1).all()  # nor was one told early
    assert program.pilot.max_active <= 8
    report = verified(tmp_path / "part.src", prediction.toolpath, cell)
    assert report.ok, [issue.text() for issue in report.issues]
    assert report.pilot.max_active == program.pilot.max_active
