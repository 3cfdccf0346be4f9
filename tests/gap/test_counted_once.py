"""A clock and its nuisance are one deviation: what is judged against the bound is their sum."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import Applied, library
from gcode2krl.gap.components import Signatures, blocks_of
from gcode2krl.gap.noise.nuisance import NuisanceDesign
from gcode2krl.gap.posterior.judgement import with_set_clocks
from gcode2krl.gap.posterior.likelihood import CountedOnce
from gcode2krl.gap.posterior.selection import examine, within_mismatch
from tests.gap.constructed import LINK, columns_nuisance, joints, likelihood, motion, noise, question, trace

CLOCK = library()["clock"]
SIGMA_RAD = 2e-6


def late_encoders(offset_s, number=0):
    """Return the gear of a run whose load encoders are late, by their own true signal."""
    nominal = trace(np.zeros((500, 6)), "gear", number=number)
    true = replace(nominal, plus_late_s=offset_s).nominal
    return replace(nominal, measured=true + noise(500, 70 + number, SIGMA_RAD, 6))


def examined(offsets_s):
    asked = question([CLOCK], "q_load")
    known = Signatures()
    traces = with_set_clocks([late_encoders(each, n) for n, each in enumerate(offsets_s)], asked, known)
    return examine(LINK["gear"], traces, asked, known)


@pytest.mark.parametrize("offsets_s", [[3.07e-3], [3.07e-3, 3.0e-3, 3.1e-3]])
def test_a_clock_beyond_the_bound_is_a_cause_with_all_of_its_number(offsets_s):
    """Beside a free clock of the runs 3.07 ms were split into 0.90 and 2.17, and the 2.17 called usual."""
    found = examined(offsets_s)
    (cause,) = found.causes
    assert cause["offset_s"] == pytest.approx(np.mean(offsets_s), abs=2e-5)


def test_a_clock_within_the_bound_is_none():
    assert not examined([1.7e-3]).causes
    assert not examined([1.8e-3, 1.6e-3, 1.9e-3]).causes


def test_runs_may_differ_from_a_common_clock_as_mismatch_lets_them():
    """What is common to the runs is the effect's, how they differ is nuisance."""
    found = examined([5.5e-3, 4.5e-3, 5.0e-3])
    (cause,) = found.causes
    assert cause["offset_s"] == pytest.approx(5e-3, abs=1e-4)
    left = found.likelihood.residual(found.applied)
    assert float(left @ left) < 1.3 * found.data.values


def test_the_whole_deviation_is_compared_with_the_bound():
    found = examined([3.07e-3])
    assert not within_mismatch(found, 0)
    wider = replace(found.question.mismatch, clock_s=4e-3)
    data = replace(found.data, question=replace(found.question, mismatch=wider))
    assert within_mismatch(replace(found, data=data), 0)


def test_nuisance_that_all_runs_share_goes_while_its_effect_is_in_the_model():
    one = trace(noise(500, 1, 1.0, 1))
    column = np.sin(motion().time_s)
    play = library()["backlash"]
    (block,) = blocks_of(play, "A1")
    own = columns_nuisance("backlash A1", column)._replace(block=block)
    made = likelihood([one], [[own]])
    beside = [Applied(play, "A1", {"gap_deg": 0.0})]
    flat = made.whiten([column[:, None]])
    assert abs(made.nuisance_of(flat)[0]) > 0.5
    assert made.nuisance_of(flat, beside)[0] == 0.0
    assert made.nuisance_of(flat, [Applied(play, "A2", {"gap_deg": 0.0})])[0] != 0.0


def test_of_nuisance_of_the_runs_own_their_mean_goes():
    own = [[columns_nuisance("table clock", np.ones(3), shared=False)] for _ in range(3)]
    once = CountedOnce(NuisanceDesign.of(own), {("clock", "q_load"): np.ones(3, dtype=bool)})
    beside = Applied(CLOCK, "q_load", {"offset_s": 1e-3, "skew": 0.0})
    kept = once.kept([beside])
    np.testing.assert_allclose(kept @ [1.0, 1.0, 1.0], 0.0, atol=1e-12)
    np.testing.assert_allclose(kept @ [1.0, -1.0, 0.0], [1.0, -1.0, 0.0])
    assert once.kept([]) is None
    assert once.kept([replace(beside, target="force")]) is None


