"""What a selection has accepted, how large the gap is, and what the data could have shown."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import Applied, Parameter, Role, library
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.compare.clocks import gone
from gcode2krl.gap.components import Signatures
from gcode2krl.gap.noise.short import white
from gcode2krl.gap.noise.source import noise_of
from gcode2krl.gap.posterior.examination import (
    Examination,
    PlaceTimes,
    _share_in_step,
    fitted_signal,
    observable,
    size_of_gap,
)
from gcode2krl.gap.posterior.selection import threshold
from gcode2krl.gap.thresholds import THRESHOLDS
from tests.gap.constructed import (
    STEP_S,
    Added,
    Impossible,
    applied,
    examined,
    joint_rates,
    joints,
    motion,
    noise,
    question,
    stub,
    trace,
    wave,
)

# What a selection has accepted: causes beside mismatch, what is left without one, where an effect acts

SIGMA, COUNT = 1e-4, 400
TIME_S = STEP_S * np.arange(COUNT)
HALF = TIME_S[-1] / 2.0
EARLY = Added("early", lambda t: np.where(t < HALF, np.sin(20.0 * t), 0.0))
LATE = Added("late", lambda t: np.where(t >= HALF, np.cos(20.0 * t), 0.0))


@pytest.fixture(scope="module")
def made() -> Examination:
    y = SIGMA * (3.0 * EARLY.form(TIME_S) + 2.0 * LATE.form(TIME_S))
    return examined([trace(y[:, None] + noise(COUNT, 3, SIGMA))], [EARLY, LATE], SIGMA)


def test_accepted_effects_are_causes_unless_they_are_mismatch(made):
    assert [each.effect.name for each in made.causes] == ["early", "late"]
    usual = replace(made, usual=(True, False))
    assert [each.effect.name for each in usual.causes] == ["late"]
    assert [each.effect.name for each in usual.mismatch] == ["early"]
    assert usual.cause_numbers == (1,)
    assert usual.applied == made.applied


def test_an_effect_changes_its_rows_only(made):
    first, second = made.rows_changed(0), made.rows_changed(1)
    assert not (first & second).any()
    assert first[: COUNT // 2].mean() > 0.9
    assert second[COUNT // 2 + 1 :].mean() > 0.9


def test_dropping_and_rejecting_leave_the_examination_as_it_is(made):
    fewer = made.dropping(0, replace(made.fitted, applied=made.without(0)))
    assert [each.effect.name for each in fewer.applied] == ["late"]
    assert fewer.surprises == made.surprises[1:]
    assert made.rejecting(("early", "A1")).rejected == {("early", "A1")}
    assert (len(made.applied), made.rejected) == (2, frozenset())
    assert made.accepted_keys == {("early", "A1"), ("late", "A1")}


def test_it_counts_values_and_times(made):
    assert (made.data.values, made.data.times) == (COUNT, COUNT)


# What the data could have shown: the smallest size by hand, and that such a size is found

ROWS, NOISE_RAD = 500, 1e-4
LEAST_RATIO = 0.08
"""Least effect in units of the noise (docs/thresholds.md)."""
ROWS_S = motion().time_s
EFFECTS = [wave(2.0), wave(3.0), wave(5.0)]
POWER = ROWS / 2.0 / NOISE_RAD**2
"""Of a sine of size 1 over whole turns, in units of the noise's variance."""


def entries(y=None, effects=EFFECTS, sigma=NOISE_RAD):
    data = noise(ROWS, 1, sigma)[:, 0] if y is None else y
    return {each["effect"]: each for each in observable(examined([trace(data[:, None])], effects, sigma))}


def test_the_smallest_size_is_that_whose_gain_is_the_threshold():
    """chi2 falls by size²·power; it must fall by twice the level, and by a share of the noise's own."""
    needed = max(2.0 * threshold(3), LEAST_RATIO**2 * ROWS)
    for entry in entries().values():
        assert entry["smallest"] == pytest.approx(np.sqrt(needed / POWER), rel=1e-3)
        assert (entry["link"], entry["target"], entry["parameter"]) == ("servo", "A1", "size_rad")
        assert entry["seen"] is True


def test_less_noise_shows_less():
    assert entries(sigma=NOISE_RAD / 5.0)["wave_2"]["smallest"] == pytest.approx(
        entries()["wave_2"]["smallest"] / 5.0, rel=1e-3
    )


