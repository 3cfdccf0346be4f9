"""After the proof the correction never steps: it is held, or no longer sent."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.cell.sections.online import Online, Probe
from gcode2krl.online.compensator import build_compensator
from gcode2krl.online.session import Phase, exchange
from gcode2krl.online.telegram import parse
from tests.online.conftest import talk
from tests.online.krc import Krc
from tests.online.test_session import SIDE, check, ramp, rests


def apart(mm, start, cycles):
    """Return a change of telegrams: for some cycles RIst is a way off RSol."""

    def changed(k, telegram):
        off = np.array([0.0, mm, 0.0]) if start <= k < start + cycles else np.zeros(3)
        return replace(telegram, position_mm=telegram.position_mm + off)

    return changed


def told(device, krc, cycles, changed):
    """Exchange telegrams that are changed on their way; returns the session, answers and phases."""
    session, log = talk(device, krc, 250, load=ramp)
    assert session.phase is Phase.RUNNING
    for k in range(cycles):
        session, answer = exchange(session, changed(k, parse(krc.telegram())), ramp(250 + k), device)
        log.sent.append(session.sent.copy())
        log.answered.append(answer is not None)
        log.phase.append(session.phase.value)
        from gcode2krl.online.telegram import answer_text

        krc.take(None if answer is None else answer_text(answer, device.settings))
    return session, log


@pytest.mark.slow
@pytest.mark.parametrize(("mm", "cycles"), [(4.0, 3), (6.0, 4), (6.0, 200), (-40.0, 200)])
def test_a_robot_that_is_seen_too_far_away_is_held_where_it_is(cell, device, settings, mm, cycles):
    session, log = told(device, Krc(cell, stands_s=0.4), 200, apart(mm, 20, cycles))
    assert (session.phase, session.reason) == (Phase.HELD, "too-far")
    assert np.linalg.norm(log.array()[-1]) > 0.2  # not taken back in material
    assert rests(log, 150)
    check(log, settings)


def test_the_program_is_told_to_stop_at_once(cell, device):
    krc = Krc(cell, stands_s=0.4)
    told(device, krc, 30, apart(6.0, 20, 10))
    assert not krc.ready


@pytest.mark.parametrize("cycles", [1, 2])
def test_one_odd_telegram_changes_nothing(cell, device, settings, cycles):
    session, log = told(device, Krc(cell, stands_s=0.4), 100, apart(6.0, 20, cycles))
    assert session.phase is Phase.RUNNING
    check(log, settings)


def test_a_robot_that_goes_on_moving_away_gets_no_answer_any_more(cell, device, settings):
    def changed(k, telegram):
        return replace(
            telegram, position_mm=telegram.position_mm + np.array([0.0, 1.0 * max(k - 20, 0), 0.0])
        )  # 1 mm a cycle

    session, log = told(device, Krc(cell, stands_s=0.4), 100, changed)
    assert (session.phase, session.reason) == (Phase.CLOSED, "adds-up")
    assert log.phase.count("held") <= 4
    check(log, settings)


@pytest.mark.slow
@pytest.mark.parametrize("axis", [False, True])
@pytest.mark.parametrize("lost", [10, 100])
def test_a_robot_that_was_started_anew_is_not_sent_the_old_correction(cell, axis, lost):
    own = Online(mode="axis" if axis else "cartesian")
    device = build_compensator(cell, own, load_frame="base")
    krc = Krc(cell, stands_s=0.3, axis=axis)
    session, log = talk(device, krc, 300, load=ramp)
    assert np.abs(krc.applied).max() > 0.0
    for _ in range(lost):
        krc.take(None)
    krc.applied, krc.asked = np.zeros_like(krc.applied), np.zeros_like(krc.asked)
    krc.waiting.extend([np.zeros_like(krc.asked)] * len(krc.waiting))
    for _ in range(len(krc.waiting) // 2):
        krc.waiting.popleft()
    session, log = talk(device, krc, 20, load=ramp, session=session)
    assert (session.phase, session.reason) == (Phase.CLOSED, "restarted")
    assert not any(log.answered)
    assert not krc.applied.any()


@pytest.mark.parametrize("mm", [6.0, 1e9])
def test_a_position_that_cannot_be_hides_no_restart(cell, device, mm):
    """RIst jumps in the direction of the correction, as if the robot still had it."""
    krc = Krc(cell, stands_s=0.3)
    session, _ = talk(device, krc, 300, load=ramp)
    sent = session.sent
    assert np.linalg.norm(sent) > device.bounds.step[0]
    for _ in range(10):
        krc.take(None)
    telegram = parse(krc.telegram())
    there_mm = telegram.command_mm + mm * sent / np.linalg.norm(sent)
    session, answer = exchange(session, replace(telegram, position_mm=there_mm), ramp(300), device)
    assert (session.phase, session.reason) == (Phase.CLOSED, "restarted")
    assert answer is None


def test_a_lost_link_alone_is_no_restart(cell, device):
    session, log = talk(device, Krc(cell, stands_s=0.3), 400, load=ramp, lose=set(range(300, 340)))
    assert (session.phase, session.reason) == (Phase.HELD, "telegrams-lost")
    assert all(log.answered)


def test_a_slow_limit_holds_for_the_proof_too(cell):
    own = Online(rate_mm_s=10.0, probe=Probe(amplitude_mm=0.04))
    device = build_compensator(cell, own, load_frame="base")
    session, log = talk(device, Krc(cell, stands_s=2.0), 300, load=lambda k: SIDE)
    assert session.phase is Phase.RUNNING
    check(log, own)


@pytest.mark.parametrize("limit", [{"rate_mm_s": 10.0}, {"step_mm": 0.05}])
def test_a_probe_of_more_than_a_step_is_refused(limit):
    with pytest.raises(ValueError, match=r"probe\.amplitude_mm 0\.1 .* lower it"):
        Online(**limit)
