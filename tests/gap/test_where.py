"""Where a gap is, on residuals that are at known places."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import Applied, library
from gcode2krl.gap.answer.where import PHASES, over_noise, phase_of, place
from tests.gap.constructed import AMPLITUDE_RAD, HZ, applied, motion, trace, wave

TIME_S = motion().time_s
SLOW = replace(motion(), q_cmd_rad=np.tile(motion().q_cmd_rad[:1], (500, 1)))
"""No joint moves: no reversal."""
CUTTING = replace(
    SLOW, force_base_N=np.where(((TIME_S >= 3.0) & (TIME_S < 7.0))[:, None], [50.0, 0.0, 0.0], 0.0)
)


def bump(first_s, last_s, height=1.0):
    return np.where((first_s <= TIME_S) & (last_s >= TIME_S), height, 0.0)


def found(residual, inputs=SLOW, link="servo", effects=(), noise=1e-9, **more):
    """Return the place of a gap that is made of a residual or, where effects are given, of what they do."""
    residual = residual.reshape(500, -1)
    one = trace(residual, link, inputs=inputs, **more)
    shape = one.sample(list(effects)) - one.nominal if effects else residual
    return place([one], [shape], np.full(residual.shape[1], noise), list(effects))


def test_phases_by_the_clock():
    phase, joint = phase_of(CUTTING)
    expected = np.select(
        [TIME_S < 3.0, TIME_S <= 3.3, TIME_S < 6.7, TIME_S <= 7.0], ["air", "entry", "cruise", "exit"], "air"
    )
    said = np.array(PHASES)[phase]
    near = np.min(np.abs(TIME_S[:, None] - [3.0, 3.3, 6.7, 7.0]), axis=1) < 0.03
    assert (said == expected)[~near].all()
    assert (joint == -1).all()


def test_reversals_are_at_the_turning_points_of_each_joint_and_a_moment_after():
    alone = SLOW.q_cmd_rad.copy()
    alone[:, 1] += AMPLITUDE_RAD[1] * np.sin(2.0 * np.pi * HZ[1] * TIME_S)
    phase, joint = phase_of(replace(SLOW, q_cmd_rad=alone))
    turns = (np.arange(1, 20, 2) / 4.0) / HZ[1]
    since = np.array([np.min(np.append((t - turns)[t >= turns], np.inf)) for t in TIME_S])
    assert (joint[(since > 0.03) & (since < 0.27)] == 1).all()
    assert (joint[since > 0.33] == -1).all()
    assert (phase[joint == 1] == PHASES.index("reversal")).all()


class Samples:
    """As much of a motion as says where its corners are."""

    def __init__(self, corner):
        self.corner = corner

    def __len__(self):
        return len(self.corner)


def test_a_corner_goes_before_everything_else():
    corner = np.zeros(500, dtype=bool)
    corner[160:170] = True

    phase, _ = phase_of(replace(CUTTING, motion=Samples(corner)))
    assert (phase[160:170] == PHASES.index("corner")).all()
    assert PHASES.index("corner") not in phase[170:]


def test_intervals_are_where_the_gap_exceeds_the_noise_and_the_first_holds_most():
    where = found(0.9 + bump(2.0, 2.5, 4.0) + bump(6.0, 7.0, 2.0), noise=1.0)
    first, second = where.intervals
    assert (first.t_start_s, first.t_end_s) == (pytest.approx(2.0, abs=0.07), pytest.approx(2.5, abs=0.07))
    assert (second.t_start_s, second.t_end_s) == (pytest.approx(6.0, abs=0.07), pytest.approx(7.0, abs=0.07))
    assert first.rms == pytest.approx(4.9, rel=0.15)
    power = np.array([25 * 4.9**2, 50 * 2.9**2])
    assert [first.share, second.share] == pytest.approx(power / (power.sum() + 425 * 0.9**2), abs=0.05)
    assert (first.run, first.signal, first.what) == ("run-1", "joint_actual", "air")
    # one source line a sample, from 1
    assert first.lines == (pytest.approx(101, abs=4), pytest.approx(126, abs=4))


def test_stretches_a_fifth_of_a_second_apart_are_one():
    assert len(found(bump(2.0, 2.5) + bump(2.62, 3.2)).intervals) == 1
    assert len(found(bump(2.0, 2.5) + bump(3.0, 3.6)).intervals) == 2


def test_shares_of_phases_are_those_of_the_power():
    where = found(bump(3.6, 6.0, 3.0) + bump(8.0, 9.0, 1.0), CUTTING)
    shares = {phase.phase: phase.share for phase in where.phases}
    assert shares["cruise"] == pytest.approx(9.0 * 2.4 / (9.0 * 2.4 + 1.0), abs=0.02)
    assert where.phases[0].phase == "cruise"
    assert sum(shares.values()) == pytest.approx(1.0)
    cruise = np.sum((TIME_S >= 3.3) & (TIME_S < 6.7))
    assert where.phases[0].rms == pytest.approx(np.sqrt(9.0 * 120 / cruise), rel=0.05)


def test_shares_of_measured_joints_are_those_of_their_columns():
    residual = np.column_stack([bump(2.0, 4.0, size) for size in (1.0, 3.0, 0.05)])
    joints = {joint.joint: joint.share for joint in found(residual).joints}
    assert joints == {"A2": pytest.approx(0.9, abs=0.01), "A1": pytest.approx(0.1, abs=0.01)}


def test_of_effects_in_joints_the_shares_are_those_of_what_they_do():
    effects = [
        Applied(library()["backlash"], "A2", {"gap_deg": 0.05}),
        Applied(library()["backlash"], "A4", {"gap_deg": 0.05}),
    ]
    where = found(np.zeros((500, 3)), motion(), "mechanics", effects)
    one = trace(np.zeros((500, 3)), "mechanics")
    power = {each.target: np.sum((one.sample([each]) - one.nominal) ** 2) for each in effects}
    for joint in where.joints:
        assert joint.share == pytest.approx(power[joint.joint] / sum(power.values()))


def test_of_an_unexplained_gap_at_the_tip_the_joint_that_moves_it_that_way_has_most():
    columns = motion().jacobian[:, :3, :]
    residual = columns[:, :, 4] / np.linalg.norm(columns[:, :, 4], axis=1, keepdims=True)
    where = found(residual, motion(), "mechanics")
    assert where.joints[0].joint == "A5"


def test_the_direction_is_the_rms_of_each_axis():
    residual = np.column_stack([bump(2.0, 4.0, 3.0), 0.0 * TIME_S, bump(2.0, 4.0, -4.0)])
    assert found(residual, SLOW, "mechanics").direction_base == pytest.approx((0.6, 0.0, 0.8), abs=1e-6)
    assert found(residual, SLOW, "force", frame="sensor").direction_base is None
    assert found(bump(2.0, 4.0)).direction_base is None  # joints have none


def test_the_band_holds_eight_tenths_of_the_power():
    tones = np.sin(2.0 * np.pi * 0.5 * TIME_S) + np.sin(2.0 * np.pi * 2.0 * TIME_S)
    effect = wave(1.0)
    effect.form = lambda t: np.sin(2.0 * np.pi * 0.5 * t) + np.sin(2.0 * np.pi * 2.0 * t)
    where = found(tones, effects=[applied(effect, 1.0)])
    assert where.frequency_hz == pytest.approx((0.5, 2.0), abs=1e-6)


def test_of_an_explained_gap_the_place_is_that_of_the_effect():
    effect = wave(1.0)
    effect.form = lambda t: np.where((t > 4.0) & (t < 4.6), 1.0, 0.0)
    where = found(effect.form(TIME_S) + bump(8.0, 8.2, 0.5), effects=[applied(effect, 1.0)])
    (interval,) = where.intervals
    assert interval.share == pytest.approx(1.0)
    assert interval.t_start_s == pytest.approx(4.0, abs=0.07)
    assert interval.t_end_s == pytest.approx(4.6, abs=0.07)


def test_after_the_reversals_of_the_joint_that_an_effect_is_in():
    spike = Applied(library()["friction"], "A2", {"spike_deg": 0.01, "decay_s": 0.1})
    where = found(np.zeros((500, 6)), motion(), effects=[spike], noise=1e-6)
    assert {interval.what for interval in where.intervals} == {"reversal of A2"}
    assert where.joints[0].joint == "A2"
    assert where.phases[0].phase == "reversal"


def test_a_constant_gap_is_one_stretch_that_holds_all_of_it_and_blames_no_phase():
    constant = found(np.tile([0.1, 0.2, 0.2], (500, 1)), CUTTING, "mechanics", noise=0.05)
    (interval,) = constant.intervals
    assert (interval.t_start_s, interval.t_end_s) == (TIME_S[0], TIME_S[-1])
    assert interval.share == pytest.approx(1.0)
    assert interval.what == "throughout"


def test_below_the_noise_there_is_no_stretch():
    assert found(np.tile([0.1, 0.2, 0.2], (500, 1)), link="mechanics", noise=0.31).intervals == ()


def test_a_blip_shorter_than_three_tenths_of_a_second_is_noise_unless_an_effect_makes_it():
    blip = bump(4.0, 4.1, 1.0)
    assert found(blip, noise=0.44).intervals == ()
    effect = wave(1.0)
    effect.form = lambda t: blip
    (interval,) = found(blip, effects=[applied(effect, 1.0)], noise=0.44).intervals
    assert interval.t_end_s - interval.t_start_s < 0.25


def test_a_joint_stands_out_of_its_own_noise_and_not_of_that_of_six():
    values = np.zeros((500, 6))
    values[:, 2] = 1.5
    joints = over_noise(trace(values, "servo", inputs=SLOW), values, np.ones(6))
    np.testing.assert_allclose(joints, 1.5)
    vector = over_noise(trace(values[:, :3], "mechanics", inputs=SLOW), values[:, :3], np.ones(3))
    np.testing.assert_allclose(vector, 1.5)