@pytest.mark.parametrize(("factor", "least", "most"), [(0.5, 0, 2), (2.0, 12, 12)])
def test_twice_the_smallest_is_found_and_half_of_it_is_not(factor, least, most):
    smallest, form = entries()["wave_2"]["smallest"], EFFECTS[0].form(ROWS_S)
    data = [
        trace((factor * smallest * form)[:, None] + noise(ROWS, seed, NOISE_RAD)) for seed in range(2, 14)
    ]
    assert least <= sum(bool(examined([one], EFFECTS, NOISE_RAD).applied) for one in data) <= most


def test_what_mismatch_could_do_is_not_seen():
    """A lag of half a millisecond is usual; beside little noise all of a lag is hidden by it."""
    lag = library()["servo_lag"]
    asked = replace(question([lag, EFFECTS[1]]), library={"servo_lag": lag})
    made = examined([trace(noise(ROWS, 3, 1e-6))], asked, 1e-6)
    found = {each["effect"]: each["seen"] for each in observable(made)}
    assert found == {"servo_lag": False, "wave_3": True}


class Turns(type(EFFECTS[0])):
    """A wave with a grid of frequencies of which the higher one is ten times weaker."""

    def __init__(self):
        super().__init__("turns", np.sin)
        turns = Parameter("turns", "1/s", 1.0, 9.0, nominal=None, start=2.0, grid=(3.0, 2.0), source="a test")
        self.parameters = (*self.parameters, turns)

    def servo(self, q_act_rad, inputs, applied):
        q, turns = np.array(q_act_rad), applied["turns"]
        weight = 1.0 if turns == 2.0 else 0.1
        q[:, 0] += applied["size_rad"] * weight * np.sin(2.0 * np.pi * turns * inputs.time_s)
        return q


def test_of_several_shapes_the_one_that_shows_best_is_said():
    """Two blocks, so that the level is that of two."""
    entry = entries(effects=[Turns()])["turns"]
    assert entry["smallest"] == pytest.approx(np.sqrt(2.0 * threshold(2) / POWER), rel=1e-3)


def test_an_effect_of_several_numbers_has_no_smallest_one():
    pair = Turns()
    pair.parameters = tuple(
        replace(p, name=n, nominal=0.0, role=Role.SIZE)
        for p, n in zip(pair.parameters, ("size_rad", "turns"), strict=True)
    )
    assert "turns" not in entries(effects=[pair, *EFFECTS])


# What a link's model says of the joints, for the links behind it: effects and mismatch, and no encoder

ENCODER_RAD = 1e-5
INPUTS = motion()
EFFECT = wave(2.0)


def fitted(one, effects=(), asked=None, stamps_s=None):
    """Return what the fitted model says of a trace, from as much of an examination as that takes."""
    known = [white(ENCODER_RAD)] * one.shape[1]
    data = stub(known=Signatures())
    found = stub(applied=tuple(effects), noise=known, question=asked or question([]), data=data)
    return fitted_signal(one, found, stamps_s)


def test_the_effect_without_the_noise_is_what_later_links_see():
    found = fitted(trace(noise(500, 1, ENCODER_RAD)), [applied(EFFECT, 0.01)])
    np.testing.assert_allclose(found[:, 0], 0.01 * EFFECT.form(INPUTS.time_s), atol=1e-12)


def test_mismatch_that_fits_is_part_of_it():
    """A lag of 0.3 ms is no cause, and all the same the joint stands where it makes it stand."""
    late = -3e-4 * joint_rates(INPUTS.time_s)
    one = trace(late + noise(500, 2, 1e-7, 6))
    asked = replace(question([]), library={"servo_lag": library()["servo_lag"]})
    np.testing.assert_allclose(fitted(one, (), asked)[1:], late[1:], rtol=0.2, atol=1e-5)  # from rest
    assert not fitted(one).any()


def test_zeros_and_clocks_of_load_encoders_stay_out():
    nominal = trace(np.zeros((500, 6)), "gear")
    shown = np.full((500, 6), 0.003) + noise(500, 3, ENCODER_RAD, 6)
    late = Applied(library()["clock"], "q_load", {"offset_s": 0.01, "skew": 0.0})
    one = trace(shown + nominal.sample([late]) - nominal.nominal, "gear")
    play_rad = Mismatch().play_rad / 2.0  # where in it a joint begins is motion, not instrument
    assert np.abs(fitted(one, [late])).max() < play_rad
    moved = replace(one, plus_late_s=0.01)
    assert np.abs(fitted(moved)).max() < play_rad


def test_play_behind_the_gear_stays_in():
    nominal = trace(np.zeros((500, 6)), "gear")
    play = Applied(library()["backlash"], "A2", {"gap_deg": 0.02})
    shape = nominal.sample([play]) - nominal.nominal
    found = fitted(trace(shape + 0.003, "gear"), [play])
    np.testing.assert_allclose(found, shape, atol=1e-7)
    assert np.abs(shape).max() == pytest.approx(np.radians(0.01))


