"""Where a gap is, on residuals that are at known places."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import Applied, library
from gcode2krl.gap.fit.noise import white
from gcode2krl.gap.tell.where import PHASES, phase_of, place, structure
from tests.gap.constructed import AMPLITUDE_RAD, HZ, applied, motion, trace, wave

QUIET = [white(1e-9)]
TIME_S = motion().time_s
SLOW = replace(motion(), q_cmd_rad=np.tile(motion().q_cmd_rad[:1], (500, 1)))
"""No joint moves: no reversal."""
CUTTING = replace(
    SLOW, force_base_N=np.where(((TIME_S >= 3.0) & (TIME_S < 7.0))[:, None], [50.0, 0.0, 0.0], 0.0)
)


def bump(first_s, last_s, height=1.0):
    return np.where((first_s <= TIME_S) & (last_s >= TIME_S), height, 0.0)


def found(residual, inputs=SLOW, link="servo", effects=(), **more):
    residual = residual.reshape(500, -1)
    one = trace(residual, link, inputs=inputs, **more)
    return place([one], QUIET * residual.shape[1], list(effects))


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


def test_intervals_are_where_the_gap_is_larger_than_its_rms():
    where = found(bump(2.0, 2.5, 4.0) + bump(6.0, 7.0, 2.0))
    first, second = where.intervals
    assert (first.t_start_s, first.t_end_s) == (pytest.approx(2.0, abs=0.07), pytest.approx(2.5, abs=0.07))
    assert (second.t_start_s, second.t_end_s) == (pytest.approx(6.0, abs=0.07), pytest.approx(7.0, abs=0.07))
    assert first.rms == pytest.approx(4.0, rel=0.15)
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
    assert found(residual, SLOW, "force", in_sensor_frame=True).direction_base is None
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
    assert interval.t_start_s == pytest.approx(4.0, abs=0.07)
    assert interval.t_end_s == pytest.approx(4.6, abs=0.07)
    made = structure(trace(np.zeros((500, 1)), inputs=SLOW), [applied(effect, 1.0)])
    np.testing.assert_allclose(made[:, 0], effect.form(TIME_S), atol=1e-12)


def test_after_the_reversals_of_the_joint_that_an_effect_is_in():
    spike = Applied(library()["friction"], "A2", {"spike_deg": 0.01, "decay_s": 0.1})
    where = found(np.zeros((500, 6)), motion(), effects=[spike])
    assert {interval.what for interval in where.intervals} == {"reversal of A2"}
    assert where.joints[0].joint == "A2"
    assert where.phases[0].phase == "reversal"


@pytest.mark.parametrize("size", [0.1, 1.0 / 3.0, 7.3e-5])
def test_a_constant_gap_has_no_interval_whatever_its_rounding(size):
    sizes = size * (1.0 + 1e-14 * np.random.default_rng(1).standard_normal(500))
    constant = found(np.stack([sizes, 2.0 * sizes, 2.0 * sizes], axis=1), link="mechanics")
    assert constant.intervals == ()
