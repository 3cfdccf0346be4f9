"""Twins: what does the same while it is small is compared at any size, and the better one speaks."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import Applied, Parameter
from gcode2krl.gap.posterior.judgement import judge
from gcode2krl.gap.posterior.selection import rivals_of, twins_of, with_rival
from tests.gap import constructed as c

SIGMA = 1e-4
TIME_S = c.motion().time_s


def pulses(time_s):
    """Return steep flanks every half second or so: late by more than a flank lasts nothing is linear."""
    return 3.0 * SIGMA * np.tanh(np.sin(2.0 * np.pi * 0.9 * time_s + 0.3) / 0.1)


class Late(c.Added):
    """A1 is late by a time, to a share of all that it does."""

    def __init__(self, name, share=1.0, low=-0.5):
        super().__init__(name, pulses)
        self.share = share
        self.parameters = (
            Parameter("size_rad", "s", low, 0.5, nominal=0.0, start=0.01, source="a test", linear=False),
        )

    def servo(self, q_act_rad, inputs, applied):
        q = np.array(q_act_rad)
        late = pulses(inputs.time_s - applied["size_rad"]) - pulses(inputs.time_s)
        q[:, 0] += late if self.share == 1.0 else self.share * np.tanh(late / self.share / SIGMA) * SIGMA
        return q


def data(delay_s, seed=1):
    y = pulses(TIME_S - delay_s) - pulses(TIME_S)
    return [c.trace(y[:, None] + c.noise(len(y), seed, SIGMA))]


def made_by(delay_s, effects):
    return c.examined(data(delay_s), effects, SIGMA)


@pytest.mark.parametrize("delay_s", [0.01, 0.12, 0.3])
def test_a_twin_is_compared_at_any_size(delay_s):
    made = made_by(delay_s, [Late("clock"), Late("filter", low=0.0)])
    assert made.applied[0].values["size_rad"] == pytest.approx(delay_s, abs=5e-3)
    (other,) = rivals_of(made, 0)
    assert {made.applied[0].effect.name, other.applied.effect.name} == {"clock", "filter"}
    assert other.alike
    assert other.distance2 < 1e-5
    assert other.applied.values["size_rad"] == pytest.approx(delay_s, abs=5e-3)


def test_a_twin_begins_at_the_size_at_which_it_does_the_same():
    made = made_by(0.12, [Late("clock"), Late("filter")])
    other = {"clock": "filter", "filter": "clock"}[made.applied[0].effect.name]
    (twin,) = twins_of(made, made.applied[0], (), ())
    assert twin.start.effect.name == other
    assert twin.share > 0.9
    assert twin.start.values["size_rad"] == pytest.approx(0.12, rel=0.3)
    assert twins_of(made, made.applied[0], (), [(other, "A1")]) == []


def test_what_is_proportional_to_its_size_is_compared_by_its_gain():
    wave = c.wave(2.0, "first")
    made = c.examined([c.trace(5.0 * SIGMA * wave.form(TIME_S)[:, None])], [wave, c.wave(2.0, "twin")], SIGMA)
    assert twins_of(made, made.applied[0], (), ()) == []


def test_signals_nearer_than_models_are_exact_are_alike_however_loud():
    """A hundredth of another form is hundreds of nats at 300 times the noise, and no evidence."""
    first = c.wave(2.0, "first")
    other = c.Added("other", lambda t: first.form(t) + 0.01 * np.sin(2.0 * np.pi * 5.0 * t))
    y = 300.0 * SIGMA * first.form(TIME_S)
    made = c.examined([c.trace(y[:, None] + c.noise(len(y), 3, SIGMA))], [first, other], SIGMA)
    (rival,) = rivals_of(made, 0)
    assert rival.chi2_difference > 1000.0
    assert rival.distance2 < 3e-4
    assert rival.alike


def test_a_better_rival_takes_the_causes_place():
    """The worse of two is put in first, as a search does that another cause has misled."""
    right, wrong = c.wave(2.0, "right"), c.Added("wrong", lambda t: np.sin(2.0 * np.pi * 2.0 * t + 0.4))
    y = 3.0 * SIGMA * right.form(TIME_S)
    made = c.examined([c.trace(y[:, None] + c.noise(len(y), 4, SIGMA))], [right, wrong], SIGMA)
    assert made.applied[0].effect is right
    misled = with_rival(made, 0, Applied(wrong, "A1", {"size_rad": 2.0 * SIGMA}))
    assert misled.applied[0].effect is wrong
    (better,) = [each for each in rivals_of(misled, 0) if each.is_better]
    assert better.applied.effect is right
    back = with_rival(misled, 0, better.applied)
    assert back.cost == pytest.approx(made.cost, abs=0.1)
    assert with_rival(made, 0, replace(better.applied, target="A2")) is None


def test_a_judgement_names_the_best_of_twins_with_the_other_in_its_set():
    traces = [replace(data(0.12, seed)[0], run=f"run-{seed}", run_number=seed) for seed in range(3)]
    found = judge(c.LINK["servo"], traces, [], c.question([Late("clock"), Late("filter", low=0.0)]))
    (cause,) = found.causes
    ((rival, probability),) = cause.rivals
    assert {cause.applied.effect.name, rival.applied.effect.name} == {"clock", "filter"}
    assert rival.alike
    assert probability == cause.probability