def test_rows_that_were_left_out_have_a_model_too():
    """A line across the rows of a burst, where a joint turned about, was 0.1 degrees off."""
    whole = trace(noise(500, 1, ENCODER_RAD), number=0)
    change = 0.01 * EFFECT.form(INPUTS.time_s)[:, None]
    kept = np.abs(INPUTS.time_s - 1.0) > 0.1
    segments = np.array([[0, np.argmin(kept)], [np.argmin(kept), kept.sum()]])
    cut = replace(
        whole, time_s=whole.time_s[kept], measured=(whole.measured + change)[kept], segments=segments
    )
    found = fitted(cut, [applied(EFFECT, 0.01)], stamps_s=INPUTS.time_s)
    np.testing.assert_allclose(found, change, atol=1e-12)


# A tracker knows nothing of the cut: a tip that is louder there shakes, and that is no noise

SIGMA_MM = 0.02
CUT_SECONDS, CUT_STEP_S = 20.0, 0.01
CUT_ROWS = round(CUT_SECONDS / CUT_STEP_S)
CUT_INPUTS = motion(CUT_SECONDS, CUT_STEP_S)
CUTS = CUT_INPUTS.time_s > 0.4 * CUT_SECONDS
IN_CUT = replace(CUT_INPUTS, force_base_N=CUTS[:, None] * np.array([100.0, 0.0, 0.0]))


def gap_of(more):
    """Return the size of the gap of three runs; ``more`` (n,) is added along z."""
    traces = []
    for number in range(3):
        residual = noise(CUT_ROWS, number, SIGMA_MM, 3)
        residual[:, 2] += more(np.random.default_rng(number))
        traces.append(trace(residual, number=number, link="mechanics", inputs=IN_CUT))
    nothing = [np.zeros((3, CUT_ROWS, 0))] * 3
    return size_of_gap(traces, [()] * 3, noise_of(traces, nothing, [()] * 3), ())


def shakes(generator):
    """Around 25 Hz, as a robot that chatters: it looks like noise of that colour."""
    ringing = np.convolve(generator.standard_normal(CUT_ROWS), [0.5, 0.0, -0.5] * 3, mode="same")
    return CUTS * 2.0 * SIGMA_MM * ringing


def bursts(generator):
    """As loud, at times of their own."""
    loud = sum(np.abs(CUT_INPUTS.time_s - at) < 1.5 for at in generator.uniform(0.0, CUT_SECONDS, 4)) > 0
    return loud * 3.0 * SIGMA_MM * generator.standard_normal(CUT_ROWS)


def calm(generator):
    return np.zeros(CUT_ROWS)


@pytest.mark.parametrize(("more", "is_gap"), [(shakes, True), (bursts, False), (calm, False)])
def test_what_is_louder_in_the_cut_alone_is_a_gap(more, is_gap):
    assert gap_of(more).significant == is_gap


def test_what_is_loud_for_a_moment_alone_is_asked_about_and_no_gap_by_itself():
    """A burst of one instrument, or what another one tells of."""

    def burst(generator):
        return 8.0 * SIGMA_MM * (np.abs(CUT_INPUTS.time_s - 5.0) < 0.4) * generator.standard_normal(CUT_ROWS)

    size = gap_of(burst)
    assert size.is_loud
    assert not size.significant
    assert not gap_of(calm).is_loud


# What is loud for moments: a gap where it follows the command, an instrument's where it does not

MOMENTS, MOMENT_ROWS, APART = 1000, 12, 6.0


def powers(rng, loudness=None):
    x = rng.normal(size=(MOMENTS, MOMENT_ROWS))
    return np.mean((x if loudness is None else x * loudness[:, None]) ** 2, axis=1)


def bursting(rng):
    """So many bursts as of a tenth of the time, each a dozen moments long, anywhere."""
    at = np.arange(MOMENTS)
    scale = sum(np.exp(-0.5 * ((at - start) / 3.0) ** 2) for start in rng.uniform(0, MOMENTS, 12))
    return 1.0 + 4.0 * scale


def corners(rng):
    """Where a command changes: a third of the time, in pieces of unequal length."""
    edges = np.cumsum(rng.integers(3, 25, 200))
    return (np.searchsorted(edges, np.arange(MOMENTS)) % 3) == 0


def test_bursts_of_an_instrument_fall_anywhere():
    rng = np.random.default_rng(1)
    told = sum(_share_in_step(powers(rng, bursting(rng)), corners(rng), 6, APART) > 0.0 for _ in range(400))
    assert told <= 4


