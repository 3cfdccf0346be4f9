"""What the tests of the online side share: settings, a compensator, and a session against a controller."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from gcode2krl.cell.sections.online import Online
from gcode2krl.online.compensator import build_compensator
from gcode2krl.online.session import begin, exchange
from gcode2krl.online.telegram import answer_text, parse


@dataclass
class Log:
    """Record of a session, a row for each telegram."""

    sent: list = field(default_factory=list)
    phase: list = field(default_factory=list)
    gate: list = field(default_factory=list)
    answered: list = field(default_factory=list)

    def array(self):
        return np.array(self.sent)


def talk(device, krc, cycles, *, load=None, lose=(), session=None, change=None, log=None):
    """Exchange telegrams without a network.

    ``load(k)`` is the sensor's load in cycle k, ``change(k, krc)`` may change the controller, answers and
    telegrams of the cycles in ``lose`` are lost.
    """
    session = session or begin(device)
    log = log if log is not None else Log()
    for k in range(cycles):
        if change is not None:
            change(k, krc)
        if k in lose:
            krc.take(None)
            continue
        telegram = parse(krc.telegram())
        now = np.zeros(6) if load is None else load(k)
        session, answer = exchange(session, telegram, now, device)
        krc.take(None if answer is None else answer_text(answer, device.settings))
        log.sent.append(session.sent.copy())
        log.phase.append(session.phase.value)
        log.gate.append(session.gate)
        log.answered.append(answer is not None)
    return session, log


@pytest.fixture(scope="session")
def settings():
    return Online()


@pytest.fixture(scope="session")
def device(cell, settings):
    return build_compensator(cell, settings, load_frame="base")
