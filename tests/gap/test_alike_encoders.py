"""Six encoders are alike: what wanders or is loud in few joints is no noise, in most of them it is."""

import numpy as np
import pytest

from gcode2krl.gap.noise.short import Slow, drawn_slow
from gcode2krl.gap.noise.source import noise_of
from gcode2krl.gap.posterior.examination import size_of_gap
from tests.gap.constructed import STEP_S, motion, noise, trace

COUNT, SIGMA = 2000, 2e-4


def runs(more):
    """Return traces of three runs of other lengths, so no repeats; ``more`` (joints,) is added of each."""
    found = []
    for number in range(3):
        residual = noise(COUNT - 100 * number, number, SIGMA, 6)
        for joint, value in more(number, len(residual)).items():
            residual[:, joint] += value
        found.append(trace(residual, number=number, declared_sigma=SIGMA))
    return found


def wander(joints):
    def added(number, count):
        return {
            joint: drawn_slow(Slow(0.98, 2.0 * SIGMA), count, np.random.default_rng(10 * number + joint))
            for joint in joints
        }

    return added


def learnt(traces):
    nothing = [np.zeros((6, len(each.time_s), 0)) for each in traces]
    return noise_of(traces, nothing, [()] * len(traces))


@pytest.mark.parametrize(("joints", "is_noise"), [((1,), False), ((0, 4), False), (range(6), True)])
def test_a_slow_part_is_noise_where_most_encoders_have_it(joints, is_noise):
    slow = [bool(each.slow) for each in learnt(runs(wander(joints)))]
    assert slow[joints[0]] == is_noise
    assert is_noise or not any(slow)


def gap_of(more):
    traces = runs(more)
    return size_of_gap(traces, [()] * len(traces), learnt(traces), ())


def bump(number, count):
    """Half a second far off in two of three runs: a joint that is held, no encoder."""
    values = np.zeros(count)
    if number != 1:
        values[900:925] = 30.0 * SIGMA
    return {3: values}


def heavy(number, count):
    draw = np.random.default_rng(50 + number)
    return {joint: SIGMA * draw.standard_t(3, count) for joint in range(6)}


def test_what_one_joint_alone_has_for_moments_is_a_gap():
    assert gap_of(bump).significant
    assert not gap_of(lambda number, count: {}).significant


def test_heavy_tails_of_all_joints_and_a_spike_in_one_run_are_none():
    assert gap_of(heavy).loud_in_step == 0.0
    spike = gap_of(
        lambda number, count: (
            {3: np.where(np.arange(count) == 700, 300.0 * SIGMA, 0.0)} if number == 0 else {}
        )
    )
    assert spike.loud_in_step == 0.0


def faster_is_louder(share):
    """Noise of one joint with so much more deviation at its highest speed than where it stands."""

    def added(number, count):
        speed = np.abs(np.gradient(motion(STEP_S * count).q_cmd_rad[:, 3]))
        return {3: share * SIGMA * speed / speed.max() * noise(count, 70 + number, 1.0, 1)[:, 0]}

    return added


def test_an_encoder_that_is_louder_while_its_joint_turns_fast_shows_a_gap():
    assert gap_of(faster_is_louder(1.2)).loud_in_step > 0.25
    assert gap_of(faster_is_louder(0.0)).loud_in_step == 0.0
    assert gap_of(wander(range(6))).loud_in_step == 0.0
