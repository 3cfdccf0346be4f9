"""One session: the proof of the absolute mode, and the final state after every fault."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.cell.sections.online import Online
from gcode2krl.online.compensator import build_compensator
from gcode2krl.online.pilot_gate import Gate
from gcode2krl.online.session import Phase, begin, exchange, silent
from gcode2krl.online.telegram import parse
from tests.online import pilot_of
from tests.online.conftest import Log, talk
from tests.online.krc import Krc

pytestmark = pytest.mark.slow

SIDE = np.array([0.0, 300.0, -50.0, 0.0, 0.0, 0.0])
PROOF = 60
"""Cycles after which corrections are made."""


def ramp(k):
    """Return a load that rises slowly from the proof on."""
    return SIDE * min(max(k - PROOF, 0) / 200.0, 1.0)


def check(log, settings, axis=False):
    """Every correction is within its sum and rate."""
    sent = log.array()
    if axis:
        step = np.radians(settings.axis_rate_deg_s) * settings.cycle_s
        assert (np.abs(sent) <= np.radians(settings.axis_most_deg) * (1 + 1e-9)).all()
        assert (np.abs(np.diff(sent, axis=0, prepend=np.zeros((1, 6)))) <= step * (1 + 1e-9)).all()
        return
    assert np.linalg.norm(sent, axis=1).max() <= settings.most_mm * (1 + 1e-9)
    steps = np.linalg.norm(np.diff(sent, axis=0, prepend=np.zeros((1, 3))), axis=1)
    assert steps.max() <= min(settings.step_mm, settings.rate_mm_s * settings.cycle_s) * (1 + 1e-9)


def rests(log, cycles=50):
    """Tell whether the correction no longer changes."""
    sent = log.array()[-cycles:]
    return bool((sent == sent[0]).all())


@pytest.mark.parametrize(
    "robot",
    [
        {},
        {"decimals": 2},
        {"dead_cycles": 3, "lag_s": 0.012},
        {"dead_cycles": 5, "lag_s": 0.03, "decimals": 2},
    ],
)
def test_an_absolute_robot_is_proven_and_then_compensated(cell, device, settings, robot):
    krc = Krc(cell, **robot)
    session, log = talk(device, krc, 600, load=lambda k: SIDE if k > 300 else np.zeros(6))
    assert session.phase is Phase.RUNNING
    assert krc.ready
    assert list(dict.fromkeys(log.phase)) == ["resting", "probing", "settling", "running"]
    assert np.linalg.norm(krc.applied) > 0.5
    check(log, settings)


@pytest.mark.parametrize("axis", [False, True])
@pytest.mark.parametrize("robot", [{}, {"dead_cycles": 3}, {"dead_cycles": 5}])
def test_a_robot_that_adds_up_is_held_at_zero(cell, settings, robot, axis):
    own = build_compensator(
        cell, settings.model_copy(update={"mode": "axis" if axis else "cartesian"}), load_frame="base"
    )
    krc = Krc(cell, relative=True, axis=axis, **robot)
    session, log = talk(own, krc, 600, load=lambda k: SIDE)
    assert (session.phase, session.reason) == (Phase.ZERO, "adds-up")
    asked = np.flatnonzero(np.abs(log.array()).max(axis=1) > 0.0)
    assert len(asked) == asked[-1] - asked[0] + 1
    assert len(asked) <= 3 + robot.get("dead_cycles", 1) - 1  # three cycles once it can be seen
    assert np.linalg.norm(krc.tip_mm() - krc.program_mm()) <= 0.105 * len(asked)  # joints of another pose
    assert not krc.ready


def test_corrections_wait_for_the_proof_even_under_load(cell, device):
    krc = Krc(cell)
    _, log = talk(device, krc, PROOF, load=lambda k: SIDE)
    before = log.array()[: log.phase.index("running")]
    assert np.linalg.norm(before, axis=1).max() <= 0.1 + 1e-12
    assert not before[:25].any()


def test_a_robot_that_moves_is_not_probed(cell, device):
    krc = Krc(cell, stands_s=0.05)
    session, log = talk(device, krc, 500, load=lambda k: SIDE)
    assert session.phase is Phase.RESTING
    assert not log.array().any()


def test_a_robot_that_ignores_corrections_stays_at_zero(cell, device):
    krc = Krc(cell, ignores=True)
    session, log = talk(device, krc, 400, load=lambda k: SIDE)
    assert not krc.ready
    assert session.phase in (Phase.RESTING, Phase.PROBING, Phase.SETTLING)
    assert np.linalg.norm(log.array(), axis=1).max() <= 0.1 + 1e-12


def test_a_robot_that_begins_to_add_up_while_running_gets_no_more_answers_and_no_step(cell, device, settings):
    def change(k, krc):
        krc.relative = k >= 300

    krc = Krc(cell, decimals=4, speed_mm_s=0.0)
    session, log = talk(device, krc, 500, load=lambda k: 3 * ramp(k), change=change)
    assert (session.phase, session.reason) == (Phase.CLOSED, "adds-up")
    assert not any(log.answered[-150:])
    check(log, settings)


@pytest.mark.parametrize("mode", ["cartesian", "axis"])
def test_twelve_milliseconds(cell, mode):
    own = Online(cycle_s=0.012, mode=mode)
    device = build_compensator(cell, own, load_frame="base")
    krc = Krc(cell, cycle_ms=12, axis=mode == "axis")
    session, log = talk(device, krc, 400, load=ramp)
    assert session.phase is Phase.RUNNING
    check(log, own, mode == "axis")


@pytest.mark.parametrize(("own_s", "other_ms"), [(0.004, 12), (0.012, 4)])
def test_the_other_cycle_is_noticed(cell, own_s, other_ms):
    own = Online(cycle_s=own_s)
    device = build_compensator(cell, own, load_frame="base")
    krc = Krc(cell, cycle_ms=other_ms)
    session, log = talk(device, krc, 200, load=lambda k: SIDE)
    assert not log.array()[-1].any()
    assert session.phase is not Phase.RUNNING


# the fault list: what happens


def fault(device, cell, **how):
    krc = Krc(cell, stands_s=0.4, **how.pop("robot", {}))
    return talk(device, krc, 450, **({"load": ramp} | how))


@pytest.mark.parametrize(("lost", "held"), [(1, False), (5, False), (6, True), (10, True), (100, True)])
def test_lost_telegrams(cell, device, settings, lost, held):
    session, log = fault(device, cell, lose=set(range(200, 200 + lost)))
    check(log, settings)
    assert session.lost == lost
    if held:
        assert (session.phase, session.reason) == (Phase.HELD, "telegrams-lost")
        assert (log.array()[200:] == log.array()[199]).all()  # held where it was, never taken back
        assert log.array()[199].any()
    else:
        assert session.phase is Phase.RUNNING


def test_a_peer_that_dies_ends_the_session(cell, device, settings):
    session, log = fault(device, cell)
    last = log.array()[-1]
    assert silent(session, 0.5, settings).phase is Phase.RUNNING
    session = silent(session, 1.1, settings)
    assert (session.phase, session.reason) == (Phase.CLOSED, "silence")
    assert (session.sent == last).all()
    krc = Krc(cell, ipoc=session.ipoc + 2000)
    _, log = talk(device, krc, 20, load=ramp, session=session)
    assert not any(log.answered)


@pytest.mark.parametrize(
    ("ahead", "phase", "reason"),
    [
        (1_000_000, Phase.HELD, "ipoc-jump"),
        (400, Phase.HELD, "telegrams-lost"),
        (-500_000, Phase.CLOSED, "ipoc-restart"),
        (3, Phase.HELD, "ipoc-cycle"),
    ],
)
def test_an_ipoc_that_jumps(cell, device, settings, ahead, phase, reason):
    def change(k, krc):
        if k == 300:
            krc.ipoc += ahead

    krc = Krc(cell, ipoc=10_000_000, stands_s=0.4)
    session, log = talk(device, krc, 500, load=ramp, change=change)
    assert (session.phase, session.reason) == (phase, reason)
    assert rests(log)
    check(log, settings)


def test_telegrams_that_come_twice_or_late_are_not_answered(cell, device):
    krc = Krc(cell)
    session, _ = talk(device, krc, 200, load=ramp)
    again = parse(krc.telegram())
    session, first = exchange(session, again, ramp(200), device)
    session, second = exchange(session, again, ramp(200), device)
    session, third = exchange(session, replace(again, ipoc=again.ipoc - 40), ramp(200), device)
    assert first is not None
    assert second is None
    assert third is None
    assert session.ignored == 2
    assert session.phase is Phase.RUNNING


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_sensor_that_is_no_number(cell, device, settings, bad):
    session, log = fault(device, cell, load=lambda k: np.full(6, bad) if k >= 300 else ramp(k))
    assert (session.phase, session.reason) == (Phase.HELD, "sensor")
    assert rests(log, 140)
    check(log, settings)


def test_a_sensor_silent_for_three_cycles_does_no_harm(cell, device, settings):
    session, log = fault(device, cell, load=lambda k: np.full(6, np.nan) if 300 <= k < 303 else ramp(k))
    assert session.phase is Phase.RUNNING
    check(log, settings)


def test_a_force_step_of_5_kN(cell, device, settings):
    hit = np.array([0.0, 5000.0, 0.0, 0.0, 0.0, 0.0])
    session, log = fault(device, cell, load=lambda k: hit if k >= 300 else ramp(k))
    assert (session.phase, session.reason) == (Phase.HELD, "sensor")
    assert (log.array()[300:] == log.array()[299]).all()
    check(log, settings)


def test_a_joint_limit_ahead(cell, settings):
    degrees = [list(pair) for pair in cell.robot.limits.q_deg]
    krc = Krc(cell)
    degrees[0][1] = np.degrees(krc.q_rad[0]) + 0.2  # A1 turns the tip to -y; its limit lies just there
    degrees[0][0] = degrees[0][1] - 100.0
    limits = cell.robot.limits.model_copy(update={"q_deg": tuple(tuple(pair) for pair in degrees)})
    narrow = cell.model_copy(update={"robot": cell.robot.model_copy(update={"limits": limits})})
    device = build_compensator(narrow, settings, load_frame="base")
    session, log = talk(device, Krc(cell, speed_mm_s=0.0), 500, load=ramp)
    free = build_compensator(cell, settings, load_frame="base")
    _, without = talk(free, Krc(cell, speed_mm_s=0.0), 500, load=ramp)
    assert session.phase is Phase.RUNNING
    assert np.abs(without.array()[-1]).max() > 0.5
    assert np.abs(log.array()[-1]).max() < 0.01  # towards the limit: nothing
    away = talk(device, Krc(cell, speed_mm_s=0.0), 500, load=lambda k: -ramp(k))[1]
    assert np.abs(away.array()[-1]).max() > 0.5  # away from it: as usual
    check(log, settings)


def test_all_faults_at_once_come_to_rest(cell, device, settings):
    rng = np.random.default_rng(3)
    for _ in range(4):
        krc = Krc(cell, stands_s=0.4)
        lose = set(rng.integers(80, 500, 60).tolist())
        loads = rng.choice([1.0, -1.0, 0.0, np.nan, 30.0], size=700, p=[0.5, 0.2, 0.2, 0.09, 0.01])

        def change(k, peer, rng=rng):
            if k > 100 and rng.random() < 0.003:
                peer.ipoc += int(rng.integers(-5000, 5000)) * 4

        _, log = talk(device, krc, 500, load=lambda k: loads[k] * SIDE, lose=lose, change=change)  # noqa: B023
        check(log, settings)


# the pilot on the wire


def pilot(form="index"):
    force_N = [[0, 0, 0], [0, 300, -50], [0, 310, -50], [0, 0, 0]]
    return pilot_of([0.6, 0.75, 1.4, 1.5], force_N, form=form, checksum=12345)


def telling(form, knots, checksum=12345, override=100):
    def change(k, krc):
        told = np.searchsorted(knots.time_s - knots.lead_s, krc.time_s, side="right") - 1
        krc.told = {"SenPInt2": checksum, "OvPro": override, "T1": 0}
        if form == "index":
            krc.told["SenPInt1"] = told
        else:
            row = (*knots.force_N[told], knots.lead_s[told]) if told >= 0 else (0.0,) * 4
            krc.told |= {f"SenPrea{n}": f"{value:.4f}" for n, value in enumerate(row, start=1)}

    return change


@pytest.mark.parametrize("form", ["index", "values"])
def test_the_pilot_is_used_in_both_forms(cell, settings, form):
    knots, header = pilot(form)
    device = build_compensator(cell, settings, load_frame="base", knots=knots, header=header)
    session, log = talk(device, Krc(cell, stands_s=0.3), 400, load=ramp, change=telling(form, knots))
    assert Gate.OPEN in log.gate
    assert session.phase is Phase.RUNNING


@pytest.mark.parametrize("form", ["index", "values"])
@pytest.mark.parametrize("wrong", [{"checksum": 1}, {"override": 50}])
def test_a_pilot_that_does_not_fit_is_not(cell, settings, form, wrong):
    knots, header = pilot(form)
    device = build_compensator(cell, settings, load_frame="base", knots=knots, header=header)
    session, log = talk(device, Krc(cell, stands_s=0.3), 400, load=ramp, change=telling(form, knots, **wrong))
    assert Gate.OPEN not in log.gate
    assert session.phase is Phase.RUNNING  # the measured force alone


def test_a_new_session_begins_at_zero(device):
    session = begin(device)
    assert session.phase is Phase.WAITING
    assert not session.sent.any()
    assert Log().sent == []