def test_a_count_of_another_number_is_another_form():
    """The second harmonic of a gear stays usual beside the first."""
    swing = library()["transmission"]
    blocks = list(blocks_of(swing, "A1"))
    own = [columns_nuisance(f"swing {n}", np.ones(3))._replace(block=each) for n, each in enumerate(blocks)]
    once = CountedOnce(NuisanceDesign.of([own]))
    first = blocks[0].shape["harmonic"]
    gone = once.gone(Applied(swing, "A1", {"amplitude_deg": 0.01, "harmonic": first, "phase": 0.0}))
    assert gone.tolist() == [each.shape["harmonic"] == first for each in blocks]


def test_drives_ahead_of_their_command_have_no_negative_lag():
    """A negative lag is a bound hit; only a clock of the commanded columns explains it."""
    time_s = motion().time_s
    whole = trace(joints(time_s + 6e-3) - joints(time_s) + noise(500, 4, SIGMA_RAD, 6), "servo")
    inside = slice(1, -1)  # the model's joints begin and end with the run, in motion
    segments = np.array([[0, len(time_s) - 2]])
    one = replace(whole, time_s=time_s[inside], measured=whole.measured[inside], segments=segments)
    lag = library()["servo_lag"]
    lags = [block for n in range(1, 7) for block in blocks_of(lag, f"A{n}")]
    asked = question([])
    assert not examine(LINK["servo"], [one], replace(asked, blocks=lags)).causes
    clocks = list(blocks_of(CLOCK, "q_cmd"))
    (cause,) = examine(LINK["servo"], [one], replace(asked, blocks=[*lags, *clocks])).causes
    assert (cause.effect.name, cause.target) == ("clock", "q_cmd")
    assert abs(cause["offset_s"]) == pytest.approx(6e-3, abs=1e-4)


def _late_commands(offset_s):
    """Return the servos of a run whose logged commands are late, and what is asked of them."""
    nominal = trace(np.zeros((500, 6)), "servo")
    late = Applied(CLOCK, "q_cmd", {"offset_s": offset_s, "skew": 0.0})
    shown = nominal.sample([late]) + noise(500, 8, SIGMA_RAD, 6)
    inside = slice(2, -2)  # before and behind the model's joints are held
    one = replace(
        nominal,
        time_s=nominal.time_s[inside],
        measured=shown[inside],
        segments=np.array([[0, 496]]),
    )
    asked = replace(question([CLOCK], "q_cmd"), library={"servo_lag": library()["servo_lag"]})
    return one, asked


def test_the_usual_lag_of_all_six_servos_is_a_clock():
    """0.5 ms in each is no clock; 0.5 ms in all of them together took as much off a clock of 12 ms."""
    one, asked = _late_commands(12e-3)
    found = examine(LINK["servo"], [one], asked)
    (cause,) = found.causes
    assert cause["offset_s"] == pytest.approx(12e-3, abs=2e-5)
    lags = found.likelihood.design.names(0)
    kept = found.likelihood.once.kept([cause])
    of_servos = np.array([name.startswith("servo_lag") for name in lags])
    alike = kept[np.ix_(of_servos, of_servos)]
    assert np.linalg.matrix_rank(alike, tol=1e-6) == of_servos.sum() - 1  # one sum goes, no column alone
    assert (np.diag(alike) > 0.1).all()


def test_what_lags_together_may_add_is_allowed_on_top_of_the_bound_of_a_clock():
    one, asked = _late_commands(2.5e-3)
    assert not examine(LINK["servo"], [one], asked).causes  # 2 ms of a clock and 0.5 ms of lag
    one, asked = _late_commands(3.2e-3)
    assert examine(LINK["servo"], [one], asked).causes
