"""Servos of all axes: one number for six joints, closed forms on a sine, and twins to first order."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects.effect import JOINTS, LINKS
from tests.effects import KNOWN, run

COMMON = [
    ("servo_lag", "tau_s=0.02", "q_act_rad"),
    ("dead_time", "delay_s=0.02", "q_act_rad"),
    ("servo_gain", "missing_share=0.4,k_v_per_s=20", "q_act_rad"),
    ("jerk_feed_forward", "per_jerk_s3=2e-5,settle_s=0.02", "q_act_rad"),
    ("backlash", "gap_deg=0.02", "q_load_rad"),
]
HZ, SWING = 0.6, 0.1


@pytest.fixture(scope="module")
def sine(swinging):
    """A3 in a sine of one frequency, the others as they swing."""
    q = np.array(swinging.q_cmd_rad)
    q[:, 2] = 1.7 - SWING * np.cos(2.0 * np.pi * HZ * swinging.time_s)
    return replace(swinging, q_cmd_rad=q)


@pytest.mark.parametrize(("name", "numbers", "signal"), COMMON)
def test_all_is_every_joint_with_the_same_number(swinging, name, numbers, signal):
    together = getattr(run(swinging, f"{name}:target=all,{numbers}"), signal)
    singly = getattr(run(swinging, *(f"{name}:target={j},{numbers}" for j in JOINTS)), signal)
    np.testing.assert_array_equal(together, singly)
    assert all((together != swinging.q_cmd_rad).any(axis=0))


@pytest.mark.parametrize(("name", "numbers", "signal"), COMMON)
def test_a_common_cause_shows_where_those_of_the_joints_do(name, numbers, signal):
    """Joints without an encoder do not take the link away: those that have one show it all the same."""
    effect, link = KNOWN[name], "gear" if name == "backlash" else "servo"
    assert effect.visible_links(frozenset(LINKS), "all") == {link}
    assert effect.joints_at("all") == frozenset()
    assert effect.joints_at("A4") == {"A4"}
    assert effect.searched(link, "all", frozenset(LINKS))
    assert effect.visible_links(frozenset({"mechanics"}), "all") == {"mechanics"}


def response(inputs, text):
    """The complex ratio of q_act to q_cmd of A3 at the sine's frequency, once it has settled."""
    turn = np.exp(-2j * np.pi * HZ * inputs.time_s)
    rows = np.flatnonzero((inputs.time_s > 3.0) & (inputs.time_s < 3.0 + 8.0 / HZ))
    basis = np.stack([np.ones(len(rows)), turn[rows].real, turn[rows].imag], axis=1)

    def amplitude(q):
        _, a, b = np.linalg.lstsq(basis, q[rows, 2], rcond=None)[0]
        return a + 1j * b

    return amplitude(run(inputs, text).q_act_rad) / amplitude(inputs.q_cmd_rad)


S = 2j * np.pi * HZ
TRANSFER = [
    ("servo_lag:target=A3,tau_s=0.03", 1.0 / (1.0 + 0.03 * S)),
    ("dead_time:target=all,delay_s=0.03", np.exp(-0.03 * S)),
    ("servo_gain:target=A3,missing_share=0.4,k_v_per_s=20", (20.0 + 0.6 * S) / (20.0 + S)),
    ("servo_gain:target=all,missing_share=-0.2,k_v_per_s=20", (20.0 + 1.2 * S) / (20.0 + S)),
    ("jerk_feed_forward:target=A3,per_jerk_s3=1e-4,settle_s=0.02", 1.0 + 1e-4 * S**3 / (1.0 + 0.02 * S) ** 2),
]


@pytest.mark.parametrize(("text", "wanted"), TRANSFER)
def test_a_sine_is_answered_by_the_transfer_function(sine, text, wanted):
    found = response(sine, text)
    assert abs(found - wanted) < 0.01 * abs(wanted - 1.0)


def test_twins_to_first_order_differ_by_the_acceleration(swinging):
    """Slow swings: all are late by 5 ms; the rest goes with the acceleration, by each its own factor."""
    q, t, late = swinging.q_cmd_rad, swinging.time_s, 0.005
    speed = np.gradient(q, t, axis=0)
    bend = np.gradient(speed, t, axis=0)
    rows = slice(50, -50)
    twins = {
        "servo_lag:target=all,tau_s=0.005": late**2,
        "dead_time:target=all,delay_s=0.005": late**2 / 2.0,
        "servo_gain:target=all,missing_share=0.1,k_v_per_s=20": late / 20.0,
    }
    for text, factor in twins.items():
        rest = run(swinging, text).q_act_rad - q + late * speed
        between = 0.012**2 / 8.0  # what linear interpolation of a delay adds at most
        assert np.abs(rest[rows]).max() < (1.2 * factor + between) * np.abs(bend).max(), text
        per_bend = np.sum(rest[rows] * bend[rows]) / np.sum(bend[rows] ** 2)
        assert per_bend == pytest.approx(factor, abs=between), text
    clock = run(swinging, "clock:target=q_cmd,offset_s=-0.005")
    delay = run(swinging, "dead_time:target=all,delay_s=0.005")
    apart = (delay.q_act_rad - q) - (q - clock.seen("q_cmd_rad"))
    assert np.abs(apart[rows]).max() < (1.1 * late**2 + 2.0 * between) * np.abs(bend).max()


def test_the_path_shows_a_clock_and_no_dead_time():
    """At the drives they are twins; where the commanded joints are compared with the plan they are not."""
    examined = frozenset({"path", "servo"})
    assert KNOWN["clock"].visible_links(examined, "q_cmd") == {"path", "servo"}
    assert KNOWN["dead_time"].visible_links(examined, "all") == {"servo"}
    shared = KNOWN["clock"].depends_on & KNOWN["clock"].at("q_cmd").depends_on
    for name in ("servo_lag", "dead_time", "servo_gain"):
        assert KNOWN[name].depends_on <= shared, name
        assert KNOWN[name].where <= KNOWN["clock"].where, name
    for name, clock in (("tracker_filter", "tracker"), ("force_delay", "force")):
        assert KNOWN[name].links <= KNOWN["clock"].links_at(clock), name
