"""Five hostile peers and networks: no answer differs from the one before by more than a step."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.online.session import Phase, begin, exchange
from gcode2krl.online.telegram import answer_text, parse
from tests.online.conftest import Log, talk
from tests.online.krc import Krc
from tests.online.test_session import SIDE, check, ramp, rests

PROVEN = 250
"""Cycles after which the proof is done."""


def steep(k):
    """Return a load that rises until the correction is at its limit."""
    return SIDE * min(max(k - PROVEN, 0) / 20.0, 4.0)


def proven(device, krc):
    """Return a running session."""
    session, log = talk(device, krc, PROVEN)
    assert session.phase is Phase.RUNNING
    return session, log


def drive(device, session, log, krc, cycles, changed, load=ramp):
    """Exchange telegrams that are changed on their way."""
    for k in range(cycles):
        session, answer = exchange(session, changed(k, parse(krc.telegram())), load(PROVEN + k), device)
        log.sent.append(session.sent.copy())
        log.answered.append(answer is not None)
        krc.take(None if answer is None else answer_text(answer, device.settings))
    return session


@pytest.mark.slow
@pytest.mark.parametrize("through", [2, 3, 5])
def test_a_network_that_loses_answers_makes_no_step_at_the_robot(cell, device, settings, through):
    """Telegrams come, but only each second, third, fifth answer gets through."""
    krc = Krc(cell, stands_s=0.4)
    session, log = proven(device, krc)
    asked = []
    for k in range(200):
        session, answer = exchange(session, parse(krc.telegram()), steep(PROVEN + k), device)
        log.sent.append(session.sent.copy())
        krc.take(answer_text(answer, settings) if answer is not None and k % through == 0 else None)
        asked.append(krc.asked.copy())
    limit = min(settings.step_mm, settings.rate_mm_s * settings.cycle_s)
    rounding = 1e-4
    steps = np.linalg.norm(np.diff(np.array(asked), axis=0), axis=1)
    assert steps.max() <= limit + rounding
    assert np.linalg.norm(asked[-1]) > 2.0 * limit  # there was a correction nevertheless
    check(log, settings)


def test_a_second_controller_on_the_same_line(cell, device, settings):
    """Each second telegram is that of another robot, with its own clock, place and joints."""
    session, log = proven(device, krc := Krc(cell, stands_s=0.4))
    other = Krc(cell, stands_s=0.0, ipoc=krc.ipoc + 400_000, start_mm=(10.0, 30.0, 20.0))

    def changed(k, telegram):
        if k % 2:
            return telegram
        other.take(None)
        return parse(other.telegram())

    session = drive(device, session, log, krc, 300, changed)
    assert session.phase in (Phase.HELD, Phase.CLOSED)
    assert rests(log, 200)
    check(log, settings)


@pytest.mark.slow
def test_a_controller_that_contradicts_itself(cell, device, settings):
    """POSCORRMON comes and goes, with any sign, while RIst says 5 mm."""
    session, log = proven(device, krc := Krc(cell, stands_s=0.4))
    rng = np.random.default_rng(1)

    def changed(k, telegram):
        told = (np.full(3, np.nan), 7.0 * rng.normal(size=3), np.zeros(3))[k % 3]
        return replace(
            telegram, monitor_mm=told, position_mm=telegram.position_mm + np.array([0.0, 5.0, 0.0])
        )

    drive(device, session, log, krc, 400, changed, steep)
    check(log, settings)


@pytest.mark.parametrize("far", [10**17, -900, -1100, 4])
def test_a_clock_that_lies(cell, device, settings, far):
    """IPOC goes on, and in between it is somewhere else for a telegram."""
    session, log = proven(device, krc := Krc(cell, stands_s=0.4))

    def changed(k, telegram):
        return replace(telegram, ipoc=telegram.ipoc + (far if k % 7 == 3 else 0))

    session = drive(device, session, log, krc, 200, changed, steep)
    check(log, settings)
    if far in (10**17, -1100):
        assert session.phase in (Phase.HELD, Phase.CLOSED)


@pytest.mark.slow
def test_everything_that_a_wild_controller_can_say(cell, device, settings):
    """Sometimes a number of a telegram is any value that can be parsed, in every phase."""
    rng = np.random.default_rng(7)
    names = ("position_mm", "command_mm", "q_rad", "q_command_rad", "monitor_mm", "load", "values")
    numbers = ("late", "knot", "checksum", "override_percent", "t1")
    phases = set()
    for _ in range(12):
        krc, session, log = Krc(cell, stands_s=0.4), begin(device), Log()
        quiet = int(rng.integers(0, PROVEN + 60))

        def changed(k, telegram, quiet=quiet):
            if k < quiet or rng.random() < 0.6:
                return telegram
            name = names[rng.integers(len(names))]
            array = getattr(telegram, name)
            wild = rng.choice([0.0, 1e-9, 0.3, 6.0, 1e3, 1e90, -1e90], size=len(array)) * rng.normal()
            number = numbers[rng.integers(len(numbers))]
            return replace(telegram, **{name: wild, number: float(rng.choice([-1e12, 0.0, 1.0, np.nan]))})

        session = drive(device, session, log, krc, PROVEN + 150, changed, lambda k: steep(k % 300))
        phases.add(session.phase)
        check(log, settings)
    assert len(phases) > 1