def test_what_is_loud_at_corners_is_told_with_its_power():
    rng = np.random.default_rng(2)
    changes = np.arange(MOMENTS) % 20 < 3
    share = _share_in_step(powers(rng, np.where(changes, 3.0, 1.0)), changes, 6, APART)
    assert share == np.clip(
        share, 0.15 * 7.0, 0.15 * 9.0
    )  # nine times the power in .15 of the time, less one


def test_two_loud_moments_are_a_coincidence():
    power = np.ones(MOMENTS)
    power[[100, 500]] = 50.0
    changes = np.isin(np.arange(MOMENTS), [100, 500])
    assert THRESHOLDS.compare.in_step_least > 2
    assert _share_in_step(power, changes, 1, APART) == 0.0


# Times at which places are reached: ways by hand, and a time law that comes back


class Slower(Added):
    """The same path in (1 + share) of the time."""

    def __init__(self):
        super().__init__("slower", np.sin)
        shape = {"nominal": 0.0, "start": 0.1, "source": "a test"}
        self.parameters = (Parameter("share", "", -0.5, 2.0, **shape),)

    def replan(self, inputs, applied):
        return replace(inputs, time_s=inputs.time_s * (1.0 + applied["share"]))


SLOWER = Slower()


def run(share, clock_s=0.0, noise_rad=0.0):
    """Return the path of a run that takes longer by a share, on a clock of its own."""
    inputs = motion()
    time_s = np.arange(0.0, inputs.time_s[-1] * (1.0 + share), 0.012)
    q_rad = joints(time_s / (1.0 + share)) + noise_rad * np.random.default_rng(1).standard_normal(
        (len(time_s), 6)
    )
    stamps = {"time_s": time_s + clock_s, "segments": np.array([[0, len(time_s)]])}
    return replace(trace(np.zeros((500, 6)), "path"), measured=q_rad, **stamps)


def test_the_way_along_a_circle_is_its_arc():
    t = np.linspace(0.0, 2.0, 2001)
    time_s, way = gone(t, np.stack([np.cos(t), np.sin(t)], axis=1), 0.0)
    np.testing.assert_allclose(way, t, atol=1e-6)
    assert (time_s == t).all()


def test_ways_too_short_are_added_up_and_counted_together():
    t = np.arange(11.0)
    time_s, way = gone(t, 0.2 * t[:, None], 0.5)
    np.testing.assert_array_equal(time_s, [0, 3, 6, 9])  # each 0.6 from the one before
    np.testing.assert_allclose(way, [0.0, 0.6, 1.2, 1.8])


def test_standing_in_noise_is_no_way():
    t = np.arange(500.0)
    noisy = np.random.default_rng(2).uniform(-0.1, 0.1, (500, 2))
    assert gone(t, noisy, 0.0)[1][-1] > 10.0
    assert gone(t, noisy, 0.5)[1][-1] == 0.0


def test_a_run_as_planned_is_not_late_whatever_its_clock_says():
    times = PlaceTimes([run(0.0, clock_s=3.0)])
    assert times.size(()) < 2e-4


@pytest.mark.parametrize("share", [0.2, -0.1])
def test_lateness_grows_with_the_time_at_which_a_place_is_reached(share):
    """Of places evenly along the way, each is late by share·t; the mean is the clock's."""
    times = PlaceTimes([run(share)])
    inputs = motion()
    way = gone(inputs.time_s, inputs.q_cmd_rad, 0.0)[1]
    places = way[-1] * (np.arange(400) + 0.5) / 400
    t = np.interp(places, way, inputs.time_s)
    np.testing.assert_allclose(times.late(()), share * (t - t.mean()), atol=5e-3)
    assert times.size([applied(SLOWER, share)]) < 2e-3


def test_numbers_of_a_time_law_are_found_from_far_away():
    times = PlaceTimes([run(0.35), run(0.35, clock_s=1.0)])
    found = times.fitted((), applied(SLOWER, 0.05))
    assert found.values["share"] == pytest.approx(0.35, abs=2e-3)


def test_noise_at_the_bound_of_the_instrument_hardly_moves_them():
    times = PlaceTimes([run(0.35, noise_rad=1e-5)])
    assert times.fitted((), applied(SLOWER, 0.05)).values["share"] == pytest.approx(0.35, abs=4e-3)


def test_what_cannot_be_planned_is_infinitely_late():
    class Unplannable(Impossible):
        def replan(self, inputs, applied):
            return self.servo(None, inputs, applied)

    assert PlaceTimes([run(0.0)]).size([applied(Unplannable("unplannable", np.sin), 1.0)]) == np.inf
